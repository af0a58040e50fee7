//! Cuts through a light tree. A cut is a set of nodes, and a point picks lights from the children of these
//! nodes. If there are few lights, the cut consists of all nodes whose children are lights. Otherwise, nodes
//! that are too close to the point for tight bounds are replaced by their children, up to a maximum number of
//! nodes. All picks for a point use the same cut.

use arrayvec::ArrayVec;

use super::node::{ImportanceAndNearnessPacket, NodeChild, Receiver};
use super::{
    CumulativeImportance, LightPick, LightTree, NOT_IN_TREE, PreviousPickPath, ROOT, clamp_to_less_than,
    scale_u_to_total,
};
use crate::math::Vec3;
use crate::math::lanes::F32x16;

/// A cut through a tree, for picking lights at successive points.
pub struct AdaptiveLightTreeCut<'a> {
    tree: &'a LightTree,
    /// Maximum number of nodes in the cut.
    room: usize,
    receiver: Receiver,
    /// Indices of the cut's nodes.
    nodes: ArrayVec<u32, { AdaptiveLightTreeCut::MAX_NODES }>,
    /// Importance of each node's children, which is 0 for children that are also in the cut.
    importance: ArrayVec<F32x16, { AdaptiveLightTreeCut::MAX_NODES }>,
    /// Sum of the importance up to and including each node.
    sums: ArrayVec<f64, { AdaptiveLightTreeCut::MAX_NODES }>,
}

/// Minimum nearness at which a node is replaced by its children. Nearness is the squared sine of half the
/// angle that the bounding sphere subtends.
const NEAR: f32 = 0.05;

impl<'a> AdaptiveLightTreeCut<'a> {
    /// Maximum number of nodes in any cut.
    pub const MAX_NODES: usize = 64;

    /// Creates a cut with at most `room` nodes. [`AdaptiveLightTreeCut::adapt_to_receiver`] must be called
    /// before picking.
    #[inline(always)]
    pub fn new(tree: &'a LightTree, room: usize) -> Self {
        let receiver = Receiver::with_unknown_lobe(Vec3::ZERO, Vec3::ZERO);
        let room = room.clamp(1, Self::MAX_NODES);
        Self {
            tree,
            room,
            receiver,
            nodes: ArrayVec::new(),
            importance: ArrayVec::new(),
            sums: ArrayVec::new(),
        }
    }

    /// Adapts the cut to a surface point.
    #[inline(always)]
    pub fn adapt_to_receiver(&mut self, receiver: &Receiver) {
        let tree = self.tree;
        self.receiver = *receiver;
        self.nodes.clear();
        self.importance.clear();
        self.sums.clear();
        if tree.over_lights.len() <= self.room {
            for &node in &tree.over_lights {
                self.nodes.push(node);
                self.importance.push(tree.nodes[node as usize].child_importances(receiver).importance);
            }
        } else {
            self.nodes.push(ROOT);
        }
        while self.importance.len() < self.nodes.len() {
            let node = &tree.nodes[self.nodes[self.importance.len()] as usize];
            let ImportanceAndNearnessPacket { mut importance, nearness } = node.child_importances(receiver);
            for i in 0..node.count as usize {
                if let NodeChild::LightTreeNode(below) = node.children[i]
                    && importance[i] > 0.0
                    && nearness[i] > NEAR
                    && self.nodes.len() < self.room
                {
                    self.nodes.push(below);
                    importance[i] = 0.0;
                }
            }
            self.importance.push(importance);
        }
        let mut sum = 0.0;
        for importance in &self.importance {
            sum += horizontal_sum(importance);
            self.sums.push(sum);
        }
    }

    /// Total importance.
    #[inline(always)]
    fn total_importance(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Picks lights like [`LightTree::pick`], for numbers `u` in increasing order. `picked` receives the
    /// index of each number, the picked light, and the light's probability.
    #[inline(always)]
    pub fn pick_sorted_batch(&self, u: impl Iterator<Item = f64>, mut picked: impl FnMut(usize, u32, f32)) {
        let all = self.total_importance();
        if !(all > 0.0) {
            return;
        }
        let inverse = 1.0 / all;
        let (mut index, mut way) = (0, PreviousPickPath::NEW);
        let (mut of, mut shares) = (usize::MAX, CumulativeImportance::NONE);
        // `before` is the sum over the preceding nodes. `scale`, which corrects for rounding, is the exact
        // sum over the children divided by the node's share of the rounded total.
        let (mut before, mut scale) = (0.0, 0.0);
        for (place, u) in u.enumerate() {
            let target = scale_u_to_total(u, all);
            while self.sums[index] <= target {
                index += 1;
            }
            if of != index {
                (of, shares) = (index, CumulativeImportance::new(&self.importance[index]));
                before = if index == 0 { 0.0 } else { self.sums[index - 1] };
                scale = shares.total() / (self.sums[index] - before);
            }
            // Stay below the sum over the children, which is positive because the node's share is positive.
            let part = clamp_to_less_than((target - before) * scale, shares.total());
            let child = shares.find_child(part);
            let probability = self.child_probability(index, child, inverse);
            match self.tree.nodes[self.nodes[index] as usize].children[child] {
                NodeChild::Light(light) => picked(place, light, probability),
                NodeChild::LightTreeNode(node) => {
                    let so_far =
                        LightPick { light: 0, probability, rest: shares.remap_within_child(part, child) };
                    if let Some(pick) = self.tree.pick_in_subtree(node, &self.receiver, so_far, &mut way) {
                        picked(place, pick.light, pick.probability);
                    }
                }
            }
        }
    }

    /// Probability of picking a node's child, given the reciprocal of the total importance.
    #[inline(always)]
    fn child_probability(&self, index: usize, child: usize, inverse: f64) -> f32 {
        (f64::from(self.importance[index][child]) * inverse) as f32
    }

    /// Probability that [`AdaptiveLightTreeCut::pick_sorted_batch`] picks a light.
    #[inline]
    pub fn probability(&self, light: u32) -> f32 {
        let place = self.tree.positions[light as usize];
        if place == NOT_IN_TREE || !(self.total_importance() > 0.0) {
            return 0.0;
        }
        // Find the cut's last node on the path to the light.
        let (mut node, mut last) = (ROOT, None);
        loop {
            let one = &self.tree.nodes[node as usize];
            let child = one.child_containing(place);
            if let Some(index) = self.nodes.iter().position(|&other| other == node) {
                last = Some((index, child));
            }
            match one.children[child] {
                NodeChild::Light(_) => break,
                NodeChild::LightTreeNode(below) => node = below,
            }
        }
        let Some((index, child)) = last else { return 0.0 };
        let share = self.child_probability(index, child, 1.0 / self.total_importance());
        match self.tree.nodes[self.nodes[index] as usize].children[child] {
            NodeChild::LightTreeNode(below) if share > 0.0 => {
                self.tree.probability_in_subtree(below, &self.receiver, place, share)
            }
            NodeChild::LightTreeNode(_) | NodeChild::Light(_) => share,
        }
    }
}

/// Sums a packet in a fixed order, which is the same on all machines.
#[inline(always)]
fn horizontal_sum(importance: &F32x16) -> f64 {
    let mut row = *importance;
    for i in 0..8 {
        row[i] += row[i + 8];
    }
    for i in 0..4 {
        row[i] += row[i + 4];
    }
    for i in 0..2 {
        row[i] += row[i + 2];
    }
    f64::from(row[0] + row[1])
}
