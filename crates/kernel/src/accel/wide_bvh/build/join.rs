//! Joins the parts of a wide BVH.

use rayon::prelude::*;

use super::Part;
use super::subtree::{Pack, Subtree};
use crate::accel::reference::Bounds;
use crate::accel::wide_bvh::node::{Child, Node, WIDTH};
use crate::accel::wide_bvh::simd::pages;

/// Joins all nodes, root first, and the contents of all packs.
pub fn join(root: Part) -> (Vec<Node>, Vec<Pack>) {
    let mut top = Top::default();
    match root {
        Part::Built(subtree) if matches!(subtree.root, Child::Inner(0)) => top.subtrees.push(subtree),
        root => {
            let bounds = root.bounds();
            top.node(bounds, root);
        }
    }
    top.finish()
}

impl Part {
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
    subtrees: Vec<Subtree>,
}

impl Top {
    /// Creates the node over a part and everything below it, and returns its index.
    fn node(&mut self, bounds: Bounds, part: Part) -> usize {
        let place = self.nodes.len();
        self.nodes.push(Vec::new());
        let mut children = vec![(bounds, part)];
        while children.len() < WIDTH {
            let inner = children.iter().enumerate().filter(|(_, (_, part))| matches!(part, Part::Halves(_)));
            let largest = inner.max_by(|a, b| a.1.0.half_area().total_cmp(&b.1.0.half_area()));
            let Some(slot) = largest.map(|(slot, _)| slot) else { break };
            if let (_, Part::Halves(halves)) = children.swap_remove(slot) {
                children.extend(*halves);
            }
        }
        for (bounds, part) in children {
            let below = match part {
                Part::Built(subtree) => {
                    self.subtrees.push(subtree);
                    Below::Subtree(self.subtrees.len() - 1)
                }
                halves @ Part::Halves(_) => Below::Top(self.node(bounds, halves)),
            };
            self.nodes[place].push((bounds, below));
        }
        place
    }

    fn finish(self) -> (Vec<Node>, Vec<Pack>) {
        let starts = self.starts();
        let nodes_of_top: Vec<Node> =
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

    /// Starts of all subtrees, followed by the end of the last one.
    fn starts(&self) -> Vec<Start> {
        let mut start = Start { node: self.nodes.len() as u32, pack: 0 };
        let mut starts = vec![start];
        for subtree in &self.subtrees {
            start.node += subtree.nodes.len() as u32;
            start.pack += subtree.packs.len() as u32;
            starts.push(start);
        }
        starts
    }

    fn top_node(&self, children: &[(Bounds, Below)], starts: &[Start]) -> Node {
        let mut node = Node::EMPTY;
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
struct Start {
    node: u32,
    pack: u32,
}

impl Start {
    fn moved_child(&self, child: Child) -> Child {
        match child {
            Child::Inner(node) => Child::Inner(node + self.node),
            Child::Leaf { first, count } => Child::Leaf { first: first + self.pack, count },
        }
    }

    fn moved(&self, node: &Node) -> Node {
        let mut moved = *node;
        for slot in 0..WIDTH {
            if node.bounds(slot).is_some() {
                moved.set_child(slot, self.moved_child(node.child(slot)));
            }
        }
        moved
    }
}
