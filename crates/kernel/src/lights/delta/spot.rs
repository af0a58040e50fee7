//! Spotlights.

use std::f32::consts::{FRAC_PI_2, PI};

use super::{DeltaPositionLight, PointLight};
use crate::lights::tree::bounds::{EmissionCone, LightBounds};
use crate::math::Vec3;
use crate::math::elementary::{acos, sin_cos};
use crate::math::frame::Frame;
use crate::sampling::warp;

/// A point light that emits into a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotLight {
    /// The same light without the cone.
    pub point: PointLight,
    /// Unit vector along the cone's axis, away from the light.
    pub axis: Vec3,
    /// Half angle of the cone in radians, in (0, π].
    pub half_angle: f32,
    /// Outer fraction of the half angle, in [0, 1], where the intensity fades linearly with the angle.
    pub blend: f32,
}

impl DeltaPositionLight for SpotLight {
    fn isotropic_at_peak_intensity(&self) -> &PointLight {
        &self.point
    }

    #[inline(always)]
    fn relative_intensity(&self, away: Vec3) -> f32 {
        // Use the sine of half the angle, which is accurate even for small angles, unlike the cosine.
        let half_sine = (away - self.axis).length() * 0.5;
        let half_sine = if half_sine < 1.0 { half_sine } else { 1.0 };
        let angle = 2.0 * (FRAC_PI_2 - acos(half_sine));
        let inside = self.half_angle - angle;
        let fade = self.blend * self.half_angle;
        let falloff = if inside < fade { inside / fade } else { 1.0 };
        if inside > 0.0 || self.half_angle >= PI { falloff } else { 0.0 }
    }

    /// The solid angle of the inner cone, whose half angle is (1 − blend)·H, plus the integral of (H −
    /// θ)/(blend·H) over the directions between the two cones.
    #[inline]
    fn effective_solid_angle(&self) -> f64 {
        let SpotCone { inner, faded, .. } = self.cone_solid_angles();
        inner + faded
    }

    fn sample_direction(&self, u: [f32; 2]) -> Vec3 {
        let SpotCone { half, width, inner, faded } = self.cone_solid_angles();
        let goal = f64::from(u[0]) * (inner + faded);
        let local = if goal < inner {
            let one_minus_cos = (goal / (2.0 * std::f64::consts::PI)) as f32;
            warp::cone([1.0, u[1]], one_minus_cos)
        } else {
            let part = ((inner + faded - goal) / faded).clamp(0.0, 1.0);
            let angle = half - invert_edge_integral(half, width, part);
            let (sin, cos) = libm::sincos(angle);
            let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u[1]);
            Vec3::new(sin as f32 * cos_phi, sin as f32 * sin_phi, cos as f32)
        };
        Frame::from_normal(self.axis).to_world(local)
    }

    fn bounds(&self) -> LightBounds {
        let cone = EmissionCone::from_half_angle(self.axis.as_dvec3(), f64::from(self.half_angle));
        LightBounds { cone, ..self.point.bounds() }
    }
}

impl SpotLight {
    fn cone_solid_angles(&self) -> SpotCone {
        let half = f64::from(self.half_angle);
        let width = f64::from(self.blend) * half;
        let sin = libm::sin((half - width) * 0.5);
        let faded = if width > 0.0 { edge_integral(half, width) / width } else { 0.0 };
        let full = 2.0 * std::f64::consts::PI;
        SpotCone { half, width, inner: full * 2.0 * sin * sin, faded: full * faded }
    }
}

/// A spotlight's inner and outer cone.
struct SpotCone {
    /// Half angle of the outer cone.
    half: f64,
    /// Angular width of the fading part.
    width: f64,
    /// Power of the inner cone divided by the intensity on the axis, in sr.
    inner: f64,
    /// Power of the fading part divided by the intensity on the axis, in sr.
    faded: f64,
}

/// ∫ t·sin(H − t) dt from the edge of a cone (t = 0) inward to t = δ. For small angles, uses the first terms
/// of the sine series, with a relative error below 1e-9.
fn edge_integral(half: f64, delta: f64) -> f64 {
    if half < 0.02 {
        let (h2, d2) = (half * half, delta * delta);
        let third = h2 * half / 2.0 - h2 * delta + 0.75 * half * d2 - d2 * delta / 5.0;
        return d2 * (half / 2.0 - delta / 3.0 - third / 6.0);
    }
    let ((sin, cos), (sin_half, cos_half)) = (libm::sincos(half - delta), libm::sincos(0.5 * delta));
    delta * cos - 2.0 * sin_half * (cos * cos_half - sin * sin_half)
}

/// Inverts [`edge_integral`]. Returns the δ in [0, width] at which the integral reaches a fraction `part` of
/// its total. Uses a bracketed Newton iteration.
fn invert_edge_integral(half: f64, width: f64, part: f64) -> f64 {
    let goal = part * edge_integral(half, width);
    let (mut low, mut high) = (0.0, width);
    // Near the edge, the integral is quadratic in δ, or cubic for the widest cone.
    let mut delta = width * part.sqrt();
    for _ in 0..60 {
        let off = edge_integral(half, delta) - goal;
        (low, high) = if off > 0.0 { (low, delta) } else { (delta, high) };
        let next = delta - off / (delta * libm::sin(half - delta));
        let next = if next > low && next < high { next } else { 0.5 * (low + high) };
        let has_converged = (next - delta).abs() <= 1e-6 * delta;
        delta = next;
        if has_converged {
            break;
        }
    }
    delta
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lights::delta::Falloff;
    use crate::math::DVec3;

    /// Relative intensity of a spotlight, at an angle in degrees from the axis.
    fn falloff(half_angle: f64, blend: f32, angle: f64) -> f32 {
        let position = DVec3::new(1.0, 2.0, 3.0);
        let point = PointLight { position, intensity: Vec3::ONE, falloff: Falloff::None };
        let spot = SpotLight { point, axis: Vec3::NEG_Y, half_angle: half_angle.to_radians() as f32, blend };
        let (sin, cos) = angle.to_radians().sin_cos();
        spot.direction_and_irradiance((position + DVec3::new(sin, -cos, 0.0)).as_vec3()).1.x
    }

    #[test]
    fn intensity_fades_linearly_with_angle() {
        for half_angle in [0.5, 22.5, 60.0, 90.0, 150.0] {
            for blend in [0.1_f32, 0.2, 1.0] {
                for part in [0.0, 0.3, 0.85, 0.91, 0.97, 1.02, 1.19] {
                    let expected = ((1.0 - part) / f64::from(blend)).clamp(0.0, 1.0);
                    let found = f64::from(falloff(half_angle, blend, part * half_angle));
                    assert!(
                        (found - expected).abs() < 2e-3,
                        "{half_angle} {blend} {part}: {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn zero_blend_gives_a_sharp_edge() {
        assert_eq!((falloff(30.0, 0.0, 29.99), falloff(30.0, 0.0, 30.01)), (1.0, 0.0));
        assert_eq!((falloff(30.0, 0.0, 0.0), falloff(180.0, 0.0, 179.99)), (1.0, 1.0));
    }
}
