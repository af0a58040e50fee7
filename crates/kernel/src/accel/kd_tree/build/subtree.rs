//! Subtrees built by a single thread.

use super::Cell;
use super::partition::PartitionBuffers;
use crate::accel::kd_tree::node::{DecodedNode, PackedKdNode};
use crate::accel::reference::TriangleReference;
use crate::control::{CancelToken, Canceled};
use crate::math::Vec3;

/// Nodes and references, with indices relative to the subtree.
#[derive(Default)]
pub struct KdSubtree {
    pub nodes: Vec<PackedKdNode>,
    pub ids: Vec<u32>,
}

impl KdSubtree {
    /// Builds the subtree for a cell and its references.
    ///
    /// # Errors
    /// [`Canceled`] if the build was canceled.
    pub fn build(
        cell: &Cell,
        references: Vec<TriangleReference>,
        corners: &impl Fn(u32) -> [Vec3; 3],
        token: &CancelToken,
    ) -> Result<Self, Canceled> {
        let mut builder = KdSubtreeBuilder {
            built: Self::default(),
            references,
            scratch: PartitionBuffers::default(),
            corners,
            token,
        };
        builder.build_cell(0, cell)?;
        Ok(builder.built)
    }
}

/// Builds a subtree, reusing the same buffers for all cells.
struct KdSubtreeBuilder<'a, C> {
    built: KdSubtree,
    /// References for all pending cells. Those for the next cell are at the end.
    references: Vec<TriangleReference>,
    scratch: PartitionBuffers,
    corners: &'a C,
    token: &'a CancelToken,
}

impl<C: Fn(u32) -> [Vec3; 3]> KdSubtreeBuilder<'_, C> {
    /// Builds the nodes for a cell and removes the cell's references, which begin at `first`. The recursion
    /// depth is limited by the tree depth.
    fn build_cell(&mut self, first: usize, cell: &Cell) -> Result<(), Canceled> {
        let place = self.built.nodes.len();
        let own = &self.references[first..];
        let leaf = DecodedNode::Leaf { first: self.built.ids.len() as u32, count: own.len() as u32 };
        self.built.nodes.push(PackedKdNode::new(leaf));
        let Some(plane) = cell.choose_split(own) else {
            self.built.ids.extend(own.iter().map(TriangleReference::id));
            self.references.truncate(first);
            return Ok(());
        };
        if own.len() > MIN_POLLED_REFERENCES {
            self.token.check_pause_and_cancel()?;
        }
        let left = self.scratch.partition_references(&mut self.references, first, &plane, self.corners);
        let middle = self.references.len();
        let [left_cell, right_cell] = cell.halves(&plane, [left.len(), middle - first]);
        self.references.extend_from_slice(left);
        self.build_cell(middle, &left_cell)?;
        let right = self.built.nodes.len() as u32;
        self.built.nodes[place] =
            PackedKdNode::new(DecodedNode::Inner { axis: plane.axis, at: plane.at, right });
        self.build_cell(first, &right_cell)
    }
}

/// Number of references above which splitting a cell polls the cancellation token.
const MIN_POLLED_REFERENCES: usize = 256;
