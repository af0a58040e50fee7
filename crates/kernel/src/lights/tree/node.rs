//! Light tree nodes, which store bounds on their 16 children in SIMD layout.

use super::bounds::{ConeFalloff, DistanceFalloff, LightBounds};
use crate::math::Vec3;
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane, set_lane};

/// A node with up to 16 children.
#[derive(Clone, Debug, PartialEq)]
pub struct LightTreeNode {
    /// Bounds on the children's positions and emission.
    bounds: LightBoundsPacket,
    /// Whether all children have a position, inverse-square falloff, and emission in all directions (like
    /// point lights and spheres). If not, the general code path is used.
    is_plain: bool,
    /// The children.
    pub children: [NodeChild; PACKET_SIZE],
    /// Number of leaves before each child in tree order. For unused children, the number of leaves in the
    /// tree.
    pub first: [u32; PACKET_SIZE],
    /// Number of children.
    pub count: u32,
}

/// A packet of light bounds.
#[derive(Clone, Debug, PartialEq)]
struct LightBoundsPacket {
    /// Centers of the bounding spheres.
    center: Vec3x16,
    /// Radii of the bounding spheres, enlarged by the rounding errors of the centers.
    radius: F32x16,
    /// 1 if the sphere bounds positions, 0 if it bounds directions.
    is_place: F32x16,
    /// 1 for inverse-square falloff, otherwise 0.
    weakens: F32x16,
    /// Power in a unit close to the entire tree's power, or 0 in unused lanes.
    power: F32x16,
    /// 1 / (4 · radius).
    spread: F32x16,
    /// Axes of the emission cones.
    axis: Vec3x16,
    /// Cosines of the cones' half angles.
    cos: F32x16,
    sin: F32x16,
    /// Cosine of the angle outside the cone at which emission ends.
    end: F32x16,
}

impl LightBoundsPacket {
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

    /// Broadcasts one lane to all lanes.
    #[inline(always)]
    fn splat_lane(&self, i: usize) -> Self {
        Self {
            center: splat_vec3(lane(&self.center, i)),
            radius: [self.radius[i]; PACKET_SIZE],
            is_place: [self.is_place[i]; PACKET_SIZE],
            weakens: [self.weakens[i]; PACKET_SIZE],
            power: [self.power[i]; PACKET_SIZE],
            spread: [self.spread[i]; PACKET_SIZE],
            axis: splat_vec3(lane(&self.axis, i)),
            cos: [self.cos[i]; PACKET_SIZE],
            sin: [self.sin[i]; PACKET_SIZE],
            end: [self.end[i]; PACKET_SIZE],
        }
    }
}

#[inline(always)]
fn splat_vec3(v: Vec3) -> Vec3x16 {
    [[v.x; PACKET_SIZE], [v.y; PACKET_SIZE], [v.z; PACKET_SIZE]]
}

/// A child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeChild {
    /// The index of a light.
    Light(u32),
    /// The index of a node.
    LightTreeNode(u32),
}

/// Tolerance for rounding errors in bounds on cosines, and minimum cosine used in an importance.
const MIN_COSINE: f32 = 1e-3;

/// Minimum and maximum importance for a child that may contribute.
const MIN_IMPORTANCE: f32 = 1e-36;
const MAX_IMPORTANCE: f32 = 1e30;

/// Maximum squared distance.
const MAX_SQUARED_DISTANCE: f32 = 1e37;

/// A surface point that receives light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position.
    pub point: Vec3,
    /// Unit normal of the surface.
    pub normal: Vec3,
    /// The glossy lobe, or `None` if the surface has no glossy lobe or if it is unknown.
    pub lobe: Option<ReceiverLobe>,
}

/// A glossy lobe, usually in addition to a diffuse lobe.
#[derive(Clone, Copy, Debug)]
pub struct ReceiverLobe {
    /// Unit direction of the lobe's axis.
    pub axis: Vec3,
    /// Exponent of the cosine.
    pub shininess: f32,
    /// Peak value. It is relative to the diffuse lobe, or absolute if `diffuse` is 0.
    pub peak: f32,
    /// 1 if there is a diffuse lobe, otherwise 0.
    pub diffuse: f32,
}

impl Receiver {
    /// Creates a receiver from its position and normal. The glossy lobe is unknown.
    #[inline(always)]
    pub fn with_unknown_lobe(point: Vec3, normal: Vec3) -> Self {
        Self { point, normal, lobe: None }
    }
}

