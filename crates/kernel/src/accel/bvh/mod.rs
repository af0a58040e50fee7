//! A binary bounding volume hierarchy built with the binned surface area heuristic.

mod build;
mod packet;
mod shell;
mod top_node;
mod traverse;

use crate::geometry::Aabb;

pub use packet::{AnyHitCallback, ClosestHitCallback};
pub use shell::{PrimitiveOrSubtreeAroundBox, SphericalShell};
use top_node::WideTopNode;

/// Maximum number of primitives in a leaf chosen by the surface area heuristic.
const LEAF_SIZE: usize = 4;

/// Number of levels split with the surface area heuristic. Deeper nodes are split at the median, which limits
/// the depth for any input.
const SURFACE_AREA_LEVELS: usize = 56;

/// Stack size for the deepest possible tree: [`SURFACE_AREA_LEVELS`] levels, then median splits of up to 2³²
/// primitives.
const DEEP_STACK: usize = SURFACE_AREA_LEVELS + 34;

/// Stack size for small trees, for which initializing a deep stack would take longer than the traversal
/// itself.
const SHALLOW_STACK: usize = 12;

/// A binary BVH over boxes identified by index.
#[derive(Clone, Debug)]
pub struct Bvh {
    /// Nodes, starting with the root. Empty if there are no boxes.
    nodes: Vec<BinaryNode>,
    /// Box ids in leaf order.
    order: Vec<u32>,
    bounds: Aabb,
    /// Number of node levels.
    depth: usize,
    /// The upper levels of the tree, flattened for packet traversal.
    top: WideTopNode,
    /// Whether any large node was split by the size of its boxes, because large boxes contain small ones.
    is_nested: bool,
    /// The shells of each node's children. `None` if few boxes are nested.
    shells: Option<Box<[[SphericalShell; 2]]>>,
}

/// Two children and their boxes, which fit into one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct BinaryNode {
    bounds: [Aabb; 2],
    child: [ChildRef; 2],
}

impl BinaryNode {
    /// A node without children.
    const EMPTY: Self = Self { bounds: [Aabb::EMPTY; 2], child: [ChildRef::NONE; 2] };
}

/// An inner node, or a leaf with `count` > 0 entries of [`Bvh::order`] starting at `first`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ChildRef {
    first: u32,
    count: u32,
}

impl ChildRef {
    const NONE: Self = Self { first: 0, count: 0 };
}

impl Bvh {
    /// Memory used by the tree, in bytes.
    pub fn memory_bytes(&self) -> usize {
        let shells = self.shells.as_deref().map_or(0, size_of_val);
        size_of_val(self.nodes.as_slice()) + size_of_val(self.order.as_slice()) + shells
    }

    /// Checks that every box contains its subtree and that every id occurs exactly once.
    ///
    /// # Errors
    /// A description of the first error found.
    pub fn validate(&self, boxes: &[Aabb]) -> Result<(), String> {
        let mut seen = vec![false; boxes.len()];
        let mut pending: Vec<(u32, Aabb)> =
            if self.nodes.is_empty() { Vec::new() } else { vec![(0, self.bounds)] };
        while let Some((index, outer)) = pending.pop() {
            let node = &self.nodes[index as usize];
            for (child, bounds) in node.child.iter().zip(node.bounds) {
                if bounds.is_empty() {
                    continue;
                }
                if bounds.union(outer) != outer {
                    return Err(format!("a child of node {index} is larger than the node"));
                }
                if child.count == 0 {
                    pending.push((child.first, bounds));
                    continue;
                }
                let range = child.first as usize..(child.first + child.count) as usize;
                for &id in &self.order[range] {
                    let own = boxes[id as usize];
                    if own.union(bounds) != bounds {
                        return Err(format!("box {id} extends outside its leaf"));
                    }
                    if std::mem::replace(&mut seen[id as usize], true) {
                        return Err(format!("box {id} is in two leaves"));
                    }
                }
            }
        }
        match seen.iter().position(|seen| !seen) {
            Some(id) if !boxes[id].is_empty() => Err(format!("box {id} is not in any leaf")),
            _ => Ok(()),
        }
    }
}
