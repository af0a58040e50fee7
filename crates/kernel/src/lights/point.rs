//! Point lights.

use super::tree::bounds::{EmissionCone, LightBounds, Space, strength};
use super::{End, LightSample, Source};
use crate::choice;
use crate::math::{DVec3, Vec3};

/// A light without extent, with the same intensity in every direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Position.
    pub position: DVec3,
    /// Intensity in W·sr⁻¹; without fall-off, irradiance at normal incidence.
    pub intensity: Vec3,
    /// Fall-off with distance.
    pub falloff: Falloff,
}

choice! {
    /// Fall-off of a point light with distance.
    pub enum Falloff {
        /// With the square of the distance.
        Square = "square",
        /// Not at all.
        None = "none",
    }
}

impl PointLight {
    /// Samples it by the only direction.
    pub fn sample(&self, point: Vec3) -> Option<LightSample> {
        let (direction, weight) = self.arriving(point);
        let end = End::At(self.position.as_vec3());
        (weight != Vec3::ZERO).then_some(LightSample { end, direction, weight, source: Source::Nothing })
    }

    /// Bounds of its position and emission.
    pub fn bounds(&self) -> LightBounds {
        let space = match self.falloff {
            Falloff::Square => Space::Weakening,
            Falloff::None => Space::Steady,
        };
        let power = strength(self.intensity);
        LightBounds { space, center: self.position, radius: 0.0, power, cone: EmissionCone::ALL }
    }

    /// Unit direction to the light, and irradiance at normal incidence; 0 at the light itself.
    #[inline(always)]
    pub fn arriving(&self, point: Vec3) -> (Vec3, Vec3) {
        let to_light = self.position - point.as_dvec3();
        let distance_squared = to_light.length_squared();
        let direction = (to_light * (1.0 / distance_squared.sqrt())).as_vec3();
        let weight = match self.falloff {
            Falloff::Square => self.intensity * (1.0 / distance_squared as f32),
            Falloff::None => self.intensity,
        };
        (direction, if distance_squared > 0.0 { weight } else { Vec3::ZERO })
    }
}
