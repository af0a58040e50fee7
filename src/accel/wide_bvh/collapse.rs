//! From a binary tree to a wide one.

use super::node::{Child, Node, PACK, TrianglePack, WIDTH};
use crate::accel::bvh::{Bvh, Subtree};
use crate::math::Vec3;

/// Open the child with the largest box until eight are there (Wald, Benthin, Boulos, *Getting Rid of Packets*, 2008).
pub fn collapse(tree: &Bvh, corners: impl Fn(u32) -> [Vec3; 3]) -> (Vec<Node>, Vec<TrianglePack>) {
    let mut collapsing = Collapsing { tree, corners, nodes: Vec::new(), packs: Vec::new() };
    if let Some(root) = tree.root() {
        collapsing.nodes.reserve(tree.node_count() / 3 + 1);
        collapsing.packs.reserve(tree.order().len() / 3 + 1);
        collapsing.node(root);
    }
    (collapsing.nodes, collapsing.packs)
}

struct Collapsing<'a, F> {
    tree: &'a Bvh,
    corners: F,
    nodes: Vec<Node>,
    packs: Vec<TrianglePack>,
}

impl<F: Fn(u32) -> [Vec3; 3]> Collapsing<'_, F> {
    /// Write the node over a subtree and all below; returns its place.
    fn node(&mut self, root: Subtree) -> u32 {
        let place = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        for (slot, subtree) in widest(self.tree, root).into_iter().flatten().enumerate() {
            let child = match self.tree.ids(&subtree) {
                Some(ids) => self.leaf(ids),
                None => Child::Inner(self.node(subtree)),
            };
            self.nodes[place].set(slot, subtree.bounds, child);
        }
        place as u32
    }

    fn leaf(&mut self, ids: &[u32]) -> Child {
        let first = self.packs.len() as u32;
        for four in ids.chunks(PACK) {
            self.packs.push(TrianglePack::new(four.iter().map(|&id| (id, (self.corners)(id)))));
        }
        Child::Leaf { first, count: self.packs.len() as u32 - first }
    }
}

/// At most eight subtrees that make up one.
fn widest(tree: &Bvh, root: Subtree) -> [Option<Subtree>; WIDTH] {
    let mut slots = [None; WIDTH];
    slots[0] = Some(root);
    let mut count = 1;
    while count < WIDTH {
        let inner = slots[..count].iter().enumerate().filter_map(|(slot, subtree)| {
            let subtree = subtree.as_ref()?;
            tree.children(subtree).map(|children| (slot, subtree.bounds.half_area(), children))
        });
        let Some((slot, _, (left, right))) = inner.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        slots[slot] = Some(left);
        slots[count] = right;
        count += usize::from(right.is_some());
    }
    slots
}
