//! A binary bounding volume hierarchy, built by binned surface area.

mod build;
mod crown;
mod packet;
mod traverse;

use crate::geometry::Aabb;

use crown::Crown;
pub use packet::{AnyTest, ClosestTest};

/// Most primitives in a leaf that the surface area heuristic may make.
const LEAF_SIZE: usize = 4;

/// Levels below which nodes are split in the middle of their primitives, so that no input makes a deep tree.
const SURFACE_AREA_LEVELS: usize = 56;

/// Room for the deepest tree there can be: the levels above and a halving of 2³² primitives.
const DEEP_STACK: usize = SURFACE_AREA_LEVELS + 34;

/// Room for small trees, whose traversal takes less time than clearing a deep stack.
const SHALLOW_STACK: usize = 12;

/// A tree over boxes that are known by their index.
#[derive(Clone, Debug)]
pub struct Bvh {
    /// The root is node 0; empty where there are no boxes.
    nodes: Vec<Node>,
    /// Ids of the boxes, in the order of the leaves.
    order: Vec<u32>,
    bounds: Aabb,
    /// Levels of nodes.
    depth: usize,
    /// Where packets start.
    crown: Crown,
}

/// Two children with their boxes, one cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node {
    bounds: [Aabb; 2],
    child: [Child; 2],
}

impl Node {
    /// No children.
    const EMPTY: Self = Self { bounds: [Aabb::EMPTY; 2], child: [Child::NONE; 2] };
}

/// An inner node, or `count` > 0 places of [`Bvh::order`] from `first` on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Child {
    first: u32,
    count: u32,
}

impl Child {
    const NONE: Self = Self { first: 0, count: 0 };
}

impl Bvh {
    /// Bytes held.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice()) + size_of_val(self.order.as_slice())
    }

    /// Walks the tree and says what is wrong with it: a box that does not hold what is below it, an id that is there
    /// twice or not at all.
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
