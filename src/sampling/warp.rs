//! Warps of the unit square.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use crate::math::elementary::sin_cos;
use crate::math::{Vec2, Vec3};

/// Uniform on the unit disk (Shirley and Chiu, *A Low Distortion Map Between Disk and Square*, 1997).
#[inline(always)]
pub fn disk(u: Vec2) -> Vec2 {
    let offset = u * 2.0 - Vec2::ONE;
    let is_wide = offset.x.abs() > offset.y.abs();
    let (radius, across) = if is_wide { (offset.x, offset.y) } else { (offset.y, offset.x) };
    // In the middle both are 0.
    let part = FRAC_PI_4 * (across / if radius == 0.0 { 1.0 } else { radius });
    let (sin, cos) = sin_cos(if is_wide { part } else { FRAC_PI_2 - part });
    Vec2::new(cos, sin) * radius
}

/// Uniform barycentric weights of a triangle, with little distortion (Heitz, *A Low-Distortion Map Between
/// Triangle and Square*, 2019).
pub fn triangle(u: Vec2) -> Vec3 {
    let (b0, b1) = if u.x < u.y {
        let b0 = u.x * 0.5;
        (b0, u.y - b0)
    } else {
        let b1 = u.y * 0.5;
        (u.x - b1, b1)
    };
    Vec3::new(b0, b1, 1.0 - b0 - b1)
}

/// Uniform over the solid angle of a cone about z, given 1 − cos of its half angle, which keeps its digits for
/// narrow cones.
#[inline(always)]
pub fn cone(u: [f32; 2], one_minus_cos_max: f32) -> Vec3 {
    let one_minus_cos = u[0] * one_minus_cos_max;
    let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u[1]);
    Vec3::new(sin * cos_phi, sin * sin_phi, 1.0 - one_minus_cos)
}

/// Unit vectors before z with a density of cos θ/π (Malley's method: *Physically Based Rendering*, 4th ed., section 13.6.3).
#[inline(always)]
pub fn cosine(u: [f32; 2]) -> Vec3 {
    let at = disk(Vec2::from_array(u));
    at.extend((1.0 - at.length_squared()).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> impl Iterator<Item = Vec2> {
        (0..10_000).map(|i| Vec2::new((i % 100) as f32 + 0.5, (i / 100) as f32 + 0.5) / 100.0)
    }

    #[test]
    fn the_disk_is_uniform() {
        let inner = grid().filter(|&u| disk(u).length() < 0.5).count();
        let right = grid().filter(|&u| disk(u).x > 0.0).count();
        assert_eq!(inner, 2500);
        assert!((right as i32 - 5000).abs() < 60);
        assert!(grid().all(|u| disk(u).length() <= 1.0));
        assert_eq!(disk(Vec2::splat(0.5)), Vec2::ZERO);
    }

    #[test]
    fn the_triangle_is_uniform() {
        let mean = grid().map(triangle).sum::<Vec3>() / 10_000.0;
        assert!((mean - Vec3::splat(1.0 / 3.0)).length() < 2e-3);
        let corner = grid().filter(|&u| triangle(u).x > 0.5).count();
        assert!((corner as i32 - 2500).abs() < 60);
    }

    #[test]
    fn the_cosine_is_the_density() {
        let moment = |of: fn(Vec3) -> f32| grid().map(|u| of(cosine(u.to_array()))).sum::<f32>() / 1e4;
        // ∫cos²/π, ∫cos³/π, and nothing to any side.
        assert!((moment(|d| d.z) - 2.0 / 3.0).abs() < 1e-3 && (moment(|d| d.z * d.z) - 0.5).abs() < 1e-3);
        assert!(moment(|d| d.x).abs() < 1e-3 && moment(|d| d.y).abs() < 1e-3);
        assert!(grid().all(|u| (cosine(u.to_array()).length() - 1.0).abs() < 1e-6));
    }

    #[test]
    fn the_cone_is_uniform_over_solid_angle_also_when_narrow() {
        for one_minus_cos in [2.0, 0.5, 1e-9] {
            let cone = |u: Vec2| cone(u.to_array(), one_minus_cos);
            let z = grid().map(|u| 1.0 - f64::from(cone(u).z)).sum::<f64>() / 10_000.0;
            let sin2 = grid().map(|u| f64::from(cone(u).truncate().length_squared())).sum::<f64>() / 1e4;
            let c = f64::from(one_minus_cos);
            assert!(one_minus_cos < 1e-6 || (z / (c / 2.0) - 1.0).abs() < 1e-3);
            // ∫(2c − c²) over the cone.
            assert!((sin2 / (c - c * c / 3.0) - 1.0).abs() < 1e-3, "{one_minus_cos}");
        }
    }
}
