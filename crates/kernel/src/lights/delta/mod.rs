//! Delta lights. Rays cannot hit these lights, and their light arrives at each point from a single direction.

mod point;
mod spot;

pub use point::{Falloff, PointLight};
pub use spot::SpotLight;

use super::packet::{LightSamplePacket, packet_of};
use super::sample::{GeometryOfLight, LightSample, ShadowRayEnd};
use super::tree::LightBounds;
use crate::math::Vec3;
use crate::math::lanes::{Vec3x16, lane};

/// A light without extent: a point light or a spotlight.
pub trait DeltaPositionLight {
    /// An isotropic light with the same position, falloff, and peak intensity.
    fn isotropic_at_peak_intensity(&self) -> &PointLight;

    /// Intensity in a unit direction away from the light, relative to the peak intensity, in [0, 1].
    fn relative_intensity(&self, away: Vec3) -> f32;

    /// Power divided by the peak intensity, in sr: the integral of
    /// [`DeltaPositionLight::relative_intensity`].
    fn effective_solid_angle(&self) -> f64;

    /// Samples a unit direction away from the light, with a pdf proportional to the intensity. `u` is in [0,
    /// 1)².
    fn sample_direction(&self, u: [f32; 2]) -> Vec3;

    /// Bounds on the light's position and emission. Nothing is emitted outside the cone.
    fn bounds(&self) -> LightBounds;

    /// Unit direction from a point to the light, and irradiance at normal incidence (0 at the light's
    /// position).
    #[inline(always)]
    fn direction_and_irradiance(&self, point: Vec3) -> (Vec3, Vec3) {
        let (direction, weight) =
            self.isotropic_at_peak_intensity().direction_and_isotropic_irradiance(point);
        (direction, weight * self.relative_intensity(-direction))
    }

    /// Implements [`Light::sample`](super::Light::sample). There is only one direction.
    fn sample(&self, point: Vec3) -> Option<LightSample> {
        let (direction, weight) = self.direction_and_irradiance(point);
        let end = ShadowRayEnd::At(self.isotropic_at_peak_intensity().position.as_vec3());
        (weight != Vec3::ZERO).then_some(LightSample {
            end,
            direction,
            weight,
            source: GeometryOfLight::Nothing,
        })
    }

    /// [`DeltaPositionLight::sample`] for a packet of points.
    #[inline(always)]
    fn sample_packet(&self, points: &Vec3x16) -> LightSamplePacket {
        let target = self.isotropic_at_peak_intensity().position.as_vec3();
        packet_of!(GeometryOfLight::Nothing, i => {
            let (direction, weight) = self.direction_and_irradiance(lane(points, i));
            (direction, target, weight)
        })
    }
}
