//! Packet traversal with up to 16 rays. A node is visited if any ray hits its box. The arithmetic matches
//! [`SlabRay::entry_distance`] but uses plain arrays. All functions are inlined so that they use the caller's
//! instruction set.
//!
//! [`SlabRay::entry_distance`]: crate::geometry::aabb::SlabRay::entry_distance

use arrayvec::ArrayVec;
use glimt_base::reduce;

use super::top_node::RayPacketBounds;
use super::{Bvh, ChildRef, DEEP_STACK};
use crate::accel::{F32x16, PACKET_SIZE};
use crate::geometry::Aabb;
use crate::geometry::aabb::SLAB_PAD;
use crate::geometry::packet::{RayPacket, set_bit_lanes};
use crate::math::lanes::{Simd, TRUE};

/// Callback that finds the nearest hits for a packet.
pub trait ClosestHitCallback {
    /// Tests a primitive against the rays in `active`. If a ray hits the primitive, the ray's end is moved to
    /// the hit. Primitives exactly at a ray's end are still tested because ties are broken by id.
    fn intersect_primitive(&mut self, id: u32, active: u32, ends: &mut F32x16);
}

/// Callback that tests a packet for any hit.
pub trait AnyHitCallback {
    /// Returns the mask of the rays in `active` that hit a primitive.
    fn primitive_hit_mask(&mut self, id: u32, active: u32, ends: &F32x16) -> u32;
}

/// A packet preprocessed for the slab test.
struct SlabRayPacket<'a> {
    origin: &'a [F32x16; 3],
    inverse: [F32x16; 3],
}

/// Distance interval in which each ray is inside a box. Empty if `near` > `far`.
#[repr(align(64))]
struct SlabIntervals {
    near: F32x16,
    far: F32x16,
}

impl<'a> SlabRayPacket<'a> {
    #[inline(always)]
    fn new(rays: &'a RayPacket, simd: impl Simd) -> Self {
        let [x, y, z] = &rays.direction;
        let inverse = [simd.reciprocals(x), simd.reciprocals(y), simd.reciprocals(z)];
        Self { origin: &rays.origin, inverse }
    }

    #[inline(always)]
    fn intervals_in_box(&self, bounds: &Aabb, ends: &F32x16) -> SlabIntervals {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let mut stretches = SlabIntervals { near: [0.0; PACKET_SIZE], far: [0.0; PACKET_SIZE] };
        for (lane, &end) in ends.iter().enumerate() {
            let (mut near, mut far) = (0.0_f32, end * SLAB_PAD);
            for axis in 0..3 {
                let (origin, inverse) = (self.origin[axis][lane], self.inverse[axis][lane]);
                let a = (min[axis] - origin) * inverse;
                let b = (max[axis] - origin) * inverse;
                let is_down = inverse < 0.0;
                let low = if is_down { b } else { a };
                let high = (if is_down { a } else { b }) * SLAB_PAD;
                near = if low > near { low } else { near };
                far = if high < far { high } else { far };
            }
            (stretches.near[lane], stretches.far[lane]) = (near, far);
        }
        stretches
    }
}

impl SlabIntervals {
    /// Smallest entry distance among the rays that hit the box. Compares bit patterns, because this orders
    /// nonnegative floats correctly and ignores NaN.
    #[inline(always)]
    fn nearest_entry(&self) -> f32 {
        let mut entries = [0; PACKET_SIZE];
        for lane in 0..PACKET_SIZE {
            let (near, far) = (self.near[lane], self.far[lane]);
            entries[lane] = if near <= far { near.to_bits() } else { f32::INFINITY.to_bits() };
        }
        f32::from_bits(reduce!(entries, <))
    }
}

/// Mask of the rays that hit a box before their end.
#[inline(always)]
fn hit_mask(stretches: &SlabIntervals, simd: impl Simd) -> u32 {
    let mut hits = [0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        hits[lane] = if stretches.near[lane] <= stretches.far[lane] { TRUE } else { 0 };
    }
    simd.movemask(&hits)
}

/// The largest ray end, or a negative number if no ray is traced. Compares bits as in
/// [`SlabIntervals::nearest_entry`].
#[inline(always)]
fn max_ray_end(ends: &F32x16) -> f32 {
    let mut all = [0; PACKET_SIZE];
    for lane in 0..PACKET_SIZE {
        all[lane] = ends[lane].to_bits() as i32;
    }
    f32::from_bits(reduce!(all, >) as u32)
}

/// Traversal stack: a lower bound on the entry distance, the mask of the rays that may hit the child, and the
/// child.
type PacketStack = ArrayVec<(f32, u32, ChildRef), DEEP_STACK>;

/// Unvisited subtrees of the top node, nearest last.
struct PendingSubtrees {
    entry: F32x16,
    order: [u8; PACKET_SIZE],
    count: usize,
}

impl PendingSubtrees {
    #[inline(always)]
    fn sorted_by_entry((hits, entry): (u32, F32x16)) -> Self {
        let mut near = Self { entry, order: [0; PACKET_SIZE], count: 0 };
        for i in set_bit_lanes(hits) {
            let mut place = near.count;
            while place > 0 && entry[usize::from(near.order[place - 1])] < entry[i] {
                near.order[place] = near.order[place - 1];
                place -= 1;
            }
            near.order[place] = i as u8;
            near.count += 1;
        }
        near
    }

