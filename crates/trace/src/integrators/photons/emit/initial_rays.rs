//! The first ray of each photon, from a light.

use super::{PhotonTracer, PhotonWavefront, max_flux_component};
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfacePoint};
use crate::integrators::PACKET_SIZE;
use crate::integrators::transport::cone::RayCone;
use crate::integrators::transport::interiors::{Interior, InteriorList};
use crate::integrators::transport::ray::{PathHistory, PathRay};
use crate::integrators::transport::tile::TileContext;
use crate::integrators::transport::walk::MAX_PASSED_SURFACES;
use crate::lights::{EmittedPhoton, PhotonOrigin, PhotonRandomNumbers};
use crate::math::Vec3;
use crate::math::lanes::Simd;
use crate::sampling::{CAMERA_PATH, Dimension, SamplerPacket};
use crate::world::SimdKernel;

impl PhotonTracer<'_> {
    /// Moves the origin of a photon's ray from an infinite light back past any transmissive infinite planes.
    /// Returns `None` if an opaque surface blocks the ray.
    fn move_origin_back_past_infinite_planes(&self, ray: Ray) -> Option<Ray> {
        let world = self.tile.world;
        let mut start = ray.origin;
        for _ in 0..MAX_PASSED_SURFACES {
            let back = Ray::new(start, -ray.direction);
            let Some(hit) = world.geometry.closest_hit(&back) else {
                return Some(Ray::new(start, ray.direction));
            };
            let material = &world.materials[world.material_index(&hit)];
            if material.bsdf.as_dielectric().is_none() && !material.has_null_interaction() {
                return None;
            }
            let SurfacePoint { point, error, normal, .. } = world.geometry.surface(&back, &hit);
            start = offset_origin(point, error, normal, back.direction);
        }
        None
    }

    /// Medium at a photon's starting point.
    fn interiors_at(&self, point: Vec3, emitted: &EmittedPhoton) -> InteriorList {
        let world = self.tile.world;
        let emitter = || Some(world.lights.get(emitted.light).as_area()?.object);
        let around = |glass: &&Interior| world.is_closed_shape_containing(glass.body, point);
        let in_parts = self.bodies.iter().filter(|_| !is_from_infinite_light(emitted)).filter_map(|body| {
            let material = world.glass_material_around_point(body, point, emitter())?;
            Some(Interior { body: body.body, material })
        });
        self.glasses
            .iter()
            .filter(around)
            .copied()
            .chain(in_parts)
            .fold(InteriorList::default(), InteriorList::entered)
    }
}

impl PhotonWavefront<'_> {
    /// Emits the photons.
    pub(super) fn emit(&mut self, count: u32, rays: &mut Vec<PathRay>) {
        let tracing = self.tracing;
        let tile = tracing.tile;
        let has_planes = tile.world.geometry.has_unbounded();
        for begin in (0..count).step_by(PACKET_SIZE) {
            let numbers =
                tile.world.geometry.instruction_set().run(PhotonRandomNumbersKernel { tile, first: begin });
            for (i, numbers) in numbers.iter().enumerate().take((count - begin) as usize) {
                // Emit a photon, and start it in front of all infinite planes it may pass through.
                let Some(emitted) = tracing.emission.emit(numbers) else { continue };
                let past_planes = is_from_infinite_light(&emitted) && has_planes;
                let ray = emitted.ray();
                let Some(ray) = (if past_planes {
                    tracing.move_origin_back_past_infinite_planes(ray)
                } else {
                    Some(ray)
                }) else {
                    continue;
                };
                let offset = begin as usize + i;
                let path = PathRay {
                    ray,
                    throughput: emitted.flux * tracing.flux_scale,
                    slot: offset as u32,
                    path: CAMERA_PATH + 1,
                    interiors: tracing.interiors_at(ray.origin, &emitted),
                    state: PathHistory::CAMERA,
                    cone: RayCone::default(),
                };
                self.references[offset] = max_flux_component(tile.world, &path);
                rays.push(path);
            }
        }
    }
}

fn is_from_infinite_light(emitted: &EmittedPhoton) -> bool {
    match emitted.start {
        PhotonOrigin::Beyond(_) => true,
        PhotonOrigin::Point(_) | PhotonOrigin::Surface { .. } => false,
    }
}

/// Draws the random numbers for photon emission.
struct PhotonRandomNumbersKernel<'a> {
    tile: &'a TileContext<'a>,
    first: u32,
}

impl SimdKernel for PhotonRandomNumbersKernel<'_> {
    type Output = [PhotonRandomNumbers; PACKET_SIZE];

    #[inline(always)]
    fn run(self, _: impl Simd) -> Self::Output {
        let slots = std::array::from_fn(|i| self.first + i as u32);
        let (xs, ys, samples) = self.tile.block.pixels_and_samples_of_slots(&slots);
        let sampler = SamplerPacket::new(self.tile.settings.render.seed, &xs, &ys, &samples);
        let pairs = |decision| sampler.pairs(&[CAMERA_PATH; PACKET_SIZE], decision, 0, 1);
        let (light, aim) = (pairs(Dimension::PhotonLight), pairs(Dimension::PhotonTarget));
        let (position, direction) = (pairs(Dimension::PhotonPosition), pairs(Dimension::PhotonDirection));
        std::array::from_fn(|i| PhotonRandomNumbers {
            light: light.map(|row| row[i]),
            aim: aim.map(|row| row[i]),
            position: position.map(|row| row[i]),
            direction: direction.map(|row| row[i]),
        })
    }
}
