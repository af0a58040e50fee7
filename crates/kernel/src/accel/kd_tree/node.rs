//! Kd-tree nodes of eight bytes, and the triangles in the leaves.

use crate::math::Vec3;

/// Tag of a leaf, stored in place of an inner node's axis.
const LEAF: u32 = 3;

/// Largest child index or reference count that fits into `PackedKdNode::tag`.
pub const MAX_PAYLOAD: u32 = u32::MAX >> 2;

/// An encoded node. The left child of an inner node is the next node.
#[derive(Clone, Copy, Debug)]
pub struct PackedKdNode {
    /// Inner node: bits of the plane's coordinate. Leaf: index of the first reference.
    payload: u32,
    /// The two low bits contain the axis or [`LEAF`]. The others contain the right child or the number of
    /// references.
    tag: u32,
}

/// A decoded node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DecodedNode {
    /// An inner node, split by a plane.
    Inner {
        /// Axis of the plane's normal.
        axis: usize,
        /// Coordinate of the plane.
        at: f32,
        /// Index of the child above the plane.
        right: u32,
    },
    /// A leaf with references to triangles.
    Leaf {
        /// Index of the first reference.
        first: u32,
        /// Number of references.
        count: u32,
    },
}

impl PackedKdNode {
    /// Encodes a node.
    pub fn new(kind: DecodedNode) -> Self {
        match kind {
            DecodedNode::Inner { axis, at, right } => {
                debug_assert!(axis < 3 && right <= MAX_PAYLOAD);
                Self { payload: at.to_bits(), tag: right << 2 | axis as u32 }
            }
            DecodedNode::Leaf { first, count } => {
                debug_assert!(count <= MAX_PAYLOAD);
                Self { payload: first, tag: count << 2 | LEAF }
            }
        }
    }

    /// Decodes a node.
    #[inline(always)]
    pub fn decode(self) -> DecodedNode {
        let (low, high) = (self.tag & 3, self.tag >> 2);
        if low == LEAF {
            DecodedNode::Leaf { first: self.payload, count: high }
        } else {
            DecodedNode::Inner { axis: low as usize, at: f32::from_bits(self.payload), right: high }
        }
    }

    /// Offsets the node's indices by the number of nodes and the number of references that precede its
    /// subtree.
    pub fn offset_indices(self, nodes: u32, references: u32) -> Self {
        Self::new(match self.decode() {
            DecodedNode::Inner { axis, at, right } => DecodedNode::Inner { axis, at, right: right + nodes },
            DecodedNode::Leaf { first, count } => DecodedNode::Leaf { first: first + references, count },
        })
    }
}

/// A triangle and its index in the mesh.
#[derive(Clone, Copy, Debug)]
pub struct LeafTriangle {
    pub corners: [Vec3; 3],
    pub id: u32,
}