/// A packet of [`Receiver`]s.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct ReceiverPacket {
    /// Positions.
    pub point: Vec3x16,
    /// Unit normals.
    pub normal: Vec3x16,
    lobes: LobePacket,
}

/// A packet of [`ReceiverLobe`]s.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct LobePacket {
    axis: Vec3x16,
    shininess: F32x16,
    peak: F32x16,
    diffuse: F32x16,
}

impl ReceiverPacket {
    /// Creates receivers from their positions and normals. The glossy lobes are unknown.
    #[inline(always)]
    pub fn with_unknown_lobe(point: &Vec3x16, normal: &Vec3x16) -> Self {
        Self { point: *point, normal: *normal, lobes: LobePacket::NONE }
    }

    /// Sets a lane's glossy lobe.
    #[inline(always)]
    pub fn set_lobe(&mut self, i: usize, lobe: &ReceiverLobe) {
        let LobePacket { axis, shininess, peak, diffuse } = &mut self.lobes;
        set_lane(axis, i, lobe.axis);
        (shininess[i], peak[i], diffuse[i]) = (lobe.shininess, lobe.peak, lobe.diffuse);
    }

    /// A packet with the same receiver in all lanes.
    #[inline(always)]
    fn splat(receiver: &Receiver) -> Self {
        let mut row = Self::with_unknown_lobe(&splat_vec3(receiver.point), &splat_vec3(receiver.normal));
        if let Some(ReceiverLobe { axis, shininess, peak, diffuse }) = receiver.lobe {
            row.lobes = LobePacket {
                axis: splat_vec3(axis),
                shininess: [shininess; PACKET_SIZE],
                peak: [peak; PACKET_SIZE],
                diffuse: [diffuse; PACKET_SIZE],
            };
        }
        row
    }
}

impl LobePacket {
    /// Lanes without a glossy lobe.
    const NONE: Self = Self {
        axis: [[0.0; PACKET_SIZE]; 3],
        shininess: [0.0; PACKET_SIZE],
        peak: [0.0; PACKET_SIZE],
        diffuse: [1.0; PACKET_SIZE],
    };

    /// A lobe's response to light within an angle δ of a direction. The result is an upper bound that also
    /// serves as an estimate: cosⁿ δ is at most (1 + n(1 − cos δ)/8)⁻⁸, which is never 0.
    #[inline(always)]
    fn response_bound_in_lane(&self, i: usize, cos: f32, sin: f32) -> f32 {
        let short = 1.0 - cos - sin;
        let short = if short > 0.0 { short } else { 0.0 };
        let root = 1.0 / (1.0 + 0.125 * self.shininess[i] * short);
        let square = root * root;
        let fourth = square * square;
        self.diffuse[i] + self.peak[i] * (fourth * fourth)
    }
}

/// Expected contributions of a node's children at a point.
#[repr(align(64))]
pub struct ImportanceAndNearnessPacket {
    /// Importance in the tree's unit of power. It is 0 only if the child certainly contributes nothing.
    pub importance: F32x16,
    /// Squared sines of half the angles that the bounding spheres subtend, or 1 for points inside a sphere.
    pub nearness: F32x16,
}

impl LightTreeNode {
    /// A node without children in a tree with `leaves` lights.
    pub fn empty(leaves: u32) -> Self {
        Self {
            bounds: LightBoundsPacket::EMPTY,
            is_plain: true,
            children: [NodeChild::Light(u32::MAX); PACKET_SIZE],
            first: [leaves; PACKET_SIZE],
            count: 0,
        }
    }

    /// Sets a child. `unit` is the unit of power, approximately the power of the entire tree.
    pub fn set_child_bounds(&mut self, i: usize, bounds: &LightBounds, unit: f64) {
        let LightBounds { space, center, radius, power, cone } = bounds;
        let own = &mut self.bounds;
        set_lane(&mut own.center, i, center.as_vec3());
        let rounding = center.abs().max_element() * 2.0 * f64::from(f32::EPSILON);
        own.radius[i] = ((radius + rounding) * 1.000_001) as f32;
        (own.is_place[i], own.weakens[i]) = match space {
            DistanceFalloff::InverseSquare => (1.0, 1.0),
            DistanceFalloff::Constant => (1.0, 0.0),
            DistanceFalloff::Beyond => (0.0, 0.0),
        };
        own.power[i] = ((power / unit) as f32).max(MIN_IMPORTANCE);
        own.spread[i] = 0.25 / own.radius[i].max(MIN_IMPORTANCE);
        self.is_plain &= *space == DistanceFalloff::InverseSquare && cone.cos <= -1.0;
        set_lane(&mut own.axis, i, cone.axis.as_vec3());
        own.cos[i] = cone.cos as f32;
        own.sin[i] = ((1.0 - cone.cos) * (1.0 + cone.cos)).max(0.0).sqrt() as f32;
        own.end[i] = match cone.edge {
            ConeFalloff::Sharp => 1.0,
            ConeFalloff::Cosine => 0.0,
        };
    }

