//! Tree nodes along a ray, for visualizing the tree and its traversal cost.

use crate::geometry::{Aabb, Ray};

/// A tree node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisitedNode {
    /// Bounding box.
    pub bounds: Aabb,
    /// Number of ancestors.
    pub depth: u32,
    /// Number of shapes in a leaf; 0 for inner nodes.
    pub shapes: u32,
}

/// The part of a ray that is inside a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayBoxInterval {
    /// Distance at which the ray enters the box (negative if it starts inside), and the axis of the entry
    /// face.
    pub enter: (f32, usize),
    /// Distance at which the ray leaves the box, and the axis of the exit face.
    pub leave: (f32, usize),
}

impl RayBoxInterval {
    /// Intersects a ray with a box. Returns `None` if the box is not hit before the ray's end. Uses the plain
    /// slab test, so rays that only touch the box may hit or miss.
    #[inline]
    pub fn new(bounds: &Aabb, ray: &Ray) -> Option<Self> {
        let (mut enter, mut leave) = ((f32::NEG_INFINITY, 0), (f32::INFINITY, 0));
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            let (low, high) = (bounds.min[axis], bounds.max[axis]);
            if d == 0.0 {
                if !(low <= o && o <= high) {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - o) / d, (high - o) / d);
            let (near, far) = if a < b { (a, b) } else { (b, a) };
            enter = if near > enter.0 { (near, axis) } else { enter };
            leave = if far < leave.0 { (far, axis) } else { leave };
        }
        (enter.0 <= leave.0 && leave.0 >= 0.0 && enter.0 <= ray.t_max).then_some(Self { enter, leave })
    }
}
