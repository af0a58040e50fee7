//! Single-node light trees, for picking lights for an entire packet of points.

use super::node::{LightTreeNode, NodeChild, ReceiverPacket};
use super::{LightTree, ROOT};
use crate::math::lanes::{F32x16, PACKET_SIZE, Simd, SimdKernel};

/// Importance of each light in a single-node tree, for a packet of points.
pub struct SingleNodeLightImportances<'a> {
    node: &'a LightTreeNode,
    /// Importance, indexed by child, then by point.
    importance: [F32x16; PACKET_SIZE],
    /// Sums over the children.
    totals: [f64; PACKET_SIZE],
}

/// The lights picked for a packet of points.
#[repr(align(64))]
pub struct LightPickPacket {
    /// Index of the picked child for each point.
    children: [u32; PACKET_SIZE],
    /// Index of the picked light for each point.
    pub lights: [u32; PACKET_SIZE],
    /// Probabilities of the picks, or 0 if no light reaches the point.
    pub probabilities: F32x16,
}

impl LightTree {
    /// Importance of the tree's lights for a packet of points, or `None` if the tree has more than one node.
    #[inline(always)]
    pub fn importance_if_single_node(
        &self,
        receivers: &ReceiverPacket,
        has_lobes: bool,
        simd: impl Simd,
    ) -> Option<SingleNodeLightImportances<'_>> {
        if !self.is_single_node() {
            return None;
        }
        Some(simd.call_out_of_line(ImportanceKernel {
            node: &self.nodes[ROOT as usize],
            receivers,
            has_lobes,
        }))
    }

    /// Whether the tree consists of a single node.
    #[inline(always)]
    pub fn is_single_node(&self) -> bool {
        self.nodes.len() == 1
    }
}

/// Kernel of [`LightTree::importance_if_single_node`].
struct ImportanceKernel<'a, 'b> {
    node: &'a LightTreeNode,
    receivers: &'b ReceiverPacket,
    has_lobes: bool,
}

impl<'a> SimdKernel for ImportanceKernel<'a, '_> {
    type Output = SingleNodeLightImportances<'a>;

    #[inline(always)]
    fn run(self, _: impl Simd) -> SingleNodeLightImportances<'a> {
        let Self { node, receivers, has_lobes } = self;
        let (mut importance, mut totals) = ([[0.0; PACKET_SIZE]; PACKET_SIZE], [0.0; PACKET_SIZE]);
        for child in 0..node.count as usize % (PACKET_SIZE + 1) {
            importance[child] = node.importance_packet_of_child(child, receivers, has_lobes);
            for i in 0..PACKET_SIZE {
                totals[i] += f64::from(importance[child][i]);
            }
        }
        SingleNodeLightImportances { node, importance, totals }
    }
}

impl SingleNodeLightImportances<'_> {
    /// Picks a light for each point. `u` is in [0, 1).
    #[inline(always)]
    pub fn pick_packet(&self, u: &[f64; PACKET_SIZE]) -> LightPickPacket {
        let mut targets = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            // Stay below the total to avoid rounding past the last child with nonzero importance.
            let (target, last) = (u[i] * self.totals[i], next_down_or_zero(self.totals[i]));
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
                NodeChild::Light(light) => light,
                NodeChild::LightTreeNode(_) => 0,
            };
        }
        LightPickPacket { children, lights, probabilities: self.importances_to_pick_probabilities(&values) }
    }

    /// Probabilities of `picks` with these importances.
    #[inline(always)]
    pub fn probabilities_of_picks(&self, picks: &LightPickPacket) -> F32x16 {
        let mut values = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            values[i] = self.importance[picks.children[i] as usize % PACKET_SIZE][i];
        }
        self.importances_to_pick_probabilities(&values)
    }

    #[inline(always)]
    fn importances_to_pick_probabilities(&self, values: &F32x16) -> F32x16 {
        let mut shares = [0.0; PACKET_SIZE];
        for i in 0..PACKET_SIZE {
            let share = (f64::from(values[i]) / self.totals[i]) as f32;
            shares[i] = if self.totals[i] > 0.0 { share } else { 0.0 };
        }
        shares
    }
}

/// The largest number below a positive `total`, or 0 if `total` is 0.
#[inline(always)]
fn next_down_or_zero(total: f64) -> f64 {
    f64::from_bits(total.to_bits().saturating_sub(1))
}