    /// Importance of the children for a surface point: power × distance falloff × mean cosine at the surface
    /// × cosine of the smallest angle between the emission cone and a direction from the child (section 4.2,
    /// with bounds on cosines) × the lobe's response. It is never 0 if light from the child may reach the
    /// point.
    #[inline(always)]
    pub fn child_importances(&self, receiver: &Receiver) -> ImportanceAndNearnessPacket {
        let receivers = ReceiverPacket::splat(receiver);
        light_importances(&self.bounds, &receivers, self.is_plain, receiver.lobe.is_some())
    }

    /// [`LightTreeNode::child_importances`] of one child for a packet of surface points.
    #[inline(always)]
    pub fn importance_packet_of_child(
        &self,
        child: usize,
        receivers: &ReceiverPacket,
        has_lobes: bool,
    ) -> F32x16 {
        light_importances(&self.bounds.splat_lane(child), receivers, self.is_plain, has_lobes).importance
    }

    /// The child that contains the leaf at `place` in tree order.
    pub fn child_containing(&self, place: u32) -> usize {
        let after = self.first[1..].iter().position(|&first| first > place);
        after.unwrap_or(PACKET_SIZE - 1)
    }
}

/// Importance of a light for a receiver in each lane.
#[inline(always)]
fn light_importances(
    bounds: &LightBoundsPacket,
    receivers: &ReceiverPacket,
    is_plain: bool,
    has_lobes: bool,
) -> ImportanceAndNearnessPacket {
    match (is_plain, has_lobes) {
        (true, false) => specialized_importances::<true, false>(bounds, receivers),
        (false, false) => specialized_importances::<false, false>(bounds, receivers),
        (true, true) => specialized_importances::<true, true>(bounds, receivers),
        (false, true) => specialized_importances::<false, true>(bounds, receivers),
    }
}

