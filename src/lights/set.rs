//! All lights of a scene, and which of them a hit is on.

use std::collections::HashMap;

use super::emitter::{Emitter, Part};
use super::{AreaLight, DirectionalLight, Environment, Light};
use crate::math::Vec3;

/// The lights of a scene, known by their index.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lights {
    all: Vec<Light>,
    by_object: HashMap<u32, OfObject>,
    /// Those that rays see which leave the scene.
    suns: Vec<DirectionalLight>,
    /// The same of light from all around.
    environment: Option<Environment>,
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
    pub fn new(all: Vec<Light>) -> Self {
        let mut lights = Self::default();
        for (number, light) in (0_u32..).zip(&all) {
            match light {
                Light::Point(_) | Light::Spot(_) => {}
                Light::Directional(sun) if sun.is_sharp() => {}
                Light::Directional(sun) => lights.suns.push(*sun),
                Light::Environment(light) => lights.environment = Some(light.clone()),
                Light::Area(light) => lights.note(number, light),
            }
        }
        Self { all, ..lights }
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
    pub fn iter(&self) -> impl Iterator<Item = (u32, &Light)> {
        (0..).zip(&self.all)
    }

    /// Whether a ray that leaves the scene may see light.
    pub fn are_beyond(&self) -> bool {
        !self.suns.is_empty() || self.environment.is_some()
    }

    /// The light from all around.
    pub fn environment(&self) -> Option<&Environment> {
        self.environment.as_ref()
    }

    /// Radiance that comes from beyond the scene, from a unit direction; of each light the share that is given by the density in
    /// sr⁻¹ of its samples from there.
    pub fn beyond_by_density(&self, direction: Vec3, share: impl Fn(f32) -> f32) -> Vec3 {
        let sky = self.environment.as_ref().map(|environment| environment.arriving(direction));
        self.beyond_with(sky, direction, share)
    }

    /// The same where it is known what [`Environment::arriving`] says.
    pub fn beyond_with(&self, sky: Option<(Vec3, f32)>, direction: Vec3, share: impl Fn(f32) -> f32) -> Vec3 {
        let suns = self.suns.iter().map(|sun| (sun.radiance(direction), sun.pdf(direction)));
        let environment = sky.into_iter();
        let seen = suns.chain(environment).filter(|(radiance, _)| *radiance != Vec3::ZERO);
        seen.map(|(radiance, density)| radiance * share(density)).sum()
    }

    /// The light that a primitive of an object is, with its number.
    pub fn of_hit(&self, object: u32, primitive: u32) -> Option<(u32, &Light)> {
        let number = match self.by_object.get(&object)? {
            OfObject::Whole(number) => *number,
            OfObject::Primitives(lights) => lights.get(primitive as usize).copied().flatten()?,
        };
        Some((number, &self.all[number as usize]))
    }
}
