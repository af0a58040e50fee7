//! What a split is expected to cost, by surface areas (MacDonald, Booth, *Heuristics for ray tracing using space
//! subdivision*, 1990).

use super::bounds::Bounds;
use crate::math::Vec3;

/// What one step of traversal costs, in tests of a triangle.
const TRAVERSAL_COST: f32 = 0.5;

/// Factor on the cost of a split that cuts empty space off.
const EMPTY_FACTOR: f32 = 0.8;

/// A plane and what comes of it.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    pub axis: usize,
    pub at: f32,
    /// Triangles in the plane go to the right.
    pub planar_right: bool,
    pub cost: f32,
}

/// Takes planes of one cell and keeps the cheapest.
pub struct Search<'a> {
    cell: &'a Bounds,
    /// Extents, flat ones taken as a little thick, so that cells without area are split as well.
    extent: [f32; 3],
    inverse_area: f32,
    best: Plane,
}

impl<'a> Search<'a> {
    /// Only planes that make `count` triangles cheaper than a leaf of them count.
    pub fn new(cell: &'a Bounds, count: usize) -> Self {
        let extent = (cell.max - cell.min).truncate();
        let extent = extent.max(Vec3::splat(extent.max_element() * 1e-4)).to_array();
        let [x, y, z] = extent;
        let leaf = Plane { axis: 3, at: 0.0, planar_right: false, cost: count as f32 };
        Self { cell, extent, inverse_area: 1.0 / (x * y + y * z + z * x), best: leaf }
    }

    /// The cheapest; none where a leaf is.
    pub fn cheapest(self) -> Option<Plane> {
        Some(self.best).filter(|plane| plane.axis < 3)
    }

    /// Whether a plane is inside the cell.
    #[inline(always)]
    pub fn is_inside(&self, axis: usize, at: f32) -> bool {
        at > self.cell.min[axis] && at < self.cell.max[axis]
    }

    /// A plane with so many triangles below, above and in it.
    #[inline(always)]
    pub fn offer(&mut self, axis: usize, at: f32, left: usize, right: usize, planar: usize) {
        if !self.is_inside(axis, at) {
            return;
        }
        self.offer_side(axis, at, (left + planar, right), false);
        if planar > 0 {
            self.offer_side(axis, at, (left, right + planar), true);
        }
    }

    #[inline(always)]
    fn offer_side(&mut self, axis: usize, at: f32, (left, right): (usize, usize), planar_right: bool) {
        let (u, v) = (self.extent[(axis + 1) % 3], self.extent[(axis + 2) % 3]);
        let area = |length: f32| u * v + length * (u + v);
        let below = area(at - self.cell.min[axis]) * left as f32;
        let above = area(self.cell.max[axis] - at) * right as f32;
        let factor = if left == 0 || right == 0 { EMPTY_FACTOR } else { 1.0 };
        let cost = factor * (TRAVERSAL_COST + (below + above) * self.inverse_area);
        if cost < self.best.cost {
            self.best = Plane { axis, at, planar_right, cost };
        }
    }
}
