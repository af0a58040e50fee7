//! A tree over many lights. Each point picks lights at random, with probabilities proportional to bounds on
//! their contributions (Conty Estevez and Kulla, *Importance Sampling of Many Lights with Adaptive Tree
//! Splitting*, 2018). Nodes have 16 children, whose importance is computed with SIMD.

pub mod bounds;
mod build;
mod cut;
mod node;
mod single_node;

pub use bounds::{EmissionCone, LightBounds};
pub use cut::AdaptiveLightTreeCut;
pub use node::{LightTreeNode, NodeChild, Receiver, ReceiverLobe, ReceiverPacket};
pub use single_node::{LightPickPacket, SingleNodeLightImportances};

use crate::math::lanes::{F32x16, PACKET_SIZE};

/// A tree over lights.
#[derive(Clone, Debug, PartialEq)]
pub struct LightTree {
    /// All nodes, starting with the root.
    nodes: Vec<LightTreeNode>,
    /// Nodes whose children are lights, in tree order. Other nodes have only nodes as children.
    over_lights: Vec<u32>,
    /// Each light's position in tree order, or [`NOT_IN_TREE`] if the light emits nothing.
    positions: Vec<u32>,
}

/// Maximum number of lights (or triangles in a light) that are sampled without a tree.
pub const MAX_WITHOUT_TREE: usize = 32;

/// Marks a light that is not in the tree.
const NOT_IN_TREE: u32 = u32::MAX;

/// Index of the root.
const ROOT: u32 = 0;

/// A picked light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPick {
    /// Index of the light.
    pub light: u32,
    /// Probability of picking the light.
    pub probability: f32,
    /// Random number in [0, 1) for further use: the position of the original number within the light's
    /// subinterval.
    pub rest: f64,
}

impl LightTree {
    /// Picks a light for a surface point. `u` is in [0, 1). Returns `None` if no light reaches the point.
    #[inline(always)]
    pub fn pick(&self, receiver: &Receiver, u: f64) -> Option<LightPick> {
        let mut way = PreviousPickPath::NEW;
        self.pick_in_subtree(ROOT, receiver, LightPick { light: 0, probability: 1.0, rest: u }, &mut way)
    }

    /// Probability that [`LightTree::pick`] picks this light.
    pub fn probability(&self, receiver: &Receiver, light: u32) -> f32 {
        match self.positions[light as usize] {
            NOT_IN_TREE => 0.0,
            place => self.probability_in_subtree(ROOT, receiver, place, 1.0),
        }
    }

    /// Picks a light from the subtree at `node`. `pick` is the pick so far, and `way` caches the path of the
    /// previous pick for the same point.
    #[inline(always)]
    fn pick_in_subtree(
        &self,
        mut node: u32,
        receiver: &Receiver,
        mut pick: LightPick,
        way: &mut PreviousPickPath,
    ) -> Option<LightPick> {
        let mut level = 0;
        loop {
            let one = &self.nodes[node as usize];
            if way.nodes[level] != node {
                way.nodes[level] = node;
                way.shares[level] = CumulativeImportance::new(&one.child_importances(receiver).importance);
            }
            let shares = &way.shares[level];
            let total = shares.total();
            if !(total > 0.0) {
                return None;
            }
            let target = scale_u_to_total(pick.rest, total);
            let child = shares.find_child(target);
            pick.probability *= shares.probability(child);
            pick.rest = shares.remap_within_child(target, child);
            match one.children[child] {
                NodeChild::Light(light) => return Some(LightPick { light, ..pick }),
                NodeChild::LightTreeNode(below) => node = below,
            }
            level = (level + 1).min(LEVELS - 1);
        }
    }

    /// Probability of picking the light at `place` in tree order, given the probability of reaching an
    /// ancestor node.
    fn probability_in_subtree(
        &self,
        mut node: u32,
        receiver: &Receiver,
        place: u32,
        mut probability: f32,
    ) -> f32 {
        loop {
            let one = &self.nodes[node as usize];
            let child = one.child_containing(place);
            probability *=
                CumulativeImportance::new(&one.child_importances(receiver).importance).probability(child);
            match one.children[child] {
                NodeChild::LightTreeNode(below) if probability > 0.0 => node = below,
                NodeChild::LightTreeNode(_) | NodeChild::Light(_) => return probability,
            }
        }
    }

