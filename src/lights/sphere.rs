//! Sphere lights, sampled over the cone that they fill.

use std::f32::consts::PI;

use super::{Ends, LightSamples, Source};
use crate::math::frame::Frame;
use crate::math::lanes::{LANES, Lanes, map, zip};
use crate::math::{DVec3, Vec3};
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
    /// The light as seen from a point; none from inside.
    pub fn seen_from(&self, point: Vec3) -> Option<SeenSphere> {
        let (axis, distance, sin2_max) = self.cone(point)?;
        Some(SeenSphere { point, frame: Frame::from_normal(axis), distance, sin2_max })
    }

    /// [`Light::pdf`](super::Light::pdf): the same in all directions that meet it.
    pub fn pdf(&self, from: Vec3) -> f32 {
        self.cone(from).map_or(0.0, |(_, _, sin2_max)| 1.0 / (2.0 * PI * one_minus_cos(sin2_max)))
    }

    /// Unit direction to the centre, distance, and sin² of the half angle; none from inside.
    fn cone(&self, point: Vec3) -> Option<(Vec3, f32, f32)> {
        let to_center = self.center - point.as_dvec3();
        let distance = to_center.length();
        let sin = self.radius / distance;
        (sin < 1.0).then(|| ((to_center / distance).as_vec3(), distance as f32, (sin * sin) as f32))
    }
}

/// A sphere and a point outside.
#[derive(Clone, Copy, Debug)]
pub struct SeenSphere {
    point: Vec3,
    /// Around the direction to the centre.
    frame: Frame,
    distance: f32,
    /// sin² of the half angle.
    sin2_max: f32,
}

impl SeenSphere {
    /// Uniform over the solid angle (*Physically Based Rendering*, 4th ed., section 6.2.4), exact for narrow cones too; one
    /// for each lane.
    #[inline(always)]
    pub fn samples(&self, u: [Lanes; 2], radiance: Vec3, source: Source) -> LightSamples {
        let one_minus_cos_max = one_minus_cos(self.sin2_max);
        let [x, y, z] = warp::cone(u, one_minus_cos_max);
        // The near root along a direction at angle θ from the axis: d·cos θ − √(R² − d²·sin²θ).
        let sin2 = zip(x, y, |x, y| x * x + y * y);
        let depth = map(sin2, |sin2| (self.sin2_max - sin2).max(0.0).sqrt());
        let distance = zip(z, depth, |z, depth| self.distance * (z - depth));
        let Frame { s, t, n } = self.frame;
        let (mut directions, mut targets) = ([x; 3], [x; 3]);
        for axis in 0..3 {
            for i in 0..LANES {
                let direction = s[axis] * x[i] + t[axis] * y[i] + n[axis] * z[i];
                directions[axis][i] = direction;
                targets[axis][i] = self.point[axis] + direction * distance[i];
            }
        }
        let factors = [2.0 * PI * one_minus_cos_max; LANES];
        LightSamples { ends: Ends::At(targets), directions, radiance, factors, source, count: LANES }
    }
}

/// 1 − cos of the angle whose sin² this is, up to 90°.
#[inline(always)]
fn one_minus_cos(sin2: f32) -> f32 {
    sin2 / (1.0 + (1.0 - sin2).sqrt())
}
