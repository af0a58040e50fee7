//! All lights of a scene, and which of them a hit is on.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::emitter::{Emitter, Part};
use super::tree::{Cut, LightTree, MOST_WITHOUT, Receiver};
use super::{AreaLight, DirectionalLight, Environment, Light};
use crate::control::{CancelToken, Cancelled};
use crate::math::Vec3;

/// The lights of a scene, known by their index.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lights {
    all: Vec<Light>,
    by_object: HashMap<u32, OfObject>,
    /// Those that rays see which leave the scene, with their numbers.
    suns: Vec<(u32, DirectionalLight)>,
    /// The same of light from all around.
    environment: Option<(u32, Environment)>,
    /// Over all of them, where they are many.
    tree: Option<Arc<LightTree>>,
    /// Over those that are in the scene, where these are more than paths sample.
    tree_of_lamps: Option<Arc<LightTree>>,
}

/// What the samples of lights at a vertex are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Receivers {
    /// All that is seen of the light.
    Eye,
    /// A vertex of a path, which has other noise as well.
    Paths,
}

/// From which lights vertices pick some.
#[derive(Clone, Copy, Debug)]
pub struct Selection<'a> {
    /// Over the lights that are picked from.
    pub tree: &'a LightTree,
    /// How.
    pub picks: Picks,
    /// Whether light from beyond the scene is not in the tree, and is sampled at every vertex: what the scene hides of it, its bounds
    /// do not tell.
    pub leaves_beyond: bool,
}

/// How vertices pick lights, where not all of them are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Picks {
    /// Lights that a vertex picks, for each sample of a light that it is asked for.
    pub count: u32,
    /// Nodes of the tree that it looks at for all of them, at most.
    nodes: usize,
}

impl Picks {
    /// Where all that is seen of the light are these: as good as a look at each of a thousand lights.
    pub const BY_EYE: Self = Self { count: MOST_WITHOUT as u32, nodes: Cut::MOST };

    /// Of paths, which have other noise as well: more rays cost more than they bring.
    pub const BY_PATHS: Self = Self { count: 1, nodes: 8 };

    /// What points pick from.
    #[inline(always)]
    pub fn cut(self, tree: &LightTree) -> Cut<'_> {
        Cut::new(tree, self.nodes)
    }
}

/// How often a vertex samples lights, for each time that it is asked to.
pub struct Samples<'a>(Option<(Selection<'a>, Cut<'a>)>);

impl Samples<'_> {
    /// How often it is expected to sample the light of this number.
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

/// The lights that an object is.
#[derive(Clone, Debug, PartialEq)]
enum OfObject {
    /// One.
    Whole(u32),
    /// One or none for each primitive.
    Primitives(Vec<Option<u32>>),
}

