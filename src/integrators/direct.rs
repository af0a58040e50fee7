//! Direct light at a Phong surface: every light with its own shadow rays.

use super::View;
use super::batch::{Arrival, PathRay};
use super::whitted::Wave;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfacePoint};
use crate::lights::{LightSamples, SeenLight, Source};
use crate::materials::phong::PhongBsdf;
use crate::math::Vec3;
use crate::math::color::luminance;
use crate::math::lanes::{Lanes, Lanes3, dot, lane};
use crate::sampling::{PixelSampler, Purpose, Repetitions};
use crate::scene::description::Shadows;
use crate::world::Loops;

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
    /// Cosine between the smooth and the shading normal; none where nothing bends them apart.
    bend: Option<f32>,
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
        let (smooth_normal, shading_normal) = (surface.shading_normal * side, shading_normal * side);
        let bend = (smooth_normal != shading_normal).then(|| smooth_normal.dot(shading_normal));
        let normal = surface.normal * side;
        Self { path, surface, bsdf, normal, smooth_normal, shading_normal, to_eye, bend }
    }

    /// What the BSDF makes of light of this radiance by the view: the same in all directions, and where the mirrored direction
    /// is the eye's.
    fn parts(&self, radiance: Vec3, view: View) -> [Vec3; 2] {
        let diffuse = || radiance * self.bsdf.diffuse_value();
        let specular = || radiance * self.bsdf.specular_peak();
        match view {
            View::Diffuse => [diffuse(), Vec3::ZERO],
            View::Specular => [Vec3::ZERO, specular()],
            View::Shadow => [Vec3::splat(luminance(radiance)), Vec3::ZERO],
            View::Beauty => [diffuse(), specular()],
            // Nothing of it is light that lights send.
            View::Ambient | View::Normal | View::Depth | View::Barycentric | View::Uv | View::Albedo => {
                [Vec3::ZERO; 2]
            }
        }
    }

    /// Cosines at the surface for light from some directions, softened where bent normals leave the light; not above 0 where
    /// the light is behind the smooth surface or its bent normal.
    fn cosines(&self, directions: &Lanes3) -> Lanes {
        let mut cosines = dot(directions, self.shading_normal);
        if self.bend.is_some() {
            for (i, cosine) in cosines.iter_mut().enumerate().filter(|(_, cosine)| **cosine > 0.0) {
                *cosine *= self.terminator(*cosine, lane(directions, i));
            }
        }
        cosines
    }

    /// Cosines between the mirrored directions and the one to the eye.
    fn mirrored_cosines(&self, directions: &Lanes3) -> Lanes {
        // (2(n·l)n − l)·v = (2(n·v)n − v)·l.
        let mirrored_eye = self.shading_normal * (2.0 * self.shading_normal.dot(self.to_eye)) - self.to_eye;
        dot(directions, mirrored_eye)
    }

    /// Softens the edge where bent normals leave the light of the surface that they are on, 0 behind that; 1 where nothing
    /// bends them (Chiang, Li, Burley, *Taming the Shadow Terminator*, 2019).
    fn terminator(&self, cosine: f32, direction: Vec3) -> f32 {
        let Some(between) = self.bend else { return 1.0 };
        let smooth = self.smooth_normal.dot(direction);
        if !(smooth > 0.0) {
            return 0.0;
        }
        let g = (smooth / (cosine * between)).min(1.0);
        if between > 0.0 { -g * g * g + g * g + g } else { 1.0 }
    }

    fn shadow_origin(&self) -> Vec3 {
        offset_origin(self.surface.shadow_point, self.surface.error, self.normal, self.normal)
    }
}

/// Light a point: contributions that nothing can stop are added, the others wait for their shadow rays.
pub(super) fn light(wave: &mut Wave<'_>, vertex: &PhongVertex<'_>) {
    let (world, settings) = (wave.tracer.world, wave.tracer.settings);
    let mut arrivals = Arrivals::new(wave, vertex);
    for (number, light) in world.lights.iter() {
        if settings.render.shadows == Shadows::Hard {
            if let Some(sample) = light.middle(vertex.surface.point) {
                arrivals.push(&sample.into(), 1.0);
            }
            continue;
        }
        match light.seen_from(vertex.surface.point) {
            Some(SeenLight::Only(sample)) => arrivals.push(&sample.into(), 1.0),
            Some(seen) => arrivals.push_samples(&seen, number),
            None => {}
        }
    }
    arrivals.finish();
}

