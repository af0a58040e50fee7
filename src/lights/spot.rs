//! Spotlights.

use std::f32::consts::{FRAC_PI_2, PI};

use super::tree::bounds::{EmissionCone, LightBounds};
use super::{End, LightSample, PointLight, Source};
use crate::math::Vec3;
use crate::math::elementary::acos;

/// A point light that shines into a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotLight {
    /// The same light without the cone.
    pub point: PointLight,
    /// Unit direction of its axis, away from the light.
    pub axis: Vec3,
    /// Half the angle of the cone, in radians, in (0, π].
    pub half_angle: f32,
    /// The outer part of the half angle over which it fades, linearly in the angle, in [0, 1].
    pub blend: f32,
}

impl SpotLight {
    /// The one way from here.
    pub fn sample(&self, point: Vec3) -> Option<LightSample> {
        let (direction, weight) = self.arriving(point);
        let end = End::At(self.point.position.as_vec3());
        (weight != Vec3::ZERO).then_some(LightSample { end, direction, weight, source: Source::Nothing })
    }

    /// Where it is and what it sends.
    pub fn bounds(&self) -> LightBounds {
        let cone = EmissionCone::within(self.axis.as_dvec3(), f64::from(self.half_angle));
        LightBounds { cone, ..self.point.bounds() }
    }

    /// [`PointLight::arriving`].
    #[inline(always)]
    pub fn arriving(&self, point: Vec3) -> (Vec3, Vec3) {
        let (direction, weight) = self.point.arriving(point);
        (direction, weight * self.share(-direction))
    }

    /// The share of the intensity on the axis that it sends into a direction.
    #[inline(always)]
    fn share(&self, away: Vec3) -> f32 {
        // The sine of half the angle, which is exact where the cosine of a small one is not.
        let half_sine = (away - self.axis).length() * 0.5;
        let half_sine = if half_sine < 1.0 { half_sine } else { 1.0 };
        let angle = 2.0 * (FRAC_PI_2 - acos(half_sine));
        let inside = self.half_angle - angle;
        let fade = self.blend * self.half_angle;
        let share = if inside < fade { inside / fade } else { 1.0 };
        if inside > 0.0 || self.half_angle >= PI { share } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::super::point::Falloff;
    use super::*;
    use crate::math::DVec3;

    /// The share that a cone of a half angle in degrees sends into a direction at an angle in degrees from its axis.
    fn share(half_angle: f64, blend: f32, angle: f64) -> f32 {
        let position = DVec3::new(1.0, 2.0, 3.0);
        let point = PointLight { position, intensity: Vec3::ONE, falloff: Falloff::None };
        let spot = SpotLight { point, axis: Vec3::NEG_Y, half_angle: half_angle.to_radians() as f32, blend };
        let (sin, cos) = angle.to_radians().sin_cos();
        spot.arriving((position + DVec3::new(sin, -cos, 0.0)).as_vec3()).1.x
    }

    #[test]
    fn the_light_fades_linearly_in_the_angle() {
        for half_angle in [0.5, 22.5, 60.0, 90.0, 150.0] {
            for blend in [0.1_f32, 0.2, 1.0] {
                for part in [0.0, 0.3, 0.85, 0.91, 0.97, 1.02, 1.19] {
                    let expected = ((1.0 - part) / f64::from(blend)).clamp(0.0, 1.0);
                    let found = f64::from(share(half_angle, blend, part * half_angle));
                    assert!(
                        (found - expected).abs() < 2e-3,
                        "{half_angle} {blend} {part}: {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn without_a_blend_the_edge_is_a_step() {
        assert_eq!((share(30.0, 0.0, 29.99), share(30.0, 0.0, 30.01)), (1.0, 0.0));
        assert_eq!((share(30.0, 0.0, 0.0), share(180.0, 0.0, 179.99)), (1.0, 1.0));
    }
}
