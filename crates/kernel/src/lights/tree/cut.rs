//! Cuts through a light tree: sets of nodes from whose children a point picks. If the lights are not too many, these are all
//! nodes over lights. Otherwise nodes so near to the point that their bounds say little are replaced by their children, as far
//! as there is room. Many picks for one point share a cut.

use arrayvec::ArrayVec;

use super::node::{Child, Expected, Receiver};
use super::{LightTree, NOWHERE, Pick, ROOT, Shares, Way, below, target};
use crate::math::Vec3;
use crate::math::lanes::F32x16;

/// A cut, for picks at one point after the other.
pub struct Cut<'a> {
    tree: &'a LightTree,
    /// Most nodes.
    room: usize,
    receiver: Receiver,
    /// Numbers of the nodes.
    nodes: ArrayVec<u32, { Cut::MOST }>,
    /// Importance of their children; 0 for those that are nodes of the cut themselves.
    importance: ArrayVec<F32x16, { Cut::MOST }>,
    /// Cumulative importance up to each node.
    sums: ArrayVec<f64, { Cut::MOST }>,
}

/// Least nearness at which a node is replaced: the square of the sine of half the angle that its bounding sphere
/// subtends.
const NEAR: f32 = 0.05;

impl<'a> Cut<'a> {
    /// Most nodes of any cut.
    pub const MOST: usize = 64;

    /// A cut through a tree, of so many nodes at most; for no point yet.
    #[inline(always)]
    pub fn new(tree: &'a LightTree, room: usize) -> Self {
        let receiver = Receiver::plain(Vec3::ZERO, Vec3::ZERO);
        let room = room.clamp(1, Self::MOST);
        Self {
            tree,
            room,
            receiver,
            nodes: ArrayVec::new(),
            importance: ArrayVec::new(),
            sums: ArrayVec::new(),
        }
    }

    /// Moves the cut to a point of a surface.
    #[inline(always)]
    pub fn go_to(&mut self, receiver: &Receiver) {
        let tree = self.tree;
        self.receiver = *receiver;
        self.nodes.clear();
        self.importance.clear();
        self.sums.clear();
        if tree.over_lights.len() <= self.room {
            for &node in &tree.over_lights {
                self.nodes.push(node);
                self.importance.push(tree.nodes[node as usize].expected(receiver).importance);
            }
        } else {
            self.nodes.push(ROOT);
        }
        while self.importance.len() < self.nodes.len() {
            let node = &tree.nodes[self.nodes[self.importance.len()] as usize];
            let Expected { mut importance, nearness } = node.expected(receiver);
            for i in 0..node.count as usize {
                if let Child::Node(below) = node.children[i]
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
            sum += total(importance);
            self.sums.push(sum);
        }
    }

    /// Importance of all nodes.
    #[inline(always)]
    fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// [`LightTree::pick`] by the cut, for numbers that increase. `picked` gets the index of each number, the light and its
    /// probability, but no rest.
    #[inline(always)]
    pub fn pick(&self, u: impl Iterator<Item = f64>, mut picked: impl FnMut(usize, u32, f32)) {
        let all = self.total();
        if !(all > 0.0) {
            return;
        }
        let inverse = 1.0 / all;
        let (mut index, mut way) = (0, Way::NEW);
        let (mut of, mut shares) = (usize::MAX, Shares::NONE);
        // Keep the sum before the node, and its own sum over the sum over its children, which is not rounded.
        let (mut before, mut scale) = (0.0, 0.0);
        for (place, u) in u.enumerate() {
            let target = target(u, all);
            while self.sums[index] <= target {
                index += 1;
            }
            if of != index {
                (of, shares) = (index, Shares::new(&self.importance[index]));
                before = if index == 0 { 0.0 } else { self.sums[index - 1] };
                scale = shares.total() / (self.sums[index] - before);
            }
            // Stay below the sum over the children, which is above 0 as the node's sum is.
            let part = below((target - before) * scale, shares.total());
            let child = shares.find(part);
            let probability = self.share(index, child, inverse);
            match self.tree.nodes[self.nodes[index] as usize].children[child] {
                Child::Light(light) => picked(place, light, probability),
                Child::Node(node) => {
                    let so_far = Pick { light: 0, probability, rest: shares.rest(part, child) };
                    if let Some(pick) = self.tree.pick_under(node, &self.receiver, so_far, &mut way) {
                        picked(place, pick.light, pick.probability);
                    }
                }
            }
        }
    }

    /// The probability of a child of a node, given the inverse importance of all.
    #[inline(always)]
    fn share(&self, index: usize, child: usize, inverse: f64) -> f32 {
        (f64::from(self.importance[index][child]) * inverse) as f32
    }

    /// The probability with which [`Cut::pick`] picks a light.
    #[inline]
    pub fn probability(&self, light: u32) -> f32 {
        let place = self.tree.places[light as usize];
        if place == NOWHERE || !(self.total() > 0.0) {
            return 0.0;
        }
        // Find the last node of the cut on the path to the light.
        let (mut node, mut last) = (ROOT, None);
        loop {
            let one = &self.tree.nodes[node as usize];
            let child = one.child_over(place);
            if let Some(index) = self.nodes.iter().position(|&other| other == node) {
                last = Some((index, child));
            }
            match one.children[child] {
                Child::Light(_) => break,
                Child::Node(below) => node = below,
            }
        }
        let Some((index, child)) = last else { return 0.0 };
        let share = self.share(index, child, 1.0 / self.total());
        match self.tree.nodes[self.nodes[index] as usize].children[child] {
            Child::Node(below) if share > 0.0 => {
                self.tree.probability_under(below, &self.receiver, place, share)
            }
            Child::Node(_) | Child::Light(_) => share,
        }
    }
}

/// The sum of a row, in one order on all machines.
#[inline(always)]
fn total(importance: &F32x16) -> f64 {
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
