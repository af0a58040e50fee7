//! All lights of a scene, and the mapping from hits to lights.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::area::{AreaLight, EmittingPart, MeshEmitter, Side};
use super::infinite::{DirectionalLight, Environment, InfiniteLight};
use super::light::Light;
use super::tree::{AdaptiveLightTreeCut, LightTree, MAX_WITHOUT_TREE, Receiver};
use crate::control::{CancelToken, Canceled};
use crate::math::Vec3;

/// The lights of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lights {
    all: Vec<Light>,
    /// Lights on the fronts of objects.
    by_object: HashMap<u32, ObjectLights>,
    /// Lights on the backs of objects.
    by_back: HashMap<u32, ObjectLights>,
    /// Directional lights with an extent, which are visible to rays that leave the scene, and their indices.
    suns: Vec<(u32, DirectionalLight)>,
    /// The environment light and its index.
    environment: Option<(u32, Environment)>,
    /// Tree over all lights, or `None` if there are few lights.
    tree: Option<Arc<LightTree>>,
    /// Tree over all lights except lights at infinity, or `None` if path vertices sample every light.
    local_tree: Option<Arc<LightTree>>,
}

/// Purpose of the light samples at a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightSamplingPurpose {
    /// Direct lighting only, where light sampling is the only source of noise.
    Eye,
    /// Path tracing, where the image also has noise from other sources.
    Paths,
}

/// A set of lights, and how a vertex picks lights from it.
#[derive(Clone, Copy, Debug)]
pub struct LightSampler<'a> {
    /// Tree over the lights to choose from.
    pub tree: &'a LightTree,
    /// Effort to spend on picking lights.
    pub picks: LightSamplingEffort,
    /// Whether lights at infinity are sampled at every vertex instead of being in the tree, because their
    /// bounds ignore occlusion.
    pub samples_infinite: bool,
}

/// Effort to spend on picking lights at a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightSamplingEffort {
    /// Number of lights to pick for each requested light sample.
    pub count: u32,
    /// Maximum total number of tree nodes to examine for all picks.
    nodes: usize,
}

impl LightSamplingEffort {
    /// Effort for direct lighting. The results are as good as if each of a thousand lights were examined.
    pub const DIRECT: Self = Self { count: MAX_WITHOUT_TREE as u32, nodes: AdaptiveLightTreeCut::MAX_NODES };

    /// Effort for path vertices. Additional shadow rays are not worthwhile because the image also has other
    /// noise.
    pub const PATHS: Self = Self { count: 1, nodes: 8 };

    /// Creates a cut through a tree for this effort.
    #[inline(always)]
    pub fn new_adaptive_tree_cut(self, tree: &LightTree) -> AdaptiveLightTreeCut<'_> {
        AdaptiveLightTreeCut::new(tree, self.nodes)
    }
}

/// Expected number of samples that each light gets at a vertex, per requested sample.
pub struct ExpectedSamplesPerLight<'a>(Option<(LightSampler<'a>, AdaptiveLightTreeCut<'a>)>);

impl ExpectedSamplesPerLight<'_> {
    /// Expected number of samples for a light.
    #[inline]
    pub fn for_light(&self, number: u32) -> f32 {
        self.0.as_ref().map_or(1.0, |(sampler, cut)| {
            if sampler.samples_infinite && !sampler.tree.contains(number) {
                1.0
            } else {
                sampler.picks.count as f32 * cut.probability(number)
            }
        })
    }
}

/// The lights that belong to one object.
#[derive(Clone, Debug, PartialEq)]
enum ObjectLights {
    /// A single light.
    Whole(u32),
    /// The light on each primitive, or `None` for primitives without a light.
    Primitives(Vec<Option<u32>>),
}

