//! What one thread builds.

use super::Cell;
use crate::accel::kd_tree::node::{Kind, Node};
use crate::math::Vec3;

/// Nodes and numbers of triangles, counted from its own first.
#[derive(Default)]
pub struct Subtree {
    pub nodes: Vec<Node>,
    pub ids: Vec<u32>,
}

impl Subtree {
    /// Of a cell and all in it.
    pub fn build(cell: Cell, corners: &impl Fn(u32) -> [Vec3; 3]) -> Self {
        let mut own = Self::default();
        own.add(cell, corners);
        own
    }

    /// Recursion is as deep as the tree, which is limited.
    fn add(&mut self, cell: Cell, corners: &impl Fn(u32) -> [Vec3; 3]) {
        let place = self.nodes.len();
        let first = self.ids.len() as u32;
        self.nodes.push(Node::new(Kind::Leaf { first, count: cell.references.len() as u32 }));
        let Some(plane) = cell.plane() else {
            self.ids.extend(cell.references.iter().map(super::Reference::id));
            return;
        };
        let [left, right] = cell.split(&plane, corners);
        self.add(left, corners);
        let right_place = self.nodes.len() as u32;
        self.nodes[place] = Node::new(Kind::Inner { axis: plane.axis, at: plane.at, right: right_place });
        self.add(right, corners);
    }

    /// Put another behind.
    pub fn append(&mut self, other: &Self) {
        let (nodes, ids) = (self.nodes.len() as u32, self.ids.len() as u32);
        self.nodes.extend(other.nodes.iter().map(|node| node.moved(nodes, ids)));
        self.ids.extend_from_slice(&other.ids);
    }
}