/// Draws samples of a light.
struct Draw<'a, 'l> {
    light: &'a SeenLight<'l>,
    numbers: Repetitions,
    queue: &'a mut Vec<LightSamples>,
}

impl Loops for Draw<'_, '_> {
    type Done = ();

    #[inline(always)]
    fn run(self) {
        for (numbers, used) in self.numbers {
            self.light.samples(numbers, used, self.queue);
        }
    }
}

/// Takes what arrives at a vertex to the queue of shadow rays.
struct Arrivals<'a, 'w, 'v> {
    wave: &'a mut Wave<'w>,
    vertex: &'a PhongVertex<'v>,
    sampler: PixelSampler,
    shadow_origin: Vec3,
    /// Length of the queue before.
    first: usize,
    /// Sum of the values in the view of shadows.
    total: f32,
}

impl<'a, 'w, 'v> Arrivals<'a, 'w, 'v> {
    fn new(wave: &'a mut Wave<'w>, vertex: &'a PhongVertex<'v>) -> Self {
        let first = wave.shadows.len();
        let sampler = wave.tracer.block.sampler(wave.tracer.settings.render.seed, vertex.path.slot);
        Self { wave, vertex, sampler, shadow_origin: vertex.shadow_origin(), first, total: 0.0 }
    }

    /// As many samples of a light as the settings ask for.
    fn push_samples(&mut self, light: &SeenLight<'_>, number: u32) {
        let (settings, path) = (self.wave.tracer.settings, self.vertex.path);
        let numbers =
            self.sampler.get2_all(Purpose::at_vertex(path.path, number), settings.render.shadow_samples);
        let share = 1.0 / settings.render.shadow_samples as f32;
        let mut queue = std::mem::take(self.wave.samples);
        queue.clear();
        self.wave.tracer.world.geometry.instructions().run(Draw { light, numbers, queue: &mut queue });
        for samples in &queue {
            self.push(samples, share);
        }
        *self.wave.samples = queue;
    }

    /// Samples of one light, each of which counts as this share of it.
    fn push(&mut self, samples: &LightSamples, share: f32) {
        let settings = self.wave.tracer.settings;
        let [diffuse, specular] = self.vertex.parts(samples.radiance * share, settings.view);
        let cosines = self.vertex.cosines(&samples.directions);
        let mirrored = self.vertex.mirrored_cosines(&samples.directions);
        for i in 0..samples.count {
            let arriving = cosines[i] * samples.factors[i];
            if !(arriving > 0.0) {
                continue;
            }
            let mut value = diffuse;
            if specular != Vec3::ZERO {
                value += specular * self.vertex.bsdf.specular_part(mirrored[i]);
            }
            value *= arriving;
            if value != Vec3::ZERO {
                self.arrive(value, lane(&samples.targets, i), samples.source);
            }
        }
    }

    /// What arrives from a place if nothing is in its way.
    fn arrive(&mut self, value: Vec3, from: Vec3, source: Source) {
        let settings = self.wave.tracer.settings;
        let (contribution, slot) = (value * self.vertex.path.throughput, self.vertex.path.slot);
        self.total += value.x;
        if settings.render.shadows == Shadows::Off && settings.view != View::Shadow {
            self.wave.radiance[slot as usize] += contribution;
        } else {
            let ray = Ray::segment(self.shadow_origin, from);
            self.wave.shadows.push(ray, source, Arrival { contribution, slot });
        }
    }

    /// In the view of shadows contributions are parts of the whole that could arrive.
    fn finish(self) {
        if self.wave.tracer.settings.view == View::Shadow {
            for arrival in &mut self.wave.shadows.arrivals[self.first..] {
                arrival.contribution /= self.total;
            }
        }
    }
}
