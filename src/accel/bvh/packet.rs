//! Traversal by up to sixteen rays at once: a box is visited if any of them meets it. The arithmetic is that of
//! [`SlabRay::enter`], side by side in plain arrays.
//!
//! [`SlabRay::enter`]: crate::geometry::aabb::SlabRay::enter

use super::{Bvh, Child, DEEP_STACK};
use crate::accel::{Ends, PACKET};
use crate::geometry::aabb::SLAB_PAD;
use crate::geometry::{Aabb, Ray};

/// Rays side by side; lanes without a ray have no length.
struct SlabPacket {
    origin: [[f32; PACKET]; 3],
    inverse: [[f32; PACKET]; 3],
}

impl SlabPacket {
    fn new(rays: &[Ray]) -> Self {
        let mut own = Self { origin: [[0.0; PACKET]; 3], inverse: [[1.0; PACKET]; 3] };
        for (lane, ray) in rays.iter().enumerate().take(PACKET) {
            let inverse = ray.direction.recip();
            for axis in 0..3 {
                own.origin[axis][lane] = ray.origin[axis];
                own.inverse[axis][lane] = inverse[axis];
            }
        }
        own
    }

    /// A bit for each ray that meets the box before its end, and where the first of them enters.
    #[inline(always)]
    fn enter(&self, bounds: &Aabb, ends: &Ends) -> (u32, f32) {
        let mut near = [0.0_f32; PACKET];
        let mut far = ends.map(|end| end * SLAB_PAD);
        for axis in 0..3 {
            let (min, max) = (bounds.min[axis], bounds.max[axis]);
            let (origin, inverse) = (&self.origin[axis], &self.inverse[axis]);
            for lane in 0..PACKET {
                let a = (min - origin[lane]) * inverse[lane];
                let b = (max - origin[lane]) * inverse[lane];
                let (low, high) = if inverse[lane] < 0.0 { (b, a) } else { (a, b) };
                let high = high * SLAB_PAD;
                near[lane] = if low > near[lane] { low } else { near[lane] };
                far[lane] = if high < far[lane] { high } else { far[lane] };
            }
        }
        let (mut met, mut first) = (0, f32::INFINITY);
        for lane in 0..PACKET {
            let meets = near[lane] <= far[lane];
            met |= u32::from(meets) << lane;
            first = if meets && near[lane] < first { near[lane] } else { first };
        }
        (met, first)
    }
}

impl Bvh {
    /// Visit the leaves that any of at most [`PACKET`] rays may meet, near ones first. `test(id, met, ends)` tests one primitive
    /// against the rays whose bits are set in `met`, and shortens the ends of those that hit it; a ray that is
    /// done has an end below 0. Primitives at exactly a ray's end are still tested, so that the caller can
    /// break ties by id.
    pub fn visit_packet(&self, rays: &[Ray], ends: &mut Ends, mut test: impl FnMut(u32, u32, &mut Ends)) {
        if self.nodes.is_empty() {
            return;
        }
        let packet = SlabPacket::new(rays);
        let mut stack = [(0.0_f32, u32::MAX, Child::NONE); DEEP_STACK];
        stack[0].2 = Child { first: 0, count: 0 };
        let mut size = 1;
        while size > 0 {
            size -= 1;
            let (entry, met, child) = stack[size];
            if ends.iter().all(|&end| entry > end * SLAB_PAD) {
                continue;
            }
            if child.count > 0 {
                for place in child.first..child.first + child.count {
                    test(self.order[place as usize], met, ends);
                }
                continue;
            }
            let node = &self.nodes[child.first as usize];
            let ((left, left_entry), (right, right_entry)) =
                (packet.enter(&node.bounds[0], ends), packet.enter(&node.bounds[1], ends));
            let children = [(left_entry, left, node.child[0]), (right_entry, right, node.child[1])];
            let far_first = if right_entry < left_entry { [0, 1] } else { [1, 0] };
            for side in far_first {
                if children[side].1 != 0 {
                    stack[size] = children[side];
                    size += 1;
                }
            }
        }
    }
}
