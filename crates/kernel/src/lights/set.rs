//! All lights of a scene, and the map from hits to lights.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::area::{AreaLight, MeshEmitter, Part, Side};
use super::infinite::{DirectionalLight, Environment, InfiniteLight};
use super::light::Light;
use super::tree::{Cut, LightTree, MOST_WITHOUT, Receiver};
use crate::control::{CancelToken, Cancelled};
use crate::math::Vec3;

/// The lights of a scene, which an index names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lights {
    all: Vec<Light>,
    /// Lights of the fronts of objects.
    by_object: HashMap<u32, OfObject>,
    /// Lights of the backs of objects.
    by_back: HashMap<u32, OfObject>,
    /// Directional lights, which rays see that leave the scene, with their numbers.
    suns: Vec<(u32, DirectionalLight)>,
    /// The environment, with its number.
    environment: Option<(u32, Environment)>,
    /// Tree over all lights. `None` if they are few.
    tree: Option<Arc<LightTree>>,
    /// Tree over the lights in the scene, without those beyond. `None` if paths sample all of them.
    tree_of_lamps: Option<Arc<LightTree>>,
}

/// Purpose of the light samples at a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Receivers {
    /// Direct light in the picture, which has no other noise.
    Eye,
    /// Vertices of paths, whose light has other noise as well.
    Paths,
}

/// Set of lights from which vertices pick some.
#[derive(Clone, Copy, Debug)]
pub struct Selection<'a> {
    /// Tree over the lights to pick from.
    pub tree: &'a LightTree,
    /// Effort of picking.
    pub picks: Picks,
    /// Whether light from beyond the scene is outside of the tree, and is sampled at every vertex: its bounds ignore what the scene
    /// occludes.
    pub leaves_beyond: bool,
}

/// Effort of picking lights at a vertex, if not all of them are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Picks {
    /// Lights that a vertex picks for each requested light sample.
    pub count: u32,
    /// Most nodes of the tree that it examines for all of them.
    nodes: usize,
}

impl Picks {
    /// Picks for direct light alone: as good as examining each of a thousand lights.
    pub const BY_EYE: Self = Self { count: MOST_WITHOUT as u32, nodes: Cut::MOST };

    /// Picks for paths, which have other noise as well: more rays cost more than they gain.
    pub const BY_PATHS: Self = Self { count: 1, nodes: 8 };

    /// The cut of a tree for these picks.
    #[inline(always)]
    pub fn cut(self, tree: &LightTree) -> Cut<'_> {
        Cut::new(tree, self.nodes)
    }
}

/// Expected number of light samples at a vertex, for each requested one.
pub struct Samples<'a>(Option<(Selection<'a>, Cut<'a>)>);

impl Samples<'_> {
    /// Expected number of samples of the light of this number.
    #[inline]
    pub fn of(&self, number: u32) -> f32 {
        self.0.as_ref().map_or(1.0, |(selection, cut)| {
            if selection.leaves_beyond && !selection.tree.has(number) {
                1.0
            } else {
                selection.picks.count as f32 * cut.probability(number)
            }
        })
    }
}

/// Lights of an object.
#[derive(Clone, Debug, PartialEq)]
enum OfObject {
    /// A single light.
    Whole(u32),
    /// A light, or none, for each primitive.
    Primitives(Vec<Option<u32>>),
}

impl Lights {
    /// The lights in this order.
    ///
    /// # Errors
    /// [`Cancelled`] if the token is cancelled.
    pub fn new(all: Vec<Light>, token: &CancelToken) -> Result<Self, Cancelled> {
        let mut lights = Self::default();
        for (number, light) in (0_u32..).zip(&all) {
            if let Some(light) = light.as_area() {
                lights.note(number, light);
            } else if let Some(sun) = light.as_directional().filter(|sun| !sun.is_sharp()) {
                lights.suns.push((number, *sun));
            } else if let Some(light) = light.as_environment() {
                lights.environment = Some((number, light.clone()));
            }
        }
        let tree_over = |taken: &dyn Fn(&&Light) -> bool, most| -> Result<_, Cancelled> {
            if count(all.iter().filter(taken)) <= most {
                return Ok(None);
            }
            let bounds = all.iter().map(|light| light.bounds().filter(|_| taken(&light)));
            Ok(LightTree::new(&bounds.collect::<Vec<_>>(), token)?.map(Arc::new))
        };
        lights.tree = tree_over(&|_| true, MOST_WITHOUT)?;
        lights.tree_of_lamps = match &lights.tree {
            Some(tree) if all.iter().all(|light| !light.is_beyond()) => Some(tree.clone()),
            Some(_) | None => tree_over(&|light| !light.is_beyond(), Self::MOST_BY_PATHS)?,
        };
        Ok(Self { all, ..lights })
    }

    /// Most lamps of a scene whose paths sample all lamps at each vertex; of more, vertices pick one. Measured in rooms of 3 to
    /// 12 lamps.
    const MOST_BY_PATHS: usize = 3;

