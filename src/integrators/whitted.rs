//! Direct light by Phong, mirror, glass and ambient light (Whitted, *An Improved Illumination Model for Shaded Display*,
//! 1980), over queues instead of recursion.

use super::RayCounters;
use super::crossing::{Crossing, CrossingMemory};
use super::light::DirectLight;
use super::medium::{Medium, absorption};
use super::queues::{PathRay, Queues};
use super::shot::Shot;
use super::sink::{Part, Sink};
use super::specular::{Interface, interface, reflected};
use super::vertices::{LitVertex, Vertex};
use crate::control::Cancelled;
use crate::geometry::Ray;
use crate::materials::{Bsdf, Mirror, Phong};
use crate::math::Vec3;
use crate::sampling::Decision;
use crate::world::Hit;

/// A ray is split in two while the weaker part counts at least this much of its sample; below, chance takes one of them.
const LEAST_SPLIT: f32 = 0.01;

/// Surfaces where the glass stays the same that a ray passes in one round; each so many of them count as a scattering.
const MOST_HIDDEN: usize = 64;

/// Follow the camera rays in the queue to the end; the sink takes what they see.
pub fn trace(
    shot: &Shot<'_>,
    queues: &mut Queues,
    sink: Sink<'_>,
    counters: &mut RayCounters,
) -> Result<(), Cancelled> {
    let Queues { rays, next, shadows, samples, hits, crossing } = queues;
    shadows.clear();
    next.clear();
    let mut wave =
        Wave { depth: 0, light: DirectLight { shot, shadows, samples, sink }, next, crossing, counters };
    while !rays.is_empty() {
        shot.closest_hits(rays, hits)?;
        for (path, hit) in rays.iter().zip(hits.iter()) {
            match hit {
                Some(hit) => wave.shade(*path, *hit),
                None => wave.leave(path),
            }
            if wave.light.shadows.is_full() {
                wave.trace_shadows()?;
            }
        }
        wave.trace_shadows()?;
        std::mem::swap(rays, wave.next);
        wave.next.clear();
        wave.depth += 1;
    }
    Ok(())
}

/// One round of all rays of a batch.
struct Wave<'a, 's> {
    /// Scatterings before the hits of this round.
    depth: u32,
    light: DirectLight<'a, 's>,
    /// Rays of the next round.
    next: &'a mut Vec<PathRay>,
    crossing: &'a mut CrossingMemory,
    counters: &'a mut RayCounters,
}

impl Wave<'_, '_> {
    fn trace_shadows(&mut self) -> Result<(), Cancelled> {
        let DirectLight { shot, shadows, sink, .. } = &mut self.light;
        self.counters.shadow_rays += shot.trace_shadows(shadows, sink)?;
        Ok(())
    }

    fn leave(&mut self, path: &PathRay) {
        let background = self.light.shot.settings.render.background;
        self.light.sink.add(path.slot, Part::Emitted, path.throughput * background);
    }

    /// Shade the first thing that is no mere change between parts of one glass.
    fn shade(&mut self, mut path: PathRay, mut hit: Hit) {
        let shot = self.light.shot;
        for _ in 0..MOST_HIDDEN {
            let vertex = Vertex::new(shot, &path, &hit);
            if vertex.material.bsdf.glass().is_none() {
                return self.shade_surface(path, &vertex, hit.shape.t);
            }
            let Crossing { sides, near, far, opaque } =
                shot.crossing(&path, &vertex, hit.shape.t, self.crossing);
            path.medium = near;
            if let Some(touching) = opaque {
                let vertex = Vertex::touching(shot, &path, sides, &touching);
                return self.shade_surface(path, &vertex, hit.shape.t);
            }
            if near.glass() != far.glass() {
                return self.shade_glass(path, &vertex.between(sides), far, hit.shape.t);
            }
            path.throughput *= absorption(shot.world, near, hit.shape.t);
            (path.medium, path.ray) = (far, Ray::new(sides.beyond, path.ray.direction));
            match shot.world.geometry.closest(&path.ray) {
                Some(next) => hit = next,
                None => return self.leave(&path),
            }
        }
        if self.depth < shot.settings.render.max_depth {
            self.next.push(path);
        }
    }

    /// Take what a surface sends out on the way of a path; whether the path may be scattered there.
    fn arrive(&mut self, path: &mut PathRay, vertex: &Vertex<'_>, distance: f32) -> bool {
        let shot = self.light.shot;
        path.throughput *= absorption(shot.world, path.medium, distance);
        let emission = vertex.material.emission;
        if emission != Vec3::ZERO && vertex.is_front {
            self.light.sink.add(path.slot, Part::Emitted, path.throughput * emission);
        }
        self.depth < shot.settings.render.max_depth
    }

    fn shade_surface(&mut self, mut path: PathRay, vertex: &Vertex<'_>, distance: f32) {
        if !self.arrive(&mut path, vertex, distance) {
            return;
        }
        match &vertex.material.bsdf {
            Bsdf::Phong(phong) => self.shade_phong(&path, vertex, phong),
            Bsdf::Mirror(mirror) => self.shade_mirror(&path, vertex, mirror),
            Bsdf::Glass(_) => {}
        }
    }

    fn shade_phong(&mut self, path: &PathRay, vertex: &Vertex<'_>, phong: &Phong) {
        let bsdf = phong.at(vertex.surface.uv, &mut self.counters.texture_lookups);
        let ambient = self.light.shot.settings.render.ambient;
        if ambient != Vec3::ZERO {
            self.light.sink.add(path.slot, Part::Ambient, path.throughput * ambient * bsdf.ambient);
        }
        if bsdf.is_black() || !self.light.sink.takes_reflected() {
            return;
        }
        let shading = vertex.shading(self.counters);
        self.light.shade(&LitVertex { path, vertex, shading, bsdf });
    }

    fn shade_mirror(&mut self, path: &PathRay, vertex: &Vertex<'_>, mirror: &Mirror) {
        let shading = vertex.shading(self.counters);
        self.counters.reflected_rays += 1;
        self.next.push(reflected(path, vertex, &shading, mirror.reflectance));
    }

    fn shade_glass(&mut self, mut path: PathRay, vertex: &Vertex<'_>, far: Medium, distance: f32) {
        if !self.arrive(&mut path, vertex, distance) {
            return;
        }
        let shading = vertex.shading(self.counters);
        let Interface { reflectance, refracted } =
            interface(self.light.shot.world, &path, vertex, &shading, far);
        let mirrored = |weight: f32| reflected(&path, vertex, &shading, Vec3::splat(weight));
        let Some(refracted) = refracted else { return self.push_reflected(mirrored(1.0)) };
        let weaker = reflectance.min(1.0 - reflectance) * path.throughput.abs().max_element();
        if weaker >= LEAST_SPLIT {
            self.push_reflected(mirrored(reflectance));
            self.push_refracted(refracted, 1.0 - reflectance);
        } else if self.light.shot.sampler(path.slot).pair(path.path, Decision::Choice).x < reflectance {
            self.push_reflected(mirrored(1.0));
        } else {
            self.push_refracted(refracted, 1.0);
        }
    }

    fn push_reflected(&mut self, ray: PathRay) {
        self.counters.reflected_rays += 1;
        self.next.push(ray);
    }

    fn push_refracted(&mut self, mut ray: PathRay, weight: f32) {
        self.counters.refracted_rays += 1;
        ray.throughput *= weight;
        self.next.push(ray);
    }
}
