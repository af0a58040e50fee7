//! All lights of a scene, and which of them a hit is on.

use std::collections::HashMap;

use super::emitter::{Emitter, Part};
use super::{AreaLight, DirectionalLight, Light};
use crate::math::Vec3;

/// The lights of a scene, known by their index.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lights {
    all: Vec<Light>,
    by_object: HashMap<u32, OfObject>,
    /// Those that rays see which leave the scene.
    suns: Vec<DirectionalLight>,
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
        !self.suns.is_empty()
    }

    /// Radiance that comes from beyond the scene, from a unit direction; of each light the share that is given by the density in
    /// sr⁻¹ of its samples from there.
    pub fn beyond_by_density(&self, direction: Vec3, share: impl Fn(f32) -> f32) -> Vec3 {
        let of_sun = |sun: &DirectionalLight| match sun.radiance(direction) {
            Vec3::ZERO => Vec3::ZERO,
            radiance => radiance * share(sun.pdf(direction)),
        };
        self.suns.iter().map(of_sun).sum()
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
