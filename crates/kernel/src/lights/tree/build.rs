//! Building light trees from the top: lights that are close together and emit in similar directions come under one node (Conty
//! Estevez and Kulla, 2018, section 4.4, with bins).

use super::bounds::{EmissionCone, LightBounds};
use super::node::{Child, Node};
use super::{LightTree, NOWHERE};
use crate::control::{CancelToken, Cancelled};
use crate::math::DVec3;
use crate::math::float::floor_to_power_of_two;
use crate::math::lanes::PACKET_SIZE;

impl LightTree {
    /// A tree over these lights, which an index names; lights without bounds emit nothing. `None` if no light emits.
    ///
    /// # Errors
    /// [`Cancelled`] if the token is cancelled; a large tree takes a while.
    pub fn new(lights: &[Option<LightBounds>], token: &CancelToken) -> Result<Option<Self>, Cancelled> {
        let mut leaves: Vec<Leaf> = (0..).zip(lights).filter_map(Leaf::new).collect();
        // Lights of one space come together.
        leaves.sort_by_key(|leaf| leaf.bounds.space);
        let power: f64 = leaves.iter().map(|leaf| leaf.bounds.power).sum();
        let mut places = vec![NOWHERE; lights.len()];
        let unit = floor_to_power_of_two(power);
        let mut builder = Builder { nodes: Vec::new(), unit, leaves: leaves.len() as u32, token };
        if leaves.is_empty() {
            return Ok(None);
        }
        builder.node(&mut leaves, 0)?;
        for (place, leaf) in (0..).zip(&leaves) {
            places[leaf.light as usize] = place;
        }
        let is_over_lights = |node: &Node| matches!(node.children[0], Child::Light(_));
        let over_lights = (0..).zip(&builder.nodes).filter(|(_, node)| is_over_lights(node)).map(|(i, _)| i);
        Ok(Some(Self { over_lights: over_lights.collect(), nodes: builder.nodes, places }))
    }
}

/// A light of the tree.
#[derive(Clone)]
struct Leaf {
    light: u32,
    bounds: LightBounds,
}

impl Leaf {
    fn new((light, bounds): (u32, &Option<LightBounds>)) -> Option<Self> {
        let bounds = (*bounds)?;
        (bounds.power > 0.0).then_some(Self { light, bounds })
    }
}

struct Builder<'a> {
    nodes: Vec<Node>,
    /// Unit of powers. It is a power of two, which rounds nothing, so that a scaled scene has the same picks.
    unit: f64,
    /// Number of lights.
    leaves: u32,
    token: &'a CancelToken,
}

impl Builder<'_> {
    /// Builds the node over some leaves, behind so many others; returns its number.
    fn node(&mut self, leaves: &mut [Leaf], before: u32) -> Result<u32, Cancelled> {
        let number = self.nodes.len() as u32;
        self.nodes.push(Node::empty(self.leaves));
        let is_over_lights = leaves.len() <= PACKET_SIZE;
        let groups = groups(leaves, self.token)?;
        let mut node = Node::empty(self.leaves);
        let (mut rest, mut first) = (leaves, before);
        for (i, count) in groups.into_iter().enumerate() {
            let (own, others) = rest.split_at_mut(count);
            rest = others;
            let Some(bounds) = LightBounds::around(own.iter().map(|leaf| &leaf.bounds)) else { continue };
            node.set(i, &bounds, self.unit);
            node.first[i] = first;
            node.children[i] = match own {
                [leaf] if is_over_lights => Child::Light(leaf.light),
                several => Child::Node(self.node(several, first)?),
            };
            node.count = i as u32 + 1;
            first += count as u32;
        }
        self.nodes[number as usize] = node;
        Ok(number)
    }
}

/// Forms groups of leaves, at most one for each child, and returns their sizes. There are as few groups as possible, so that
/// nodes are full.
fn groups(leaves: &mut [Leaf], token: &CancelToken) -> Result<Vec<usize>, Cancelled> {
    token.check()?;
    if leaves.len() <= PACKET_SIZE {
        return Ok(vec![1; leaves.len()]);
    }
    let mut unit = PACKET_SIZE;
    while unit * PACKET_SIZE < leaves.len() {
        unit *= PACKET_SIZE;
    }
    let mut groups: Vec<Group> = Vec::with_capacity(PACKET_SIZE);
    let mut start = 0;
    for own in leaves.chunk_by(|a, b| a.bounds.space == b.bounds.space) {
        groups.push(Group::new(start, own));
        start += own.len();
    }
    while groups.len() < PACKET_SIZE {
        let dearest = (0..groups.len()).filter(|&i| groups[i].count > unit);
        let Some(dearest) = dearest.max_by(|&a, &b| groups[a].cost.total_cmp(&groups[b].cost)) else { break };
        let Group { start, count, .. } = groups[dearest];
        let own = &mut leaves[start..start + count];
        token.check()?;
        let middle = split(own, unit);
        let (left, right) = own.split_at(middle);
        groups[dearest] = Group::new(start, left);
        groups.insert(dearest + 1, Group::new(start + middle, right));
    }
    Ok(groups.into_iter().map(|group| group.count).collect())
}

