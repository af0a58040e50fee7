//! Joins the parts of a wide BVH.

use rayon::prelude::*;

use super::TreePart;
use super::subtree::{Pack, WideSubtree};
use crate::accel::reference::Bounds;
use crate::accel::wide_bvh::node::{Child, WIDTH, WideNode};
use crate::accel::wide_bvh::simd::pages;

/// Joins all nodes (root first) and the contents of all packs.
pub fn join(root: TreePart) -> (Vec<WideNode>, Vec<Pack>) {
    let mut top = Top::default();
    match root {
        TreePart::Built(subtree) if matches!(subtree.root, Child::Inner(0)) => top.subtrees.push(subtree),
        root => {
            let bounds = root.bounds();
            top.node(bounds, root);
        }
    }
    top.finish()
}

impl TreePart {
    fn bounds(&self) -> Bounds {
        match self {
            Self::Built(subtree) => subtree.bounds,
            Self::Halves(halves) => {
                let mut bounds = halves[0].0;
                bounds.grow(&halves[1].0);
                bounds
            }
        }
    }
}

/// A child of a node above the subtrees.
#[derive(Clone, Copy)]
enum Below {
    Top(usize),
    Subtree(usize),
}

/// The nodes above the subtrees.
#[derive(Default)]
struct Top {
    nodes: Vec<Vec<(Bounds, Below)>>,
    subtrees: Vec<WideSubtree>,
}

impl Top {
    /// Creates the node of a part and all nodes below it. Returns its index.
    fn node(&mut self, bounds: Bounds, part: TreePart) -> usize {
        let place = self.nodes.len();
        self.nodes.push(Vec::new());
        let mut children = vec![(bounds, part)];
        while children.len() < WIDTH {
            let inner =
                children.iter().enumerate().filter(|(_, (_, part))| matches!(part, TreePart::Halves(_)));
            let largest = inner.max_by(|a, b| a.1.0.half_area().total_cmp(&b.1.0.half_area()));
            let Some(slot) = largest.map(|(slot, _)| slot) else { break };
            if let (_, TreePart::Halves(halves)) = children.swap_remove(slot) {
                children.extend(*halves);
            }
        }
        for (bounds, part) in children {
            let below = match part {
                TreePart::Built(subtree) => {
                    self.subtrees.push(subtree);
                    Below::Subtree(self.subtrees.len() - 1)
                }
                halves @ TreePart::Halves(_) => Below::Top(self.node(bounds, halves)),
            };
            self.nodes[place].push((bounds, below));
        }
        place
    }

    fn finish(self) -> (Vec<WideNode>, Vec<Pack>) {
        let starts = self.starts();
        let nodes_of_top: Vec<WideNode> =
            self.nodes.iter().map(|children| self.top_node(children, &starts)).collect();
        let total = starts.last().map_or(0, |end| end.node);
        let mut nodes = pages::large(total as usize);
        let node = |place: u32| match nodes_of_top.get(place as usize) {
            Some(node) => *node,
            None => {
                let subtree = starts.partition_point(|start| start.node <= place) - 1;
                let start = &starts[subtree];
                start.moved(&self.subtrees[subtree].nodes[(place - start.node) as usize])
            }
        };
        (0..total).into_par_iter().map(node).collect_into_vec(&mut nodes);
        (nodes, self.subtrees.iter().flat_map(|subtree| subtree.packs.iter().copied()).collect())
    }

    /// Start of each subtree, followed by the end of the last one.
    fn starts(&self) -> Vec<SubtreeStart> {
        let mut start = SubtreeStart { node: self.nodes.len() as u32, pack: 0 };
        let mut starts = vec![start];
        for subtree in &self.subtrees {
            start.node += subtree.nodes.len() as u32;
            start.pack += subtree.packs.len() as u32;
            starts.push(start);
        }
        starts
    }

    fn top_node(&self, children: &[(Bounds, Below)], starts: &[SubtreeStart]) -> WideNode {
        let mut node = WideNode::EMPTY;
        for (slot, &(bounds, below)) in children.iter().enumerate() {
            let child = match below {
                Below::Top(place) => Child::Inner(place as u32),
                Below::Subtree(subtree) => starts[subtree].moved_child(self.subtrees[subtree].root),
            };
            node.set(slot, bounds.aabb(), child);
        }
        node
    }
}

/// Indices of a subtree's first node and pack.
#[derive(Clone, Copy)]
struct SubtreeStart {
    node: u32,
    pack: u32,
}

impl SubtreeStart {
    fn moved_child(&self, child: Child) -> Child {
        match child {
            Child::Inner(node) => Child::Inner(node + self.node),
            Child::Leaf { first, count } => Child::Leaf { first: first + self.pack, count },
        }
    }

    fn moved(&self, node: &WideNode) -> WideNode {
        let mut moved = *node;
        for slot in 0..WIDTH {
            if node.bounds(slot).is_some() {
                moved.set_child(slot, self.moved_child(node.child(slot)));
            }
        }
        moved
    }
}
