//! Nodes of a light tree: the bounds of sixteen children side by side.

use super::bounds::{Edge, LightBounds, Space};
use crate::math::Vec3;
use crate::math::lanes::{LANES, Lanes, Lanes3, lane, set_lane};

/// Children of a tree's node.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Where the children are and what they send.
    bounds: BoundsRow,
    /// Whether all children are in the scene, weaken with distance and send light everywhere, as points and balls do: of others all
    /// that follows is looked at.
    is_plain: bool,
    /// What the children are.
    pub children: [Child; LANES],
    /// The number of leaves before each child, in the order of the tree; of the whole tree where there is none.
    pub first: [u32; LANES],
    /// How many there are.
    pub count: u32,
}

/// Bounds of lights, side by side.
#[derive(Clone, Debug, PartialEq)]
struct BoundsRow {
    /// Centres of the bounding spheres.
    center: Lanes3,
    /// Radii of the same, with the rounding errors of the centres.
    radius: Lanes,
    /// 1 where the spheres are in the scene, 0 where they are among directions.
    is_place: Lanes,
    /// 1 where light weakens with distance, else 0.
    weakens: Lanes,
    /// In a unit of about the tree's power; 0 where there is no light.
    power: Lanes,
    /// One over four times the radii.
    spread: Lanes,
    /// Of the cones of emission.
    axis: Lanes3,
    /// Of their half angles.
    cos: Lanes,
    sin: Lanes,
    /// Cosine of the angle from the cone at which there is no light any more.
    end: Lanes,
}

impl BoundsRow {
    const EMPTY: Self = Self {
        center: [[0.0; LANES]; 3],
        radius: [0.0; LANES],
        is_place: [0.0; LANES],
        weakens: [0.0; LANES],
        power: [0.0; LANES],
        spread: [1.0; LANES],
        axis: [[0.0; LANES]; 3],
        cos: [-1.0; LANES],
        sin: [0.0; LANES],
        end: [1.0; LANES],
    };

    /// Those of one lane in all.
    #[inline(always)]
    fn splat(&self, i: usize) -> Self {
        Self {
            center: splat3(lane(&self.center, i)),
            radius: [self.radius[i]; LANES],
            is_place: [self.is_place[i]; LANES],
            weakens: [self.weakens[i]; LANES],
            power: [self.power[i]; LANES],
            spread: [self.spread[i]; LANES],
            axis: splat3(lane(&self.axis, i)),
            cos: [self.cos[i]; LANES],
            sin: [self.sin[i]; LANES],
            end: [self.end[i]; LANES],
        }
    }
}

#[inline(always)]
fn splat3(v: Vec3) -> Lanes3 {
    [[v.x; LANES], [v.y; LANES], [v.z; LANES]]
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

/// Squares of distances count as no more.
const GREATEST: f32 = 1e37;

/// A point of a surface that lights are expected to bring light to.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Where.
    pub point: Vec3,
    /// Unit normal that the cosines are of.
    pub normal: Vec3,
    /// The glossy lobe; none of a surface that has none, or of which nothing is known.
    pub lobe: Option<Lobe>,
}

/// A glossy lobe beside a diffuse one.
#[derive(Clone, Copy, Debug)]
pub struct Lobe {
    /// The unit direction that it is around.
    pub axis: Vec3,
    /// The exponent of its cosine.
    pub shininess: f32,
    /// Its peak by the value of the diffuse lobe beside it, or by 1 where `diffuse` is 0.
    pub peak: f32,
    /// 1, or 0 where there is no other lobe.
    pub diffuse: f32,
}

impl Receiver {
    /// Of a surface of which nothing but this is known.
    #[inline(always)]
    pub fn plain(point: Vec3, normal: Vec3) -> Self {
        Self { point, normal, lobe: None }
    }
}

/// [`Receiver`]s, side by side.
#[derive(Clone, Debug)]
pub struct ReceiverRow {
    /// Where.
    pub point: Lanes3,
    /// Unit normals.
    pub normal: Lanes3,
    lobes: LobeRow,
}

/// [`Lobe`]s, side by side.
#[derive(Clone, Debug)]
struct LobeRow {
    axis: Lanes3,
    shininess: Lanes,
    peak: Lanes,
    diffuse: Lanes,
}

impl ReceiverRow {
    /// Of surfaces of which nothing but this is known.
    #[inline(always)]
    pub fn plain(point: &Lanes3, normal: &Lanes3) -> Self {
        Self { point: *point, normal: *normal, lobes: LobeRow::NONE }
    }

    /// Set a glossy lobe.
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
                shininess: [shininess; LANES],
                peak: [peak; LANES],
                diffuse: [diffuse; LANES],
            };
        }
        row
    }
}

impl LobeRow {
    /// Of no surface.
    const NONE: Self =
        Self { axis: [[0.0; LANES]; 3], shininess: [0.0; LANES], peak: [0.0; LANES], diffuse: [1.0; LANES] };

    /// What a surface makes of light from within an angle of a direction, at most and about: cosⁿ δ lies below
    /// (1 + n(1 − cos δ)/8)⁻⁸, which is no narrower than a lobe of a few lamps and has no end.
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

/// What children are expected to bring to a point.
pub struct Expected {
    /// In a unit of the tree; 0 where certainly nothing.
    pub importance: Lanes,
    /// Squares of the sines of half the angles that the spheres fill; 1 inside.
    pub nearness: Lanes,
}

impl Node {
    /// Without children, in a tree of so many lights.
    pub fn empty(leaves: u32) -> Self {
        Self {
            bounds: BoundsRow::EMPTY,
            is_plain: true,
            children: [Child::Light(u32::MAX); LANES],
            first: [leaves; LANES],
            count: 0,
        }
    }