/// A run of leaves.
struct Group {
    start: usize,
    count: usize,
    cost: f64,
}

impl Group {
    fn new(start: usize, leaves: &[Leaf]) -> Self {
        Self { start, count: leaves.len(), cost: Sum::of(leaves).cost() }
    }
}

/// Sums over leaves for the cost of a node over them.
#[derive(Clone, Copy)]
struct Sum {
    count: usize,
    power: f64,
    min: DVec3,
    max: DVec3,
    /// Sum of axes times powers.
    axes: DVec3,
}

impl Sum {
    const NOTHING: Self =
        Self { count: 0, power: 0.0, min: DVec3::INFINITY, max: DVec3::NEG_INFINITY, axes: DVec3::ZERO };

    fn of(leaves: &[Leaf]) -> Self {
        let mut sum = Self::NOTHING;
        leaves.iter().for_each(|leaf| sum.add(leaf));
        sum
    }

    fn add(&mut self, leaf: &Leaf) {
        let LightBounds { center, radius, power, cone, .. } = &leaf.bounds;
        let EmissionCone { axis, cos, .. } = cone;
        self.count += 1;
        self.power += power;
        (self.min, self.max) = (self.min.min(center - radius), self.max.max(center + radius));
        // The mean of the directions of a cone has this length.
        self.axes += axis * (power * 0.5 * (1.0 + cos));
    }

    fn and(mut self, other: &Self) -> Self {
        self.count += other.count;
        self.power += other.power;
        (self.min, self.max) = (self.min.min(other.min), self.max.max(other.max));
        self.axes += other.axes;
        self
    }

    /// Power times area times solid angle (section 4.4, equation 1). The solid angle is that of a cone whose directions have
    /// this mean. The square of the diagonal replaces the area, as it is not 0 for lights in a row.
    fn cost(&self) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let mean = (self.axes.length() / self.power).min(1.0);
        self.power * (self.max - self.min).length_squared() * (1.0 + 3.0 * (1.0 - mean))
    }
}

/// Most leaves that are sorted; more are split between bins.
const MOST_SORTED: usize = 1 << 15;

/// Bins along the longest axis.
const BINS: usize = 64;

/// Splits leaves into two parts along the longest axis, neither of them empty; returns the start of the second. Few leaves are
/// sorted, and then the first part is a multiple of `unit`.
fn split(leaves: &mut [Leaf], unit: usize) -> usize {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for leaf in &*leaves {
        (min, max) = (min.min(leaf.bounds.center), max.max(leaf.bounds.center));
    }
    let extent = max - min;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    if leaves.len() > MOST_SORTED && extent[axis] > 0.0 {
        let bin_of = |leaf: &Leaf| {
            let share = (leaf.bounds.center[axis] - min[axis]) / extent[axis];
            ((share * BINS as f64) as usize).min(BINS - 1)
        };
        let mut bins = [Sum::NOTHING; BINS];
        for leaf in &*leaves {
            bins[bin_of(leaf)].add(leaf);
        }
        let last = cheapest(&bins);
        let count = bins[..last].iter().map(|bin| bin.count).sum();
        if count > 0 {
            leaves.sort_by_key(|leaf| bin_of(leaf) >= last);
            return count;
        }
    }
    // A stable order: the tree is the same on all machines.
    leaves.sort_by(|a, b| a.bounds.center[axis].total_cmp(&b.bounds.center[axis]));
    let parts: Vec<Sum> = leaves.chunks(unit).map(Sum::of).collect();
    cheapest(&parts) * unit
}

/// Number of parts, side by side, to put together at the least cost, with the others together as well; both sides have leaves.
fn cheapest(parts: &[Sum]) -> usize {
    let mut right = parts.to_vec();
    for i in (0..parts.len() - 1).rev() {
        right[i] = right[i].and(&right[i + 1]);
    }
    let (mut left, mut best) = (Sum::NOTHING, (f64::INFINITY, 1));
    for i in 1..parts.len() {
        left = left.and(&parts[i - 1]);
        let cost = left.cost() + right[i].cost();
        if left.count > 0 && right[i].count > 0 && cost < best.0 {
            best = (cost, i);
        }
    }
    best.1
}
