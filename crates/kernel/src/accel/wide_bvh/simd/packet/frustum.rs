//! A frustum around a packet's rays.

use super::rays::SimdRayPacket;
use crate::accel::wide_bvh::node::WideNode;
use crate::accel::wide_bvh::simd::vector::{SimdF32x8, SimdVector};
use crate::geometry::aabb::SLAB_PAD;

/// Bounds on all rays in a packet, tested against eight boxes at a time. Subtraction and multiplication round
/// monotonically, so no ray enters a box before the frustum does, or leaves it after the frustum does.
pub struct Frustum {
    /// The origin coordinate closest to the near plane: the maximum for positive directions, the minimum for
    /// negative ones.
    near_origin: [SimdF32x8; 3],
    far_origin: [SimdF32x8; 3],
    inverse: [[SimdF32x8; 2]; 3],
    near: [usize; 3],
}

impl Frustum {
    #[inline(always)]
    pub fn new<V: SimdVector>(packet: &SimdRayPacket<V>, like: SimdF32x8) -> Self {
        let (mut near_origin, mut far_origin) = ([like; 3], [like; 3]);
        let mut inverse = [[like; 2]; 3];
        for axis in 0..3 {
            let ends = packet.origins[axis];
            let negative = packet.near[axis] & 1;
            let margin = if negative == 1 { -packet.margin } else { packet.margin };
            near_origin[axis] = like.splat_like(ends[1 - negative] + margin);
            far_origin[axis] = like.splat_like(ends[negative] - margin);
            let row = packet.inverse[axis];
            inverse[axis] = [like.splat_like(row.min_element()), like.splat_like(row.max_element())];
        }
        Self { near_origin, far_origin, inverse, near: packet.near }
    }

    /// Lower bounds on the distances at which any ray enters each box, and the mask of the boxes that any ray
    /// may hit before `end`.
    #[inline(always)]
    pub fn box_entries(&self, node: &WideNode, end: SimdF32x8) -> (SimdF32x8, u32) {
        let pad = end.splat_like(SLAB_PAD);
        let (mut near, mut far) = (end.splat_like(0.0), end);
        for axis in 0..3 {
            let [min, max] = self.inverse[axis];
            let to_near = end.load_slice(&node.rows[self.near[axis]]) - self.near_origin[axis];
            let to_far = end.load_slice(&node.rows[self.near[axis] ^ 1]) - self.far_origin[axis];
            near = (to_near * min).min(to_near * max).max(near);
            far = ((to_far * min).max(to_far * max) * pad).min(far);
        }
        (near, SimdF32x8::movemask(near.le(far)))
    }
}