    /// Set a child; `unit` is that of powers, about the power of the whole tree.
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

    /// What its children are expected to bring to a point of a surface: power by distance, by the mean cosine at the surface, by the
    /// least angle between the cone of emission and a direction from there (section 4.2, with bounds of cosines), and by what a lobe
    /// makes of it. Never 0 where a light of the child might arrive.
    #[inline(always)]
    pub fn expected(&self, receiver: &Receiver) -> Expected {
        let receivers = ReceiverRow::splat(receiver);
        expected(&self.bounds, &receivers, self.is_plain, receiver.lobe.is_some())
    }

    /// What one of its children is expected to bring to points of surfaces, side by side; as [`Node::expected`].
    #[inline(always)]
    pub fn expected_of(&self, child: usize, receivers: &ReceiverRow, has_lobes: bool) -> Lanes {
        expected(&self.bounds.splat(child), receivers, self.is_plain, has_lobes).importance
    }

    /// The child that a leaf is under, by its place in the order of the tree.
    pub fn child_over(&self, place: u32) -> usize {
        let after = self.first[1..].iter().position(|&first| first > place);
        after.unwrap_or(LANES - 1)
    }
}

/// What lights are expected to bring to receivers, lane by lane.
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
        for i in 0..LANES {
            let start = if IS_PLAIN { point[axis][i] } else { point[axis][i] * bounds.is_place[i] };
            offset[axis][i] = bounds.center[axis][i] - start;
        }
    }
    // Squares of the distance, not below that of the radius; and the part along the normal.
    let [mut square, mut least, mut along] = [[0.0; LANES]; 3];
    for i in 0..LANES {
        square[i] = lane(&offset, i).length_squared();
        least[i] = at_least(bounds.radius[i] * bounds.radius[i], LEAST);
        along[i] = lane(normal, i).dot(lane(&offset, i));
    }
    let mut inverse = square;
    for i in 0..LANES {
        inverse[i] = at_least(square[i], least[i]);
    }
    inverse_roots(&mut inverse);
    // Positive where θ − β < 90°, and above 1 where θ < β, with β half of the angle that the sphere fills. From inside there is
    // light in every direction.
    let [mut sin, mut towards, mut mean] = [[0.0; LANES]; 3];
    for i in 0..LANES {
        sin[i] = bounds.radius[i] * inverse[i];
        let straight = along[i] * inverse[i];
        let sum = straight + sin[i];
        towards[i] = if square[i] <= least[i] { 1.0 } else { sum };
        // Cosines at the points of a sphere are uniform between the least and the greatest; those below 0 bring nothing.
        let above = at_least(towards[i], 0.0);
        let cut = above * above * bounds.spread[i] * at_least(square[i], least[i]) * inverse[i];
        mean[i] = if straight > sin[i] { straight } else { cut };
    }
    let (mut value, mut away) = ([0.0; LANES], [1.0; LANES]);
    if IS_PLAIN {
        for i in 0..LANES {
            value[i] = bounds.power[i] * cosine(mean[i]) * (inverse[i] * inverse[i]);
        }
    } else {
        let [mut cos, mut without] = [[0.0; LANES]; 2];
        for i in 0..LANES {
            cos[i] = -lane(&bounds.axis, i).dot(lane(&offset, i)) * inverse[i];
            without[i] = at_least(1.0 - cos[i] * cos[i], LEAST);
        }
        let rest = without;
        inverse_roots(&mut without);
        for i in 0..LANES {
            let beyond = cos[i] * bounds.cos[i] + rest[i] * without[i] * bounds.sin[i];
            let is_within = (cos[i] >= bounds.cos[i]) | (square[i] <= least[i]);
            away[i] = (if is_within { 1.0 } else { beyond }) + sin[i];
            let weakened = if bounds.weakens[i] > 0.0 { inverse[i] * inverse[i] } else { 1.0 };
            value[i] = bounds.power[i] * cosine(mean[i]) * weakened * cosine(away[i]);
        }
    }
    if HAS_LOBE {
        for i in 0..LANES {
            value[i] *= lobes.value(i, lane(&lobes.axis, i).dot(lane(&offset, i)) * inverse[i], sin[i]);
        }
    }
    let (mut importance, mut nearness) = ([0.0; LANES], [0.0; LANES]);
    for i in 0..LANES {
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
/// numbers would take longer than all else that is asked of children.
#[inline(always)]
fn inverse_roots(x: &mut Lanes) {
    for i in 0..LANES {
        let x = &mut x[i];
        let square = at_most(*x, GREATEST);
        let half = 0.5 * square;
        let root = f32::from_bits(0x5f37_5a86_u32.wrapping_sub(square.to_bits() >> 1));
        let root = root * (1.5 - half * root * root);
        let root = root * (1.5 - half * root * root);
        *x = root * (1.5 - half * root * root);
    }
}

/// A bound of a cosine as it counts.
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
            let mut x: Lanes = std::array::from_fn(|i| (1.0 + 0.6 * i as f32) * 10_f32.powi(exponent));
            let expected = x.map(|x| (1.0 / f64::from(at_most(x, GREATEST)).sqrt()) as f32);
            inverse_roots(&mut x);
            for (root, expected) in x.iter().zip(expected) {
                assert!((root / expected - 1.0).abs() < 4.0 * f32::EPSILON, "{root} {expected}");
            }
        }
    }
}
