//! Direct light at a Phong surface: every light with its own shadow rays.

use super::View;
use super::batch::PathRay;
use super::whitted::Wave;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfacePoint};
use crate::lights::{Light, LightSample};
use crate::materials::phong::PhongBsdf;
use crate::math::Vec3;
use crate::math::color::luminance;
use crate::sampling::{PixelSampler, Purpose};
use crate::scene::description::Shadows;

/// A point to be lit.
pub(super) struct PhongVertex<'a> {
    path: &'a PathRay,
    surface: &'a SurfacePoint,
    bsdf: PhongBsdf,
    /// Geometric normal on the eye's side.
    normal: Vec3,
    /// Shading normal on the eye's side.
    shading_normal: Vec3,
    to_eye: Vec3,
}

impl<'a> PhongVertex<'a> {
    pub(super) fn new(
        path: &'a PathRay,
        surface: &'a SurfacePoint,
        shading_normal: Vec3,
        bsdf: PhongBsdf,
    ) -> Self {
        let to_eye = -path.ray.direction;
        let side = if surface.normal.dot(to_eye) < 0.0 { -1.0 } else { 1.0 };
        Self {
            path,
            surface,
            bsdf,
            normal: surface.normal * side,
            shading_normal: shading_normal * side,
            to_eye,
        }
    }

    /// What a sample of a light brings unoccluded; 0 where the light is behind the surface or its shading.
    fn reflected(&self, sample: &LightSample, view: View) -> Vec3 {
        let cosine = self.shading_normal.dot(sample.direction);
        let geometric = self.normal.dot(sample.direction);
        if !(cosine > 0.0 && geometric > 0.0) {
            return Vec3::ZERO;
        }
        let arriving = sample.weight * (cosine * self.terminator(cosine, geometric));
        let specular = || self.bsdf.specular_value(self.shading_normal, self.to_eye, sample.direction);
        match view {
            View::Diffuse => arriving * self.bsdf.diffuse_value(),
            View::Specular => arriving * specular(),
            View::Shadow => Vec3::splat(luminance(arriving)),
            _ => arriving * (self.bsdf.diffuse_value() + specular()),
        }
    }

    /// Softens the edge of the shadow that the facets of a smooth-shaded surface throw on themselves; 1 where the two
    /// normals are one (Chiang, Li, Burley, *Taming the Shadow Terminator*, 2019).
    fn terminator(&self, cosine: f32, geometric: f32) -> f32 {
        let between = self.normal.dot(self.shading_normal);
        let g = (geometric / (cosine * between)).min(1.0);
        if !(between > 0.0) { 1.0 } else { -g * g * g + g * g + g }
    }

    fn shadow_ray(&self, target: Vec3) -> Ray {
        let origin = offset_origin(self.surface.point, self.surface.error, self.normal, self.normal);
        Ray::segment(origin, target)
    }
}

/// Light a point: contributions that nothing can stop are added, the others wait for their shadow rays.
pub(super) fn light(wave: &mut Wave<'_>, vertex: &PhongVertex<'_>) {
    let settings = wave.tracer.settings;
    let sampler = wave.tracer.block.sampler(settings.seed, vertex.path.slot);
    let mut samples = Vec::new();
    for (number, light) in (0_u32..).zip(&wave.tracer.world.lights) {
        let repetitions = match settings.shadows {
            Shadows::Hard => 1,
            _ if light.is_delta() => 1,
            _ => settings.shadow_samples,
        };
        for i in 0..repetitions {
            let sample = match settings.shadows {
                Shadows::Hard => light.middle(vertex.surface.point),
                _ => sample_light(light, vertex, &sampler, number, (i, repetitions)),
            };
            let Some(sample) = sample else { continue };
            let value = vertex.reflected(&sample, settings.view) / repetitions as f32;
            if value != Vec3::ZERO {
                samples.push((sample, value));
            }
        }
    }
    let scale = vertex.path.throughput * shadow_view_scale(settings.view, &samples);
    for (sample, value) in samples {
        let contribution = value * scale;
        if settings.shadows == Shadows::Off {
            wave.radiance[vertex.path.slot as usize] += contribution;
        } else {
            wave.shadows.push(
                vertex.shadow_ray(sample.target),
                sample.source,
                contribution,
                vertex.path.slot,
            );
        }
    }
}

fn sample_light(
    light: &Light,
    vertex: &PhongVertex<'_>,
    sampler: &PixelSampler,
    number: u32,
    (i, repetitions): (u32, u32),
) -> Option<LightSample> {
    if light.is_delta() {
        return light.sample(vertex.surface.point, [0.5; 2]);
    }
    let u = sampler.get4_of(Purpose::at_vertex(vertex.path.path, number / 2), i, repetitions);
    let pair = if number.is_multiple_of(2) { [u[0], u[1]] } else { [u[2], u[3]] };
    light.sample(vertex.surface.point, pair)
}

/// In the view of shadows contributions are parts of the whole that could arrive.
fn shadow_view_scale(view: View, samples: &[(LightSample, Vec3)]) -> f32 {
    if view == View::Shadow { 1.0 / samples.iter().map(|(_, value)| value.x).sum::<f32>() } else { 1.0 }
}
