//! Nodes of a light tree: the bounds of sixteen children side by side.

use super::bounds::{Edge, LightBounds, Space};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};

/// A node of a tree, with its children.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Bounds of the children's positions and emission.
    bounds: BoundsRow,
    /// Whether all children are in the scene, fall off with distance and emit in all directions, as points and balls do. Otherwise
    /// the computations take account of all of this.
    is_plain: bool,
    /// Contents of the children.
    pub children: [Child; PACKET_SIZE],
    /// The number of leaves before each child, in the order of the tree; that of the whole tree for an unused child.
    pub first: [u32; PACKET_SIZE],
    /// Number of children.
    pub count: u32,
}

/// Bounds of lights, side by side.
#[derive(Clone, Debug, PartialEq)]
struct BoundsRow {
    /// Centres of the bounding spheres.
    center: Vec3x16,
    /// Radii of the spheres, with the rounding errors of the centres.
    radius: F32x16,
    /// 1 if the sphere is in the scene, 0 if it is among directions.
    is_place: F32x16,
    /// 1 if light falls off with distance, else 0.
    weakens: F32x16,
    /// Power in a unit of about the tree's power; 0 in an unused lane.
    power: F32x16,
    /// Inverse of four times the radii.
    spread: F32x16,
    /// Axes of the cones of emission.
    axis: Vec3x16,
    /// Cosines of their half angles.
    cos: F32x16,
    sin: F32x16,
    /// Cosine of the angle from the cone at which emission ends.
    end: F32x16,
}

impl BoundsRow {
    const EMPTY: Self = Self {
        center: [[0.0; PACKET_SIZE]; 3],
        radius: [0.0; PACKET_SIZE],
        is_place: [0.0; PACKET_SIZE],
        weakens: [0.0; PACKET_SIZE],
        power: [0.0; PACKET_SIZE],
        spread: [1.0; PACKET_SIZE],
        axis: [[0.0; PACKET_SIZE]; 3],
        cos: [-1.0; PACKET_SIZE],
        sin: [0.0; PACKET_SIZE],
        end: [1.0; PACKET_SIZE],
    };

    /// The bounds of one lane, in all lanes.
    #[inline(always)]
    fn splat(&self, i: usize) -> Self {
        Self {
            center: splat3(lane(&self.center, i)),
            radius: [self.radius[i]; PACKET_SIZE],
            is_place: [self.is_place[i]; PACKET_SIZE],
            weakens: [self.weakens[i]; PACKET_SIZE],
            power: [self.power[i]; PACKET_SIZE],
            spread: [self.spread[i]; PACKET_SIZE],
            axis: splat3(lane(&self.axis, i)),
            cos: [self.cos[i]; PACKET_SIZE],
            sin: [self.sin[i]; PACKET_SIZE],
            end: [self.end[i]; PACKET_SIZE],
        }
    }
}

#[inline(always)]
fn splat3(v: Vec3) -> Vec3x16 {
    [[v.x; PACKET_SIZE], [v.y; PACKET_SIZE], [v.z; PACKET_SIZE]]
}

/// A child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Child {
    /// A light, by its number.
    Light(u32),
    /// A node, by its number.
    Node(u32),
}

/// Rounding error allowed for cosine bounds, and the least cosine that enters an importance.
const LEAST_COSINE: f32 = 1e-3;

/// Least and greatest importance of a child that may contribute.
const LEAST: f32 = 1e-36;
const MOST: f32 = 1e30;

/// Greatest square of a distance that counts.
const GREATEST: f32 = 1e37;

/// A point of a surface that receives light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position.
    pub point: Vec3,
    /// Unit normal for the cosines.
    pub normal: Vec3,
    /// The glossy lobe. `None` if the surface has none, or it is unknown.
    pub lobe: Option<Lobe>,
}

/// A glossy lobe beside a diffuse one.
#[derive(Clone, Copy, Debug)]
pub struct Lobe {
    /// Unit direction of the lobe's axis.
    pub axis: Vec3,
    /// The exponent of its cosine.
    pub shininess: f32,
    /// Its peak, divided by the value of the diffuse lobe beside it, or by 1 if `diffuse` is 0.
    pub peak: f32,
    /// 1, or 0 if there is no diffuse lobe.
    pub diffuse: f32,
}