    /// Whether a light is in the tree.
    #[inline(always)]
    pub fn contains(&self, light: u32) -> bool {
        self.positions[light as usize] != NOT_IN_TREE
    }

    /// Position of a light in tree order, where nearby lights are close together.
    #[inline(always)]
    pub fn tree_order_position(&self, light: u32) -> u32 {
        self.positions[light as usize]
    }

    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Memory used by the tree, in bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.over_lights) + size_of_val(&*self.positions)
    }
}

/// Number of cached levels of the previous path.
const LEVELS: usize = 3;

/// The nodes on the previous pick's path, and the importance of their children. Successive picks for the same
/// point often share part of the path.
struct PreviousPickPath {
    nodes: [u32; LEVELS],
    shares: [CumulativeImportance; LEVELS],
}

impl PreviousPickPath {
    const NEW: Self = Self { nodes: [u32::MAX; LEVELS], shares: [CumulativeImportance::NONE; LEVELS] };
}

/// Cumulative importance of a node's children.
#[derive(Clone, Copy)]
struct CumulativeImportance([f64; PACKET_SIZE]);

impl CumulativeImportance {
    const NONE: Self = Self([0.0; PACKET_SIZE]);

    /// Computes prefix sums for all children at once, by repeatedly adding the sums that are 1, 2, 4, and 8
    /// places earlier.
    #[inline(always)]
    fn new(importance: &F32x16) -> Self {
        let mut sums = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            sums[i] = f64::from(importance[i]);
        }
        sums = add_shifted_lanes::<1>(&sums);
        sums = add_shifted_lanes::<2>(&sums);
        sums = add_shifted_lanes::<4>(&sums);
        Self(add_shifted_lanes::<8>(&sums))
    }

    /// Probability of a child.
    #[inline(always)]
    fn probability(&self, child: usize) -> f32 {
        let (before, total) = (if child == 0 { 0.0 } else { self.0[child - 1] }, self.0[PACKET_SIZE - 1]);
        if total > 0.0 { ((self.0[child] - before) / total) as f32 } else { 0.0 }
    }

    /// Total importance of all children.
    #[inline(always)]
    fn total(&self) -> f64 {
        self.0[PACKET_SIZE - 1]
    }

    /// The child whose interval contains `target`. `target` must be less than the total.
    #[inline(always)]
    fn find_child(&self, target: f64) -> usize {
        let mut child = 0;
        for i in 0..PACKET_SIZE {
            child += usize::from(self.0[i] <= target);
        }
        child
    }

    /// Position of `target` within a child's interval, in [0, 1).
    #[inline(always)]
    fn remap_within_child(&self, target: f64, child: usize) -> f64 {
        let before = if child == 0 { 0.0 } else { self.0[child - 1] };
        remap_to_unit(target - before, self.0[child] - before)
    }
}

/// Adds the value `STEP` lanes earlier to each lane.
#[inline(always)]
fn add_shifted_lanes<const STEP: usize>(sums: &[f64; PACKET_SIZE]) -> [f64; PACKET_SIZE] {
    let mut before = [0.0; PACKET_SIZE];
    before[STEP..].copy_from_slice(&sums[..PACKET_SIZE - STEP]);
    for i in 0..PACKET_SIZE {
        before[i] += sums[i];
    }
    before
}

/// Scales `u` in [0, 1) to a total. The result is always below the total, so rounding never selects a
/// position past the last interval.
#[inline(always)]
fn scale_u_to_total(u: f64, total: f64) -> f64 {
    clamp_to_less_than(u * total, total)
}

/// Limits `part` to less than `total`.
#[inline(always)]
fn clamp_to_less_than(part: f64, total: f64) -> f64 {
    let last = total.next_down();
    if part < last { part } else { last }
}

/// Position of `part` within an interval, in [0, 1).
#[inline(always)]
fn remap_to_unit(part: f64, share: f64) -> f64 {
    const LAST: f64 = 1.0_f64.next_down();
    let rest = part / share;
    if rest < LAST { rest } else { LAST }
}

#[cfg(test)]
mod tests;
