//! Lifts the shadow-ray origins of vertices on smooth meshes above their facets.

use crate::geometry::Ray;
use crate::geometry::packet::{RayPacket, nonnegative_end_mask};
use crate::integrators::transport::batch::VertexBatch;
use crate::lights::{GeometryOfLight, GeometryOfLightPacket};
use crate::math::lanes::{PACKET_SIZE, Simd, mask_from_bits, select, select_u32};
use crate::world::{Geometry, SimdKernel};

/// Moves a packet's shadow-ray origins above their facets wherever the segment from the facet is unoccluded.
pub struct ShadowOriginLiftKernel<'a> {
    /// The scene's geometry.
    pub geometry: &'a Geometry,
    /// The vertices.
    pub row: &'a mut VertexBatch,
}

impl SimdKernel for ShadowOriginLiftKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: impl Simd) {
        let Self { geometry, row } = self;
        // Create rays from the facets to the lifted points.
        let mut direction = row.lifted;
        for axis in 0..3 {
            for i in 0..PACKET_SIZE {
                direction[axis][i] = row.lifted[axis][i] - row.from[axis][i];
            }
        }
        let mut ends = [-1.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            ends[i] = if row.may_lift & 1 << i != 0 { row.lift_end[i] } else { -1.0 };
        }
        let rays = RayPacket::from_soa(row.from, direction).with_start_triangles(row.start);
        // Find the occluded rays.
        let blocked = {
            let (traced, nothing) =
                (nonnegative_end_mask(&ends, simd), GeometryOfLightPacket::splat(GeometryOfLight::Nothing));
            geometry.occluded_ray_mask(&rays, &ends, traced, &nothing, simd)
        };
        // Move the origins of the unoccluded rays.
        let lifted = row.may_lift & !blocked;
        row.has_horizon &= !lifted;
        let of = mask_from_bits(lifted);
        select_u32(&of, &[Ray::NO_TRIANGLE; PACKET_SIZE], &mut row.start);
        for axis in 0..3 {
            select(&of, &row.lifted[axis], &mut row.from[axis]);
        }
    }
}
