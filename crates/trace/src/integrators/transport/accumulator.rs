//! Accumulator of light: a view takes its parts of the light.

use super::ray::PathRay;
use crate::integrators::view::{Measure, Parts};
use crate::math::Vec3;

/// Kind of a contribution that no lamp's light makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Emission of a surface, or of the background.
    Emitted,
    /// The ambient part of Phong.
    Ambient,
}

/// Accumulates radiance per slot, as far as the view shows it: in each round of paths first emission and ambient light,
/// then the light of lamps, in the order of the paths.
pub struct Accumulator<'a> {
    /// Measure of the numbers.
    pub measure: Measure,
    /// Sums, by slot.
    pub radiance: &'a mut [Vec3],
    /// Upper bound on contributions at vertices that the camera does not see; 0 for no bound.
    pub clamp: f32,
}

impl Accumulator<'_> {
    /// Adds light that no lamp's ray brings.
    pub fn add(&mut self, slot: u32, part: Part, radiance: Vec3) {
        let parts = self.parts();
        let is_taken = match part {
            Part::Emitted => parts.emitted,
            Part::Ambient => parts.ambient,
        };
        if is_taken {
            self.radiance[slot as usize] += radiance;
        }
    }

    /// Adds light of a lamp that a path hits after a surface which the camera sees.
    pub fn add_met(&mut self, path: &PathRay, radiance: Vec3) {
        match self.measure {
            Measure::Radiance(parts) if path.state.contributes(parts.ways) => {
                self.add_arrived(path.slot, radiance, false);
            }
            Measure::Radiance(_) | Measure::ArrivingShare | Measure::Work => {}
        }
    }

    /// Adds the work of a ray.
    pub fn add_work(&mut self, slot: u32, count: u32) {
        self.radiance[slot as usize] += Vec3::splat(count as f32);
    }

    /// The parts of radiance that are taken unchanged.
    fn parts(&self) -> Parts {
        match self.measure {
            Measure::Radiance(parts) => parts,
            Measure::ArrivingShare | Measure::Work => Parts::NONE,
        }
    }

    /// Whether it takes any light of lamps.
    pub fn takes_reflected(&self) -> bool {
        match self.measure {
            Measure::Radiance(parts) => parts.are_reflected(),
            Measure::ArrivingShare | Measure::Work => true,
        }
    }

    /// Whether it takes the ambient light of Phong surfaces that a path meets. Behind a rough surface it is light that this surface
    /// reflects.
    pub fn takes_ambient(&self, path: &PathRay) -> bool {
        let parts = self.parts();
        if path.state.only_specular_before {
            parts.ambient
        } else {
            parts.are_reflected() && parts.ways.indirect
        }
    }

    /// Adds ambient light that a path meets.
    #[inline]
    pub fn add_ambient(&mut self, path: &PathRay, radiance: Vec3) {
        if path.state.only_specular_before {
            self.add(path.slot, Part::Ambient, radiance);
        } else if self.takes_ambient(path) {
            self.add_arrived(path.slot, radiance, false);
        }
    }

    /// Adds the light of lamps at the vertices of consecutive slots, all of which the camera sees.
    pub fn add_arrived_run(&mut self, first: u32, contributions: &[Vec3]) {
        for (sum, contribution) in self.radiance[first as usize..].iter_mut().zip(contributions) {
            *sum += *contribution;
        }
    }

    /// Adds the light of lamps at a vertex, which the camera sees or not.
    pub fn add_arrived(&mut self, slot: u32, contribution: Vec3, only_specular_before: bool) {
        let largest = contribution.max_element();
        let is_clamped = !only_specular_before && self.clamp > 0.0 && largest > self.clamp;
        let kept = if is_clamped { self.clamp / largest } else { 1.0 };
        self.radiance[slot as usize] += contribution * kept;
    }
}
