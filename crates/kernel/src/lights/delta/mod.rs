//! Lights without extent: no ray hits them, and their light arrives in a single direction.

mod point;
mod spot;

pub use point::{Falloff, PointLight};
pub use spot::SpotLight;

use super::row::{LightRow, row_of};
use super::sample::{End, LightSample, Source};
use super::tree::LightBounds;
use crate::math::Vec3;
use crate::math::lanes::{Vec3x16, lane};

/// A light without extent.
pub trait DeltaLight {
    /// The light that has its intensity in the brightest direction everywhere: its position and its fall-off are theirs.
    fn brightest(&self) -> &PointLight;

    /// Intensity in a unit direction away from the light, relative to the brightest direction; in [0, 1].
    fn share(&self, away: Vec3) -> f32;

    /// Power over the intensity in the brightest direction, in sr: the integral of [`DeltaLight::share`].
    fn solid_angle(&self) -> f64;

    /// Samples a unit direction away from the light by numbers in [0, 1), in proportion to its intensity.
    fn direction(&self, u: [f32; 2]) -> Vec3;

    /// Bounds of its position and emission. Nothing is emitted outside of their cone.
    fn bounds(&self) -> LightBounds;

    /// Unit direction to the light from a point, and irradiance at normal incidence; 0 at the light itself.
    #[inline(always)]
    fn arriving(&self, point: Vec3) -> (Vec3, Vec3) {
        let (direction, weight) = self.brightest().irradiance(point);
        (direction, weight * self.share(-direction))
    }

    /// [`Light::sample`](super::Light::sample): the only direction.
    fn sample(&self, point: Vec3) -> Option<LightSample> {
        let (direction, weight) = self.arriving(point);
        let end = End::At(self.brightest().position.as_vec3());
        (weight != Vec3::ZERO).then_some(LightSample { end, direction, weight, source: Source::Nothing })
    }

    /// [`DeltaLight::sample`] for points side by side.
    #[inline(always)]
    fn sample_row(&self, points: &Vec3x16) -> LightRow {
        let target = self.brightest().position.as_vec3();
        row_of!(Source::Nothing, i => {
            let (direction, weight) = self.arriving(lane(points, i));
            (direction, target, weight)
        })
    }
}
