//! Environment lights.

use std::f32::consts::PI;
use std::sync::Arc;

use super::InfiniteLight;
use super::environment_map::EnvironmentMap;
use super::sky::{SkyDome, SkyFrame};
use crate::lights::packet::LightSamplePacket;
use crate::lights::sample::{GeometryOfLight, LightSample, ShadowRayEnd};
use crate::lights::tree::bounds::{DistanceFalloff, EmissionCone, LightBounds, mean_channel};
use crate::math::frame::Frame;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};
use crate::math::{DVec3, Mat3, Vec3};
use crate::sampling::warp;

/// Light from all directions, visible to rays that leave the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Environment {
    /// The same radiance from all directions.
    Constant(Vec3),
    /// A radiance map.
    Map {
        /// The map.
        sky: Arc<EnvironmentMap>,
        /// Radiance of a white texel.
        factor: Vec3,
        /// Orientation of the map.
        orientation: MapOrientation,
    },
    /// A clear sky above a diffuse ground.
    Sky {
        /// The sky.
        dome: Arc<SkyDome>,
        /// Its orientation.
        frame: SkyFrame,
    },
}

/// Orientation of an environment map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapOrientation {
    /// Rotation about +y as a fraction of 360°, counterclockwise when seen from above, in [0, 1).
    Turn(f32),
    /// Rotation from the map's axes to the world's.
    Rotation(Mat3),
}

impl MapOrientation {
    /// Rotation about +y by an angle in degrees, counterclockwise when seen from above.
    pub fn from_azimuth_degrees(degrees: f64) -> Self {
        Self::Turn((degrees / 360.0).rem_euclid(1.0) as f32)
    }

    /// Converts a world direction to the direction and the turn for a lookup in the map.
    #[inline(always)]
    fn to_map(self, direction: Vec3) -> (Vec3, f32) {
        match self {
            Self::Turn(turn) => (direction, turn),
            Self::Rotation(rotation) => (rotation.transpose() * direction, 0.0),
        }
    }

    /// The turn for sampling the map. Pass sampled directions to [`Self::to_world`].
    #[inline(always)]
    fn turn_in_map(self) -> f32 {
        match self {
            Self::Turn(turn) => turn,
            Self::Rotation(_) => 0.0,
        }
    }

    /// Converts a sampled direction to a world direction.
    #[inline(always)]
    fn to_world(self, direction: Vec3) -> Vec3 {
        match self {
            Self::Turn(_) => direction,
            Self::Rotation(rotation) => rotation * direction,
        }
    }

    /// Applies `convert` to a packet of directions if the orientation is a general rotation.
    #[inline(always)]
    fn convert_if_general_rotation(self, directions: &mut Vec3x16, convert: impl Fn(Self, Vec3) -> Vec3) {
        match self {
            Self::Turn(_) => {}
            Self::Rotation(_) => {
                for i in 0..PACKET_SIZE {
                    let direction = convert(self, lane(directions, i));
                    set_lane(directions, i, direction);
                }
            }
        }
    }
}

/// Pdf for sampling a constant environment, uniformly over the hemisphere above the surface.
const HEMISPHERE_PDF: f32 = 1.0 / (2.0 * PI);

impl Environment {
    /// An environment map, scaled by `factor`.
    pub fn from_map(sky: Arc<EnvironmentMap>, factor: Vec3, orientation: MapOrientation) -> Self {
        Self::Map { sky, factor, orientation }
    }

    /// Radiance from a unit direction, and pdf of [`Environment::sample`] in sr⁻¹. The pdf is for directions
    /// above the surface.
    #[inline(always)]
    pub fn radiance_and_pdf(&self, direction: Vec3) -> (Vec3, f32) {
        match self {
            Self::Constant(radiance) => (*radiance, HEMISPHERE_PDF),
            Self::Map { sky, factor, orientation } => {
                let (direction, turn) = orientation.to_map(direction);
                let (color, pdf) = sky.lookup_color_and_pdf(direction, turn);
                (color * *factor, pdf)
            }
            Self::Sky { dome, frame } => dome.radiance_and_pdf(frame, direction),
        }
    }

    /// [`Environment::radiance_and_pdf`] for a packet of directions.
    #[inline(always)]
    pub fn radiance_and_pdf_packet(&self, directions: &Vec3x16) -> (Vec3x16, F32x16) {
        match self {
            Self::Constant(Vec3 { x, y, z }) => {
                ([[*x; PACKET_SIZE], [*y; PACKET_SIZE], [*z; PACKET_SIZE]], [HEMISPHERE_PDF; PACKET_SIZE])
            }
            Self::Map { sky, factor, orientation } => {
                let mut directions = *directions;
                orientation
                    .convert_if_general_rotation(&mut directions, |own, direction| own.to_map(direction).0);
                let (mut colors, pdfs) =
                    sky.lookup_color_and_pdf_packet(&directions, orientation.turn_in_map());
                for i in 0..PACKET_SIZE {
                    let color = lane(&colors, i) * *factor;
                    set_lane(&mut colors, i, color);
                }
                (colors, pdfs)
            }
            Self::Sky { dome, frame } => dome.radiance_and_pdf_packet(frame, directions),
        }
    }