impl Lights {
    /// These, in this order.
    ///
    /// # Errors
    /// [`Cancelled`] when the token was told so.
    pub fn new(all: Vec<Light>, token: &CancelToken) -> Result<Self, Cancelled> {
        let mut lights = Self::default();
        for (number, light) in (0_u32..).zip(&all) {
            match light {
                Light::Point(_) | Light::Spot(_) => {}
                Light::Directional(sun) if sun.is_sharp() => {}
                Light::Directional(sun) => lights.suns.push((number, *sun)),
                Light::Environment(light) => lights.environment = Some((number, light.clone())),
                Light::Area(light) => lights.note(number, light),
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

    /// So many lamps are all sampled by the vertices of a path; of more, some are picked. Measured in rooms of 1 to 32 lamps.
    const MOST_BY_PATHS: usize = 8;

    /// What vertices pick lights from; none where they sample all of them.
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

    /// How often a vertex that picks in this way samples lights, at a point of a surface with this normal, if nothing else is known
    /// of that.
    #[inline]
    pub fn samples_at(&self, receivers: Receivers, point: Vec3, normal: Vec3) -> Samples<'_> {
        // What is not picked from is not moved: a cut is large.
        let Some(selection) = self.selection(receivers) else { return Samples(None) };
        let mut cut = selection.picks.cut(selection.tree);
        cut.go_to(&Receiver::plain(point, normal));
        Samples(Some((selection, cut)))
    }

    /// Bytes that trees over lights and over the triangles of lights hold.
    pub fn memory_bytes(&self) -> usize {
        let of_mesh = |light: &Light| match light {
            Light::Area(AreaLight { shape: Emitter::Mesh(mesh), .. }) => {
                mesh.tree().map_or(0, LightTree::memory_bytes)
            }
            Light::Point(_)
            | Light::Spot(_)
            | Light::Directional(_)
            | Light::Environment(_)
            | Light::Area(_) => 0,
        };
        let mut trees: Vec<_> = [&self.tree, &self.tree_of_lamps].into_iter().flatten().collect();
        trees.dedup_by(|a, b| Arc::ptr_eq(a, b));
        trees.iter().map(|tree| tree.memory_bytes()).chain(self.all.iter().map(of_mesh)).sum()
    }

    fn note(&mut self, number: u32, light: &AreaLight) {
        let note = |primitive: u32| {
            let place = primitive as usize;
            match self.by_object.entry(light.object).or_insert(OfObject::Primitives(Vec::new())) {
                OfObject::Whole(_) => {}
                OfObject::Primitives(lights) => {
                    lights.resize(lights.len().max(place + 1), None);
                    lights[place] = Some(number);
                }
            }
        };
        match (light.part, &light.shape) {
            (Part::Whole, _) => {
                self.by_object.insert(light.object, OfObject::Whole(number));
            }
            (Part::Listed, Emitter::Mesh(mesh)) => mesh.primitives().for_each(note),
            (
                Part::Listed,
                Emitter::Sphere(_)
                | Emitter::Quad(_)
                | Emitter::Picture(_)
                | Emitter::Box(_)
                | Emitter::Triangle(_)
                | Emitter::Disk(_)
                | Emitter::Cylinder(_)
                | Emitter::Cone(_)
                | Emitter::Torus(_),
            ) => {}
        }
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Whether a ray can find any.
    pub fn can_be_found(&self) -> bool {
        !self.by_object.is_empty() || self.are_beyond()
    }

    /// All with their numbers.
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

    /// Solid angle in sr of the widest light from beyond the scene; 0 where there is none that has an extent.
    pub fn extent_beyond(&self) -> f32 {
        match self.environment {
            Some(_) => 4.0 * std::f32::consts::PI,
            None => self.suns.iter().map(|(_, sun)| sun.inverse_density()).fold(0.0, f32::max),
        }
    }

    /// Radiance that comes from beyond the scene, from a unit direction; of each light the share that is given by its number and
    /// the density in sr⁻¹ of its samples from there.
    pub fn beyond_by_density(&self, direction: Vec3, share: impl Fn(u32, f32) -> f32) -> Vec3 {
        let sky = self.environment().map(|environment| environment.arriving(direction));
        self.beyond_with(sky, direction, share)
    }

    /// The same where it is known what [`Environment::arriving`] says.
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

    /// The light that a primitive of an object is, with its number.
    #[inline]
    pub fn of_hit(&self, object: u32, primitive: u32) -> Option<(u32, &Light)> {
        let number = match self.by_object.get(&object)? {
            OfObject::Whole(number) => *number,
            OfObject::Primitives(lights) => lights.get(primitive as usize).copied().flatten()?,
        };
        Some((number, &self.all[number as usize]))
    }
}

/// How many lights these are where all that one object is counts as one.
fn count<'a>(lights: impl Iterator<Item = &'a Light> + Clone) -> usize {
    let object = |light: &Light| match light {
        Light::Area(light) => Some(light.object),
        Light::Point(_) | Light::Spot(_) | Light::Directional(_) | Light::Environment(_) => None,
    };
    let objects: HashSet<u32> = lights.clone().filter_map(object).collect();
    objects.len() + lights.filter(|light| object(light).is_none()).count()
}
