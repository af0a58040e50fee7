//! Joins the parts of a kd-tree in parallel.

use rayon::prelude::*;

use super::cost::SplitPlane;
use super::subtree::KdSubtree;
use crate::accel::kd_tree::node::{DecodedNode, PackedKdNode};
use crate::accel::wide_bvh::pages;

/// A part of the kd-tree: an upper node or a subtree.
pub enum TreePart {
    /// A plane, and the parts below and above it.
    Halves { plane: SplitPlane, size: SubtreeSize, halves: Box<[TreePart; 2]> },
    /// A subtree built by a single thread.
    Built(KdSubtree),
}

/// Number of nodes and triangle references in a subtree.
#[derive(Clone, Copy)]
pub struct SubtreeSize {
    nodes: usize,
    ids: usize,
}

impl TreePart {
    /// Creates an upper node from its plane and its two parts.
    pub fn from_halves(plane: SplitPlane, halves: [Self; 2]) -> Self {
        let [left, right] = halves.each_ref().map(Self::size);
        let size = SubtreeSize { nodes: 1 + left.nodes + right.nodes, ids: left.ids + right.ids };
        Self::Halves { plane, size, halves: Box::new(halves) }
    }

    fn size(&self) -> SubtreeSize {
        match self {
            Self::Built(subtree) => SubtreeSize { nodes: subtree.nodes.len(), ids: subtree.ids.len() },
            Self::Halves { size, .. } => *size,
        }
    }

    /// Joins all parts into one subtree. Nodes precede their children, and left children precede right
    /// children.
    pub fn flatten(self) -> KdSubtree {
        let size = self.size();
        let mut all = KdSubtree {
            nodes: pages::allocate_vec_in_huge_pages(size.nodes),
            ids: pages::allocate_vec_in_huge_pages(size.ids),
        };
        let nothing = PackedKdNode::new(DecodedNode::Leaf { first: 0, count: 0 });
        rayon::join(
            || (0..size.nodes).into_par_iter().map(|_| nothing).collect_into_vec(&mut all.nodes),
            || (0..size.ids).into_par_iter().map(|_| 0).collect_into_vec(&mut all.ids),
        );
        self.flatten_into(&mut all.nodes, &mut all.ids, SubtreeSize { nodes: 0, ids: 0 });
        all
    }

    /// Writes the part, given the numbers of nodes and references that precede it.
    fn flatten_into(self, nodes: &mut [PackedKdNode], ids: &mut [u32], before: SubtreeSize) {
        match self {
            Self::Built(subtree) => {
                for (node, own) in nodes.iter_mut().zip(&subtree.nodes) {
                    *node = own.offset_indices(before.nodes as u32, before.ids as u32);
                }
                ids.copy_from_slice(&subtree.ids);
            }
            Self::Halves { plane, halves, .. } => {
                let [left, right] = *halves;
                let size = left.size();
                let (node, nodes) = nodes.split_at_mut(1);
                let (left_nodes, right_nodes) = nodes.split_at_mut(size.nodes);
                let (left_ids, right_ids) = ids.split_at_mut(size.ids);
                let before_left = SubtreeSize { nodes: before.nodes + 1, ..before };
                let before_right =
                    SubtreeSize { nodes: before_left.nodes + size.nodes, ids: before.ids + size.ids };
                let right_place = before_right.nodes as u32;
                node[0] = PackedKdNode::new(DecodedNode::Inner {
                    axis: plane.axis,
                    at: plane.at,
                    right: right_place,
                });
                rayon::join(
                    || left.flatten_into(left_nodes, left_ids, before_left),
                    || right.flatten_into(right_nodes, right_ids, before_right),
                );
            }
        }
    }
}
