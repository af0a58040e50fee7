//! Direct light at a Phong surface: every light with its own shadow rays.

use super::View;
use super::batch::PathRay;
use super::whitted::Wave;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfacePoint};
use crate::lights::LightSample;
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
    /// Interpolated normal on the same side.
    smooth_normal: Vec3,
    /// Shading normal on the same side: the interpolated one, bent by a normal map.
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
            smooth_normal: surface.shading_normal * side,
            shading_normal: shading_normal * side,
            to_eye,
        }
    }

    /// What a sample of a light brings unoccluded; 0 where the light is behind the smooth surface or its bent normal.
    fn reflected(&self, sample: &LightSample, view: View) -> Vec3 {
        let cosine = self.shading_normal.dot(sample.direction);
        let smooth = self.smooth_normal.dot(sample.direction);
        if !(cosine > 0.0 && smooth > 0.0) {
            return Vec3::ZERO;
        }
        let arriving = sample.weight * (cosine * self.terminator(cosine, smooth));
        let specular = || self.bsdf.specular_value(self.shading_normal, self.to_eye, sample.direction);
        match view {
            View::Diffuse => arriving * self.bsdf.diffuse_value(),
            View::Specular => arriving * specular(),
            View::Shadow => Vec3::splat(luminance(arriving)),
            _ => arriving * (self.bsdf.diffuse_value() + specular()),
        }
    }

    /// Softens the edge where bent normals leave the light of the surface that they are on; 1 where nothing bends them
    /// (Chiang, Li, Burley, *Taming the Shadow Terminator*, 2019).
    fn terminator(&self, cosine: f32, smooth: f32) -> f32 {
        let between = self.smooth_normal.dot(self.shading_normal);
        let g = (smooth / (cosine * between)).min(1.0);
        if !(between > 0.0) { 1.0 } else { -g * g * g + g * g + g }
    }

    fn shadow_origin(&self) -> Vec3 {
        offset_origin(self.surface.shadow_point, self.surface.error, self.normal, self.normal)
    }
}

/// Light a point: contributions that nothing can stop are added, the others wait for their shadow rays.
pub(super) fn light(wave: &mut Wave<'_>, vertex: &PhongVertex<'_>) {
    let settings = wave.tracer.settings;
    let sampler = wave.tracer.block.sampler(settings.seed, vertex.path.slot);
    let mut arrivals = Arrivals::new(wave, vertex);
    for (number, light) in (0_u32..).zip(&arrivals.wave.tracer.world.lights) {
        if settings.shadows == Shadows::Hard {
            arrivals.push(light.middle(vertex.surface.point), 1);
            continue;
        }
        let Some(seen) = light.seen_from(vertex.surface.point) else { continue };
        let repetitions = if light.is_delta() { 1 } else { settings.shadow_samples };
        for i in 0..repetitions {
            let u =
                if light.is_delta() { [0.5; 2] } else { numbers(&sampler, vertex, number, (i, repetitions)) };
            arrivals.push(seen.sample(u), repetitions);
        }
    }
    arrivals.finish();
}

/// Two random numbers for the `i`-th of some samples of a light; two lights share four numbers.
fn numbers(sampler: &PixelSampler, vertex: &PhongVertex<'_>, light: u32, (i, n): (u32, u32)) -> [f32; 2] {
    let [a, b, c, d] = sampler.get4_of(Purpose::at_vertex(vertex.path.path, light / 2), i, n);
    if light.is_multiple_of(2) { [a, b] } else { [c, d] }
}

/// Takes what arrives at a vertex to the queue of shadow rays.
struct Arrivals<'a, 'w, 'v> {
    wave: &'a mut Wave<'w>,
    vertex: &'a PhongVertex<'v>,
    shadow_origin: Vec3,
    /// Length of the queue before.
    first: usize,
    /// Sum of the values in the view of shadows.
    total: f32,
}

impl<'a, 'w, 'v> Arrivals<'a, 'w, 'v> {
    fn new(wave: &'a mut Wave<'w>, vertex: &'a PhongVertex<'v>) -> Self {
        let first = wave.shadows.len();
        Self { wave, vertex, shadow_origin: vertex.shadow_origin(), first, total: 0.0 }
    }

    fn push(&mut self, sample: Option<LightSample>, repetitions: u32) {
        let Some(sample) = sample else { return };
        let settings = self.wave.tracer.settings;
        let value = self.vertex.reflected(&sample, settings.view) / repetitions as f32;
        if value == Vec3::ZERO {
            return;
        }
        let (contribution, slot) = (value * self.vertex.path.throughput, self.vertex.path.slot);
        self.total += value.x;
        if settings.shadows == Shadows::Off && settings.view != View::Shadow {
            self.wave.radiance[slot as usize] += contribution;
        } else {
            self.wave.shadows.push(
                Ray::segment(self.shadow_origin, sample.target),
                sample.source,
                contribution,
                slot,
            );
        }
    }

    /// In the view of shadows contributions are parts of the whole that could arrive.
    fn finish(self) {
        if self.wave.tracer.settings.view == View::Shadow {
            for contribution in &mut self.wave.shadows.contribution[self.first..] {
                *contribution /= self.total;
            }
        }
    }
}
