//! A binary bounding volume hierarchy, built by binned surface area.

mod build;
mod packet;
mod top_node;
mod traverse;

use crate::geometry::Aabb;

pub use packet::{AnyTest, ClosestTest};
use top_node::TopNode;

/// Most primitives in a leaf that the surface area heuristic may make.
const LEAF_SIZE: usize = 4;

/// Number of levels that the surface area heuristic splits. Deeper nodes are halved by number, so that no input makes a
/// deep tree.
const SURFACE_AREA_LEVELS: usize = 56;

/// Stack size for the deepest possible tree: the levels above and a halving of 2³² primitives.
const DEEP_STACK: usize = SURFACE_AREA_LEVELS + 34;

/// Stack size for small trees, whose traversal takes less time than clearing a deep stack.
const SHALLOW_STACK: usize = 12;

/// A tree over boxes, which an index names.
#[derive(Clone, Debug)]
pub struct Bvh {
    /// Nodes; the root is node 0. Empty if there are no boxes.
    nodes: Vec<Node>,
    /// Ids of the boxes, in the order of the leaves.
    order: Vec<u32>,
    bounds: Aabb,
    /// Number of levels of nodes.
    depth: usize,
    /// Start of the traversal by packets.
    top: TopNode,
}

/// Two children with their boxes, one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node {
    bounds: [Aabb; 2],
    child: [Child; 2],
}

impl Node {
    /// A node without children.
    const EMPTY: Self = Self { bounds: [Aabb::EMPTY; 2], child: [Child::NONE; 2] };
}

/// An inner node, or a leaf of `count` > 0 entries of [`Bvh::order`] from `first` on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Child {
    first: u32,
    count: u32,
}

impl Child {
    const NONE: Self = Self { first: 0, count: 0 };
}

impl Bvh {
    /// Bytes that the tree takes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.order.as_slice())
    }

    /// Walks the tree and reports faults: a box that does not contain its subtree, an id that occurs twice or not at
    /// all.
    ///
    /// # Errors
    /// The first fault, in words.
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
                        return Err(format!("box {id} reaches out of its leaf"));
                    }
                    if std::mem::replace(&mut seen[id as usize], true) {
                        return Err(format!("box {id} is in two leaves"));
                    }
                }
            }
        }
        match seen.iter().position(|seen| !seen) {
            Some(id) if !boxes[id].is_empty() => Err(format!("box {id} is in no leaf")),
            _ => Ok(()),
        }
    }
}
