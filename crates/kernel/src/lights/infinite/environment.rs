//! Environment light.

use std::f32::consts::PI;
use std::sync::Arc;

use super::InfiniteLight;
use super::sky::SkyMap;
use crate::lights::row::LightRow;
use crate::lights::sample::{End, LightSample, Source};
use crate::lights::tree::bounds::{EmissionCone, LightBounds, Space, strength};
use crate::math::frame::Frame;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};
use crate::math::{DVec3, Vec3};
use crate::sampling::warp;

/// Light that every ray sees which leaves the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Environment {
    /// The same radiance everywhere.
    Constant(Vec3),
    /// A map of radiance.
    Map {
        /// The map.
        sky: Arc<SkyMap>,
        /// Radiance of white.
        factor: Vec3,
        /// Turns about +y, counterclockwise seen from above, in [0, 1).
        turn: f32,
    },
}

/// Pdf of samples of a constant radiance: uniform over the hemisphere before the surface.
const HEMISPHERE: f32 = 1.0 / (2.0 * PI);

impl Environment {
    /// A map whose white is times a factor, turned by an angle in degrees.
    pub fn map(sky: Arc<SkyMap>, factor: Vec3, degrees: f64) -> Self {
        Self::Map { sky, factor, turn: (degrees / 360.0).rem_euclid(1.0) as f32 }
    }

    /// Radiance from a unit direction, and the pdf in sr⁻¹ of [`Environment::sample`], on the side of the surface that the
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

    /// [`Environment::arriving`] for directions side by side.
    #[inline(always)]
    pub fn arriving_row(&self, directions: &Vec3x16) -> (Vec3x16, F32x16) {
        match self {
            Self::Constant(Vec3 { x, y, z }) => {
                ([[*x; PACKET_SIZE], [*y; PACKET_SIZE], [*z; PACKET_SIZE]], [HEMISPHERE; PACKET_SIZE])
            }
            Self::Map { sky, factor, turn } => {
                let (mut colors, densities) = sky.lookup_row(directions, *turn);
                for i in 0..PACKET_SIZE {
                    let color = lane(&colors, i) * *factor;
                    set_lane(&mut colors, i, color);
                }
                (colors, densities)
            }
        }
    }

    /// Samples of the environment for surfaces of these normals, side by side.
    #[inline(always)]
    pub fn sample_row(&self, normals: &Vec3x16, u: &[F32x16; 2]) -> LightRow {
        let (directions, mut weights, densities) = match self {
            Self::Constant(_) => {
                let mut directions = [[0.0; PACKET_SIZE]; 3];
                for i in 0..PACKET_SIZE {
                    let frame = Frame::from_normal(lane(normals, i));
                    set_lane(&mut directions, i, frame.to_world(warp::cone([u[0][i], u[1][i]], 1.0)));
                }
                let (radiance, densities) = self.arriving_row(&directions);
                (directions, radiance, densities)
            }
            Self::Map { sky, factor, turn } => {
                let (directions, mut colors, densities) = sky.sample_row(u, *turn);
                for i in 0..PACKET_SIZE {
                    let color = lane(&colors, i) * *factor;
                    set_lane(&mut colors, i, color);
                }
                (directions, colors, densities)
            }
        };
        let mut inverse_densities = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            // The pdf is 0 in the corner of a cell that is dark but for its neighbours.
            inverse_densities[i] = if densities[i] > 0.0 { 1.0 / densities[i] } else { 0.0 };
            let weight = lane(&weights, i) * inverse_densities[i];
            set_lane(&mut weights, i, weight);
        }
        let dark = LightRow::dark(Source::Nothing);
        LightRow { directions, weights, beyond: u32::MAX, of_sky: inverse_densities, ..dark }
    }

    /// Inverse pdf of its samples at a direction, in sr.
    #[inline(always)]
    pub fn inverse_density(&self, direction: Vec3) -> f32 {
        let (_, density) = self.arriving(direction);
        if density > 0.0 { 1.0 / density } else { 0.0 }
    }

    /// The mean of the radiance over all directions.
    pub fn mean(&self) -> Vec3 {
        match self {
            Self::Constant(radiance) => *radiance,
            Self::Map { sky, factor, .. } => sky.mean() * *factor,
        }
    }

    /// Samples the environment for a surface of this normal.
    pub fn sample(&self, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (direction, radiance, density) = match self {
            Self::Constant(radiance) => {
                (Frame::from_normal(normal).to_world(warp::cone(u, 1.0)), *radiance, HEMISPHERE)
            }
            Self::Map { sky, factor, turn } => {
                let (direction, color, density) = sky.sample(u, *turn);
                (direction, color * *factor, density)
            }
        };
        let weight = radiance * if density > 0.0 { 1.0 / density } else { 0.0 };
        let is_light = weight != Vec3::ZERO;
        is_light.then_some(LightSample { end: End::Beyond, direction, weight, source: Source::Nothing })
    }
}

impl InfiniteLight for Environment {
    fn arriving_anywhere(&self, u: [f32; 2]) -> (Vec3, Vec3) {
        match self {
            Self::Constant(radiance) => (warp::cone(u, 2.0), *radiance * (4.0 * PI)),
            Self::Map { sky, factor, turn } => {
                let (direction, color, density) = sky.sample(u, *turn);
                // The pdf is 0 in the corner of a cell that is dark but for its neighbours.
                (direction, color * *factor * if density > 0.0 { 1.0 / density } else { 0.0 })
            }
        }
    }

    fn power_over(&self, area: f64) -> Vec3 {
        (self.mean().as_dvec3() * (4.0 * std::f64::consts::PI * area)).as_vec3()
    }

    /// All directions, and the irradiance of a surface by the mean radiance.
    fn bounds(&self) -> LightBounds {
        let mean = match self {
            Self::Constant(radiance) => strength(*radiance),
            Self::Map { sky, factor, .. } => sky.mean_luminance() * strength(*factor),
        };
        let power = std::f64::consts::PI * mean;
        LightBounds { space: Space::Beyond, center: DVec3::ZERO, radius: 1.0, power, cone: EmissionCone::ALL }
    }

    fn middle(&self) -> Option<Vec3> {
        None
    }

    fn is_sharp(&self) -> bool {
        false
    }
}

#[cfg(test)]
#[path = "environment_tests.rs"]
mod tests;
