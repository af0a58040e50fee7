//! Expected cost of a split, estimated from surface areas (MacDonald, Booth, *Heuristics for ray tracing
//! using space subdivision*, 1990). Evaluates four planes at a time.

use crate::accel::reference::SimdBounds;
use crate::math::{Vec3, Vec4};

/// Cost of a traversal step relative to a triangle test.
const TRAVERSAL_COST: f32 = 1.0;

/// Cost factor for a split that cuts off empty space.
const EMPTY_FACTOR: f32 = 0.8;

/// Leaf tag, stored in place of an axis.
const LEAF: usize = 3;

/// Tag bit above the axis. Set if triangles in the plane go to the right.
const PLANAR_RIGHT: usize = 4;

/// A splitting plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitPlane {
    pub axis: usize,
    pub at: f32,
    /// Whether triangles in the plane go to the right.
    pub planar_right: bool,
}

/// 4·`N` planes perpendicular to one axis, and the triangle counts on both sides of each plane. Triangles on
/// both sides are counted twice.
#[derive(Clone, Copy)]
pub struct PlanesWithTriangleCounts<const N: usize> {
    pub at: [Vec4; N],
    pub left: [Vec4; N],
    pub right: [Vec4; N],
}

/// Searches the planes of a cell, 4·`N` at a time. Each lane keeps its cheapest plane.
pub struct PlaneSearch<const N: usize> {
    min: [f32; 4],
    max: [f32; 4],
    /// Edge lengths of the cell. Flat cells are slightly thickened, so that even cells without area can be
    /// split.
    extent: [f32; 3],
    inverse_area: f32,
    cost: [Vec4; N],
    at: [Vec4; N],
    /// Axis or [`LEAF`], combined with [`PLANAR_RIGHT`]. Stored as floats because selection works on floats.
    tag: [Vec4; N],
}

impl<const N: usize> PlaneSearch<N> {
    /// Starts a search for a plane that is cheaper than a leaf with `count` triangles.
    #[inline(always)]
    pub fn new(cell: &SimdBounds, count: usize) -> Self {
        let extent = cell.extent().truncate();
        let extent = extent.max(Vec3::splat(extent.max_element() * 1e-4)).to_array();
        let [x, y, z] = extent;
        Self {
            min: cell.min.to_array(),
            max: cell.max_corner().to_array(),
            extent,
            inverse_area: 1.0 / (x * y + y * z + z * x),
            cost: [Vec4::splat(count as f32); N],
            at: [Vec4::ZERO; N],
            tag: [Vec4::splat(LEAF as f32); N],
        }
    }

    /// Adds candidate planes. Planes outside the cell are ignored.
    #[inline(always)]
    pub fn add_planes(&mut self, axis: usize, planar_right: bool, planes: &PlanesWithTriangleCounts<N>) {
        let (u, v) = (self.extent[(axis + 1) % 3], self.extent[(axis + 2) % 3]);
        // Area of the plane within the cell and area per unit length along the axis, both relative to the
        // cell's area.
        let face = Vec4::splat(u * v * self.inverse_area);
        let per_length = Vec4::splat((u + v) * self.inverse_area);
        let (min, max) = (Vec4::splat(self.min[axis]), Vec4::splat(self.max[axis]));
        let tag = Vec4::splat((axis + if planar_right { PLANAR_RIGHT } else { 0 }) as f32);
        for i in 0..N {
            let (at, left, right) = (planes.at[i], planes.left[i], planes.right[i]);
            let below = (face + (at - min) * per_length) * left;
            let above = (face + (max - at) * per_length) * right;
            let is_empty = left.min(right).cmpeq(Vec4::ZERO);
            let factor = Vec4::select(is_empty, Vec4::splat(EMPTY_FACTOR), Vec4::ONE);
            let cost = factor * (Vec4::splat(TRAVERSAL_COST) + below + above);
            self.update_lanes(i, Vec4::select(at.cmpgt(min) & at.cmplt(max), cost, Vec4::INFINITY), at, tag);
        }
    }

    /// Updates the lanes whose plane is cheaper than their best plane so far.
    #[inline(always)]
    fn update_lanes(&mut self, i: usize, cost: Vec4, at: Vec4, tag: Vec4) {
        let is_cheaper = cost.cmplt(self.cost[i]);
        self.cost[i] = Vec4::select(is_cheaper, cost, self.cost[i]);
        self.at[i] = Vec4::select(is_cheaper, at, self.at[i]);
        self.tag[i] = Vec4::select(is_cheaper, tag, self.tag[i]);
    }

    /// Returns the cheapest plane, or `None` if a leaf is no more expensive.
    #[inline(always)]
    pub fn cheapest(mut self) -> Option<SplitPlane> {
        for i in 1..N {
            let (cost, at, tag) = (self.cost[i], self.at[i], self.tag[i]);
            self.update_lanes(0, cost, at, tag);
        }
        let cost = self.cost[0].to_array();
        let lane = (1..4).fold(0, |best, lane| if cost[lane] < cost[best] { lane } else { best });
        let tag = self.tag[0].to_array()[lane] as usize;
        let (axis, planar_right) = (tag % PLANAR_RIGHT, tag >= PLANAR_RIGHT);
        (axis != LEAF).then_some(SplitPlane { axis, at: self.at[0].to_array()[lane], planar_right })
    }
}