    /// Samples the environment for a packet of surface normals.
    #[inline(always)]
    pub fn sample_packet(&self, normals: &Vec3x16, u: &[F32x16; 2]) -> LightSamplePacket {
        let (directions, mut weights, pdfs) = match self {
            Self::Constant(_) => {
                let mut directions = [[0.0; PACKET_SIZE]; 3];
                for i in 0..PACKET_SIZE {
                    let frame = Frame::from_normal(lane(normals, i));
                    set_lane(&mut directions, i, frame.to_world(warp::cone([u[0][i], u[1][i]], 1.0)));
                }
                let (radiance, pdfs) = self.radiance_and_pdf_packet(&directions);
                (directions, radiance, pdfs)
            }
            Self::Map { sky, factor, orientation } => {
                let (mut directions, mut colors, pdfs) = sky.sample_packet(u, orientation.turn_in_map());
                orientation.convert_if_general_rotation(&mut directions, MapOrientation::to_world);
                for i in 0..PACKET_SIZE {
                    let color = lane(&colors, i) * *factor;
                    set_lane(&mut colors, i, color);
                }
                (directions, colors, pdfs)
            }
            Self::Sky { dome, frame } => dome.sample_packet(frame, u),
        };
        let mut inverse_pdfs = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            // The pdf is 0 at the centers of black texels.
            inverse_pdfs[i] = if pdfs[i] > 0.0 { 1.0 / pdfs[i] } else { 0.0 };
            let weight = lane(&weights, i) * inverse_pdfs[i];
            set_lane(&mut weights, i, weight);
        }
        let dark = LightSamplePacket::black(GeometryOfLight::Nothing);
        LightSamplePacket {
            directions,
            weights,
            beyond: u32::MAX,
            environment_inverse_pdfs: inverse_pdfs,
            ..dark
        }
    }

    /// Inverse sampling pdf of a direction, in sr.
    #[inline(always)]
    pub fn inverse_pdf(&self, direction: Vec3) -> f32 {
        let (_, pdf) = self.radiance_and_pdf(direction);
        if pdf > 0.0 { 1.0 / pdf } else { 0.0 }
    }

    /// Mean radiance over all directions.
    pub fn mean(&self) -> Vec3 {
        match self {
            Self::Constant(radiance) => *radiance,
            Self::Map { sky, factor, .. } => sky.mean() * *factor,
            Self::Sky { dome, .. } => dome.mean(),
        }
    }

    /// Samples the environment for a surface with the given normal.
    pub fn sample(&self, normal: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let (direction, radiance, pdf) = match self {
            Self::Constant(radiance) => {
                (Frame::from_normal(normal).to_world(warp::cone(u, 1.0)), *radiance, HEMISPHERE_PDF)
            }
            Self::Map { sky, factor, orientation } => {
                let (direction, color, pdf) = sky.sample(u, orientation.turn_in_map());
                (orientation.to_world(direction), color * *factor, pdf)
            }
            Self::Sky { dome, frame } => dome.sample(frame, u),
        };
        let weight = radiance * if pdf > 0.0 { 1.0 / pdf } else { 0.0 };
        let is_light = weight != Vec3::ZERO;
        is_light.then_some(LightSample {
            end: ShadowRayEnd::Beyond,
            direction,
            weight,
            source: GeometryOfLight::Nothing,
        })
    }
}

impl InfiniteLight for Environment {
    fn sample_direction_and_weight(&self, u: [f32; 2]) -> (Vec3, Vec3) {
        match self {
            Self::Constant(radiance) => (warp::cone(u, 2.0), *radiance * (4.0 * PI)),
            Self::Map { sky, factor, orientation } => {
                let (direction, color, pdf) = sky.sample(u, orientation.turn_in_map());
                // The pdf is 0 at the centers of black texels.
                (orientation.to_world(direction), color * *factor * if pdf > 0.0 { 1.0 / pdf } else { 0.0 })
            }
            Self::Sky { dome, frame } => {
                let (direction, radiance, pdf) = dome.sample(frame, u);
                (direction, radiance / pdf)
            }
        }
    }

    fn power_through_disk(&self, area: f64) -> Vec3 {
        (self.mean().as_dvec3() * (4.0 * std::f64::consts::PI * area)).as_vec3()
    }

    /// Bounds that include all directions. The power is the irradiance that the mean radiance causes on a
    /// surface.
    fn direction_and_irradiance_bounds(&self) -> LightBounds {
        let mean = match self {
            Self::Constant(radiance) => mean_channel(*radiance),
            Self::Map { sky, factor, .. } => sky.mean_luminance() * mean_channel(*factor),
            Self::Sky { dome, .. } => mean_channel(dome.mean()),
        };
        let power = std::f64::consts::PI * mean;
        LightBounds {
            space: DistanceFalloff::Beyond,
            center: DVec3::ZERO,
            radius: 1.0,
            power,
            cone: EmissionCone::ALL,
        }
    }

    fn direction_to_center(&self) -> Option<Vec3> {
        None
    }

    fn has_no_angular_extent(&self) -> bool {
        false
    }
}

#[cfg(test)]
#[path = "environment_tests.rs"]
mod tests;
