//! Directional lights, which shine from a single direction or from a disk in the sky.

use std::f32::consts::PI;

use super::InfiniteLight;
use super::sky::sun::OrientedSunDisk;
use crate::lights::packet::{LightSamplePacket, infinite_packet_of};
use crate::lights::sample::{GeometryOfLight, LightSample, ShadowRayEnd};
use crate::lights::tree::bounds::{DistanceFalloff, EmissionCone, LightBounds, mean_channel};
use crate::math::Vec3;
use crate::math::frame::Frame;
use crate::math::lanes::F32x16;
use crate::sampling::warp;

/// Light from one direction or from a disk of directions. The radiance is uniform over the disk, except for
/// the sun of a sky.
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionalLight {
    /// Unit direction toward the light's center.
    pub to_light: Vec3,
    /// Irradiance on a surface that directly faces the light.
    pub irradiance: Vec3,
    /// 1 − cos of half the angular diameter, or 0 for a light without extent.
    one_minus_cos: f32,
    /// Mean radiance of the disk, or 0 for light from a single direction.
    radiance: Vec3,
    /// The disk, if its radiance is not uniform.
    sun: Option<OrientedSunDisk>,
}

impl DirectionalLight {
    /// Creates a light with an angular diameter of `angle` radians, up to π, or without extent if `angle` is
    /// 0.
    pub fn new(to_light: Vec3, irradiance: Vec3, angle: f64) -> Self {
        let (quarter, half) = (libm::sin(angle / 4.0), libm::sin(angle / 2.0));
        let radiance = if angle > 0.0 {
            (irradiance.as_dvec3() / (std::f64::consts::PI * half * half)).as_vec3()
        } else {
            Vec3::ZERO
        };
        Self { to_light, irradiance, one_minus_cos: (2.0 * quarter * quarter) as f32, radiance, sun: None }
    }

    /// Creates the sun of a sky. `to_light` is the unit direction toward its center.
    pub fn from_sun(to_light: Vec3, sun: OrientedSunDisk) -> Self {
        let (one_minus_cos, radiance) = (sun.disk.one_minus_cos() as f32, sun.disk.mean());
        let irradiance = radiance * (2.0 * PI * one_minus_cos);
        Self { to_light, irradiance, one_minus_cos, radiance, sun: Some(sun) }
    }

    /// Samples the disk uniformly over its solid angle.
    pub fn sample(&self, u: [f32; 2]) -> Option<LightSample> {
        let (direction, weight) = self.sample_direction_and_irradiance(u);
        (weight != Vec3::ZERO).then_some(LightSample {
            end: ShadowRayEnd::Beyond,
            direction,
            weight,
            source: GeometryOfLight::Nothing,
        })
    }

    /// [`DirectionalLight::sample`] for a packet.
    #[inline(always)]
    pub fn sample_packet(&self, u: &[F32x16; 2]) -> LightSamplePacket {
        match &self.sun {
            None => infinite_packet_of!(i => self.sample_uniform_disk([u[0][i], u[1][i]])),
            Some(_) => self.sample_sun_packet(u),
        }
    }

    /// [`DirectionalLight::sample_packet`] for the sun of a sky.
    #[cold]
    #[inline(never)]
    fn sample_sun_packet(&self, u: &[F32x16; 2]) -> LightSamplePacket {
        infinite_packet_of!(i => self.sample_direction_and_irradiance([u[0][i], u[1][i]]))
    }

    /// Samples a unit direction to the light. Also returns the radiance divided by the pdf, or the irradiance
    /// if the light has no extent.
    #[inline(always)]
    pub fn sample_direction_and_irradiance(&self, u: [f32; 2]) -> (Vec3, Vec3) {
        let (direction, irradiance) = self.sample_uniform_disk(u);
        match &self.sun {
            None => (direction, irradiance),
            Some(sun) => (direction, sun.radiance(self.to_light, direction) * self.inverse_pdf()),
        }
    }

    /// Samples a unit direction to the light, assuming a disk of uniform radiance.
    #[inline(always)]
    fn sample_uniform_disk(&self, u: [f32; 2]) -> (Vec3, Vec3) {
        if self.has_no_angular_extent() {
            return (self.to_light, self.irradiance);
        }
        let direction = Frame::from_normal(self.to_light).to_world(warp::cone(u, self.one_minus_cos));
        (direction, self.radiance * self.inverse_pdf())
    }

    /// Radiance from a direction, or 0 for a light without extent.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        match (&self.sun, self.contains(direction)) {
            (_, false) => Vec3::ZERO,
            (None, true) => self.radiance,
            (Some(sun), true) => sun.radiance(self.to_light, direction),
        }
    }

    /// Pdf of [`DirectionalLight::sample`] in sr⁻¹, or 0 for a light without extent.
    pub fn pdf(&self, direction: Vec3) -> f32 {
        if self.contains(direction) { 1.0 / self.inverse_pdf() } else { 0.0 }
    }

    /// Inverse of [`DirectionalLight::pdf`] inside the disk, or 0 for a light without extent.
    #[inline(always)]
    pub fn inverse_pdf(&self) -> f32 {
        2.0 * PI * self.one_minus_cos
    }

    /// Whether a unit direction is inside the disk. Compares chords, which is accurate even for small disks.
    fn contains(&self, direction: Vec3) -> bool {
        !self.has_no_angular_extent()
            && (direction - self.to_light).length_squared() <= 2.0 * self.one_minus_cos
    }
}

impl InfiniteLight for DirectionalLight {
    fn sample_direction_and_weight(&self, u: [f32; 2]) -> (Vec3, Vec3) {
        self.sample_direction_and_irradiance(u)
    }

    fn power_through_disk(&self, area: f64) -> Vec3 {
        (self.sample_uniform_disk([0.5; 2]).1.as_dvec3() * area).as_vec3()
    }

    fn direction_and_irradiance_bounds(&self) -> LightBounds {
        LightBounds {
            space: DistanceFalloff::Beyond,
            center: self.to_light.as_dvec3(),
            // Chord from the center of the disk to its edge.
            radius: (2.0 * f64::from(self.one_minus_cos)).sqrt(),
            power: mean_channel(self.irradiance),
            cone: EmissionCone::ALL,
        }
    }

    fn direction_to_center(&self) -> Option<Vec3> {
        Some(self.to_light)
    }

    #[inline]
    fn has_no_angular_extent(&self) -> bool {
        self.one_minus_cos == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::{Dimension, PixelSampler};

    #[test]
    fn disk_samples_give_the_irradiance() {
        for degrees in [1e-3_f64, 0.53, 10.0, 90.0, 180.0] {
            let sun = DirectionalLight::new(Vec3::new(0.6, 0.0, 0.8), Vec3::splat(3.0), degrees.to_radians());
            let (mut irradiance, count) = (0.0, 4096);
            for sample in 0..count {
                let u = PixelSampler::new(1, 2, 3, sample).pair(1, Dimension::Light(0)).to_array();
                let sample = sun.sample(u).expect("the sun should be sampled");
                assert_eq!(sample.end, ShadowRayEnd::Beyond);
                // At the edge of the disk, rounding decides whether the pdf is 0.
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
    fn sharp_lights_are_invisible_to_rays() {
        let sun = DirectionalLight::new(Vec3::Y, Vec3::ONE, 0.0);
        assert_eq!((sun.radiance(Vec3::Y), sun.pdf(Vec3::Y)), (Vec3::ZERO, 0.0));
        assert_eq!(sun.sample([0.3, 0.4]).map(|sample| sample.weight), Some(Vec3::ONE));
    }
}
