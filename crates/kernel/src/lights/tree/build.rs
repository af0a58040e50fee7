//! Top-down construction of light trees. Nearby lights with similar emission directions share a node (Conty
//! Estevez and Kulla, 2018, section 4.4). Large groups of lights are binned.

use super::bounds::{EmissionCone, LightBounds};
use super::node::{LightTreeNode, NodeChild};
use super::{LightTree, NOT_IN_TREE};
use crate::control::{CancelToken, Canceled};
use crate::math::DVec3;
use crate::math::float::floor_to_power_of_two;
use crate::math::lanes::PACKET_SIZE;

impl LightTree {
    /// Builds a tree over indexed lights. Lights without bounds emit nothing. Returns `None` if no light
    /// emits.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn new(lights: &[Option<LightBounds>], token: &CancelToken) -> Result<Option<Self>, Canceled> {
        let mut leaves: Vec<LightLeaf> = (0..).zip(lights).filter_map(LightLeaf::new).collect();
        // Group the lights by distance falloff.
        leaves.sort_by_key(|leaf| leaf.bounds.space);
        let power: f64 = leaves.iter().map(|leaf| leaf.bounds.power).sum();
        let mut positions = vec![NOT_IN_TREE; lights.len()];
        let unit = floor_to_power_of_two(power);
        let mut builder = LightTreeBuilder { nodes: Vec::new(), unit, leaves: leaves.len() as u32, token };
        if leaves.is_empty() {
            return Ok(None);
        }
        builder.build_node(&mut leaves, 0)?;
        for (place, leaf) in (0..).zip(&leaves) {
            positions[leaf.light as usize] = place;
        }
        let is_over_lights = |node: &LightTreeNode| matches!(node.children[0], NodeChild::Light(_));
        let over_lights = (0..).zip(&builder.nodes).filter(|(_, node)| is_over_lights(node)).map(|(i, _)| i);
        Ok(Some(Self { over_lights: over_lights.collect(), nodes: builder.nodes, positions }))
    }
}

/// A light in the tree.
#[derive(Clone)]
struct LightLeaf {
    light: u32,
    bounds: LightBounds,
}

impl LightLeaf {
    fn new((light, bounds): (u32, &Option<LightBounds>)) -> Option<Self> {
        let bounds = (*bounds)?;
        (bounds.power > 0.0).then_some(Self { light, bounds })
    }
}

struct LightTreeBuilder<'a> {
    nodes: Vec<LightTreeNode>,
    /// Unit of power. It is a power of two, which makes scaling by it exact. Scaling the power of all lights
    /// by a power of two therefore does not affect picks.
    unit: f64,
    /// Number of lights.
    leaves: u32,
    token: &'a CancelToken,
}

impl LightTreeBuilder<'_> {
    /// Builds the node over `leaves` and returns its index. `before` is the number of preceding leaves.
    fn build_node(&mut self, leaves: &mut [LightLeaf], before: u32) -> Result<u32, Canceled> {
        let number = self.nodes.len() as u32;
        self.nodes.push(LightTreeNode::empty(self.leaves));
        let is_over_lights = leaves.len() <= PACKET_SIZE;
        let groups = partition_into_children(leaves, self.token)?;
        let mut node = LightTreeNode::empty(self.leaves);
        let (mut rest, mut first) = (leaves, before);
        for (i, count) in groups.into_iter().enumerate() {
            let (own, others) = rest.split_at_mut(count);
            rest = others;
            let Some(bounds) = LightBounds::union_of_all(own.iter().map(|leaf| &leaf.bounds)) else {
                continue;
            };
            node.set_child_bounds(i, &bounds, self.unit);
            node.first[i] = first;
            node.children[i] = match own {
                [leaf] if is_over_lights => NodeChild::Light(leaf.light),
                several => NodeChild::LightTreeNode(self.build_node(several, first)?),
            };
            node.count = i as u32 + 1;
            first += count as u32;
        }
        self.nodes[number as usize] = node;
        Ok(number)
    }
}

/// Partitions the leaves into at most one group per child, and returns the group sizes. Uses as few groups as
/// possible, so that the nodes are full.
fn partition_into_children(leaves: &mut [LightLeaf], token: &CancelToken) -> Result<Vec<usize>, Canceled> {
    token.check_pause_and_cancel()?;
    if leaves.len() <= PACKET_SIZE {
        return Ok(vec![1; leaves.len()]);
    }
    let mut unit = PACKET_SIZE;
    while unit * PACKET_SIZE < leaves.len() {
        unit *= PACKET_SIZE;
    }
    let mut groups: Vec<LeafGroup> = Vec::with_capacity(PACKET_SIZE);
    let mut start = 0;
    for own in leaves.chunk_by(|a, b| a.bounds.space == b.bounds.space) {
        groups.push(LeafGroup::new(start, own));
        start += own.len();
    }
    while groups.len() < PACKET_SIZE {
        let most_expensive = (0..groups.len()).filter(|&i| groups[i].count > unit);
        let Some(most_expensive) = most_expensive.max_by(|&a, &b| groups[a].cost.total_cmp(&groups[b].cost))
        else {
            break;
        };
        let LeafGroup { start, count, .. } = groups[most_expensive];
        let own = &mut leaves[start..start + count];
        token.check_pause_and_cancel()?;
        let middle = partition_leaves_along_longest_axis(own, unit);
        let (left, right) = own.split_at(middle);
        groups[most_expensive] = LeafGroup::new(start, left);
        groups.insert(most_expensive + 1, LeafGroup::new(start + middle, right));
    }
    Ok(groups.into_iter().map(|group| group.count).collect())
}

