//! Nodes of eight bytes and the triangles that leaves name.

use crate::math::Vec3;

/// A leaf, where the axis of an inner node is.
const LEAF: u32 = 3;

/// Greatest number that fits beside the axis.
pub const MOST: u32 = u32::MAX >> 2;

/// An inner node's left child is the next node.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Of an inner node the bits of the plane's place, of a leaf its first reference.
    payload: u32,
    /// Axis or [`LEAF`] in the two low bits; above them the right child or how many references.
    tag: u32,
}

/// A node, told apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Split by a plane.
    Inner {
        /// What the plane is across.
        axis: usize,
        /// Where.
        at: f32,
        /// The child above the plane.
        right: u32,
    },
    /// References to triangles.
    Leaf {
        /// The first.
        first: u32,
        /// How many.
        count: u32,
    },
}

impl Node {
    /// From what it is.
    pub fn new(kind: Kind) -> Self {
        match kind {
            Kind::Inner { axis, at, right } => {
                debug_assert!(axis < 3 && right <= MOST);
                Self { payload: at.to_bits(), tag: right << 2 | axis as u32 }
            }
            Kind::Leaf { first, count } => {
                debug_assert!(count <= MOST);
                Self { payload: first, tag: count << 2 | LEAF }
            }
        }
    }

    /// What it is.
    #[inline(always)]
    pub fn kind(self) -> Kind {
        let (low, high) = (self.tag & 3, self.tag >> 2);
        if low == LEAF {
            Kind::Leaf { first: self.payload, count: high }
        } else {
            Kind::Inner { axis: low as usize, at: f32::from_bits(self.payload), right: high }
        }
    }

    /// The same where nodes and references stand behind so many others.
    pub fn moved(self, nodes: u32, references: u32) -> Self {
        Self::new(match self.kind() {
            Kind::Inner { axis, at, right } => Kind::Inner { axis, at, right: right + nodes },
            Kind::Leaf { first, count } => Kind::Leaf { first: first + references, count },
        })
    }
}

/// A triangle with its number in the mesh.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    pub corners: [Vec3; 3],
    pub id: u32,
}
