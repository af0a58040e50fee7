//! What becomes of the light that is found: a view takes its parts of it.

use super::view::{Measure, Parts};
use crate::math::Vec3;
use crate::math::color::luminance;

/// What a contribution that nothing can stop is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Sent out by a surface, or by what is behind everything.
    Emitted,
    /// The ambient part of Phong.
    Ambient,
}

/// Light of a lamp that a vertex reflects to the eye, by parts.
#[derive(Clone, Copy, Debug)]
pub struct Reflected {
    /// The radiance that is reflected.
    pub arriving: Vec3,
    /// What the diffuse lobe makes of it.
    pub diffuse: Vec3,
    /// What the glossy lobe makes of it where the mirrored direction is the eye's.
    pub specular: Vec3,
}

/// Takes what a view shows. What nothing can stop and what shadow rays bring are added up apart, each in the order of the paths,
/// whenever the shadow rays are traced.
pub struct Sink<'a> {
    /// What the numbers are.
    pub measure: Measure,
    /// Sums of what nothing can stop, by slot.
    pub radiance: &'a mut [Vec3],
    /// Sums of what shadow rays bring, by slot.
    pub arrived: &'a mut [Vec3],
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

    /// The parts of radiance that are taken as they are.
    fn parts(&self) -> Parts {
        match self.measure {
            Measure::Radiance(parts) => parts,
            Measure::ArrivingShare => Parts::NONE,
        }
    }

    /// Whether anything is taken of what lamps send.
    pub fn takes_reflected(&self) -> bool {
        match self.measure {
            Measure::Radiance(parts) => parts.diffuse || parts.specular,
            Measure::ArrivingShare => true,
        }
    }

    /// What is taken: that which is the same in all directions, and that where the mirrored direction is the eye's.
    pub fn taken(&self, light: &Reflected) -> [Vec3; 2] {
        let part = |is_taken: bool, value: Vec3| if is_taken { value } else { Vec3::ZERO };
        match self.measure {
            Measure::Radiance(parts) => {
                [part(parts.diffuse, light.diffuse), part(parts.specular, light.specular)]
            }
            Measure::ArrivingShare => [Vec3::splat(luminance(light.arriving)), Vec3::ZERO],
        }
    }

    /// What a shadow ray brings.
    pub fn add_arrived(&mut self, slot: u32, contribution: Vec3) {
        self.arrived[slot as usize] += contribution;
    }
}
