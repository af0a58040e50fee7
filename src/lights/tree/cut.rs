//! Cuts through a light tree: nodes that a point is so near to that their bounds say little are replaced by their children, as
//! far as there is room, before anything is picked. Many picks for one point share a cut.

use super::node::{Child, Expected};
use super::{LightTree, NOWHERE, Pick, ROOT, Way, rest, target};
use crate::math::Vec3;
use crate::math::lanes::LANES;

/// What a point picks from.
pub struct Cut<'a> {
    tree: &'a LightTree,
    point: Vec3,
    normal: Vec3,
    /// How many there are.
    count: usize,
    /// Sums of their importance up to each.
    sums: [f64; ROOM],
    /// What they are.
    items: [Child; ROOM],
}

/// Items of a cut at most.
const ROOM: usize = 256;

/// Nodes are replaced from this square of the sine of half the angle on that the sphere around them fills.
const NEAR: f32 = 0.05;

impl<'a> Cut<'a> {
    /// For a point of a surface with this normal.
    #[inline(always)]
    pub fn new(tree: &'a LightTree, point: Vec3, normal: Vec3) -> Self {
        let mut cut =
            Self { tree, point, normal, count: 0, sums: [0.0; ROOM], items: [Child::Node(ROOT); ROOM] };
        // Nodes to be replaced, in the order in which they were found: the larger ones first.
        let mut open = [ROOT; ROOM / LANES];
        let (mut first, mut end) = (0, 1);
        let mut sum = 0.0;
        while first < end {
            let node = &tree.nodes[open[first] as usize];
            first += 1;
            let Expected { importance, nearness } = node.expected(point, normal);
            for i in 0..node.count as usize {
                if !(importance[i] > 0.0) {
                    continue;
                }
                match node.children[i] {
                    Child::Node(below) if nearness[i] > NEAR && end < open.len() => {
                        open[end] = below;
                        end += 1;
                    }
                    item @ (Child::Node(_) | Child::Light(_)) => {
                        sum += f64::from(importance[i]);
                        (cut.sums[cut.count], cut.items[cut.count]) = (sum, item);
                        cut.count += 1;
                    }
                }
            }
        }
        cut
    }

    /// [`LightTree::pick`] by the cut, for numbers that increase.
    #[inline(always)]
    pub fn pick<const N: usize>(&self, u: &[f64; N]) -> [Option<Pick>; N] {
        let mut picks = [None; N];
        if self.count == 0 {
            return picks;
        }
        let total = self.sums[self.count - 1];
        let (mut index, mut way) = (0, Way::NEW);
        for (pick, u) in picks.iter_mut().zip(u) {
            let target = target(*u, total);
            while self.sums[index] <= target {
                index += 1;
            }
            let before = if index == 0 { 0.0 } else { self.sums[index - 1] };
            let rest = rest(target - before, self.sums[index] - before);
            let probability = self.share(index);
            *pick = match self.items[index] {
                Child::Light(light) => Some(Pick { light, probability, rest }),
                Child::Node(node) => {
                    let so_far = Pick { light: 0, probability, rest };
                    self.tree.pick_under(node, self.point, self.normal, so_far, &mut way)
                }
            };
        }
        picks
    }

    /// The probability of an item.
    #[inline(always)]
    fn share(&self, index: usize) -> f32 {
        let before = if index == 0 { 0.0 } else { self.sums[index - 1] };
        ((self.sums[index] - before) / self.sums[self.count - 1]) as f32
    }

    /// The probability with which [`Cut::pick`] picks a light.
    pub fn probability(&self, light: u32) -> f32 {
        let place = self.tree.places[light as usize];
        if place == NOWHERE {
            return 0.0;
        }
        // Down to where the cut goes.
        let mut node = ROOT;
        loop {
            let one = &self.tree.nodes[node as usize];
            let item = one.children[one.child_over(place)];
            let index = self.items[..self.count].iter().position(|&other| other == item);
            match (index, item) {
                (Some(index), Child::Light(_)) => return self.share(index),
                (Some(index), Child::Node(below)) => {
                    let share = self.share(index);
                    return self.tree.probability_under(below, (self.point, self.normal), place, share);
                }
                // Nothing arrives, or the cut is farther down.
                (None, Child::Light(_)) => return 0.0,
                (None, Child::Node(below)) => node = below,
            }
        }
    }
}
