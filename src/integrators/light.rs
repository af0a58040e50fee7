//! Direct light at a vertex: every light with its own shadow rays.

use super::queues::{Arrival, ShadowQueue};
use super::shot::Shot;
use super::sink::{Reflected, Sink};
use super::vertices::{LitVertex, Outlook};
use super::view::Measure;
use crate::geometry::Ray;
use crate::lights::{Light, LightSamples, SeenLight};
use crate::math::Vec3;
use crate::math::lanes::lane;
use crate::sampling::{Decision, Repetitions};
use crate::scene::description::Shadows;
use crate::world::Loops;

/// Where direct light goes.
pub struct DirectLight<'a, 's> {
    /// What all have in common.
    pub shot: &'a Shot<'a>,
    /// Shadow rays that wait to be traced.
    pub shadows: &'a mut ShadowQueue,
    /// Memory for the samples of one light for one point.
    pub samples: &'a mut Vec<LightSamples>,
    /// What takes the light.
    pub sink: Sink<'s>,
}

impl DirectLight<'_, '_> {
    /// Light a vertex: contributions wait for their shadow rays.
    pub fn shade(&mut self, vertex: &LitVertex<'_>) {
        let (shot, outlook) = (self.shot, vertex.vertex.outlook(self.shot));
        let point = outlook.point;
        let mut arrivals = Arrivals::new(self, vertex, outlook);
        for (number, light) in shot.world.lights.iter() {
            match light.seen_from(point) {
                Some(SeenLight::Only(sample)) => arrivals.push(&sample.into(), 1.0),
                Some(seen) => arrivals.push_samples(&seen, number),
                None => {}
            }
            arrivals.end(light);
        }
        arrivals.finish();
    }
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

/// Takes what arrives at a vertex to the sink or to the queue of shadow rays.
struct Arrivals<'a, 'l, 's, 'v> {
    light: &'a mut DirectLight<'l, 's>,
    vertex: &'a LitVertex<'v>,
    outlook: Outlook,
    /// Length of the queue before.
    first: usize,
    /// Sum of all that could arrive.
    total: f32,
    /// What could arrive of the light at hand where one ray decides for all of it.
    of_light: Vec3,
}

impl<'a, 'l, 's, 'v> Arrivals<'a, 'l, 's, 'v> {
    fn new(light: &'a mut DirectLight<'l, 's>, vertex: &'a LitVertex<'v>, outlook: Outlook) -> Self {
        let first = light.shadows.len();
        Self { light, vertex, outlook, first, total: 0.0, of_light: Vec3::ZERO }
    }

    /// As many samples of a light as the settings ask for.
    fn push_samples(&mut self, light: &SeenLight<'_>, number: u32) {
        let (shot, path) = (self.light.shot, self.vertex.path);
        let count = shot.settings.render.shadow_samples;
        let numbers = shot.sampler(path.slot).pairs(path.path, Decision::Light(number), count);
        let mut queue = std::mem::take(self.light.samples);
        queue.clear();
        shot.world.geometry.instructions().run(Draw { light, numbers, queue: &mut queue });
        for samples in &queue {
            self.push(samples, 1.0 / count as f32);
        }
        *self.light.samples = queue;
    }

    /// Samples of one light, each of which counts as this share of it.
    fn push(&mut self, samples: &LightSamples, share: f32) {
        let LitVertex { vertex, shading, bsdf, .. } = self.vertex;
        let arriving = samples.radiance * share;
        let [diffuse, specular] = self.light.sink.taken(&Reflected {
            arriving,
            diffuse: arriving * bsdf.diffuse_value(),
            specular: arriving * bsdf.specular_peak(),
        });
        let cosines = shading.cosines(&samples.directions);
        let mirrored = shading.mirrored_cosines(vertex.to_eye, &samples.directions);
        for i in 0..samples.count {
            let factor = cosines[i] * samples.factors[i];
            if !(factor > 0.0) {
                continue;
            }
            let mut value = diffuse;
            if specular != Vec3::ZERO {
                value += specular * bsdf.specular_part(mirrored[i]);
            }
            value *= factor;
            if value != Vec3::ZERO {
                self.arrive(value, samples, i);
            }
        }
    }

    /// What arrives by one of some samples if nothing is in its way.
    fn arrive(&mut self, value: Vec3, samples: &LightSamples, i: usize) {
        let (contribution, slot) = (value * self.vertex.path.throughput, self.vertex.path.slot);
        self.total += value.x;
        match self.light.shot.settings.render.shadows {
            Shadows::Soft if self.outlook.hides(lane(&samples.directions, i)) => {}
            Shadows::Soft => {
                let ray = samples.ray(self.outlook.point, i);
                self.light.shadows.push(ray, samples.source, Arrival { contribution, slot });
            }
            Shadows::Hard | Shadows::Off => self.of_light += contribution,
        }
    }

    /// No more of a light: what waits for one ray goes to its middle.
    fn end(&mut self, light: &Light) {
        let contribution = std::mem::take(&mut self.of_light);
        if contribution != Vec3::ZERO {
            let (middle, source) = light.middle();
            if self.outlook.hides(middle - self.outlook.point) {
                return;
            }
            let ray = Ray::segment(self.outlook.point, middle);
            let slot = self.vertex.path.slot;
            self.light.shadows.push(ray, source, Arrival { contribution, slot });
        }
    }

    /// Contributions become parts of the whole that could arrive, where that is what is measured.
    fn finish(self) {
        match self.light.sink.measure {
            Measure::Radiance(_) => {}
            Measure::ArrivingShare => {
                for arrival in &mut self.light.shadows.arrivals[self.first..] {
                    arrival.contribution /= self.total;
                }
            }
        }
    }
}