impl Receiver {
    /// A receiver of which only position and normal are known.
    #[inline(always)]
    pub fn plain(point: Vec3, normal: Vec3) -> Self {
        Self { point, normal, lobe: None }
    }
}

/// [`Receiver`]s, side by side.
#[derive(Clone, Debug)]
pub struct ReceiverRow {
    /// Positions.
    pub point: Vec3x16,
    /// Unit normals.
    pub normal: Vec3x16,
    lobes: LobeRow,
}

/// [`Lobe`]s, side by side.
#[derive(Clone, Debug)]
struct LobeRow {
    axis: Vec3x16,
    shininess: F32x16,
    peak: F32x16,
    diffuse: F32x16,
}

impl ReceiverRow {
    /// Receivers of which only positions and normals are known.
    #[inline(always)]
    pub fn plain(point: &Vec3x16, normal: &Vec3x16) -> Self {
        Self { point: *point, normal: *normal, lobes: LobeRow::NONE }
    }

    /// Sets a glossy lobe.
    #[inline(always)]
    pub fn set_lobe(&mut self, i: usize, lobe: &Lobe) {
        let LobeRow { axis, shininess, peak, diffuse } = &mut self.lobes;
        set_lane(axis, i, lobe.axis);
        (shininess[i], peak[i], diffuse[i]) = (lobe.shininess, lobe.peak, lobe.diffuse);
    }

    /// The same receiver in all lanes.
    #[inline(always)]
    fn splat(receiver: &Receiver) -> Self {
        let mut row = Self::plain(&splat3(receiver.point), &splat3(receiver.normal));
        if let Some(Lobe { axis, shininess, peak, diffuse }) = receiver.lobe {
            row.lobes = LobeRow {
                axis: splat3(axis),
                shininess: [shininess; PACKET_SIZE],
                peak: [peak; PACKET_SIZE],
                diffuse: [diffuse; PACKET_SIZE],
            };
        }
        row
    }
}

impl LobeRow {
    /// Lobes of no surface.
    const NONE: Self = Self {
        axis: [[0.0; PACKET_SIZE]; 3],
        shininess: [0.0; PACKET_SIZE],
        peak: [0.0; PACKET_SIZE],
        diffuse: [1.0; PACKET_SIZE],
    };

    /// Upper bound on, and estimate of, a lobe's response to light within an angle of a direction: cosⁿ δ lies below
    /// (1 + n(1 − cos δ)/8)⁻⁸, which is no narrower than a lobe of a few lamps and never 0.
    #[inline(always)]
    fn value(&self, i: usize, cos: f32, sin: f32) -> f32 {
        let short = 1.0 - cos - sin;
        let short = if short > 0.0 { short } else { 0.0 };
        let root = 1.0 / (1.0 + 0.125 * self.shininess[i] * short);
        let square = root * root;
        let fourth = square * square;
        self.diffuse[i] + self.peak[i] * (fourth * fourth)
    }
}

/// Expected contributions of children at a point.
pub struct Expected {
    /// Importance in a unit of the tree; 0 only if the child certainly contributes nothing.
    pub importance: F32x16,
    /// Squares of the sines of half the angles that the spheres subtend; 1 inside.
    pub nearness: F32x16,
}

impl Node {
    /// A node without children, in a tree of so many lights.
    pub fn empty(leaves: u32) -> Self {
        Self {
            bounds: BoundsRow::EMPTY,
            is_plain: true,
            children: [Child::Light(u32::MAX); PACKET_SIZE],
            first: [leaves; PACKET_SIZE],
            count: 0,
        }
    }

