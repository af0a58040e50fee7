//! What a split is expected to cost, by surface areas (MacDonald, Booth, *Heuristics for ray tracing using space
//! subdivision*, 1990).

use crate::accel::reference::Bounds;
use crate::math::Vec3;

/// What one step of traversal costs, in tests of a triangle.
const TRAVERSAL_COST: f32 = 1.0;

/// Factor on the cost of a split that cuts empty space off.
const EMPTY_FACTOR: f32 = 0.8;

/// Instead of an axis.
const LEAF: usize = 3;

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
        let extent = (cell.max() - cell.min).truncate();
        let extent = extent.max(Vec3::splat(extent.max_element() * 1e-4)).to_array();
        let [x, y, z] = extent;
        let best = Plane { axis: LEAF, at: 0.0, planar_right: false, cost: count as f32 };
        Self { cell, extent, inverse_area: 1.0 / (x * y + y * z + z * x), best }
    }

    /// The cheapest; none where a leaf is.
    pub fn cheapest(self) -> Option<Plane> {
        Some(self.best).filter(|plane| plane.axis != LEAF)
    }

    /// Offer planes across an axis by a closure that is given where to.
    #[inline(always)]
    pub fn along(&mut self, axis: usize, offer: impl FnOnce(&mut Across)) {
        let (u, v) = (self.extent[(axis + 1) % 3], self.extent[(axis + 2) % 3]);
        let mut across = Across {
            axis,
            min: self.cell.min[axis],
            max: self.cell.max()[axis],
            face: u * v * self.inverse_area,
            per_length: (u + v) * self.inverse_area,
            best: self.best,
        };
        offer(&mut across);
        self.best = across.best;
    }
}

/// Takes planes across one axis.
pub struct Across {
    axis: usize,
    min: f32,
    max: f32,
    /// Area of the plane in the cell, and what each unit of length along the axis adds; relative to the cell's.
    face: f32,
    per_length: f32,
    best: Plane,
}

impl Across {
    /// A plane with so many triangles below, above and in it.
    #[inline(always)]
    pub fn offer(&mut self, at: f32, left: usize, right: usize, planar: usize) {
        if !(at > self.min && at < self.max) {
            return;
        }
        self.offer_side(at, left + planar, right, false);
        if planar > 0 {
            self.offer_side(at, left, right + planar, true);
        }
    }

    #[inline(always)]
    fn offer_side(&mut self, at: f32, left: usize, right: usize, planar_right: bool) {
        let below = (self.face + (at - self.min) * self.per_length) * left as f32;
        let above = (self.face + (self.max - at) * self.per_length) * right as f32;
        let factor = if left == 0 || right == 0 { EMPTY_FACTOR } else { 1.0 };
        let cost = factor * (TRAVERSAL_COST + below + above);
        if cost < self.best.cost {
            self.best = Plane { axis: self.axis, at, planar_right, cost };
        }
    }
}
