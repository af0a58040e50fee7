//! Nodes of a light tree: the bounds of sixteen children side by side.

use super::bounds::{Edge, LightBounds, Space};
use crate::math::Vec3;
use crate::math::lanes::{LANES, Lanes, Lanes3, lane, set_lane};

/// Children of a tree's node.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Centres of the bounding spheres of the children.
    center: Lanes3,
    /// Radii of the same, with the rounding errors of the centres.
    radius: Lanes,
    /// 1 where the spheres are in the scene, 0 where they are among directions.
    is_place: Lanes,
    /// 1 where light weakens with distance, else 0.
    weakens: Lanes,
    /// Shares of the tree's power; 0 where there is no child.
    power: Lanes,
    /// Of the cones of emission.
    axis: Lanes3,
    /// Of their half angles.
    cos: Lanes,
    sin: Lanes,
    /// Cosine of the angle from the cone at which there is no light any more.
    end: Lanes,
    /// What the children are.
    pub children: [Child; LANES],
    /// The number of leaves before each child, in the order of the tree; of the whole tree where there is none.
    pub first: [u32; LANES],
    /// How many there are.
    pub count: u32,
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

impl Lobe {
    /// What a surface makes of light from within an angle of a direction, at most and about: cosⁿ δ lies below
    /// (1 + n(1 − cos δ)/8)⁻⁸, which is no narrower than a lobe of a few lamps and has no end.
    #[inline(always)]
    fn value(&self, cos: f32, sin: f32) -> f32 {
        let short = 1.0 - cos - sin;
        let short = if short > 0.0 { short } else { 0.0 };
        let root = 1.0 / (1.0 + 0.125 * self.shininess * short);
        let square = root * root;
        let fourth = square * square;
        self.diffuse + self.peak * (fourth * fourth)
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
            center: [[0.0; LANES]; 3],
            radius: [0.0; LANES],
            is_place: [0.0; LANES],
            weakens: [0.0; LANES],
            power: [0.0; LANES],
            axis: [[0.0; LANES]; 3],
            cos: [-1.0; LANES],
            sin: [0.0; LANES],
            end: [1.0; LANES],
            children: [Child::Light(u32::MAX); LANES],
            first: [leaves; LANES],
            count: 0,
        }
    }

    /// Set a child; `power` is that of the whole tree.
    pub fn set(&mut self, i: usize, bounds: &LightBounds, power: f64) {
        let LightBounds { space, center, radius, power: own, cone } = bounds;
        set_lane(&mut self.center, i, center.as_vec3());
        let rounding = center.abs().max_element() * 2.0 * f64::from(f32::EPSILON);
        self.radius[i] = ((radius + rounding) * 1.000_001) as f32;
        (self.is_place[i], self.weakens[i]) = match space {
            Space::Weakening => (1.0, 1.0),
            Space::Steady => (1.0, 0.0),
            Space::Beyond => (0.0, 0.0),
        };
        self.power[i] = ((own / power) as f32).max(LEAST);
        set_lane(&mut self.axis, i, cone.axis.as_vec3());
        self.cos[i] = cone.cos as f32;
        self.sin[i] = ((1.0 - cone.cos) * (1.0 + cone.cos)).max(0.0).sqrt() as f32;
        self.end[i] = match cone.edge {
            Edge::Sharp => 1.0,
            Edge::Cosine => 0.0,
        };
    }

    /// What its children are expected to bring to a point of a surface: power by distance, by the mean cosine at the surface, by the
    /// least angle between the cone of emission and a direction from there (section 4.2, with bounds of cosines), and by what a lobe
    /// makes of it. Never 0 where a light of the child might arrive.
    #[inline(always)]
    pub fn expected(&self, receiver: &Receiver) -> Expected {
        let Receiver { point, normal, lobe } = *receiver;
        let (mut importance, mut nearness, mut reflected) = ([0.0; LANES], [0.0; LANES], [1.0; LANES]);
        if let Some(lobe) = lobe {
            for i in 0..LANES {
                let offset = lane(&self.center, i) - point * self.is_place[i];
                let inverse = 1.0 / at_least(offset.length_squared(), LEAST).sqrt();
                reflected[i] = lobe.value(lobe.axis.dot(offset) * inverse, self.radius[i] * inverse);
            }
        }
        for i in 0..LANES {
            let offset = lane(&self.center, i) - point * self.is_place[i];
            let radius = self.radius[i];
            let (d2, r2) = (offset.length_squared(), at_least(radius * radius, LEAST));
            let inverse = 1.0 / at_least(d2, r2).sqrt();
            // Positive where θ − β < 90°, and above 1 where θ < β, with β half of the angle that the sphere fills. From inside there is
            // light in every direction.
            let sin = radius * inverse;
            let is_inside = d2 <= r2;
            let straight = normal.dot(offset) * inverse;
            let towards = if is_inside { 1.0 } else { straight + sin };
            let cos = -lane(&self.axis, i).dot(offset) * inverse;
            let beyond = cos * self.cos[i] + one_without(cos) * self.sin[i];
            let away = (if (cos >= self.cos[i]) | is_inside { 1.0 } else { beyond }) + sin;
            let arrives =
                (towards > -LEAST_COSINE) & (away > self.end[i] - LEAST_COSINE) & (self.power[i] > 0.0);
            let weakened = if self.weakens[i] > 0.0 { inverse * inverse } else { 1.0 };
            // Cosines at the points of a sphere are uniform between the least and the greatest; those below 0 bring nothing.
            let cut = towards * towards / (4.0 * at_least(sin, LEAST));
            let mean = if straight > sin { straight } else { cut };
            let value = self.power[i] * weakened * cosine(mean) * cosine(away) * reflected[i];
            let value = at_least(value, LEAST);
            let value = if value < MOST { value } else { MOST };
            importance[i] = if arrives { value } else { 0.0 };
            nearness[i] = sin * sin;
        }
        Expected { importance, nearness }
    }

    /// The child that a leaf is under, by its place in the order of the tree.
    pub fn child_over(&self, place: u32) -> usize {
        let after = self.first[1..].iter().position(|&first| first > place);
        after.unwrap_or(LANES - 1)
    }
}

/// √(1 − x²).
#[inline(always)]
fn one_without(x: f32) -> f32 {
    let rest = 1.0 - x * x;
    (if rest > 0.0 { rest } else { 0.0 }).sqrt()
}

/// A bound of a cosine as it counts.
#[inline(always)]
fn cosine(bound: f32) -> f32 {
    let bound = at_least(bound, LEAST_COSINE);
    if bound < 1.0 { bound } else { 1.0 }
}

#[inline(always)]
fn at_least(x: f32, least: f32) -> f32 {
    if x > least { x } else { least }
}
