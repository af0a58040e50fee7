//! Joins the parts of a wide BVH.

use rayon::prelude::*;

use super::TreePart;
use super::subtree::{PackReferenceRange, WideSubtree};
use crate::accel::reference::SimdBounds;
use crate::accel::wide_bvh::node::{Child, WIDTH, WideNode};
use crate::accel::wide_bvh::simd::pages;

/// Joins all parts into one list of nodes, starting with the root, and one list of packs.
pub fn flatten(root: TreePart) -> (Vec<WideNode>, Vec<PackReferenceRange>) {
    let mut top = UpperNodes::default();
    match root {
        TreePart::Built(subtree) if matches!(subtree.root, Child::Inner(0)) => {
            top.subtrees.push(subtree);
        }
        root => {
            let bounds = root.bounds();
            top.add_nodes_for_part(bounds, root);
        }
    }
    top.into_nodes_and_packs()
}

impl TreePart {
    fn bounds(&self) -> SimdBounds {
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
enum UpperChild {
    UpperNode(usize),
    Subtree(usize),
}

/// The nodes above the subtrees.
#[derive(Default)]
struct UpperNodes {
    nodes: Vec<Vec<(SimdBounds, UpperChild)>>,
    subtrees: Vec<WideSubtree>,
}

impl UpperNodes {
    /// Creates the node for a part and all nodes below it, and returns the node's index.
    fn add_nodes_for_part(&mut self, bounds: SimdBounds, part: TreePart) -> usize {
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
                    UpperChild::Subtree(self.subtrees.len() - 1)
                }
                halves @ TreePart::Halves(_) => {
                    UpperChild::UpperNode(self.add_nodes_for_part(bounds, halves))
                }
            };
            self.nodes[place].push((bounds, below));
        }
        place
    }

    fn into_nodes_and_packs(self) -> (Vec<WideNode>, Vec<PackReferenceRange>) {
        let starts = self.subtree_starts();
        let nodes_of_top: Vec<WideNode> =
            self.nodes.iter().map(|children| self.build_wide_node(children, &starts)).collect();
        let total = starts.last().map_or(0, |end| end.node);
        let mut nodes = pages::allocate_vec_in_huge_pages(total as usize);
        let node = |place: u32| match nodes_of_top.get(place as usize) {
            Some(node) => *node,
            None => {
                let subtree = starts.partition_point(|start| start.node <= place) - 1;
                let start = &starts[subtree];
                start.with_offset_children(&self.subtrees[subtree].nodes[(place - start.node) as usize])
            }
        };
        (0..total).into_par_iter().map(node).collect_into_vec(&mut nodes);
        (nodes, self.subtrees.iter().flat_map(|subtree| subtree.packs.iter().copied()).collect())
    }

    /// Start position of each subtree, followed by the end of the last subtree.
    fn subtree_starts(&self) -> Vec<SubtreeStart> {
        let mut start = SubtreeStart { node: self.nodes.len() as u32, pack: 0 };
        let mut starts = vec![start];
        for subtree in &self.subtrees {
            start.node += subtree.nodes.len() as u32;
            start.pack += subtree.packs.len() as u32;
            starts.push(start);
        }
        starts
    }

    fn build_wide_node(&self, children: &[(SimdBounds, UpperChild)], starts: &[SubtreeStart]) -> WideNode {
        let mut node = WideNode::EMPTY;
        for (slot, &(bounds, below)) in children.iter().enumerate() {
            let child = match below {
                UpperChild::UpperNode(place) => Child::Inner(place as u32),
                UpperChild::Subtree(subtree) => starts[subtree].offset_child(self.subtrees[subtree].root),
            };
            node.set_child(slot, bounds.aabb(), child);
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
    fn offset_child(&self, child: Child) -> Child {
        match child {
            Child::Inner(node) => Child::Inner(node + self.node),
            Child::Leaf { first, count } => Child::Leaf { first: first + self.pack, count },
        }
    }

    fn with_offset_children(&self, node: &WideNode) -> WideNode {
        let mut moved = *node;
        for slot in 0..WIDTH {
            if node.child_bounds(slot).is_some() {
                moved.set_child_reference(slot, self.offset_child(node.child(slot)));
            }
        }
        moved
    }
}
