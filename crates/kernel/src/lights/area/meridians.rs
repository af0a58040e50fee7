//! Angles around a pole, chosen by the part of a light in their half planes.

use super::linear::Linear;
use crate::math::{DVec3, Vec3};

/// Number of nodes to one side at which the density is evaluated.
const NODES: usize = 9;

/// Angles around a pole to both sides of 0, up to the reach of a light. Their density is linear between a few nodes.
#[derive(Clone, Copy, Debug)]
pub struct Meridians {
    /// The greatest angle.
    reach: f64,
    share: Linear<NODES>,
}

/// Sine and cosine of an angle.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Sine.
    pub sin: f64,
    /// Cosine.
    pub cos: f64,
}

impl Turn {
    /// Sine and cosine of half the angle, in [0, π].
    fn half(self) -> Self {
        let cos = (0.5 * (1.0 + self.cos)).max(0.0).sqrt();
        // If the cosine is 0, the angle was π.
        let sin = if cos > 0.5 { 0.5 * self.sin / cos } else { (0.5 * (1.0 - self.cos)).max(0.0).sqrt() };
        Self { sin, cos }
    }

    fn and(self, other: Self) -> Self {
        Self {
            sin: self.sin * other.cos + self.cos * other.sin,
            cos: self.cos * other.cos - self.sin * other.sin,
        }
    }

    /// Sine and cosine of an angle.
    pub fn of(angle: f64) -> Self {
        let (sin, cos) = libm::sincos(angle);
        Self { sin, cos }
    }
}

impl Meridians {
    /// Angles up to a reach in [0, π], with densities in proportion to the weights of angles in [0, π].
    pub fn new(reach: Turn, weight: impl Fn(Turn) -> f64) -> Self {
        let step = reach.half().half().half();
        let mut turn = Turn { sin: 0.0, cos: 1.0 };
        let weights = std::array::from_fn(|_| {
            let own = weight(turn);
            turn = turn.and(step);
            own
        });
        Self { reach: libm::atan2(reach.sin, reach.cos), share: Linear(weights) }
    }

    /// Sum of the weights over all angles.
    pub fn total(&self) -> f64 {
        2.0 * self.reach * self.share.mean()
    }

    /// An angle, and its density per radian.
    pub fn sample(&self, u: f32) -> (f64, f64) {
        let side = 2.0 * f64::from(u) - 1.0;
        let (share, density) = self.share.sample(side.abs());
        ((share * self.reach).copysign(side), density / (2.0 * self.reach))
    }

    /// Density per radian at an angle.
    pub fn pdf(&self, angle: f64) -> f64 {
        self.share.pdf(angle.abs() / self.reach) / (2.0 * self.reach)
    }
}

/// Directions by the angle from a pole and the angle around it.
#[derive(Clone, Copy, Debug)]
pub struct Pole {
    /// The pole.
    pub pole: DVec3,
    /// Perpendicular to it, at the angle 0.
    pub front: DVec3,
    /// Perpendicular to both, at a right angle.
    pub side: DVec3,
}

impl Pole {
    /// From perpendicular unit vectors.
    pub fn new(pole: DVec3, front: DVec3) -> Self {
        Self { pole, front, side: pole.cross(front) }
    }

    /// The direction at an angle from the pole, and one around it.
    pub fn direction(&self, from_pole: Turn, around: Turn) -> DVec3 {
        self.pole * from_pole.cos + (self.front * around.cos + self.side * around.sin) * from_pole.sin
    }

    /// The angle of a direction around the pole.
    pub fn around(&self, direction: Vec3) -> f64 {
        let direction = direction.as_dvec3();
        libm::atan2(direction.dot(self.side), direction.dot(self.front))
    }
}
