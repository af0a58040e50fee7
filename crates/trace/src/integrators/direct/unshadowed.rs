//! Light that rays in narrow lobes would meet without soft shadows: that of every light on their way, whatever is before it. For hard
//! shadows, one ray to the middle of each light decides how much of it arrives.

use crate::geometry::{Ray, ShapeHit};
use crate::integrators::transport::batch::VertexBatch;
use crate::integrators::transport::tile::TileContext;
use crate::lights::{Light, Middle, Side, Source};
use crate::math::Vec3;
use crate::math::lanes::lane;
use crate::scene::description::Shadows;
use crate::world::{Hit, MOST_STRAIGHT};

use super::all_lights::LightRays;

/// A ray in a narrow lobe of a vertex, with the pdf of its direction.
pub struct Unshadowed<'a> {
    pub tile: &'a TileContext<'a>,
    pub row: &'a VertexBatch,
    /// The vertex in the row.
    pub lane: usize,
    pub ray: Ray,
    pub density: f32,
}

impl Unshadowed<'_> {
    /// Weighted radiance of the lights on the ray; light samples, as many as there are such rays, bring the rest. `transmittance` is
    /// that of the medium up to a distance.
    #[cold]
    #[inline(never)]
    pub fn radiance(&self, transmittance: impl Fn(f32) -> Vec3, rays: &mut LightRays) -> Vec3 {
        let Self { tile, row, lane: i, ray, density } = self;
        let (world, normal) = (tile.world, lane(&row.normal, *i));
        let (mut sum, mut along, mut passed) = (Vec3::ZERO, *ray, 0.0);
        // Add the lamps on the ray, one behind the other.
        for _ in 0..=MOST_STRAIGHT {
            let Some(hit) = world.geometry.closest_of(&along, |object| world.lights.has_object(object))
            else {
                break;
            };
            let distance = passed + hit.shape.t;
            let met = Hit { shape: ShapeHit { t: distance, ..hit.shape }, ..hit };
            let radiance = tile.lamp_radiance(ray, normal, &met, *density, &mut rays.lookups);
            if radiance != Vec3::ZERO {
                let front = world.geometry.surface(ray, &met).normal;
                let side = if front.dot(ray.direction) > 0.0 { Side::Back } else { Side::Front };
                let light = world.lights.of_hit(hit.object, hit.shape.primitive, side);
                let arriving = light.map_or(Vec3::ZERO, |(_, light)| self.arriving(light, rays));
                sum += radiance * transmittance(distance) * arriving;
            }
            (along, passed) = (world.beyond(&along, &hit, &mut 0).1, distance);
        }
        // Add those beyond the scene.
        for (number, light) in world.lights.iter().filter(|(_, light)| light.is_beyond()) {
            let radiance = tile.radiance_of(Some(number), ray, normal, *density);
            if radiance != Vec3::ZERO {
                sum += radiance * transmittance(f32::MAX) * self.arriving(light, rays);
            }
        }
        sum
    }

    /// The part of a light that arrives.
    fn arriving(&self, light: &Light, rays: &mut LightRays) -> Vec3 {
        match self.tile.settings.render.shadows {
            Shadows::Off => return Vec3::ONE,
            Shadows::Hard | Shadows::Soft => {}
        }
        // Light from all around has no middle: the ray itself decides.
        let (segment, source) = match light.middle() {
            Some((Middle::At(middle), source)) => (Ray::segment(self.ray.origin, middle), source),
            Some((Middle::Towards(direction), source)) => (Ray::new(self.ray.origin, direction), source),
            None => (self.ray, Source::Nothing),
        };
        if self.row.hides(self.lane, segment.direction) {
            return Vec3::ZERO;
        }
        rays.shadow += 1;
        let segment = segment.leaving(self.row.start_of(self.lane, segment.direction));
        self.tile.world.left_on_segment(&segment, source, &mut rays.lookups)
    }
}
