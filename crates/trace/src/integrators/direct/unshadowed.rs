//! Light reflected by narrow lobes without soft shadows: the light from every emitter along a lobe ray,
//! ignoring occluders. For hard shadows, one ray to the center of each light determines the transmittance to
//! the light.

use crate::geometry::{Ray, ShapeHit};
use crate::integrators::transport::batch::VertexBatch;
use crate::integrators::transport::tile::TileContext;
use crate::lights::{GeometryOfLight, Light, LightCenter, Side};
use crate::math::Vec3;
use crate::math::lanes::lane;
use crate::scene::description::ShadowMode;
use crate::world::{Hit, MAX_NULL_INTERACTIONS};

use super::light_sums::DirectLightCounters;

/// A ray in a vertex's narrow lobe, and the pdf of its direction.
pub struct LobeRayWithoutSoftShadows<'a> {
    /// The tile being rendered.
    pub tile: &'a TileContext<'a>,
    /// The packet that contains the vertex.
    pub row: &'a VertexBatch,
    /// Lane of the vertex in the packet.
    pub lane: usize,
    /// The ray.
    pub ray: Ray,
    /// Pdf of the ray's direction in sr⁻¹.
    pub pdf: f32,
}

impl LobeRayWithoutSoftShadows<'_> {
    /// Radiance from the lights along the ray, with MIS weights for equal numbers of light samples and lobe
    /// rays. `transmittance` returns the medium's transmittance up to a distance.
    #[cold]
    #[inline(never)]
    pub fn radiance(&self, transmittance: impl Fn(f32) -> Vec3, rays: &mut DirectLightCounters) -> Vec3 {
        let Self { tile, row, lane: i, ray, pdf } = self;
        let (world, normal) = (tile.world, lane(&row.normal, *i));
        let (mut sum, mut along, mut passed) = (Vec3::ZERO, *ray, 0.0);
        // Add the emitters along the ray, front to back.
        for _ in 0..=MAX_NULL_INTERACTIONS {
            let Some(hit) = world
                .geometry
                .closest_hit_on_objects_where(&along, |object| world.lights.has_light_on_object(object))
            else {
                break;
            };
            let distance = passed + hit.shape.t;
            let met = Hit { shape: ShapeHit { t: distance, ..hit.shape }, ..hit };
            let radiance = tile.lobe_ray_emitter_radiance(ray, normal, &met, *pdf, &mut rays.lookups);
            if radiance != Vec3::ZERO {
                let front = world.geometry.surface(ray, &met).normal;
                let side = if front.dot(ray.direction) > 0.0 { Side::Back } else { Side::Front };
                let light = world.lights.light_on_primitive(hit.object, hit.shape.primitive, side);
                let arriving =
                    light.map_or(Vec3::ZERO, |(_, light)| self.transmittance_to_light_center(light, rays));
                sum += radiance * transmittance(distance) * arriving;
            }
            (along, passed) = (world.transmittance_and_continued_ray(&along, &hit, &mut 0).1, distance);
        }
        // Add the infinite lights.
        for (number, light) in world.lights.iter().filter(|(_, light)| light.is_infinite()) {
            let radiance = tile.lobe_ray_radiance_from_infinite_light(Some(number), ray, normal, *pdf);
            if radiance != Vec3::ZERO {
                sum += radiance * transmittance(f32::MAX) * self.transmittance_to_light_center(light, rays);
            }
        }
        sum
    }

    /// Transmittance toward a light's center, or 1 without shadows.
    fn transmittance_to_light_center(&self, light: &Light, rays: &mut DirectLightCounters) -> Vec3 {
        match self.tile.settings.render.shadows {
            ShadowMode::Off => return Vec3::ONE,
            ShadowMode::Hard | ShadowMode::Soft => {}
        }
        // An environment has no center, so test the ray itself.
        let (segment, source) = match light.center_and_geometry() {
            Some((LightCenter::At(middle), source)) => {
                (Ray::segment_ending_before_point(self.ray.origin, middle), source)
            }
            Some((LightCenter::Towards(direction), source)) => (Ray::new(self.ray.origin, direction), source),
            None => (self.ray, GeometryOfLight::Nothing),
        };
        if self.row.is_direction_below_horizon(self.lane, segment.direction) {
            return Vec3::ZERO;
        }
        rays.shadow += 1;
        let segment = segment.with_start_triangle(self.row.ray_start_triangle(self.lane, segment.direction));
        self.tile.world.transmittance(&segment, source, &mut rays.lookups)
    }
}
