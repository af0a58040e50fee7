//! Light from all around.

use std::f32::consts::PI;
use std::sync::Arc;

use super::sky::SkyMap;
use super::tree::bounds::{EmissionCone, LightBounds, Space, strength};
use super::{End, LightSample, Source};
use crate::math::frame::Frame;
use crate::math::{DVec3, Vec3};
use crate::sampling::warp;

/// Light that every ray sees which leaves the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Environment {
    /// The same radiance everywhere.
    Constant(Vec3),
    /// By a map.
    Map {
        /// The map.
        sky: Arc<SkyMap>,
        /// Radiance of white.
        factor: Vec3,
        /// Turns about +y, counterclockwise seen from above, in [0, 1).
        turn: f32,
    },
}

/// Density of samples of a constant radiance: they are those that the front of a surface sees.
const HEMISPHERE: f32 = 1.0 / (2.0 * PI);

impl Environment {
    /// A map, as bright as white times a factor, turned by an angle in degrees.
    pub fn map(sky: Arc<SkyMap>, factor: Vec3, degrees: f64) -> Self {
        Self::Map { sky, factor, turn: (degrees / 360.0).rem_euclid(1.0) as f32 }
    }

    /// All directions, and the irradiance of a surface by its mean radiance.
    pub fn bounds(&self) -> LightBounds {
        let mean = match self {
            Self::Constant(radiance) => strength(*radiance),
            Self::Map { sky, factor, .. } => sky.mean_luminance() * strength(*factor),
        };
        let power = std::f64::consts::PI * mean;
        LightBounds { space: Space::Beyond, center: DVec3::ZERO, radius: 1.0, power, cone: EmissionCone::ALL }
    }

    /// Radiance from a unit direction, and the density in sr⁻¹ of [`Environment::sample`] on the side of the surface that the
    /// normal is on.
    #[inline(always)]
    pub fn arriving(&self, direction: Vec3) -> (Vec3, f32) {
        match self {
            Self::Constant(radiance) => (*radiance, HEMISPHERE),
            Self::Map { sky, factor, turn } => {
                let (color, density) = sky.lookup(direction, *turn);
                (color * *factor, density)
            }
        }
    }

    /// One over the density of a sample; 0 where there are none.
    #[inline(always)]
    pub fn inverse_density(&self, direction: Vec3) -> f32 {
        let (_, density) = self.arriving(direction);
        if density > 0.0 { 1.0 / density } else { 0.0 }
    }

    /// A way for its light to arrive at a surface of this normal.
    pub fn sample(&self, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (direction, weight) = self.arriving_at(normal, u);
        let is_light = weight != Vec3::ZERO;
        is_light.then_some(LightSample { end: End::Beyond, direction, weight, source: Source::Nothing })
    }

    /// A unit direction to where it comes from, and radiance over its density.
    #[inline(always)]
    pub fn arriving_at(&self, normal: Vec3, u: [f32; 2]) -> (Vec3, Vec3) {
        let direction = match self {
            Self::Constant(_) => Frame::from_normal(normal).to_world(warp::cone(u, 1.0)),
            Self::Map { sky, turn, .. } => sky.sample(u, *turn),
        };
        let (radiance, density) = self.arriving(direction);
        // At the edge of a dark cell rounding may lead into it.
        let inverse = if density > 0.0 { 1.0 / density } else { 0.0 };
        (direction, radiance * inverse)
    }
}

#[cfg(test)]
#[path = "environment_tests.rs"]
mod tests;
