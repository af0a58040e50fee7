//! Sphere lights, sampled over the cone that they fill.

use std::f32::consts::PI;

use super::{LightSample, Source};
use crate::math::frame::Frame;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::warp;

/// A sphere that shines outwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereEmitter {
    /// Centre.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
}

impl SphereEmitter {
    /// Uniform over the solid angle (*Physically Based Rendering*, 4th ed., section 6.2.4), exact for narrow cones too.
    pub fn sample(&self, point: Vec3, u: [f32; 2], radiance: Vec3, source: Source) -> Option<LightSample> {
        let (axis, distance, sin2_max) = self.seen_from(point)?;
        let one_minus_cos_max = sin2_max / (1.0 + (1.0 - sin2_max).sqrt());
        let local = warp::cone(Vec2::from_array(u), one_minus_cos_max);
        let direction = Frame::from_normal(axis).to_world(local);
        // The near root along a direction at angle θ from the axis: d·cos θ − √(R² − d²·sin²θ).
        let sin2 = local.truncate().length_squared();
        let depth = (sin2_max - sin2).max(0.0).sqrt();
        let target = point + direction * (distance * (local.z - depth));
        Some(LightSample { target, direction, weight: radiance * (2.0 * PI * one_minus_cos_max), source })
    }

    /// As from the centre: πR²/d² is what a whole visible sphere gives a surface that faces it.
    pub fn middle(&self, point: Vec3, radiance: Vec3, source: Source) -> Option<LightSample> {
        let (direction, _, sin2_max) = self.seen_from(point)?;
        Some(LightSample {
            target: self.center.as_vec3(),
            direction,
            weight: radiance * (PI * sin2_max),
            source,
        })
    }

    /// Unit direction to the centre, distance, and sin² of the half angle; none from inside.
    fn seen_from(&self, point: Vec3) -> Option<(Vec3, f32, f32)> {
        let to_center = self.center - point.as_dvec3();
        let distance = to_center.length();
        let sin = self.radius / distance;
        (sin < 1.0).then(|| ((to_center / distance).as_vec3(), distance as f32, (sin * sin) as f32))
    }
}
