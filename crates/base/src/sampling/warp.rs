//! Maps from the unit square to disks, triangles, cones and hemispheres.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use crate::math::elementary::sin_cos;
use crate::math::{Vec2, Vec3};

/// Maps the unit square uniformly to the unit disk (Shirley and Chiu, *A Low Distortion Map Between Disk and
/// Square*, 1997).
#[inline(always)]
pub fn disk(u: Vec2) -> Vec2 {
    let offset = u * 2.0 - Vec2::ONE;
    let is_wide = offset.x.abs() > offset.y.abs();
    let (radius, across) = if is_wide { (offset.x, offset.y) } else { (offset.y, offset.x) };
    // `radius` and `across` are 0 at the center.
    let part = FRAC_PI_4 * (across / if radius == 0.0 { 1.0 } else { radius });
    let (sin, cos) = sin_cos(if is_wide { part } else { FRAC_PI_2 - part });
    Vec2::new(cos, sin) * radius
}

/// Maps the unit square to uniform barycentric coordinates (Heitz, *A Low-Distortion Map Between Triangle and
/// Square*, 2019).
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

/// Samples a uniform direction in a cone around z. The cone is specified by 1 − cos of its half angle, which
/// stays accurate for narrow cones.
#[inline(always)]
pub fn cone(u: [f32; 2], one_minus_cos_max: f32) -> Vec3 {
    let one_minus_cos = u[0] * one_minus_cos_max;
    let sin = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = sin_cos(2.0 * PI * u[1]);
    Vec3::new(sin * cos_phi, sin * sin_phi, 1.0 - one_minus_cos)
}

/// Samples a direction with z > 0 and pdf cos θ/π (Malley's method: *Physically Based Rendering*, 4th ed.,
/// section 13.6.3).
#[inline(always)]
pub fn cosine(u: [f32; 2]) -> Vec3 {
    let at = disk(Vec2::from_array(u));
    at.extend((1.0 - at.length_squared()).max(0.0).sqrt())
}

/// Samples a point in the unit square with a bilinear pdf, specified by values ≥ 0 (not all 0) at the corners
/// (0, 0), (1, 0), (0, 1), (1, 1) (Pharr, Jakob, Humphreys, *Physically Based Rendering*, 4th edition,
/// A.5.1).
#[inline(always)]
pub fn bilinear(u: [f32; 2], corners: &[f32; 4]) -> [f32; 2] {
    let [a, b, c, d] = *corners;
    let y = linear(u[1], a + b, c + d);
    [linear(u[0], a + (c - a) * y, b + (d - b) * y), y]
}

/// Samples a number in [0, 1] with a linear pdf, specified by values ≥ 0 at both ends.
#[inline(always)]
fn linear(u: f32, first: f32, last: f32) -> f32 {
    let sum = first + last;
    let first = if sum > 0.0 { first / sum } else { 0.5 };
    let square = first * first + u * (1.0 - 2.0 * first);
    // If both `first` and `u` are 0, the result is 0.
    (u / (first + square.max(f32::MIN_POSITIVE).sqrt())).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> impl Iterator<Item = Vec2> {
        (0..10_000).map(|i| Vec2::new((i % 100) as f32 + 0.5, (i / 100) as f32 + 0.5) / 100.0)
    }

    #[test]
    fn disk_samples_are_uniform() {
        let inner = grid().filter(|&u| disk(u).length() < 0.5).count();
        let right = grid().filter(|&u| disk(u).x > 0.0).count();
        assert_eq!(inner, 2500);
        assert!((right as i32 - 5000).abs() < 60);
        assert!(grid().all(|u| disk(u).length() <= 1.0));
        assert_eq!(disk(Vec2::splat(0.5)), Vec2::ZERO);
    }

    #[test]
    fn triangle_samples_are_uniform() {
        let mean = grid().map(triangle).sum::<Vec3>() / 10_000.0;
        assert!((mean - Vec3::splat(1.0 / 3.0)).length() < 2e-3);
        let corner = grid().filter(|&u| triangle(u).x > 0.5).count();
        assert!((corner as i32 - 2500).abs() < 60);
    }

    #[test]
    fn cosine_samples_match_their_pdf() {
        let moment = |of: fn(Vec3) -> f32| grid().map(|u| of(cosine(u.to_array()))).sum::<f32>() / 1e4;
        // The expected values are ∫cos²/π, ∫cos³/π, and 0 along x and y.
        assert!((moment(|d| d.z) - 2.0 / 3.0).abs() < 1e-3 && (moment(|d| d.z * d.z) - 0.5).abs() < 1e-3);
        assert!(moment(|d| d.x).abs() < 1e-3 && moment(|d| d.y).abs() < 1e-3);
        assert!(grid().all(|u| (cosine(u.to_array()).length() - 1.0).abs() < 1e-6));
    }

    #[test]
    fn narrow_cone_samples_are_uniform() {
        for one_minus_cos in [2.0, 0.5, 1e-9] {
            let cone = |u: Vec2| cone(u.to_array(), one_minus_cos);
            let z = grid().map(|u| 1.0 - f64::from(cone(u).z)).sum::<f64>() / 10_000.0;
            let sin2 = grid().map(|u| f64::from(cone(u).truncate().length_squared())).sum::<f64>() / 1e4;
            let c = f64::from(one_minus_cos);
            assert!(one_minus_cos < 1e-6 || (z / (c / 2.0) - 1.0).abs() < 1e-3);
            // Integral of 2c − c² over the cone.
            assert!((sin2 / (c - c * c / 3.0) - 1.0).abs() < 1e-3, "{one_minus_cos}");
        }
    }

    #[test]
    fn bilinear_samples_match_their_pdf() {
        // Compare the fractions of samples in strips and cells with integrals of the pdf.
        for corners in
            [[1.0, 1.0, 1.0, 1.0], [0.0, 3.0, 0.0, 1.0], [5.0, 0.0, 0.0, 0.0], [1e30, 2e30, 3e30, 0.5e30]]
        {
            let [a, b, c, d] = corners.map(f64::from);
            let mean = (a + b + c + d) / 4.0;
            let below = |x: f64, y: f64| {
                // Integral of (1−s)(1−t)a + s(1−t)b + (1−s)t c + st d over [0, x] × [0, y].
                let (s1, s0) = (x * x / 2.0, x - x * x / 2.0);
                let (t1, t0) = (y * y / 2.0, y - y * y / 2.0);
                (s0 * t0 * a + s1 * t0 * b + s0 * t1 * c + s1 * t1 * d) / mean
            };
            for (x, y) in [(0.25, 1.0), (1.0, 0.25), (0.5, 0.5), (0.8, 0.3)] {
                let inside = |at: [f32; 2]| f64::from(at[0]) < x && f64::from(at[1]) < y;
                let count = grid().filter(|u| inside(bilinear(u.to_array(), &corners))).count() as f64;
                assert!((count / 1e4 - below(x, y)).abs() < 0.012, "{corners:?} {x} {y}: {count}");
            }
            let ends = [[0.0, 0.0], [1.0_f32.next_down(), 0.0], [0.0, 1.0_f32.next_down()]];
            for at in ends.map(|u| bilinear(u, &corners)) {
                assert!(at.iter().all(|x| (0.0..=1.0).contains(x)), "{at:?}");
            }
        }
    }
}
