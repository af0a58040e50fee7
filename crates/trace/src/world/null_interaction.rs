//! Null interactions along shadow rays: light passes through thin panes and partially opaque surfaces without
//! changing direction.
//!
//! Shadow rays are first tested against opaque objects only, as in a scene without see-through surfaces. Only
//! unoccluded rays that enter the bounding box of a see-through object are then traced from surface to
//! surface.

use super::packet::OcclusionTest;
use super::{Geometry, Hit, PACKET_SIZE, SimdKernel, World};
use crate::accel::{AnyHitCallback, F32x16};
use crate::geometry::packet::{RayPacket, set_bit_lanes};
use crate::geometry::ray::offset_origin;
use crate::geometry::{Ray, SurfaceRequest};
use crate::lights::{GeometryOfLight, GeometryOfLightPacket};
use crate::materials::{Footprint, Material};
use crate::math::Vec3;
use crate::math::lanes::{Simd, Vec3x16, set_lane};

/// Relative tolerance for equal distances.
const SAME_DISTANCE: f32 = 1e-4;

/// Maximum number of null interactions per ray. Further interactions block the ray.
pub const MAX_NULL_INTERACTIONS: u32 = 64;

/// Objects that light may pass through without changing direction.
#[derive(Debug)]
pub(super) struct SeeThroughObjects {
    /// Whether each object is see-through.
    objects: Vec<bool>,
    /// Whether any see-through object is in the tree of merged meshes.
    is_any_merged: bool,
}

impl SeeThroughObjects {
    /// Collects the world's see-through objects, or returns `None` if there are none.
    pub(super) fn from_world(world: &World) -> Option<Self> {
        let geometry = &world.geometry;
        let has_null_interaction =
            |object: u32| world.materials_of(object).any(Material::has_null_interaction);
        let objects: Vec<bool> = (0..geometry.objects().len() as u32).map(has_null_interaction).collect();
        let is_merged =
            |(object, is_see_through): (u32, &bool)| *is_see_through && geometry.is_merged(object);
        let is_any_merged = (0..).zip(&objects).any(is_merged);
        objects.contains(&true).then_some(Self { objects, is_any_merged })
    }

    /// Whether light may pass through an object without changing direction. Returns false for the id of the
    /// merged meshes, which is out of range.
    #[inline(always)]
    fn contains_object(&self, object: u32) -> bool {
        self.objects.get(object as usize).copied().unwrap_or(false)
    }
}

/// Transmittance along the shadow rays in a packet.
#[repr(align(64))]
pub struct ShadowTransmittancePacket {
    /// Mask of rays with zero transmittance.
    pub occluded: u32,
    /// Transmittance of each ray.
    pub left: Vec3x16,
    /// Number of texture lookups.
    pub lookups: u64,
}

impl ShadowTransmittancePacket {
    /// Sets the transmittance along a lane's ray.
    fn set(&mut self, lane: usize, left: Vec3) {
        set_lane(&mut self.left, lane, left);
        self.occluded |= u32::from(left == Vec3::ZERO) << lane;
    }
}

impl World {
    /// Whether any surface may be a null interaction.
    #[inline(always)]
    pub fn has_null_interaction_surfaces(&self) -> bool {
        self.see_through.is_some()
    }

    /// Transmittance along each shadow ray in a packet. `sources` contains each ray's light, and `traced` is
    /// the mask of rays to trace.
    #[cold]
    #[inline(never)]
    pub fn transmittance_packet(
        &self,
        rows: &RayPacket,
        ends: &F32x16,
        traced: u32,
        sources: &GeometryOfLightPacket,
    ) -> ShadowTransmittancePacket {
        self.geometry.instruction_set().run(ShadowTransmittanceKernel {
            world: self,
            rows,
            ends,
            traced,
            sources,
        })
    }

    /// Whether a shadow ray's transmittance is zero.
    pub fn has_zero_transmittance_along(&self, ray: &Ray, source: GeometryOfLight) -> bool {
        self.transmittance(ray, source, &mut 0) == Vec3::ZERO
    }

    /// Transmittance along a shadow ray to its light.
    pub fn transmittance(&self, ray: &Ray, source: GeometryOfLight, lookups: &mut u64) -> Vec3 {
        let Some(see_through) = &self.see_through else {
            return if self.geometry.is_occluded_except_by_light(ray, source) {
                Vec3::ZERO
            } else {
                Vec3::ONE
            };
        };
        let is_own = |object: u32| source == GeometryOfLight::Object(object);
        let stops = |object: u32| !see_through.contains_object(object) && !is_own(object);
        if self.geometry.closest_hit_on_objects_where(ray, stops).is_some() {
            return Vec3::ZERO;
        }
        self.see_through_transmittance(see_through, ray, source, lookups)
    }

