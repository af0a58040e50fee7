//! Boxes of trees along a ray, for views of the trees and of their traversal cost.

use crate::geometry::{Aabb, Ray};

/// A node of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Bounding box of the node.
    pub bounds: Aabb,
    /// Number of nodes above it.
    pub depth: u32,
    /// Number of shapes that the node holds itself; 0 if it has children.
    pub shapes: u32,
}

/// Interval of a ray inside of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Distance at which the ray enters, with the axis of the face; below 0 if the ray starts inside.
    pub enter: (f32, usize),
    /// Distance at which the ray leaves, with the axis of the face.
    pub leave: (f32, usize),
}

impl Stretch {
    /// Intersects a ray's line with a box. `None` if the line misses the box between the ray's ends. By the plain slab test: a ray
    /// that only touches a box may count either way.
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
