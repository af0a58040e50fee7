//! Packets of surface points, with SIMD loops for the most common shapes.

use super::packet::{HitPacket, PACKET_SIZE, RayPacket, set_bit_lanes};
use super::surface::point_error_bound;
use super::{RayF64, Shape, ShapeHit, SurfacePoint};
use crate::math::lanes::{Vec3x16, mask_from_bits, select, set_lane};
use crate::math::{DVec2, DVec3, Vec2};

/// A packet of [`SurfacePoint`]s that contains only the fields needed for lighting.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct SurfacePacket {
    /// Points in world coordinates.
    pub point: Vec3x16,
    /// Bounds on the errors of the points.
    pub error: Vec3x16,
    /// Unit geometric normals on the front sides.
    pub normal: Vec3x16,
    /// Mask of the lanes whose shading normal and shadow point are set.
    pub smooth: u32,
    /// Unit interpolated normals, on the same sides as `normal`.
    pub shading_normal: Vec3x16,
    /// [`SurfacePoint::shadow_point`](super::SurfacePoint::shadow_point) of each lane.
    pub shadow_point: Vec3x16,
    /// Texture coordinates, if requested.
    pub uv: [[f64; PACKET_SIZE]; 2],
}

/// A surface point before rounding to `f32`.
pub struct SurfacePointF64 {
    /// The point in world coordinates.
    pub point: DVec3,
    /// Normal on the front side, not necessarily of unit length.
    pub normal: DVec3,
    /// Largest magnitude among the lengths used to compute the point.
    pub reach: f64,
}

impl SurfacePointF64 {
    /// Surface point without texture coordinates or tangents.
    pub fn to_surface_point_without_uv(&self) -> SurfacePoint {
        SurfacePoint::from_f64(self.point, self.normal, Vec2::ZERO, DVec3::ZERO, DVec3::ZERO, self.reach)
    }
}

/// A shape that computes surface points in double precision.
pub trait SurfacePointsInF64 {
    /// Surface point at a hit.
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64;
}

/// A shape with a branchless texture coordinate computation.
pub trait UvMapped {
    /// Texture coordinates at a hit.
    fn uv_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> DVec2;
}

impl Default for SurfacePacket {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl SurfacePacket {
    /// A packet with all fields 0.
    pub const EMPTY: Self = Self {
        point: [[0.0; PACKET_SIZE]; 3],
        error: [[0.0; PACKET_SIZE]; 3],
        normal: [[0.0; PACKET_SIZE]; 3],
        smooth: 0,
        shading_normal: [[0.0; PACKET_SIZE]; 3],
        shadow_point: [[0.0; PACKET_SIZE]; 3],
        uv: [[0.0; PACKET_SIZE]; 2],
    };

    /// Computes the surface points of the hits selected by `of`, which must be on the same shape. Returns
    /// false if the shape has no SIMD loop.
    #[inline(always)]
    pub fn try_fill_points_of_shape_lanes(
        &mut self,
        shape: &Shape,
        rays: &RayPacket,
        hits: &HitPacket,
        of: u32,
    ) -> bool {
        shape.try_fill_surfaces(self, rays, hits, of)
    }

    /// Computes the texture coordinates of the hits selected by `of`, which must be on the same shape.
    #[inline(always)]
    pub fn fill_uv_of_shape_lanes(&mut self, shape: &Shape, rays: &RayPacket, hits: &HitPacket, of: u32) {
        if shape.try_fill_uvs(self, rays, hits, of) {
            return;
        }
        for lane in set_bit_lanes(of) {
            let Some(hit) = hits.get(lane) else { continue };
            let uv = shape.surface_point_at_hit(&rays.ray_f64(lane), &hit).uv;
            (self.uv[0][lane], self.uv[1][lane]) = (uv.x, uv.y);
        }
    }

    /// [`SurfacePacket::fill_uv_of_shape_lanes`] for a shape with a SIMD loop.
    #[inline(always)]
    pub(super) fn fill_uv_lanes_with_simd(
        &mut self,
        shape: &impl UvMapped,
        rays: &RayPacket,
        hits: &HitPacket,
        of: u32,
    ) {
        for lane in 0..PACKET_SIZE {
            let uv = shape.uv_at_hit(&rays.ray_f64(lane), &ShapeHit::from_t(hits.t[lane]));
            let is_own = of & 1 << lane != 0;
            self.uv[0][lane] = if is_own { uv.x } else { self.uv[0][lane] };
            self.uv[1][lane] = if is_own { uv.y } else { self.uv[1][lane] };
        }
    }

    /// [`SurfacePacket::try_fill_points_of_shape_lanes`] for a shape with a SIMD loop.
    #[inline(always)]
    pub(super) fn fill_point_lanes_with_simd(
        &mut self,
        shape: &impl SurfacePointsInF64,
        rays: &RayPacket,
        hits: &HitPacket,
        of: u32,
    ) {
        let mut found = Self::EMPTY;
        for lane in 0..PACKET_SIZE {
            let hit = ShapeHit {
                t: hits.t[lane],
                primitive: hits.primitive[lane],
                u: hits.u[lane],
                v: hits.v[lane],
            };
            let SurfacePointF64 { point, normal, reach } = shape.surface_point_f64(&rays.ray_f64(lane), &hit);
            let point = point.as_vec3();
            set_lane(&mut found.point, lane, point);
            set_lane(&mut found.error, lane, point_error_bound(point, reach));
            set_lane(&mut found.normal, lane, normal.normalize().as_vec3());
        }
        self.copy_surface_lanes_from(of, &found);
    }

    /// Copies the selected points, errors, and normals from another packet.
    #[inline(always)]
    pub fn copy_surface_lanes_from(&mut self, of: u32, found: &Self) {
        let of = mask_from_bits(of);
        for axis in 0..3 {
            select(&of, &found.point[axis], &mut self.point[axis]);
            select(&of, &found.error[axis], &mut self.error[axis]);
            select(&of, &found.normal[axis], &mut self.normal[axis]);
        }
    }

    /// Copies the selected shading normals and shadow points from another packet.
    #[inline(always)]
    pub fn copy_shading_lanes_from(&mut self, of: u32, found: &Self) {
        self.smooth |= of;
        let of = mask_from_bits(of);
        for axis in 0..3 {
            select(&of, &found.shading_normal[axis], &mut self.shading_normal[axis]);
            select(&of, &found.shadow_point[axis], &mut self.shadow_point[axis]);
        }
    }
}
