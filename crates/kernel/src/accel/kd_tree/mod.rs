//! A kd-tree over triangles (J. L. Bentley, *Multidimensional binary search trees used for associative
//! searching*, 1975). Unlike a BVH, it partitions space, but it returns bit-identical hits.
//!
//! Planes are chosen with the surface area heuristic. A triangle that straddles a plane is in both children,
//! each time with the bounding box of its clipped part. Traversal never misses a leaf due to rounding. Among
//! hits at the same distance, the lowest index wins.

mod build;
mod node;
mod traverse;
mod validate;

use crate::accel::{RayBoxInterval, VisitedNode};
use crate::control::{CancelToken, Canceled};
use crate::geometry::{Aabb, Ray};
use crate::math::Vec3;

use node::{DecodedNode, LeafTriangle, PackedKdNode};

/// A kd-tree over triangles.
#[derive(Clone, Debug)]
pub struct KdTree {
    /// Nodes in depth-first order: the root is first, and a left child follows its parent. Empty if there are
    /// no triangles.
    nodes: Vec<PackedKdNode>,
    /// Indices into `triangles`, leaf by leaf.
    references: Vec<u32>,
    /// All triangles without duplicates, in the order in which the leaves first refer to them.
    triangles: Vec<LeafTriangle>,
    bounds: Aabb,
}

impl KdTree {
    /// Builds a tree over `count` indexed triangles. Triangles with NaN coordinates are never hit.
    ///
    /// # Errors
    /// [`Canceled`] if the build was canceled.
    pub fn from_triangles(
        count: u32,
        corners: impl Fn(u32) -> [Vec3; 3] + Sync,
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        let build::BuiltKdTree { nodes, references, triangles, bounds } =
            build::build(count, corners, token)?;
        Ok(Self { nodes, references, triangles, bounds })
    }

    /// Bounding box of all triangles.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Memory used by the tree, in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.references.as_slice())
            + size_of_val(self.triangles.as_slice())
    }

    /// Expected numbers of nodes (including leaves) and triangles that a random line through the bounding box
    /// visits, estimated from surface areas.
    pub fn expected_visits(&self) -> (f64, f64) {
        let whole = f64::from(self.bounds.half_area());
        let mut visits = (0.0, 0.0);
        self.visit_nodes_with_cells(|cell, kind| {
            let share = f64::from(cell.half_area()) / whole;
            visits.0 += share;
            if let DecodedNode::Leaf { count, .. } = kind {
                visits.1 += share * f64::from(count);
            }
        });
        visits
    }

    /// Visits every triangle that overlaps a box, and possibly some nearby ones. A triangle in several leaves
    /// may be visited repeatedly.
    pub fn visit_overlapping(&self, other: &Aabb, mut visit: impl FnMut(u32)) {
        self.visit_overlapping_while(other, |triangle| {
            visit(triangle);
            true
        });
    }

    /// Like [`KdTree::visit_overlapping`], but stops when `visit` returns false. Returns whether all
    /// triangles were visited.
    pub fn visit_overlapping_while(&self, other: &Aabb, mut visit: impl FnMut(u32) -> bool) -> bool {
        let mut pending = [0_u32; traverse::STACK_SIZE];
        let mut size = usize::from(!self.nodes.is_empty() && self.bounds.overlaps(other));
        while size > 0 {
            size -= 1;
            let mut place = pending[size];
            loop {
                match self.nodes[place as usize].decode() {
                    DecodedNode::Leaf { first, count } => {
                        let own = &self.references[first as usize..][..count as usize];
                        if !own.iter().all(|&own| visit(self.triangles[own as usize].id)) {
                            return false;
                        }
                        break;
                    }
                    DecodedNode::Inner { axis, at, right } if other.min[axis] > at => place = right,
                    DecodedNode::Inner { axis, at, .. } if other.max[axis] < at => place += 1,
                    DecodedNode::Inner { right, .. } => {
                        pending[size] = right;
                        size += 1;
                        place += 1;
                    }
                }
            }
        }
        true
    }

    /// Visits the nodes whose cells the ray hits, parents first, in an order that depends only on the tree.
    /// `visit` returns whether to descend.
    pub fn visit_nodes_hit_by_ray(
        &self,
        ray: &Ray,
        mut visit: impl FnMut(&VisitedNode, &RayBoxInterval) -> bool,
    ) {
        let mut pending = if self.nodes.is_empty() { Vec::new() } else { vec![(self.bounds, 0_u32, 0)] };
        while let Some((bounds, place, depth)) = pending.pop() {
            let Some(stretch) = RayBoxInterval::new(&bounds, ray) else { continue };
            let kind = self.nodes[place as usize].decode();
            let shapes = match kind {
                DecodedNode::Inner { .. } => 0,
                DecodedNode::Leaf { count, .. } => count,
            };
            if !visit(&VisitedNode { bounds, depth, shapes }, &stretch) {
                continue;
            }
            if let DecodedNode::Inner { axis, at, right } = kind {
                let [below, above] = split_box(bounds, axis, at);
                pending.extend([(above, right, depth + 1), (below, place + 1, depth + 1)]);
            }
        }
    }

    /// Visits every node with its cell, parents first.
    fn visit_nodes_with_cells(&self, mut visit: impl FnMut(Aabb, DecodedNode)) {
        let mut pending = if self.nodes.is_empty() { Vec::new() } else { vec![(0_u32, self.bounds)] };
        while let Some((place, cell)) = pending.pop() {
            let kind = self.nodes[place as usize].decode();
            visit(cell, kind);
            if let DecodedNode::Inner { axis, at, right } = kind {
                let [below, above] = split_box(cell, axis, at);
                pending.extend([(right, above), (place + 1, below)]);
            }
        }
    }
}

/// The parts of a box below and above a plane.
fn split_box(cell: Aabb, axis: usize, at: f32) -> [Aabb; 2] {
    let (mut below, mut above) = (cell, cell);
    below.max[axis] = at;
    above.min[axis] = at;
    [below, above]
}