impl Lights {
    /// Indexes the lights and builds the trees over them.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn new(all: Vec<Light>, token: &CancelToken) -> Result<Self, Canceled> {
        let mut lights = Self::default();
        for (number, light) in (0_u32..).zip(&all) {
            if let Some(light) = light.as_area() {
                lights.add_light_to_object_index(number, light);
            } else if let Some(sun) = light.as_directional().filter(|sun| !sun.has_no_angular_extent()) {
                lights.suns.push((number, sun.clone()));
            } else if let Some(light) = light.as_environment() {
                lights.environment = Some((number, light.clone()));
            }
        }
        let tree_over = |taken: &dyn Fn(&&Light) -> bool, most| -> Result<_, Canceled> {
            if count_lights_once_per_object(all.iter().filter(taken)) <= most {
                return Ok(None);
            }
            let bounds = all.iter().map(|light| light.bounds_if_emissive().filter(|_| taken(&light)));
            Ok(LightTree::new(&bounds.collect::<Vec<_>>(), token)?.map(Arc::new))
        };
        lights.tree = tree_over(&|_| true, MAX_WITHOUT_TREE)?;
        lights.local_tree = match &lights.tree {
            Some(tree) if all.iter().all(|light| !light.is_infinite()) => Some(tree.clone()),
            Some(_) | None => tree_over(&|light| !light.is_infinite(), Self::MAX_LOCAL_WITHOUT_TREE)?,
        };
        Ok(Self { all, ..lights })
    }

    /// Path vertices sample all local lights if there are at most this many, and otherwise pick one. The
    /// threshold is based on measurements in rooms with 3 to 12 lights.
    const MAX_LOCAL_WITHOUT_TREE: usize = 3;

    /// How vertices pick lights, or `None` if they sample all lights.
    #[inline]
    pub fn sampler_for_purpose(&self, receivers: LightSamplingPurpose) -> Option<LightSampler<'_>> {
        match receivers {
            LightSamplingPurpose::Eye => {
                let sampler =
                    |tree| LightSampler { tree, picks: LightSamplingEffort::DIRECT, samples_infinite: false };
                self.tree.as_deref().map(sampler)
            }
            LightSamplingPurpose::Paths => {
                let sampler =
                    |tree| LightSampler { tree, picks: LightSamplingEffort::PATHS, samples_infinite: true };
                self.local_tree.as_deref().map(sampler)
            }
        }
    }

    /// Expected number of samples for each light at a surface point, given only the point's position and
    /// normal.
    #[inline]
    pub fn expected_sample_counts(
        &self,
        receivers: LightSamplingPurpose,
        point: Vec3,
        normal: Vec3,
    ) -> ExpectedSamplesPerLight<'_> {
        // Return early because a cut is expensive to copy.
        let Some(sampler) = self.sampler_for_purpose(receivers) else {
            return ExpectedSamplesPerLight(None);
        };
        let mut cut = sampler.picks.new_adaptive_tree_cut(sampler.tree);
        cut.adapt_to_receiver(&Receiver::with_unknown_lobe(point, normal));
        ExpectedSamplesPerLight(Some((sampler, cut)))
    }

    /// Memory used by the trees over lights and over the triangles of mesh lights, in bytes.
    pub fn light_trees_memory_bytes(&self) -> usize {
        let of_mesh = |light: &Light| {
            let mesh = light.as_area().and_then(|light| light.shape.as_mesh());
            mesh.and_then(MeshEmitter::light_tree).map_or(0, LightTree::memory_bytes)
        };
        let mut trees: Vec<_> = [&self.tree, &self.local_tree].into_iter().flatten().collect();
        trees.dedup_by(|a, b| Arc::ptr_eq(a, b));
        trees.iter().map(|tree| tree.memory_bytes()).chain(self.all.iter().map(of_mesh)).sum()
    }

    fn add_light_to_object_index(&mut self, number: u32, light: &AreaLight) {
        let by_object = match light.side {
            Side::Front => &mut self.by_object,
            Side::Back => &mut self.by_back,
        };
        let index_light = |primitive: u32| {
            let place = primitive as usize;
            match by_object.entry(light.object).or_insert(ObjectLights::Primitives(Vec::new())) {
                ObjectLights::Whole(_) => {}
                ObjectLights::Primitives(lights) => {
                    lights.resize(lights.len().max(place + 1), None);
                    lights[place] = Some(number);
                }
            }
        };
        match light.part {
            EmittingPart::Whole => {
                by_object.insert(light.object, ObjectLights::Whole(number));
            }
            EmittingPart::Listed => {
                light
                    .shape
                    .as_mesh()
                    .into_iter()
                    .flat_map(MeshEmitter::primitive_indices)
                    .for_each(index_light);
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

    /// Whether rays can hit a light.
    pub fn can_be_hit(&self) -> bool {
        !self.by_object.is_empty() || self.escaping_rays_can_hit_light()
    }

    /// Whether any part of an object emits.
    pub fn has_light_on_object(&self, object: u32) -> bool {
        self.by_object.contains_key(&object) || self.by_back.contains_key(&object)
    }

    /// All lights with their indices.
    #[inline]
    pub fn iter(&self) -> impl Iterator<Item = (u32, &Light)> {
        (0..).zip(&self.all)
    }

    /// Whether rays that leave the scene may reach a light.
    pub fn escaping_rays_can_hit_light(&self) -> bool {
        !self.suns.is_empty() || self.environment.is_some()
    }

    /// The environment light.
    pub fn environment(&self) -> Option<&Environment> {
        self.environment.as_ref().map(|(_, environment)| environment)
    }

    /// Solid angle of the largest light at infinity in sr, or 0 if no light has an extent.
    pub fn max_infinite_light_solid_angle(&self) -> f32 {
        match self.environment {
            Some(_) => 4.0 * std::f32::consts::PI,
            None => self.suns.iter().map(|(_, sun)| sun.inverse_pdf()).fold(0.0, f32::max),
        }
    }

    /// Radiance from infinity in a unit direction. `weight` returns the weight of a light, given its index
    /// and its light-sampling pdf in sr⁻¹.
    pub fn radiance_from_infinity(&self, direction: Vec3, weight: impl Fn(u32, f32) -> f32) -> Vec3 {
        let sky = self.environment().map(|environment| environment.radiance_and_pdf(direction));
        self.radiance_from_infinity_with_precomputed_sky(sky, direction, weight)
    }

    /// [`Lights::radiance_from_infinity`] with a precomputed result of [`Environment::radiance_and_pdf`].
    pub fn radiance_from_infinity_with_precomputed_sky(
        &self,
        sky: Option<(Vec3, f32)>,
        direction: Vec3,
        weight: impl Fn(u32, f32) -> f32,
    ) -> Vec3 {
        let suns =
            self.suns.iter().map(|(number, sun)| (*number, (sun.radiance(direction), sun.pdf(direction))));
        let number = self.environment.iter().map(|(number, _)| *number);
        let seen = suns.chain(number.zip(sky)).filter(|(_, (radiance, _))| *radiance != Vec3::ZERO);
        seen.map(|(number, (radiance, density))| radiance * weight(number, density)).sum()
    }

    /// The light with the given index.
    #[inline(always)]
    pub fn get(&self, number: u32) -> &Light {
        &self.all[number as usize]
    }

    /// The light on one side of an object's primitive, and its index.
    #[inline]
    pub fn light_on_primitive(&self, object: u32, primitive: u32, side: Side) -> Option<(u32, &Light)> {
        let by_object = match side {
            Side::Front => &self.by_object,
            Side::Back => &self.by_back,
        };
        let number = match by_object.get(&object)? {
            ObjectLights::Whole(number) => *number,
            ObjectLights::Primitives(lights) => lights.get(primitive as usize).copied().flatten()?,
        };
        Some((number, &self.all[number as usize]))
    }
}

/// Number of lights, where all lights on the same object count as one.
fn count_lights_once_per_object<'a>(lights: impl Iterator<Item = &'a Light> + Clone) -> usize {
    let object = |light: &Light| light.as_area().map(|light| light.object);
    let objects: HashSet<u32> = lights.clone().filter_map(object).collect();
    objects.len() + lights.filter(|light| object(light).is_none()).count()
}