    #[inline(always)]
    fn pop_nearest(&mut self) -> Option<(f32, usize)> {
        self.count = self.count.checked_sub(1)?;
        let i = usize::from(self.order[self.count]);
        Some((self.entry[i], i))
    }
}

impl Bvh {
    /// Mask of the top node's subtrees that the packet may hit, and lower bounds on their entry distances.
    #[inline(always)]
    fn top_subtree_hits_and_entries(
        &self,
        slabs: &SlabRayPacket<'_>,
        ends: &F32x16,
        traced: u32,
        simd: impl Simd,
    ) -> (u32, F32x16) {
        if traced == 0 {
            return (0, [0.0; PACKET_SIZE]);
        }
        self.top.subtree_hits_and_entries(
            &RayPacketBounds::from_ray_packet(slabs.origin, &slabs.inverse, (ends, traced), simd),
            simd,
        )
    }

    /// Tests the primitives outside the tree, then visits the leaves that any ray in the packet may hit,
    /// roughly front to back. `traced` is the mask of active rays.
    #[inline(always)]
    pub fn closest_hit_packet(
        &self,
        rays: &RayPacket,
        ends: &mut F32x16,
        traced: u32,
        outside: &[u32],
        closest: &mut impl ClosestHitCallback,
        simd: impl Simd,
    ) {
        let slabs = SlabRayPacket::new(rays, simd);
        let (mut leaf, mut in_leaf) = (outside, traced);
        let mut near =
            PendingSubtrees::sorted_by_entry(self.top_subtree_hits_and_entries(&slabs, ends, traced, simd));
        let mut stack = PacketStack::new();
        loop {
            for &id in leaf {
                closest.intersect_primitive(id, in_leaf, ends);
            }
            if stack.is_empty() && near.count == 0 {
                return;
            }
            let end = max_ray_end(ends) * SLAB_PAD;
            loop {
                let (entry, in_it, child) = match stack.pop() {
                    Some(waiting) => waiting,
                    None => {
                        let Some((entry, i)) = near.pop_nearest() else { return };
                        if entry > end {
                            return;
                        }
                        let (bounds, child) = self.top.subtree_bounds_and_child(i);
                        (entry, hit_mask(&slabs.intervals_in_box(&bounds, ends), simd), child)
                    }
                };
                if entry > end || in_it == 0 {
                    continue;
                }
                if child.count > 0 {
                    leaf = &self.order[child.first as usize..(child.first + child.count) as usize];
                    in_leaf = in_it;
                    break;
                }
                let node = &self.nodes[child.first as usize];
                let (left, right) = (
                    slabs.intervals_in_box(&node.bounds[0], ends),
                    slabs.intervals_in_box(&node.bounds[1], ends),
                );
                let (left_met, right_met) = (hit_mask(&left, simd), hit_mask(&right, simd));
                if left_met == 0 || right_met == 0 {
                    let side = usize::from(left_met == 0);
                    stack.push((0.0, left_met | right_met, node.child[side]));
                    continue;
                }
                let (left_first, right_first) = (left.nearest_entry(), right.nearest_entry());
                let near = usize::from(right_first < left_first);
                let children =
                    [(left_first, left_met, node.child[0]), (right_first, right_met, node.child[1])];
                stack.push(children[1 - near]);
                stack.push(children[near]);
            }
        }
    }

    /// Returns the mask of the rays that hit anything inside or outside the tree. `traced` is the mask of
    /// active rays.
    #[inline(always)]
    pub fn any_hit_packet(
        &self,
        rays: &RayPacket,
        ends: &F32x16,
        traced: u32,
        outside: &[u32],
        any: &mut impl AnyHitCallback,
        simd: impl Simd,
    ) -> u32 {
        let slabs = SlabRayPacket::new(rays, simd);
        let mut free = traced;
        let (mut leaf, mut in_leaf) = (outside, traced);
        let (mut subtrees, _) = self.top_subtree_hits_and_entries(&slabs, ends, traced, simd);
        let mut stack = PacketStack::new();
        loop {
            for &id in leaf {
                let active = in_leaf & free;
                if active != 0 {
                    free &= !any.primitive_hit_mask(id, active, ends);
                }
            }
            loop {
                if free == 0 {
                    return traced;
                }
                let (in_it, child) = match stack.pop() {
                    Some((_, in_it, child)) => (in_it, child),
                    None if subtrees == 0 => return traced & !free,
                    None => {
                        let (bounds, child) = self
                            .top
                            .subtree_bounds_and_child(subtrees.trailing_zeros() as usize % PACKET_SIZE);
                        subtrees &= subtrees - 1;
                        (hit_mask(&slabs.intervals_in_box(&bounds, ends), simd), child)
                    }
                };
                if in_it & free == 0 {
                    continue;
                }
                if child.count > 0 {
                    leaf = &self.order[child.first as usize..(child.first + child.count) as usize];
                    in_leaf = in_it;
                    break;
                }
                let node = &self.nodes[child.first as usize];
                for (bounds, child) in node.bounds.iter().zip(node.child) {
                    let hits = hit_mask(&slabs.intervals_in_box(bounds, ends), simd);
                    if hits & free != 0 {
                        stack.push((0.0, hits, child));
                    }
                }
            }
        }
    }
}