#[inline(always)]
fn specialized_importances<const IS_PLAIN: bool, const HAS_LOBE: bool>(
    bounds: &LightBoundsPacket,
    receivers: &ReceiverPacket,
) -> ImportanceAndNearnessPacket {
    let ReceiverPacket { point, normal, lobes } = receivers;
    let mut offset = bounds.center;
    for axis in 0..3 {
        for i in 0..PACKET_SIZE {
            let start = if IS_PLAIN { point[axis][i] } else { point[axis][i] * bounds.is_place[i] };
            offset[axis][i] = bounds.center[axis][i] - start;
        }
    }
    // Compute squared distances (bounded from below by the squared radius) and components along the normal.
    let [mut square, mut least, mut along] = [[0.0; PACKET_SIZE]; 3];
    for i in 0..PACKET_SIZE {
        square[i] = lane(&offset, i).length_squared();
        least[i] = max_or_second_if_nan(bounds.radius[i] * bounds.radius[i], MIN_IMPORTANCE);
        along[i] = lane(normal, i).dot(lane(&offset, i));
    }
    let mut inverse = square;
    for i in 0..PACKET_SIZE {
        inverse[i] = max_or_second_if_nan(square[i], least[i]);
    }
    replace_by_inverse_sqrt(&mut inverse);
    // Let θ be the angle between the normal and the sphere's center, and β half the angle that the sphere
    // subtends. `towards` is positive if θ − β < 90°. Inside the sphere, light arrives from every direction.
    let [mut sin, mut towards, mut mean] = [[0.0; PACKET_SIZE]; 3];
    for i in 0..PACKET_SIZE {
        sin[i] = bounds.radius[i] * inverse[i];
        let straight = along[i] * inverse[i];
        let sum = straight + sin[i];
        towards[i] = if square[i] <= least[i] { 1.0 } else { sum };
        // The cosines for points in a sphere are approximately uniformly distributed between the minimum and
        // the maximum. Negative cosines contribute nothing.
        let above = max_or_second_if_nan(towards[i], 0.0);
        let cut = above * above * bounds.spread[i] * max_or_second_if_nan(square[i], least[i]) * inverse[i];
        mean[i] = if straight > sin[i] { straight } else { cut };
    }
    let (mut value, mut away) = ([0.0; PACKET_SIZE], [1.0; PACKET_SIZE]);
    if IS_PLAIN {
        for i in 0..PACKET_SIZE {
            value[i] = bounds.power[i] * clamp_to_positive_cosine_range(mean[i]) * (inverse[i] * inverse[i]);
        }
    } else {
        let [mut cos, mut without] = [[0.0; PACKET_SIZE]; 2];
        for i in 0..PACKET_SIZE {
            cos[i] = -lane(&bounds.axis, i).dot(lane(&offset, i)) * inverse[i];
            without[i] = max_or_second_if_nan(1.0 - cos[i] * cos[i], MIN_IMPORTANCE);
        }
        let rest = without;
        replace_by_inverse_sqrt(&mut without);
        for i in 0..PACKET_SIZE {
            let beyond = cos[i] * bounds.cos[i] + rest[i] * without[i] * bounds.sin[i];
            let is_within = (cos[i] >= bounds.cos[i]) | (square[i] <= least[i]);
            away[i] = (if is_within { 1.0 } else { beyond }) + sin[i];
            let weakened = if bounds.weakens[i] > 0.0 { inverse[i] * inverse[i] } else { 1.0 };
            value[i] = bounds.power[i]
                * clamp_to_positive_cosine_range(mean[i])
                * weakened
                * clamp_to_positive_cosine_range(away[i]);
        }
    }
    if HAS_LOBE {
        for i in 0..PACKET_SIZE {
            value[i] *= lobes.response_bound_in_lane(
                i,
                lane(&lobes.axis, i).dot(lane(&offset, i)) * inverse[i],
                sin[i],
            );
        }
    }
    let (mut importance, mut nearness) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE]);
    for i in 0..PACKET_SIZE {
        let value = min_or_second_if_nan(max_or_second_if_nan(value[i], MIN_IMPORTANCE), MAX_IMPORTANCE);
        let arrives = (towards[i] > -MIN_COSINE)
            & (IS_PLAIN | (away[i] > bounds.end[i] - MIN_COSINE))
            & (bounds.power[i] > 0.0);
        importance[i] = if arrives { value } else { 0.0 };
        nearness[i] = sin[i] * sin[i];
    }
    ImportanceAndNearnessPacket { importance, nearness }
}
/// 1/√x for x ≥ [`MIN_IMPORTANCE`], accurate to a few ulps. Uses Newton's method because 16 square roots and
/// divisions would take longer than the rest of the node test.
#[inline(always)]
fn replace_by_inverse_sqrt(x: &mut F32x16) {
    for i in 0..PACKET_SIZE {
        let x = &mut x[i];
        let square = min_or_second_if_nan(*x, MAX_SQUARED_DISTANCE);
        let half = 0.5 * square;
        let root = f32::from_bits(0x5f37_5a86_u32.wrapping_sub(square.to_bits() >> 1));
        let root = root * (1.5 - half * root * root);
        let root = root * (1.5 - half * root * root);
        *x = root * (1.5 - half * root * root);
    }
}

/// Clamps a bound on a cosine.
#[inline(always)]
fn clamp_to_positive_cosine_range(bound: f32) -> f32 {
    min_or_second_if_nan(max_or_second_if_nan(bound, MIN_COSINE), 1.0)
}

#[inline(always)]
fn max_or_second_if_nan(x: f32, least: f32) -> f32 {
    if x > least { x } else { least }
}

#[inline(always)]
fn min_or_second_if_nan(x: f32, most: f32) -> f32 {
    if x < most { x } else { most }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_roots_match_exact_division() {
        for exponent in -35..37 {
            let mut x: F32x16 = std::array::from_fn(|i| (1.0 + 0.6 * i as f32) * 10_f32.powi(exponent));
            let expected =
                x.map(|x| (1.0 / f64::from(min_or_second_if_nan(x, MAX_SQUARED_DISTANCE)).sqrt()) as f32);
            replace_by_inverse_sqrt(&mut x);
            for (root, expected) in x.iter().zip(expected) {
                assert!((root / expected - 1.0).abs() < 4.0 * f32::EPSILON, "{root} {expected}");
            }
        }
    }
}