/// A group of consecutive leaves.
struct LeafGroup {
    start: usize,
    count: usize,
    cost: f64,
}

impl LeafGroup {
    fn new(start: usize, leaves: &[LightLeaf]) -> Self {
        Self { start, count: leaves.len(), cost: NodeCostSums::from_leaves(leaves).cost() }
    }
}

/// Sums over several leaves, used to compute the cost of a node.
#[derive(Clone, Copy)]
struct NodeCostSums {
    count: usize,
    power: f64,
    min: DVec3,
    max: DVec3,
    /// Power-weighted sum of the axes.
    axes: DVec3,
}

impl NodeCostSums {
    const NOTHING: Self =
        Self { count: 0, power: 0.0, min: DVec3::INFINITY, max: DVec3::NEG_INFINITY, axes: DVec3::ZERO };

    fn from_leaves(leaves: &[LightLeaf]) -> Self {
        let mut sum = Self::NOTHING;
        leaves.iter().for_each(|leaf| sum.add_leaf(leaf));
        sum
    }

    fn add_leaf(&mut self, leaf: &LightLeaf) {
        let LightBounds { center, radius, power, cone, .. } = &leaf.bounds;
        let EmissionCone { axis, cos, .. } = cone;
        self.count += 1;
        self.power += power;
        (self.min, self.max) = (self.min.min(center - radius), self.max.max(center + radius));
        // Weight the axis by the length of the cone's mean direction.
        self.axes += axis * (power * 0.5 * (1.0 + cos));
    }

    fn plus(mut self, other: &Self) -> Self {
        self.count += other.count;
        self.power += other.power;
        (self.min, self.max) = (self.min.min(other.min), self.max.max(other.max));
        self.axes += other.axes;
        self
    }

    /// Power × area × solid angle (section 4.4, equation 1). The solid angle is taken from a cone whose mean
    /// direction has the same length. The area is replaced by the squared diagonal, which is nonzero even if
    /// the lights are in a row.
    fn cost(&self) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let mean = (self.axes.length() / self.power).min(1.0);
        self.power * (self.max - self.min).length_squared() * (1.0 + 3.0 * (1.0 - mean))
    }
}

/// Maximum number of leaves to sort. Larger sets of leaves are binned.
const MAX_SORTED: usize = 1 << 15;

/// Number of bins along the longest axis.
const BINS: usize = 64;

/// Splits leaves into two nonempty parts along the longest axis. Returns the size of the first part, which is
/// a multiple of `unit` unless there are too many leaves to sort.
fn partition_leaves_along_longest_axis(leaves: &mut [LightLeaf], unit: usize) -> usize {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for leaf in &*leaves {
        (min, max) = (min.min(leaf.bounds.center), max.max(leaf.bounds.center));
    }
    let extent = max - min;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    if leaves.len() > MAX_SORTED && extent[axis] > 0.0 {
        let bin_of = |leaf: &LightLeaf| {
            let share = (leaf.bounds.center[axis] - min[axis]) / extent[axis];
            ((share * BINS as f64) as usize).min(BINS - 1)
        };
        let mut bins = [NodeCostSums::NOTHING; BINS];
        for leaf in &*leaves {
            bins[bin_of(leaf)].add_leaf(leaf);
        }
        let last = cheapest_split_index(&bins);
        let count = bins[..last].iter().map(|bin| bin.count).sum();
        if count > 0 {
            leaves.sort_by_key(|leaf| bin_of(leaf) >= last);
            return count;
        }
    }
    // A stable sort makes the tree identical on all machines.
    leaves.sort_by(|a, b| a.bounds.center[axis].total_cmp(&b.bounds.center[axis]));
    let parts: Vec<NodeCostSums> = leaves.chunks(unit).map(NodeCostSums::from_leaves).collect();
    cheapest_split_index(&parts) * unit
}

/// Finds the split with the lowest total cost for a sequence of parts. Returns the number of parts in the
/// first half. Neither half is empty.
fn cheapest_split_index(parts: &[NodeCostSums]) -> usize {
    let mut right = parts.to_vec();
    for i in (0..parts.len() - 1).rev() {
        right[i] = right[i].plus(&right[i + 1]);
    }
    let (mut left, mut best) = (NodeCostSums::NOTHING, (f64::INFINITY, 1));
    for i in 1..parts.len() {
        left = left.plus(&parts[i - 1]);
        let cost = left.cost() + right[i].cost();
        if left.count > 0 && right[i].count > 0 && cost < best.0 {
            best = (cost, i);
        }
    }
    best.1
}
