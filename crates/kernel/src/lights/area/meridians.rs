//! A distribution of angles around a pole, weighted by how much of a light is visible in each half plane.

use super::piecewise_linear::PiecewiseLinear;
use crate::math::{DVec3, Vec3};

/// Number of nodes at which the weight is evaluated, on each side of angle 0.
const NODES: usize = 9;

/// Distribution of angles around a pole, in the interval from −`reach` to `reach`. The density is piecewise
/// linear.
#[derive(Clone, Copy, Debug)]
pub struct AzimuthDistribution {
    /// Largest angle at which the light is visible.
    reach: f64,
    scaled_angle: PiecewiseLinear<NODES>,
}

/// Sine and cosine of an angle.
#[derive(Clone, Copy, Debug)]
pub struct SinCos {
    /// Sine.
    pub sin: f64,
    /// Cosine.
    pub cos: f64,
}

impl SinCos {
    /// Sine and cosine of half the angle, which must be in [0, π].
    fn half_angle(self) -> Self {
        let cos = (0.5 * (1.0 + self.cos)).max(0.0).sqrt();
        // Avoid dividing by the cosine if the angle is close to π.
        let sin = if cos > 0.5 { 0.5 * self.sin / cos } else { (0.5 * (1.0 - self.cos)).max(0.0).sqrt() };
        Self { sin, cos }
    }

    fn plus_angle(self, other: Self) -> Self {
        Self {
            sin: self.sin * other.cos + self.cos * other.sin,
            cos: self.cos * other.cos - self.sin * other.sin,
        }
    }

    /// Computes the sine and cosine of an angle.
    pub fn from_radians(angle: f64) -> Self {
        let (sin, cos) = libm::sincos(angle);
        Self { sin, cos }
    }
}

impl AzimuthDistribution {
    /// Creates a distribution over the angles from −`reach` to `reach` whose density is proportional to
    /// `weight`. `reach` is in [0, π].
    pub fn new(reach: SinCos, weight: impl Fn(SinCos) -> f64) -> Self {
        let step = reach.half_angle().half_angle().half_angle();
        let mut turn = SinCos { sin: 0.0, cos: 1.0 };
        let weights = std::array::from_fn(|_| {
            let own = weight(turn);
            turn = turn.plus_angle(step);
            own
        });
        Self { reach: libm::atan2(reach.sin, reach.cos), scaled_angle: PiecewiseLinear(weights) }
    }

    /// Integral of the weight over all angles.
    pub fn total(&self) -> f64 {
        2.0 * self.reach * self.scaled_angle.integral()
    }

    /// Samples an angle. Returns the angle and its density per radian.
    pub fn sample(&self, u: f32) -> (f64, f64) {
        let side = 2.0 * f64::from(u) - 1.0;
        let (scaled_angle, density) = self.scaled_angle.sample(side.abs());
        ((scaled_angle * self.reach).copysign(side), density / (2.0 * self.reach))
    }

    /// Density per radian at an angle.
    pub fn pdf(&self, angle: f64) -> f64 {
        self.scaled_angle.pdf(angle.abs() / self.reach) / (2.0 * self.reach)
    }
}

/// A frame for polar coordinates: the angle from a pole and the angle around the pole.
#[derive(Clone, Copy, Debug)]
pub struct PolarFrame {
    /// Direction of the pole.
    pub pole: DVec3,
    /// Direction perpendicular to the pole, at angle 0.
    pub front: DVec3,
    /// Direction perpendicular to `pole` and `front`, at angle 90°.
    pub side: DVec3,
}

impl PolarFrame {
    /// Creates a frame from perpendicular unit vectors.
    pub fn new(pole: DVec3, front: DVec3) -> Self {
        Self { pole, front, side: pole.cross(front) }
    }

    /// The direction at the given angles from the pole and around it.
    pub fn direction(&self, from_pole: SinCos, around: SinCos) -> DVec3 {
        self.pole * from_pole.cos + (self.front * around.cos + self.side * around.sin) * from_pole.sin
    }

    /// Angle of a direction around the pole.
    pub fn azimuth(&self, direction: Vec3) -> f64 {
        let direction = direction.as_dvec3();
        libm::atan2(direction.dot(self.side), direction.dot(self.front))
    }
}
