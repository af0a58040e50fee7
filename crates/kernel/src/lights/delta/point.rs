//! Point lights.

use std::f64::consts::PI;

use super::DeltaPositionLight;
use crate::choice;
use crate::lights::tree::bounds::{DistanceFalloff, EmissionCone, LightBounds, mean_channel};
use crate::math::{DVec3, Vec3};
use crate::sampling::warp;

/// An isotropic point light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Position.
    pub position: DVec3,
    /// Intensity in W·sr⁻¹, or the irradiance at normal incidence for lights without falloff.
    pub intensity: Vec3,
    /// Falloff with distance.
    pub falloff: Falloff,
}

choice! {
    /// Falloff of a point light with distance.
    pub enum Falloff {
        /// Inverse-square falloff.
        Square = "square",
        /// No falloff.
        None = "none",
    }
}

impl PointLight {
    /// Unit direction to the light, and irradiance at normal incidence (0 at the light's position).
    #[inline(always)]
    pub(super) fn direction_and_isotropic_irradiance(&self, point: Vec3) -> (Vec3, Vec3) {
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

impl DeltaPositionLight for PointLight {
    fn isotropic_at_peak_intensity(&self) -> &PointLight {
        self
    }

    fn relative_intensity(&self, _: Vec3) -> f32 {
        1.0
    }

    fn effective_solid_angle(&self) -> f64 {
        4.0 * PI
    }

    fn sample_direction(&self, u: [f32; 2]) -> Vec3 {
        warp::cone(u, 2.0)
    }

    fn bounds(&self) -> LightBounds {
        let space = match self.falloff {
            Falloff::Square => DistanceFalloff::InverseSquare,
            Falloff::None => DistanceFalloff::Constant,
        };
        let power = mean_channel(self.intensity);
        LightBounds { space, center: self.position, radius: 0.0, power, cone: EmissionCone::ALL }
    }

    #[inline(always)]
    fn direction_and_irradiance(&self, point: Vec3) -> (Vec3, Vec3) {
        self.direction_and_isotropic_irradiance(point)
    }
}
