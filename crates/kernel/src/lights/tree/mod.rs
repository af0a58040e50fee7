//! A tree over many lights. Each point picks lights at random, in proportion to bounds on their contributions (Conty Estevez and
//! Kulla, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, 2018). Its nodes have sixteen children, whose
//! importance is computed side by side.

pub mod bounds;
mod build;
mod cut;
mod flat;
mod node;

pub use bounds::{EmissionCone, LightBounds};
pub use cut::Cut;
pub use flat::{FlatPicks, FlatShares};
pub use node::{Child, Lobe, Node, Receiver, ReceiverRow};

use crate::math::lanes::{F32x16, PACKET_SIZE};

/// A tree over lights.
#[derive(Clone, Debug, PartialEq)]
pub struct LightTree {
    /// Nodes; the first is the root.
    nodes: Vec<Node>,
    /// Nodes whose children are lights, in the order of the tree; the children of other nodes are nodes.
    over_lights: Vec<u32>,
    /// Place of each light in the order of the tree; [`NOWHERE`] for those that emit nothing.
    places: Vec<u32>,
}

/// Most lights, or triangles of a light, that are all sampled, without a tree.
pub const MOST_WITHOUT: usize = 32;

/// Marks a light without a place in the tree.
const NOWHERE: u32 = u32::MAX;

/// The number of the root.
const ROOT: u32 = 0;

/// A light that was picked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pick {
    /// Its number.
    pub light: u32,
    /// Probability of the pick.
    pub probability: f32,
    /// Place of the random number in the light's share of [0, 1), in [0, 1).
    pub rest: f64,
}

impl LightTree {
    /// Picks a light for a point of a surface, by a number in [0, 1). `None` if no light arrives.
    #[inline(always)]
    pub fn pick(&self, receiver: &Receiver, u: f64) -> Option<Pick> {
        let mut way = Way::NEW;
        self.pick_under(ROOT, receiver, Pick { light: 0, probability: 1.0, rest: u }, &mut way)
    }

    /// The probability with which [`LightTree::pick`] picks this light.
    pub fn probability(&self, receiver: &Receiver, light: u32) -> f32 {
        match self.places[light as usize] {
            NOWHERE => 0.0,
            place => self.probability_under(ROOT, receiver, place, 1.0),
        }
    }

    /// Picks a light under a node, which was picked itself; `way` is the path of the previous pick for the same point.
    #[inline(always)]
    fn pick_under(&self, mut node: u32, receiver: &Receiver, mut pick: Pick, way: &mut Way) -> Option<Pick> {
        let mut level = 0;
        loop {
            let one = &self.nodes[node as usize];
            if way.nodes[level] != node {
                way.nodes[level] = node;
                way.shares[level] = Shares::new(&one.expected(receiver).importance);
            }
            let shares = &way.shares[level];
            let total = shares.total();
            if !(total > 0.0) {
                return None;
            }
            let target = target(pick.rest, total);
            let child = shares.find(target);
            pick.probability *= shares.share(child);
            pick.rest = shares.rest(target, child);
            match one.children[child] {
                Child::Light(light) => return Some(Pick { light, ..pick }),
                Child::Node(below) => node = below,
            }
            level = (level + 1).min(LEVELS - 1);
        }
    }

    /// The probability of the light at a place of the tree's order, given the probability of a node above it.
    fn probability_under(&self, mut node: u32, receiver: &Receiver, place: u32, mut probability: f32) -> f32 {
        loop {
            let one = &self.nodes[node as usize];
            let child = one.child_over(place);
            probability *= Shares::new(&one.expected(receiver).importance).share(child);
            match one.children[child] {
                Child::Node(below) if probability > 0.0 => node = below,
                Child::Node(_) | Child::Light(_) => return probability,
            }
        }
    }

    /// Whether a light is in it.
    #[inline(always)]
    pub fn has(&self, light: u32) -> bool {
        self.places[light as usize] != NOWHERE
    }

    /// The place of a light in the order of the tree, in which lights close together follow one another.
    #[inline(always)]
    pub fn place_of(&self, light: u32) -> u32 {
        self.places[light as usize]
    }

    /// Number of nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Bytes that the tree takes.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.over_lights) + size_of_val(&*self.places)
    }
}

/// Levels of a path down a tree that are remembered.
const LEVELS: usize = 3;

/// The nodes on the path of a pick, with the importance of their children: the next pick for the point may take the same
/// path.
struct Way {
    nodes: [u32; LEVELS],
    shares: [Shares; LEVELS],
}

impl Way {
    const NEW: Self = Self { nodes: [u32::MAX; LEVELS], shares: [Shares::NONE; LEVELS] };
}

/// Cumulative importance of children.
#[derive(Clone, Copy)]
struct Shares([f64; PACKET_SIZE]);

impl Shares {
    const NONE: Self = Self([0.0; PACKET_SIZE]);

    /// Sums by steps of 1, 2, 4 and 8 places, each for all children side by side.
    #[inline(always)]
    fn new(importance: &F32x16) -> Self {
        let mut sums = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            sums[i] = f64::from(importance[i]);
        }
        sums = with_those_before::<1>(&sums);
        sums = with_those_before::<2>(&sums);
        sums = with_those_before::<4>(&sums);
        Self(with_those_before::<8>(&sums))
    }

    /// The probability of a child.
    #[inline(always)]
    fn share(&self, child: usize) -> f32 {
        let (before, total) = (if child == 0 { 0.0 } else { self.0[child - 1] }, self.0[PACKET_SIZE - 1]);
        if total > 0.0 { ((self.0[child] - before) / total) as f32 } else { 0.0 }
    }

    /// Sum over all children.
    #[inline(always)]
    fn total(&self) -> f64 {
        self.0[PACKET_SIZE - 1]
    }

    /// The child whose share contains a part of the total, which is below the total.
    #[inline(always)]
    fn find(&self, target: f64) -> usize {
        let mut child = 0;
        for i in 0..PACKET_SIZE {
            child += usize::from(self.0[i] <= target);
        }
        child
    }

    /// Place of a part of the total in a child's share, in [0, 1).
    #[inline(always)]
    fn rest(&self, target: f64, child: usize) -> f64 {
        let before = if child == 0 { 0.0 } else { self.0[child - 1] };
        rest(target - before, self.0[child] - before)
    }
}

/// The sum of each number and the one so many places before it.
#[inline(always)]
fn with_those_before<const STEP: usize>(sums: &[f64; PACKET_SIZE]) -> [f64; PACKET_SIZE] {
    let mut before = [0.0; PACKET_SIZE];
    before[STEP..].copy_from_slice(&sums[..PACKET_SIZE - STEP]);
    for i in 0..PACKET_SIZE {
        before[i] += sums[i];
    }
    before
}

/// A number in [0, 1) scaled to a sum, but below it: rounding must not lead beyond the last share.
#[inline(always)]
fn target(u: f64, total: f64) -> f64 {
    below(u * total, total)
}

/// The part, kept below the total.
#[inline(always)]
fn below(part: f64, total: f64) -> f64 {
    let last = total.next_down();
    if part < last { part } else { last }
}

/// Remainder of a part of a share, in [0, 1).
#[inline(always)]
fn rest(part: f64, share: f64) -> f64 {
    const LAST: f64 = 1.0_f64.next_down();
    let rest = part / share;
    if rest < LAST { rest } else { LAST }
}

#[cfg(test)]
mod tests;
