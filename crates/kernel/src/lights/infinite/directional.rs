//! Light from far away: a direction, or a disc in the sky.

use std::f32::consts::PI;

use super::InfiniteLight;
use crate::lights::row::{LightRow, row_beyond};
use crate::lights::sample::{End, LightSample, Source};
use crate::lights::tree::bounds::{EmissionCone, LightBounds, Space, strength};
use crate::math::Vec3;
use crate::math::frame::Frame;
use crate::math::lanes::F32x16;
use crate::sampling::warp;

/// Light that comes from one direction everywhere, or from a disc of directions of the same radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Unit direction to the middle of the light, against the way that it travels.
    pub to_light: Vec3,
    /// Irradiance of a surface that faces the light.
    pub irradiance: Vec3,
    /// 1 − cos of half the apparent diameter; 0 for a light without extent.
    one_minus_cos: f32,
    /// Radiance of the disc; 0 without extent.
    radiance: Vec3,
}

impl DirectionalLight {
    /// A light with an apparent diameter of `angle` radians, up to π; 0 for a sharp light.
    pub fn new(to_light: Vec3, irradiance: Vec3, angle: f64) -> Self {
        let (quarter, half) = (libm::sin(angle / 4.0), libm::sin(angle / 2.0));
        let radiance = if angle > 0.0 {
            (irradiance.as_dvec3() / (std::f64::consts::PI * half * half)).as_vec3()
        } else {
            Vec3::ZERO
        };
        Self { to_light, irradiance, one_minus_cos: (2.0 * quarter * quarter) as f32, radiance }
    }

    /// Samples the light as it arrives anywhere, uniform over the solid angle of the disc.
    pub fn sample(&self, u: [f32; 2]) -> Option<LightSample> {
        let (direction, weight) = self.arriving(u);
        (weight != Vec3::ZERO).then_some(LightSample {
            end: End::Beyond,
            direction,
            weight,
            source: Source::Nothing,
        })
    }

    /// [`DirectionalLight::sample`] side by side.
    #[inline(always)]
    pub fn sample_row(&self, u: &[F32x16; 2]) -> LightRow {
        row_beyond!(i => self.arriving([u[0][i], u[1][i]]))
    }

    /// A unit direction to the light, and radiance over its pdf; for a light without extent, irradiance.
    #[inline(always)]
    pub fn arriving(&self, u: [f32; 2]) -> (Vec3, Vec3) {
        if self.is_sharp() {
            return (self.to_light, self.irradiance);
        }
        let direction = Frame::from_normal(self.to_light).to_world(warp::cone(u, self.one_minus_cos));
        (direction, self.radiance * self.inverse_density())
    }

    /// Radiance from a direction; 0 for a light without extent.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        if self.holds(direction) { self.radiance } else { Vec3::ZERO }
    }

    /// Pdf in sr⁻¹ of [`DirectionalLight::sample`]; 0 without extent.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        if self.holds(direction) { 1.0 / self.inverse_density() } else { 0.0 }
    }

    /// Inverse of that pdf; 0 without extent.
    #[inline(always)]
    pub fn inverse_density(&self) -> f32 {
        2.0 * PI * self.one_minus_cos
    }

    /// Whether a unit direction is in the disc. Compares chords, which is exact for small discs too.
    fn holds(&self, direction: Vec3) -> bool {
        !self.is_sharp() && (direction - self.to_light).length_squared() <= 2.0 * self.one_minus_cos
    }
}

impl InfiniteLight for DirectionalLight {
    fn arriving_anywhere(&self, u: [f32; 2]) -> (Vec3, Vec3) {
        self.arriving(u)
    }

    fn power_over(&self, area: f64) -> Vec3 {
        (self.arriving([0.5; 2]).1.as_dvec3() * area).as_vec3()
    }

    fn bounds(&self) -> LightBounds {
        LightBounds {
            space: Space::Beyond,
            center: self.to_light.as_dvec3(),
            // Take the chord from the middle to the edge.
            radius: (2.0 * f64::from(self.one_minus_cos)).sqrt(),
            power: strength(self.irradiance),
            cone: EmissionCone::ALL,
        }
    }

    fn middle(&self) -> Option<Vec3> {
        Some(self.to_light)
    }

    #[inline]
    fn is_sharp(&self) -> bool {
        self.one_minus_cos == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Dimension, PixelSampler};

    #[test]
    fn samples_are_of_the_disc_and_bring_the_irradiance() {
        for degrees in [1e-3_f64, 0.53, 10.0, 90.0, 180.0] {
            let sun = DirectionalLight::new(Vec3::new(0.6, 0.0, 0.8), Vec3::splat(3.0), degrees.to_radians());
            let (mut irradiance, count) = (0.0, 4096);
            for sample in 0..count {
                let u = PixelSampler::new(1, 2, 3, sample).pair(1, Dimension::Light(0)).to_array();
                let sample = sun.sample(u).expect("light");
                assert_eq!(sample.end, End::Beyond);
                // The very edge may count either way.
                if sun.pdf(sample.direction) > 0.0 {
                    let product =
                        sun.radiance(sample.direction).x / sun.pdf(sample.direction) / sample.weight.x;
                    assert!((product - 1.0).abs() < 1e-5, "{degrees}: {product}");
                }
                irradiance += sample.weight.x * sample.direction.dot(sun.to_light);
            }
            let mean = irradiance / count as f32;
            assert!((mean - 3.0).abs() < 3e-3, "{degrees}: {mean}");
        }
    }

    #[test]
    fn a_sharp_light_is_seen_by_no_ray() {
        let sun = DirectionalLight::new(Vec3::Y, Vec3::ONE, 0.0);
        assert_eq!((sun.radiance(Vec3::Y), sun.pdf(Vec3::Y)), (Vec3::ZERO, 0.0));
        assert_eq!(sun.sample([0.3, 0.4]).map(|sample| sample.weight), Some(Vec3::ONE));
    }
}
