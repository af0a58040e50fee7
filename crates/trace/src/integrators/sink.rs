//! What becomes of the light that is found: a view takes its parts of it.

use super::queues::PathRay;
use super::view::{Measure, Parts};
use crate::math::Vec3;

/// What a contribution that no lamp sends is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Sent out by a surface, or by what is behind everything.
    Emitted,
    /// The ambient part of Phong.
    Ambient,
}

/// Takes what a view shows, of each round of paths first what no lamp sends and then what lamps send, in the order of the
/// paths.
pub struct Sink<'a> {
    /// What the numbers are.
    pub measure: Measure,
    /// Sums, by slot.
    pub radiance: &'a mut [Vec3],
    /// Most that a vertex which the eye does not see may bring; 0: no such limit.
    pub clamp: f32,
}

impl Sink<'_> {
    /// Light that no lamp's ray brings.
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

    /// Light of a lamp that a path meets after a surface which the eye sees.
    pub fn add_met(&mut self, path: &PathRay, radiance: Vec3) {
        match self.measure {
            Measure::Radiance(parts) if path.history.shows(parts.ways) => {
                self.add_arrived(path.slot, radiance, false);
            }
            Measure::Radiance(_) | Measure::ArrivingShare | Measure::Work => {}
        }
    }

    /// Work that a ray takes.
    pub fn add_work(&mut self, slot: u32, count: u32) {
        self.radiance[slot as usize] += Vec3::splat(count as f32);
    }

    /// The parts of radiance that are taken as they are.
    fn parts(&self) -> Parts {
        match self.measure {
            Measure::Radiance(parts) => parts,
            Measure::ArrivingShare | Measure::Work => Parts::NONE,
        }
    }

    /// Whether anything is taken of what lamps send.
    pub fn takes_reflected(&self) -> bool {
        match self.measure {
            Measure::Radiance(parts) => parts.are_reflected(),
            Measure::ArrivingShare | Measure::Work => true,
        }
    }

    /// Whether anything is taken of what Phong surfaces reflect of ambient light.
    pub fn takes_ambient(&self) -> bool {
        self.parts().ambient
    }

    /// What lamps send to the eye by the vertices of the slots from one on, which the eye sees itself.
    pub fn add_arrived_run(&mut self, first: u32, contributions: &[Vec3]) {
        for (sum, contribution) in self.radiance[first as usize..].iter_mut().zip(contributions) {
            *sum += *contribution;
        }
    }

    /// What lamps send to the eye by a vertex, which the eye sees itself or not.
    pub fn add_arrived(&mut self, slot: u32, contribution: Vec3, is_seen: bool) {
        let largest = contribution.max_element();
        let is_clamped = !is_seen && self.clamp > 0.0 && largest > self.clamp;
        let kept = if is_clamped { self.clamp / largest } else { 1.0 };
        self.radiance[slot as usize] += contribution * kept;
    }
}
