//! Boxes of trees along a ray, for pictures of the trees and of the work that they take.

use crate::geometry::{Aabb, Ray};

/// A node of a tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Its box.
    pub bounds: Aabb,
    /// Nodes above it.
    pub depth: u32,
    /// Shapes that it holds itself; 0 where it has children.
    pub shapes: u32,
}

/// A stretch of a ray inside of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Where it goes in, with the axis of the side; below 0 where the ray starts inside.
    pub enter: (f32, usize),
    /// Where it comes out, with the axis of the side.
    pub leave: (f32, usize),
}

impl Stretch {
    /// Of a ray's line in a box; none where it misses that between the ray's ends. By the plain slab test: what only touches a box
    /// may go either way.
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