    /// Sets a child; `unit` is that of powers, about the power of the whole tree.
    pub fn set(&mut self, i: usize, bounds: &LightBounds, unit: f64) {
        let LightBounds { space, center, radius, power, cone } = bounds;
        let own = &mut self.bounds;
        set_lane(&mut own.center, i, center.as_vec3());
        let rounding = center.abs().max_element() * 2.0 * f64::from(f32::EPSILON);
        own.radius[i] = ((radius + rounding) * 1.000_001) as f32;
        (own.is_place[i], own.weakens[i]) = match space {
            Space::Weakening => (1.0, 1.0),
            Space::Steady => (1.0, 0.0),
            Space::Beyond => (0.0, 0.0),
        };
        own.power[i] = ((power / unit) as f32).max(LEAST);
        own.spread[i] = 0.25 / own.radius[i].max(LEAST);
        self.is_plain &= *space == Space::Weakening && cone.cos <= -1.0;
        set_lane(&mut own.axis, i, cone.axis.as_vec3());
        own.cos[i] = cone.cos as f32;
        own.sin[i] = ((1.0 - cone.cos) * (1.0 + cone.cos)).max(0.0).sqrt() as f32;
        own.end[i] = match cone.edge {
            Edge::Sharp => 1.0,
            Edge::Cosine => 0.0,
        };
    }

    /// Importance of its children for a point of a surface: power by distance, by the mean cosine at the surface, by the least
    /// angle between the cone of emission and a direction from there (section 4.2, with bounds of cosines), and by the lobe's
    /// response. Never 0 if light of the child might arrive.
    #[inline(always)]
    pub fn expected(&self, receiver: &Receiver) -> Expected {
        let receivers = ReceiverRow::splat(receiver);
        expected(&self.bounds, &receivers, self.is_plain, receiver.lobe.is_some())
    }

    /// [`Node::expected`] of one child for points of surfaces, side by side.
    #[inline(always)]
    pub fn expected_of(&self, child: usize, receivers: &ReceiverRow, has_lobes: bool) -> F32x16 {
        expected(&self.bounds.splat(child), receivers, self.is_plain, has_lobes).importance
    }

    /// The child that a leaf is under, by its place in the order of the tree.
    pub fn child_over(&self, place: u32) -> usize {
        let after = self.first[1..].iter().position(|&first| first > place);
        after.unwrap_or(PACKET_SIZE - 1)
    }
}

/// Importance of lights for receivers, lane by lane.
#[inline(always)]
fn expected(bounds: &BoundsRow, receivers: &ReceiverRow, is_plain: bool, has_lobes: bool) -> Expected {
    match (is_plain, has_lobes) {
        (true, false) => expected_as::<true, false>(bounds, receivers),
        (false, false) => expected_as::<false, false>(bounds, receivers),
        (true, true) => expected_as::<true, true>(bounds, receivers),
        (false, true) => expected_as::<false, true>(bounds, receivers),
    }
}

