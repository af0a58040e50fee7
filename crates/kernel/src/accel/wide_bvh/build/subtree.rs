//! Subtrees built by a single thread.

use super::split::{ReferenceRangeWithSplit, partition};
use crate::accel::reference::{SimdBounds, TriangleReference};
use crate::accel::wide_bvh::node::{Child, PACK, WIDTH, WideNode};

/// A range of references that forms a triangle pack.
#[derive(Clone, Copy, Debug)]
pub struct PackReferenceRange {
    /// Index of the first reference among all references.
    pub first: u32,
    /// Number of references, from one to four.
    pub count: u32,
}

/// Nodes and packs, with indices relative to the subtree.
#[derive(Debug)]
pub struct WideSubtree {
    pub nodes: Vec<WideNode>,
    pub packs: Vec<PackReferenceRange>,
    pub root: Child,
    pub bounds: SimdBounds,
}

impl WideSubtree {
    /// Builds a subtree over `references`. `start` is the index of the first reference among all references.
    pub fn build(
        references: &mut [TriangleReference],
        start: usize,
        segment: ReferenceRangeWithSplit,
    ) -> Self {
        let mut own = Self {
            nodes: Vec::with_capacity(references.len() / 6),
            packs: Vec::with_capacity(references.len() / 3),
            root: Child::Inner(0),
            bounds: segment.bounds,
        };
        own.root = own.build_child(references, start, segment);
        own
    }

    fn build_child(
        &mut self,
        references: &mut [TriangleReference],
        start: usize,
        segment: ReferenceRangeWithSplit,
    ) -> Child {
        if segment.is_node {
            Child::Inner(self.build_node(references, start, segment))
        } else {
            self.build_leaf(start, segment.count)
        }
    }

    fn build_leaf(&mut self, start: usize, count: usize) -> Child {
        let first = self.packs.len() as u32;
        for at in (0..count).step_by(PACK) {
            self.packs
                .push(PackReferenceRange { first: (start + at) as u32, count: PACK.min(count - at) as u32 });
        }
        Child::Leaf { first, count: self.packs.len() as u32 - first }
    }

    /// Builds a node by repeatedly splitting the child with the largest box until there are eight (Wald,
    /// Benthin, Boulos, *Getting Rid of Packets*, 2008).
    fn build_node(
        &mut self,
        references: &mut [TriangleReference],
        start: usize,
        segment: ReferenceRangeWithSplit,
    ) -> u32 {
        let place = self.nodes.len();
        self.nodes.push(WideNode::EMPTY);
        let mut children: [Option<(usize, ReferenceRangeWithSplit)>; WIDTH] = [const { None }; WIDTH];
        children[0] = Some((0, segment));
        let mut count = 1;
        while count < WIDTH {
            let inner = children[..count].iter().enumerate().filter_map(|(slot, child)| {
                let (_, segment) = child.as_ref()?;
                segment.split.is_some().then(|| (slot, segment.is_node, segment.bounds.half_area()))
            });
            let next = inner.max_by(|a, b| a.1.cmp(&b.1).then(a.2.total_cmp(&b.2)));
            let Some((slot, ..)) = next else { break };
            let Some((from, ReferenceRangeWithSplit { split: Some(split), .. })) = &children[slot] else {
                break;
            };
            let (from, split) = (*from, *split);
            let Some((_, parent)) = &children[slot] else { break };
            let (left, right) = partition(&mut references[from..from + parent.count], parent, &split);
            children[count] = Some((from + left.count, right));
            children[slot] = Some((from, left));
            count += 1;
        }
        for (slot, (from, segment)) in children.into_iter().flatten().enumerate() {
            let bounds = segment.bounds.aabb();
            let members = &mut references[from..from + segment.count];
            let child = self.build_child(members, start + from, segment);
            self.nodes[place].set_child(slot, bounds, child);
        }
        place as u32
    }
}
