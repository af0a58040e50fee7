//! Traversal by up to sixteen rays at once: a box is visited if any of them meets it. The arithmetic is that of
//! [`SlabRay::enter`], side by side in plain arrays; all of it is inlined, to be compiled with its caller's instructions.
//!
//! [`SlabRay::enter`]: crate::geometry::aabb::SlabRay::enter

use super::{Bvh, Child, DEEP_STACK};
use crate::accel::{Ends, PACKET};
use crate::geometry::Aabb;
use crate::geometry::aabb::SLAB_PAD;
use crate::geometry::rows::{RayRows, Row};

/// Looks for the nearest hits of the rays of a packet.
pub trait ClosestTest {
    /// Test a primitive against the rays whose bits are set in `met`, and shorten the ends of those that hit it. Primitives
    /// at exactly a ray's end are still tested, to break ties by id.
    fn test(&mut self, id: u32, met: u32, ends: &mut Ends);
}

/// Looks for any hit of the rays of a packet.
pub trait AnyTest {
    /// The bits of the rays in `met` that hit a primitive.
    fn test(&mut self, id: u32, met: u32, ends: &Ends) -> u32;
}

/// Rays made ready for boxes.
struct SlabPacket<'a> {
    origin: &'a [Row; 3],
    inverse: [Row; 3],
}

/// Between which distances each ray is in a box; nowhere where the first is the greater.
struct Stretches {
    near: Row,
    far: Row,
}

impl<'a> SlabPacket<'a> {
    #[inline(always)]
    fn new(rays: &'a RayRows) -> Self {
        let mut inverse = rays.direction;
        for x in inverse.as_flattened_mut() {
            *x = 1.0 / *x;
        }
        Self { origin: &rays.origin, inverse }
    }

    #[inline(always)]
    fn enter(&self, bounds: &Aabb, ends: &Ends) -> Stretches {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let mut stretches = Stretches { near: [0.0; PACKET], far: [0.0; PACKET] };
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

impl Stretches {
    /// Where the first of the rays that meet the box enters it. Bits of numbers from 0 on are ordered as these are, and take
    /// no care for NaN.
    #[inline(always)]
    fn first(&self) -> f32 {
        let mut first = f32::INFINITY.to_bits();
        for lane in 0..PACKET {
            let (near, far) = (self.near[lane], self.far[lane]);
            let near = if near <= far { near.to_bits() } else { f32::INFINITY.to_bits() };
            first = if near < first { near } else { first };
        }
        f32::from_bits(first)
    }
}

/// A bit for each ray that meets the first box before its end, and for each that meets the second.
#[inline(always)]
fn met(left: &Stretches, right: &Stretches) -> [u32; 2] {
    let mut met = 0_u32;
    for lane in 0..PACKET {
        let (left_bit, right_bit) = (1 << lane, 1 << (lane + 16));
        let in_left = if left.near[lane] <= left.far[lane] { left_bit } else { 0 };
        let in_right = if right.near[lane] <= right.far[lane] { right_bit } else { 0 };
        met |= in_left | in_right;
    }
    [met & 0xffff, met >> 16]
}

/// A bit for each ray that is traced.
#[inline(always)]
fn traced(ends: &Ends) -> u32 {
    let mut bits = 0;
    for (lane, &end) in ends.iter().enumerate() {
        let bit = 1 << lane;
        bits |= if end >= 0.0 { bit } else { 0 };
    }
    bits
}

/// The end of the ray that goes on longest; below 0 where no ray is traced. Bits are ordered as in [`Stretches::first`].
#[inline(always)]
fn greatest(ends: &Ends) -> f32 {
    let mut greatest = i32::MIN;
    for end in ends {
        let end = end.to_bits() as i32;
        greatest = if end > greatest { end } else { greatest };
    }
    f32::from_bits(greatest as u32)
}

impl Bvh {
    /// Visit the leaves that any of at most [`PACKET`] rays may meet, near ones first; before them primitives that are not in
    /// the tree.
    #[inline(always)]
    pub fn closest_packet(
        &self,
        rays: &RayRows,
        ends: &mut Ends,
        outside: &[u32],
        closest: &mut impl ClosestTest,
    ) {
        let slabs = SlabPacket::new(rays);
        let mut stack = [(0.0_f32, 0_u32, Child::NONE); DEEP_STACK];
        let mut size = 0;
        let (mut leaf, mut in_leaf) = (outside, traced(ends));
        if !self.nodes.is_empty() {
            stack[0] = (0.0, in_leaf, Child { first: 0, count: 0 });
            size = 1;
        }
        loop {
            for &id in leaf {
                closest.test(id, in_leaf, ends);
            }
            let end = greatest(ends) * SLAB_PAD;
            loop {
                if size == 0 {
                    return;
                }
                size -= 1;
                let (entry, in_it, child) = stack[size];
                if entry > end {
                    continue;
                }
                if child.count > 0 {
                    leaf = &self.order[child.first as usize..(child.first + child.count) as usize];
                    in_leaf = in_it;
                    break;
                }
                let node = &self.nodes[child.first as usize];
                let (left, right) = (slabs.enter(&node.bounds[0], ends), slabs.enter(&node.bounds[1], ends));
                let [left_met, right_met] = met(&left, &right);
                if left_met == 0 || right_met == 0 {
                    let side = usize::from(left_met == 0);
                    stack[size] = (0.0, left_met | right_met, node.child[side]);
                    size += usize::from(left_met | right_met != 0);
                    continue;
                }
                let (left_first, right_first) = (left.first(), right.first());
                let near = usize::from(right_first < left_first);
                let children =
                    [(left_first, left_met, node.child[0]), (right_first, right_met, node.child[1])];
                stack[size] = children[1 - near];
                stack[size + 1] = children[near];
                size += 2;
            }
        }
    }

    /// A bit for each of at most [`PACKET`] rays that hits anything in the tree, or of what is not in it.
    #[inline(always)]
    pub fn any_packet(&self, rays: &RayRows, ends: &Ends, outside: &[u32], any: &mut impl AnyTest) -> u32 {
        let slabs = SlabPacket::new(rays);
        let mut stack = [(0_u32, Child::NONE); DEEP_STACK];
        let mut size = 0;
        let traced = traced(ends);
        let mut free = traced;
        let (mut leaf, mut in_leaf) = (outside, traced);
        if !self.nodes.is_empty() {
            stack[0] = (traced, Child { first: 0, count: 0 });
            size = 1;
        }
        loop {
            for &id in leaf {
                let met = in_leaf & free;
                if met != 0 {
                    free &= !any.test(id, met, ends);
                }
            }
            loop {
                if size == 0 || free == 0 {
                    return traced & !free;
                }
                size -= 1;
                let (in_it, child) = stack[size];
                if child.count > 0 {
                    leaf = &self.order[child.first as usize..(child.first + child.count) as usize];
                    in_leaf = in_it;
                    break;
                }
                if in_it & free == 0 {
                    continue;
                }
                let node = &self.nodes[child.first as usize];
                let (left, right) = (slabs.enter(&node.bounds[0], ends), slabs.enter(&node.bounds[1], ends));
                for (met, child) in met(&left, &right).into_iter().zip(node.child) {
                    stack[size] = (met & free, child);
                    size += usize::from(met & free != 0);
                }
            }
        }
    }
}
