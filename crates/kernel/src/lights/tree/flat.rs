//! Trees of one node: points side by side pick from its children, light by light.

use super::node::{Child, Node, ReceiverRow};
use super::{LightTree, ROOT};
use crate::math::lanes::{F32x16, PACKET_SIZE};

/// Importance of each light of a tree with one node, for several points.
pub struct FlatShares<'a> {
    node: &'a Node,
    /// Importance by child, then by point.
    importance: [F32x16; PACKET_SIZE],
    /// Sums over the children.
    totals: [f64; PACKET_SIZE],
}

/// Lights that points picked.
pub struct FlatPicks {
    /// Indices of the lights among the children.
    children: [u32; PACKET_SIZE],
    /// Numbers of the lights.
    pub lights: [u32; PACKET_SIZE],
    /// Probabilities of the picks; 0 if no light arrives.
    pub probabilities: F32x16,
}

impl LightTree {
    /// Importance of its lights for several points. `None` if it has more than one node.
    #[inline(always)]
    pub fn flat_shares(&self, receivers: &ReceiverRow, has_lobes: bool) -> Option<FlatShares<'_>> {
        self.is_flat().then(|| FlatShares::new(&self.nodes[ROOT as usize], receivers, has_lobes))
    }

    /// Whether it has one node.
    #[inline(always)]
    pub fn is_flat(&self) -> bool {
        self.nodes.len() == 1
    }
}

impl<'a> FlatShares<'a> {
    #[inline(always)]
    fn new(node: &'a Node, receivers: &ReceiverRow, has_lobes: bool) -> Self {
        let (mut importance, mut totals) = ([[0.0; PACKET_SIZE]; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for child in 0..node.count as usize % (PACKET_SIZE + 1) {
            importance[child] = node.expected_of(child, receivers, has_lobes);
            for i in 0..PACKET_SIZE {
                totals[i] += f64::from(importance[child][i]);
            }
        }
        Self { node, importance, totals }
    }

    /// Picks a light for each point, by numbers in [0, 1).
    #[inline(always)]
    pub fn pick(&self, u: &[f64; PACKET_SIZE]) -> FlatPicks {
        let mut targets = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            // Stay below the total, so that rounding leads to no child after the last one with importance.
            let (target, last) = (u[i] * self.totals[i], before(self.totals[i]));
            targets[i] = if target < last { target } else { last };
        }
        let (mut sums, mut children, mut values) = ([0.0; PACKET_SIZE], [0; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for child in 0..self.node.count as usize % (PACKET_SIZE + 1) {
            for i in 0..PACKET_SIZE {
                let is_reached = sums[i] <= targets[i];
                children[i] = if is_reached { child as u32 } else { children[i] };
                values[i] = if is_reached { self.importance[child][i] } else { values[i] };
                sums[i] += f64::from(self.importance[child][i]);
            }
        }
        let mut lights = [0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            lights[i] = match self.node.children[children[i] as usize % PACKET_SIZE] {
                Child::Light(light) => light,
                Child::Node(_) => 0,
            };
        }
        FlatPicks { children, lights, probabilities: self.shares(&values) }
    }

    /// The probabilities that other picks have by these shares.
    #[inline(always)]
    pub fn probabilities(&self, picks: &FlatPicks) -> F32x16 {
        let mut values = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            values[i] = self.importance[picks.children[i] as usize % PACKET_SIZE][i];
        }
        self.shares(&values)
    }

    #[inline(always)]
    fn shares(&self, values: &F32x16) -> F32x16 {
        let mut shares = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let share = (f64::from(values[i]) / self.totals[i]) as f32;
            shares[i] = if self.totals[i] > 0.0 { share } else { 0.0 };
        }
        shares
    }
}

/// The greatest number below one that is above 0; 0 for 0.
#[inline(always)]
fn before(total: f64) -> f64 {
    f64::from_bits(total.to_bits().saturating_sub(1))
}
