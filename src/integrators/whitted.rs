//! Direct light by Phong, mirror, glass and ambient light (Whitted, *An Improved Illumination Model for Shaded Display*,
//! 1980), over queues instead of recursion.

use super::batch::{PathRay, Queues, ShadowQueue, Tracer};
use super::direct::{self, PhongVertex};
use super::medium::Inside;
use super::{POLL_INTERVAL, RayCounters, View, glass};
use crate::control::Cancelled;
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfacePoint};
use crate::lights::LightSamples;
use crate::materials::mirror::reflect;
use crate::materials::{Bsdf, Mirror, NormalMap, Phong};
use crate::math::Vec3;
use crate::scene::description::Shadows;
use crate::world::{Hit, PACKET};

/// Follow the camera rays in the queue to the end and add what they see to their samples: to `radiance` what nothing can stop, to
/// `arrived` what shadow rays bring. Each is added up in the order of the paths, whenever the shadow rays are traced.
pub fn trace(
    tracer: &Tracer<'_>,
    queues: &mut Queues,
    radiance: &mut [Vec3],
    arrived: &mut [Vec3],
    counters: &mut RayCounters,
) -> Result<(), Cancelled> {
    let mut depth = 0;
    while !queues.rays.is_empty() {
        closest_hits(tracer, queues)?;
        queues.next.clear();
        let Queues { rays, next, shadows, hits, samples } = queues;
        shadows.clear();
        let mut wave = Wave { tracer, depth, next, shadows, samples, radiance, counters };
        for (path, hit) in rays.iter().zip(hits.iter()) {
            match hit {
                Some(hit) => wave.shade(*path, hit),
                None => wave.leave(path),
            }
            if wave.shadows.is_full() {
                wave.trace_shadows(arrived)?;
            }
        }
        wave.trace_shadows(arrived)?;
        std::mem::swap(rays, next);
        depth += 1;
    }
    Ok(())
}

/// The nearest hit of every ray in the queue.
pub fn closest_hits(tracer: &Tracer<'_>, queues: &mut Queues) -> Result<(), Cancelled> {
    queues.hits.clear();
    queues.hits.resize(queues.rays.len(), None);
    for (paths, hits) in queues.rays.chunks(POLL_INTERVAL).zip(queues.hits.chunks_mut(POLL_INTERVAL)) {
        tracer.token.check()?;
        for (paths, hits) in paths.chunks(PACKET).zip(hits.chunks_mut(PACKET)) {
            let rays: [Ray; PACKET] = std::array::from_fn(|lane| paths[lane.min(paths.len() - 1)].ray);
            tracer.world.geometry.closest_packet(&rays[..paths.len()], hits);
        }
    }
    Ok(())
}

/// One round of all rays of a batch.
pub(super) struct Wave<'a> {
    pub(super) tracer: &'a Tracer<'a>,
    /// Scatterings before the hits of this round.
    pub(super) depth: u32,
    pub(super) next: &'a mut Vec<PathRay>,
    pub(super) shadows: &'a mut ShadowQueue,
    pub(super) samples: &'a mut Vec<LightSamples>,
    pub(super) radiance: &'a mut [Vec3],
    pub(super) counters: &'a mut RayCounters,
}

