//! Sphere lights, sampled over the cone they subtend.

use std::f32::consts::PI;

use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::math::frame::Frame;
use crate::math::{DVec3, Vec3};
use crate::sampling::warp;

/// A sphere that emits outward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereEmitter {
    /// Center.
    pub center: DVec3,
    /// Radius.
    pub radius: f64,
}

impl ShapeEmitter for SphereEmitter {
    /// Samples uniformly over the solid angle (*Physically Based Rendering*, 4th ed., section 6.2.4).
    /// Accurate even for narrow cones.
    #[inline(always)]
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let (axis, distance, sin2_max) = self.cone_unchecked(point);
        let is_outside = sin2_max < 1.0;
        let sin2_max = if is_outside { sin2_max } else { 0.0 };
        let one_minus_cos_max = one_minus_cos_from_sin2(sin2_max);
        let local = warp::cone(u, one_minus_cos_max);
        // Nearest intersection in a direction at the angle θ from the axis: d·cos θ − √(R² − d²·sin²θ).
        let sin2 = local.x * local.x + local.y * local.y;
        let depth = (sin2_max - sin2).max(0.0).sqrt();
        let direction = Frame::from_normal(axis).to_world(local);
        let factor = 2.0 * PI * one_minus_cos_max;
        SampledLightPoint {
            direction,
            target: point + direction * (distance * (local.z - depth)),
            factor: if is_outside { factor } else { 0.0 },
        }
    }

    /// The pdf is the same for all directions that hit the sphere.
    fn pdf(&self, from: Vec3, _: &LightHitPoint) -> f32 {
        self.cone(from).map_or(0.0, |(_, _, sin2_max)| 1.0 / (2.0 * PI * one_minus_cos_from_sin2(sin2_max)))
    }

    fn area_centroid(&self) -> DVec3 {
        self.center
    }
}

impl SphereEmitter {
    /// Unit direction to the center, distance to the center, and sin² of the cone's half angle, or `None` if
    /// the point is inside the sphere.
    fn cone(&self, point: Vec3) -> Option<(Vec3, f32, f32)> {
        Some(self.cone_unchecked(point)).filter(|(_, _, sin2)| *sin2 < 1.0)
    }

    /// Like [`SphereEmitter::cone`], but returns a sin² of at least 1 for points inside the sphere.
    #[inline(always)]
    fn cone_unchecked(&self, point: Vec3) -> (Vec3, f32, f32) {
        let to_center = self.center - point.as_dvec3();
        let distance = to_center.length();
        let sin = self.radius / distance;
        ((to_center / distance).as_vec3(), distance as f32, (sin * sin) as f32)
    }
}

/// Computes 1 − cos of an angle of up to 90° from its sin².
#[inline(always)]
pub(crate) fn one_minus_cos_from_sin2(sin2: f32) -> f32 {
    sin2 / (1.0 + (1.0 - sin2).sqrt())
}
