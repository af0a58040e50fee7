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
        let mut inverse = [[0.0; PACKET]; 3];
        for axis in 0..3 {
            for lane in 0..PACKET {
                inverse[axis][lane] = 1.0 / rays.direction[axis][lane];
            }
        }
        Self { origin: &rays.origin, inverse }
    }

    #[inline(always)]
    fn enter(&self, bounds: &Aabb, ends: &Ends) -> Stretches {
        let (min, max) = (bounds.min.to_array(), bounds.max.to_array());
        let mut stretches = Stretches { near: [0.0; PACKET], far: [0.0; PACKET] };
        for lane in 0..PACKET {
            let (mut near, mut far) = (0.0_f32, ends[lane] * SLAB_PAD);
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
    /// A bit for each ray that meets the box before its end.
    #[inline(always)]
    fn met(&self) -> u32 {
        let mut met = 0;
        for lane in 0..PACKET {
            let bit = 1 << lane;
            met |= if self.near[lane] <= self.far[lane] { bit } else { 0 };
        }
        met
    }

    /// Where the first of the rays that meet the box enters it.
    #[inline(always)]
    fn first(&self) -> f32 {
        let mut first = f32::INFINITY;
        for lane in 0..PACKET {
            let near = if self.near[lane] <= self.far[lane] { self.near[lane] } else { f32::INFINITY };
            first = if near < first { near } else { first };
        }
        first
    }
}

/// A bit for each ray that is traced.
#[inline(always)]
fn traced(ends: &Ends) -> u32 {
    let mut bits = 0;
    for lane in 0..PACKET {
        let bit = 1 << lane;
        bits |= if ends[lane] >= 0.0 { bit } else { 0 };
    }
    bits
}

/// The end of the ray that goes on longest.
#[inline(always)]
fn greatest(ends: &Ends) -> f32 {
    let mut greatest = -1.0;
    for lane in 0..PACKET {
        greatest = if ends[lane] > greatest { ends[lane] } else { greatest };
    }
    greatest
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
        let (mut leaf, mut met) = (outside, traced(ends));
        if !self.nodes.is_empty() {
            stack[0] = (0.0, met, Child { first: 0, count: 0 });
            size = 1;
        }
        loop {
            for &id in leaf {
                closest.test(id, met, ends);
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
                    met = in_it;
                    break;
                }
                let node = &self.nodes[child.first as usize];
                let (left, right) = (slabs.enter(&node.bounds[0], ends), slabs.enter(&node.bounds[1], ends));
                let (left_met, right_met) = (left.met(), right.met());
                let (left_first, right_first) = (left.first(), right.first());
                let children =
                    [(left_first, left_met, node.child[0]), (right_first, right_met, node.child[1])];
                let near = usize::from(right_first < left_first);
                stack[size] = children[1 - near];
                size += usize::from(children[1 - near].1 != 0);
                stack[size] = children[near];
                size += usize::from(children[near].1 != 0);
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
        let (mut leaf, mut met) = (outside, traced);
        if !self.nodes.is_empty() {
            stack[0] = (traced, Child { first: 0, count: 0 });
            size = 1;
        }
        loop {
            for &id in leaf {
                let met = met & free;
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
                    met = in_it;
                    break;
                }
                if in_it & free == 0 {
                    continue;
                }
                let node = &self.nodes[child.first as usize];
                for side in 0..2 {
                    let met = slabs.enter(&node.bounds[side], ends).met() & free;
                    stack[size] = (met, node.child[side]);
                    size += usize::from(met != 0);
                }
            }
        }
    }
}