    /// Set of lights from which vertices pick. `None` if they sample all lights.
    pub fn selection(&self, receivers: Receivers) -> Option<Selection<'_>> {
        match receivers {
            Receivers::Eye => {
                let selection = |tree| Selection { tree, picks: Picks::BY_EYE, leaves_beyond: false };
                self.tree.as_deref().map(selection)
            }
            Receivers::Paths => {
                let selection = |tree| Selection { tree, picks: Picks::BY_PATHS, leaves_beyond: true };
                self.tree_of_lamps.as_deref().map(selection)
            }
        }
    }

    /// Expected number of light samples at a point of a surface with this normal, if nothing else is known of the surface.
    #[inline]
    pub fn samples_at(&self, receivers: Receivers, point: Vec3, normal: Vec3) -> Samples<'_> {
        // Without picks no cut is copied, which is large.
        let Some(selection) = self.selection(receivers) else { return Samples(None) };
        let mut cut = selection.picks.cut(selection.tree);
        cut.go_to(&Receiver::plain(point, normal));
        Samples(Some((selection, cut)))
    }

    /// Bytes of the trees over lights and over the triangles of lights.
    pub fn memory_bytes(&self) -> usize {
        let of_mesh = |light: &Light| {
            let mesh = light.as_area().and_then(|light| light.shape.as_mesh());
            mesh.and_then(MeshEmitter::tree).map_or(0, LightTree::memory_bytes)
        };
        let mut trees: Vec<_> = [&self.tree, &self.tree_of_lamps].into_iter().flatten().collect();
        trees.dedup_by(|a, b| Arc::ptr_eq(a, b));
        trees.iter().map(|tree| tree.memory_bytes()).chain(self.all.iter().map(of_mesh)).sum()
    }

    fn note(&mut self, number: u32, light: &AreaLight) {
        let by_object = match light.side {
            Side::Front => &mut self.by_object,
            Side::Back => &mut self.by_back,
        };
        let note = |primitive: u32| {
            let place = primitive as usize;
            match by_object.entry(light.object).or_insert(OfObject::Primitives(Vec::new())) {
                OfObject::Whole(_) => {}
                OfObject::Primitives(lights) => {
                    lights.resize(lights.len().max(place + 1), None);
                    lights[place] = Some(number);
                }
            }
        };
        match light.part {
            Part::Whole => {
                by_object.insert(light.object, OfObject::Whole(number));
            }
            Part::Listed => {
                light.shape.as_mesh().into_iter().flat_map(MeshEmitter::primitives).for_each(note);
            }
        }
    }

    /// Number of lights.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there are no lights.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Whether a ray can hit a light.
    pub fn can_be_found(&self) -> bool {
        !self.by_object.is_empty() || self.are_beyond()
    }

    /// Whether an object emits, or a part of it.
    pub fn has_object(&self, object: u32) -> bool {
        self.by_object.contains_key(&object) || self.by_back.contains_key(&object)
    }

    /// All lights with their numbers.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (u32, &Light)> {
        (0..).zip(&self.all)
    }

    /// Whether a ray that leaves the scene may see light.
    pub fn are_beyond(&self) -> bool {
        !self.suns.is_empty() || self.environment.is_some()
    }

    /// The light from all around.
    pub fn environment(&self) -> Option<&Environment> {
        self.environment.as_ref().map(|(_, environment)| environment)
    }

    /// Solid angle in sr of the widest light from beyond the scene; 0 if no such light has an extent.
    pub fn extent_beyond(&self) -> f32 {
        match self.environment {
            Some(_) => 4.0 * std::f32::consts::PI,
            None => self.suns.iter().map(|(_, sun)| sun.inverse_density()).fold(0.0, f32::max),
        }
    }

    /// Radiance from beyond the scene, from a unit direction. `share` weights each light by its number and its light-sampling
    /// pdf in sr⁻¹.
    pub fn beyond_by_density(&self, direction: Vec3, share: impl Fn(u32, f32) -> f32) -> Vec3 {
        let sky = self.environment().map(|environment| environment.arriving(direction));
        self.beyond_with(sky, direction, share)
    }

    /// [`Lights::beyond_by_density`] with the result of [`Environment::arriving`].
    pub fn beyond_with(
        &self,
        sky: Option<(Vec3, f32)>,
        direction: Vec3,
        share: impl Fn(u32, f32) -> f32,
    ) -> Vec3 {
        let suns =
            self.suns.iter().map(|(number, sun)| (*number, (sun.radiance(direction), sun.pdf(direction))));
        let number = self.environment.iter().map(|(number, _)| *number);
        let seen = suns.chain(number.zip(sky)).filter(|(_, (radiance, _))| *radiance != Vec3::ZERO);
        seen.map(|(number, (radiance, density))| radiance * share(number, density)).sum()
    }

    /// The light of a number.
    #[inline(always)]
    pub fn get(&self, number: u32) -> &Light {
        &self.all[number as usize]
    }

    /// The light of a side of a primitive of an object, with its number.
    #[inline]
    pub fn of_hit(&self, object: u32, primitive: u32, side: Side) -> Option<(u32, &Light)> {
        let by_object = match side {
            Side::Front => &self.by_object,
            Side::Back => &self.by_back,
        };
        let number = match by_object.get(&object)? {
            OfObject::Whole(number) => *number,
            OfObject::Primitives(lights) => lights.get(primitive as usize).copied().flatten()?,
        };
        Some((number, &self.all[number as usize]))
    }
}

/// Number of these lights; all lights of one object count as one.
fn count<'a>(lights: impl Iterator<Item = &'a Light> + Clone) -> usize {
    let object = |light: &Light| light.as_area().map(|light| light.object);
    let objects: HashSet<u32> = lights.clone().filter_map(object).collect();
    objects.len() + lights.filter(|light| object(light).is_none()).count()
}