    /// Transmittance of the surface at a hit, and the ray's continuation beyond the surface.
    pub fn transmittance_and_continued_ray(&self, ray: &Ray, hit: &Hit, lookups: &mut u64) -> (Vec3, Ray) {
        let index = self.material_index(hit);
        let material = &self.materials[index];
        let request = SurfaceRequest { uv: self.material_needs_uvs_or_tangents(index), shadow_point: false };
        let surface = self.geometry.requested_surface(ray, hit, request);
        let cosine = surface.shading_normal.dot(ray.direction.normalize_or_zero());
        let color = self.vertex_color(hit).unwrap_or(Vec3::ONE);
        let at = self.texture_point(hit, &surface, |_| Footprint::POINT);
        let left = material.null_transmittance(&at, color, cosine, lookups);
        let origin = offset_origin(surface.point, surface.error, surface.normal, ray.direction);
        let start = self.geometry.scene_triangle_number(hit);
        let beyond = Ray::new(origin, ray.direction).with_start_triangle(start);
        (left, Ray { t_max: ray.t_max - hit.shape.t, ..beyond })
    }

    /// Product of the transmittances of all see-through surfaces along a shadow ray.
    fn see_through_transmittance(
        &self,
        see_through: &SeeThroughObjects,
        ray: &Ray,
        source: GeometryOfLight,
        lookups: &mut u64,
    ) -> Vec3 {
        let (mut left, mut ray, mut count) = (Vec3::ONE, *ray, 0);
        let is_own = |object: u32| source == GeometryOfLight::Object(object);
        // The sampled point may be at the end of the ray, up to rounding.
        let end = SAME_DISTANCE * ray.t_max;
        while let Some(hit) = self.geometry.closest_hit_on_objects_where(&ray, |object| {
            see_through.contains_object(object) && !is_own(object)
        }) {
            if source == GeometryOfLight::SeeThrough(hit.object) && hit.shape.t >= ray.t_max - end {
                break;
            }
            let (part, beyond) = self.transmittance_and_continued_ray(&ray, &hit, lookups);
            ray = beyond;
            // A light does not occlude itself.
            if source == GeometryOfLight::Primitive(hit.object, hit.shape.primitive) {
                continue;
            }
            (left, count) = (left * part, count + 1);
            if left == Vec3::ZERO || count > MAX_NULL_INTERACTIONS {
                return Vec3::ZERO;
            }
            if !(ray.t_max > 0.0) {
                break;
            }
        }
        left
    }
}

/// Kernel of [`World::transmittance_packet`].
struct ShadowTransmittanceKernel<'a> {
    world: &'a World,
    rows: &'a RayPacket,
    ends: &'a F32x16,
    traced: u32,
    sources: &'a GeometryOfLightPacket,
}

impl SimdKernel for ShadowTransmittanceKernel<'_> {
    type Output = ShadowTransmittancePacket;

    #[inline(always)]
    fn run(self, simd: impl Simd) -> ShadowTransmittancePacket {
        let Self { world, rows, ends, traced, sources } = self;
        let mut transmittance =
            ShadowTransmittancePacket { occluded: 0, left: [[1.0; PACKET_SIZE]; 3], lookups: 0 };
        let Some(see_through) = &world.see_through else { return transmittance };
        // Find the rays not blocked by opaque objects.
        let geometry: &Geometry = &world.geometry;
        let each_mesh =
            see_through.is_any_merged || traced & geometry.light_is_entire_merged_mesh_mask(sources) != 0;
        let tree = if each_mesh { geometry.finite_object_tree() } else { geometry.traced_tree() };
        if tree.has_shells() {
            for lane in set_bit_lanes(traced) {
                let ray = Ray { t_max: ends[lane], ..rows.ray(lane) };
                let left = world.transmittance(&ray, sources.geometry(lane), &mut transmittance.lookups);
                transmittance.set(lane, left);
            }
            return transmittance;
        }
        let occluders = OcclusionTest::new(geometry, rows, sources, simd);
        let mut solid = OpaqueOcclusionTest { occluders, see_through, near: 0 };
        transmittance.occluded =
            tree.any_hit_packet(rows, ends, traced, geometry.unbounded(), &mut solid, simd);
        // Trace the rays that may cross see-through surfaces.
        for lane in set_bit_lanes(traced & !transmittance.occluded & solid.near) {
            let ray = Ray { t_max: ends[lane], ..rows.ray(lane) };
            let left = world.see_through_transmittance(
                see_through,
                &ray,
                sources.geometry(lane),
                &mut transmittance.lookups,
            );
            transmittance.set(lane, left);
        }
        transmittance
    }
}

/// Any-hit test for opaque occluders.
struct OpaqueOcclusionTest<'a, F> {
    occluders: OcclusionTest<'a, F>,
    see_through: &'a SeeThroughObjects,
    /// Mask of rays that enter the bounding box of a see-through object.
    near: u32,
}

impl<F: Simd> AnyHitCallback for OpaqueOcclusionTest<'_, F> {
    #[inline(always)]
    fn primitive_hit_mask(&mut self, id: u32, active: u32, ends: &F32x16) -> u32 {
        if self.see_through.contains_object(id) {
            self.near |= active;
            return 0;
        }
        self.occluders.primitive_hit_mask(id, active, ends)
    }
}