#[inline(always)]
fn expected_as<const IS_PLAIN: bool, const HAS_LOBE: bool>(
    bounds: &BoundsRow,
    receivers: &ReceiverRow,
) -> Expected {
    let ReceiverRow { point, normal, lobes } = receivers;
    let mut offset = bounds.center;
    for axis in 0..3 {
        for i in 0..PACKET_SIZE {
            let start = if IS_PLAIN { point[axis][i] } else { point[axis][i] * bounds.is_place[i] };
            offset[axis][i] = bounds.center[axis][i] - start;
        }
    }
    // Compute squared distances, not below the squared radius, and the components along the normal.
    let [mut square, mut least, mut along] = [[0.0; PACKET_SIZE]; 3];
    for i in 0..PACKET_SIZE {
        square[i] = lane(&offset, i).length_squared();
        least[i] = at_least(bounds.radius[i] * bounds.radius[i], LEAST);
        along[i] = lane(normal, i).dot(lane(&offset, i));
    }
    let mut inverse = square;
    for i in 0..PACKET_SIZE {
        inverse[i] = at_least(square[i], least[i]);
    }
    inverse_roots(&mut inverse);
    // `towards` is positive if θ − β < 90°, and above 1 if θ < β, with β half of the angle that the sphere subtends. From
    // inside there is light in every direction.
    let [mut sin, mut towards, mut mean] = [[0.0; PACKET_SIZE]; 3];
    for i in 0..PACKET_SIZE {
        sin[i] = bounds.radius[i] * inverse[i];
        let straight = along[i] * inverse[i];
        let sum = straight + sin[i];
        towards[i] = if square[i] <= least[i] { 1.0 } else { sum };
        // Cosines at the points of a sphere are uniform between the least and the greatest; those below 0 contribute
        // nothing.
        let above = at_least(towards[i], 0.0);
        let cut = above * above * bounds.spread[i] * at_least(square[i], least[i]) * inverse[i];
        mean[i] = if straight > sin[i] { straight } else { cut };
    }
    let (mut value, mut away) = ([0.0; PACKET_SIZE], [1.0; PACKET_SIZE]);
    if IS_PLAIN {
        for i in 0..PACKET_SIZE {
            value[i] = bounds.power[i] * cosine(mean[i]) * (inverse[i] * inverse[i]);
        }
    } else {
        let [mut cos, mut without] = [[0.0; PACKET_SIZE]; 2];
        for i in 0..PACKET_SIZE {
            cos[i] = -lane(&bounds.axis, i).dot(lane(&offset, i)) * inverse[i];
            without[i] = at_least(1.0 - cos[i] * cos[i], LEAST);
        }
        let rest = without;
        inverse_roots(&mut without);
        for i in 0..PACKET_SIZE {
            let beyond = cos[i] * bounds.cos[i] + rest[i] * without[i] * bounds.sin[i];
            let is_within = (cos[i] >= bounds.cos[i]) | (square[i] <= least[i]);
            away[i] = (if is_within { 1.0 } else { beyond }) + sin[i];
            let weakened = if bounds.weakens[i] > 0.0 { inverse[i] * inverse[i] } else { 1.0 };
            value[i] = bounds.power[i] * cosine(mean[i]) * weakened * cosine(away[i]);
        }
    }
    if HAS_LOBE {
        for i in 0..PACKET_SIZE {
            value[i] *= lobes.value(i, lane(&lobes.axis, i).dot(lane(&offset, i)) * inverse[i], sin[i]);
        }
    }
    let (mut importance, mut nearness) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
    for i in 0..PACKET_SIZE {
        let value = at_most(at_least(value[i], LEAST), MOST);
        let arrives = (towards[i] > -LEAST_COSINE)
            & (IS_PLAIN | (away[i] > bounds.end[i] - LEAST_COSINE))
            & (bounds.power[i] > 0.0);
        importance[i] = if arrives { value } else { 0.0 };
        nearness[i] = sin[i] * sin[i];
    }
    Expected { importance, nearness }
}
/// 1/√x of numbers from [`LEAST`] on, within a few units of the last place, by Newton's method: a root and a division of sixteen
/// numbers would take longer than all other work on children.
#[inline(always)]
fn inverse_roots(x: &mut F32x16) {
    for i in 0..PACKET_SIZE {
        let x = &mut x[i];
        let square = at_most(*x, GREATEST);
        let half = 0.5 * square;
        let root = f32::from_bits(0x5f37_5a86_u32.wrapping_sub(square.to_bits() >> 1));
        let root = root * (1.5 - half * root * root);
        let root = root * (1.5 - half * root * root);
        *x = root * (1.5 - half * root * root);
    }
}

/// Clamps the bound of a cosine.
#[inline(always)]
fn cosine(bound: f32) -> f32 {
    at_most(at_least(bound, LEAST_COSINE), 1.0)
}

#[inline(always)]
fn at_least(x: f32, least: f32) -> f32 {
    if x > least { x } else { least }
}

#[inline(always)]
fn at_most(x: f32, most: f32) -> f32 {
    if x < most { x } else { most }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_roots_are_those_of_a_division() {
        for exponent in -35..37 {
            let mut x: F32x16 = std::array::from_fn(|i| (1.0 + 0.6 * i as f32) * 10_f32.powi(exponent));
            let expected = x.map(|x| (1.0 / f64::from(at_most(x, GREATEST)).sqrt()) as f32);
            inverse_roots(&mut x);
            for (root, expected) in x.iter().zip(expected) {
                assert!((root / expected - 1.0).abs() < 4.0 * f32::EPSILON, "{root} {expected}");
            }
        }
    }
}
