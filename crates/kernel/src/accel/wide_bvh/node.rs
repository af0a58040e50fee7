//! Nodes and triangle packs, laid out for SIMD loads.

use crate::geometry::Aabb;
use crate::geometry::mesh::TriangleMesh;
use crate::math::Vec3;

/// Number of children per node.
pub const WIDTH: usize = 8;

/// Maximum number of triangles per pack.
pub const PACK: usize = 4;

/// Maximum number of packs per leaf.
pub const MAX_PACKS: u32 = 8;

/// Bit that marks a leaf in [`WideNode::children`]. The next three bits contain the number of packs minus
/// one. The remaining bits contain the index of the first pack.
const LEAF: u32 = 1 << 31;

const FIRST_BITS: u32 = 28;

/// Mask of an encoded leaf's bits, except those that contain the index of the first pack.
pub const LEAF_BITS: u32 = !((1 << FIRST_BITS) - 1);

/// A mesh has at most 1.3 references per triangle after splitting. Every pack and every node needs at least
/// one reference.
const _: () = assert!(TriangleMesh::MAX_TRIANGLES as u64 * 13 / 10 < 1 << FIRST_BITS);

/// Eight children and their boxes, stored as arrays of minimum and maximum coordinates.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub struct WideNode {
    /// Minimum x, maximum x, minimum y, maximum y, minimum z, and maximum z of each box. Empty boxes range
    /// from ∞ to −∞, and are never hit unless the arithmetic overflows.
    pub rows: [[f32; WIDTH]; 6],
    /// Encoded children; see [`Child`].
    pub children: [u32; WIDTH],
}

/// A decoded child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// Index of a node.
    Inner(u32),
    /// Packs of triangles.
    Leaf {
        /// Index of the first pack.
        first: u32,
        /// Number of packs.
        count: u32,
    },
}

impl Child {
    /// Decodes a child.
    #[inline(always)]
    pub fn decode(code: u32) -> Self {
        if code & LEAF == 0 {
            Self::Inner(code)
        } else {
            Self::Leaf { first: code & ((1 << FIRST_BITS) - 1), count: ((code & !LEAF) >> FIRST_BITS) + 1 }
        }
    }

    fn encode(self) -> u32 {
        match self {
            Self::Inner(node) => node,
            Self::Leaf { first, count } => {
                debug_assert!(count <= MAX_PACKS && first < 1 << FIRST_BITS);
                LEAF | (count - 1) << FIRST_BITS | first
            }
        }
    }
}

impl WideNode {
    /// A node with eight empty boxes. They refer to the first pack, so that traversal terminates even if the
    /// arithmetic overflows and a ray hits all boxes.
    pub const EMPTY: Self = {
        let (least, greatest) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self { rows: [least, greatest, least, greatest, least, greatest], children: [LEAF; WIDTH] }
    };

    /// Sets a slot's box and child.
    pub fn set_child(&mut self, slot: usize, bounds: Aabb, child: Child) {
        for axis in 0..3 {
            self.rows[2 * axis][slot] = bounds.min[axis];
            self.rows[2 * axis + 1][slot] = bounds.max[axis];
        }
        self.set_child_reference(slot, child);
    }

    /// Replaces a slot's child.
    pub fn set_child_reference(&mut self, slot: usize, child: Child) {
        self.children[slot] = child.encode();
    }

    /// Box of a slot, or `None` if the slot is empty.
    pub fn child_bounds(&self, slot: usize) -> Option<Aabb> {
        let corner = |side: usize| {
            Vec3::new(self.rows[side][slot], self.rows[2 + side][slot], self.rows[4 + side][slot])
        };
        Some(Aabb { min: corner(0), max: corner(1) }).filter(|bounds| !bounds.is_empty())
    }

    /// Mask of the slots whose boxes overlap `other`.
    #[inline]
    pub fn overlap_mask(&self, other: &Aabb) -> u32 {
        let mut overlaps = [true; WIDTH];
        for axis in 0..3 {
            let (least, greatest) = (&self.rows[2 * axis], &self.rows[2 * axis + 1]);
            for slot in 0..WIDTH {
                overlaps[slot] &= (least[slot] <= other.max[axis]) & (other.min[axis] <= greatest[slot]);
            }
        }
        (0..WIDTH).fold(0, |bits, slot| bits | u32::from(overlaps[slot]) << slot)
    }

    /// Child of a slot.
    pub fn child(&self, slot: usize) -> Child {
        Child::decode(self.children[slot])
    }
}

/// Up to four triangles. Unused lanes are NaN, which rays never hit.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub struct TrianglePack {
    /// x, y and z of the first corners, then of the second and third corners.
    pub rows: [[f32; PACK]; 9],
    /// Triangle indices, or `u32::MAX` in unused lanes.
    pub ids: [u32; PACK],
}

impl TrianglePack {
    /// Packs up to four triangles.
    pub fn new(triangles: impl IntoIterator<Item = (u32, [Vec3; 3])>) -> Self {
        let mut pack = Self { rows: [[f32::NAN; PACK]; 9], ids: [u32::MAX; PACK] };
        for (lane, (id, corners)) in triangles.into_iter().take(PACK).enumerate() {
            pack.ids[lane] = id;
            for (corner, point) in corners.iter().enumerate() {
                for axis in 0..3 {
                    pack.rows[3 * corner + axis][lane] = point[axis];
                }
            }
        }
        pack
    }

    /// Corners of the triangle in a lane.
    #[inline(always)]
    pub fn corners_at_lane(&self, lane: usize) -> [Vec3; 3] {
        [0, 3, 6]
            .map(|row| Vec3::new(self.rows[row][lane], self.rows[row + 1][lane], self.rows[row + 2][lane]))
    }

    /// Indices of the triangles in the pack.
    pub fn ids(&self) -> impl Iterator<Item = u32> {
        self.ids.into_iter().filter(|&id| id != u32::MAX)
    }
}