impl Wave<'_> {
    fn add(&mut self, slot: u32, radiance: Vec3) {
        self.radiance[slot as usize] += radiance;
    }

    /// Add what arrives by the shadow rays in the queue, in their order, and empty it.
    fn trace_shadows(&mut self, arrived: &mut [Vec3]) -> Result<(), Cancelled> {
        let is_traced = self.tracer.settings.render.shadows != Shadows::Off;
        let ShadowQueue { rays, sources, arrivals } = &*self.shadows;
        let packets = rays.chunks(PACKET).zip(sources.chunks(PACKET)).zip(arrivals.chunks(PACKET));
        for (number, ((rays, sources), arrivals)) in packets.enumerate() {
            if number.is_multiple_of(POLL_INTERVAL / PACKET) {
                self.tracer.token.check()?;
            }
            let geometry = &self.tracer.world.geometry;
            let occluded = if is_traced { geometry.occluded_packet(rays, sources) } else { 0 };
            for (lane, arrival) in arrivals.iter().enumerate() {
                if occluded & 1 << lane == 0 {
                    arrived[arrival.slot as usize] += arrival.contribution;
                }
            }
        }
        self.counters.shadow_rays += self.shadows.len() as u64;
        self.shadows.clear();
        Ok(())
    }

    /// Whether one more scattering is allowed.
    pub(super) fn may_scatter(&self) -> bool {
        self.depth < self.tracer.settings.render.max_depth
    }

    fn leave(&mut self, path: &PathRay) {
        if self.tracer.settings.view == View::Beauty {
            self.add(path.slot, path.throughput * self.tracer.settings.render.background);
        }
    }

    fn shade(&mut self, mut path: PathRay, hit: &Hit) {
        let world = self.tracer.world;
        let surface = world.geometry.surface(&path.ray, hit);
        let index = world.material_index(hit);
        let material = &world.materials[index];
        path.throughput *= glass::absorption(world, &path, hit.shape.t, &surface, material);
        let emission = material.emission;
        let front = surface.normal.dot(path.ray.direction) < 0.0;
        if emission != Vec3::ZERO && front && self.tracer.settings.view == View::Beauty {
            self.add(path.slot, path.throughput * emission);
        }
        if !self.may_scatter() {
            return;
        }
        match &material.bsdf {
            Bsdf::Phong(phong) => self.shade_phong(&path, &surface, phong, material.normal_map.as_ref()),
            Bsdf::Mirror(mirror) => self.shade_mirror(&path, &surface, mirror),
            Bsdf::Glass(glass) => {
                let part = Inside { object: hit.object, material: index as u32 };
                self.shade_glass(&path, part, &surface, glass);
            }
        }
    }

    fn shade_phong(
        &mut self,
        path: &PathRay,
        surface: &SurfacePoint,
        phong: &Phong,
        map: Option<&NormalMap>,
    ) {
        let bsdf = phong.at(surface.uv, &mut self.counters.texture_lookups);
        let view = self.tracer.settings.view;
        let ambient = self.tracer.settings.render.ambient;
        if ambient != Vec3::ZERO && matches!(view, View::Beauty | View::Ambient) {
            self.add(path.slot, path.throughput * ambient * bsdf.ambient);
        }
        if view == View::Ambient || bsdf.is_black() {
            return;
        }
        let mut shading_normal = surface.shading_normal;
        if let Some(map) = map {
            self.counters.texture_lookups += 1;
            shading_normal = map.bend(surface.uv, shading_normal, surface.dpdu, surface.dpdv);
        }
        let vertex = PhongVertex::new(path, surface, shading_normal, bsdf);
        direct::light(self, &vertex);
    }

    fn shade_mirror(&mut self, path: &PathRay, surface: &SurfacePoint, mirror: &Mirror) {
        self.counters.reflected_rays += 1;
        self.next.push(reflected(path, surface, mirror.reflectance));
    }
}

/// The mirrored ray; a shading normal that sends it below the surface gives way to the geometric one.
pub(super) fn reflected(path: &PathRay, surface: &SurfacePoint, reflectance: Vec3) -> PathRay {
    let incident = path.ray.direction;
    let side = -incident.dot(surface.normal);
    let mut direction = reflect(incident, surface.shading_normal);
    if !(direction.dot(surface.normal) * side > 0.0) {
        direction = reflect(incident, surface.normal);
    }
    PathRay {
        ray: leaving(surface, direction.normalize()),
        throughput: path.throughput * reflectance,
        path: path.next_path(1),
        ..*path
    }
}

/// A ray that starts at a surface.
pub(super) fn leaving(surface: &SurfacePoint, direction: Vec3) -> Ray {
    Ray::new(offset_origin(surface.point, surface.error, surface.normal, direction), direction)
}
