//! The Epanechnikov kernel, in units of its radius: weights over polygons, and sampling.

use std::f64::consts::FRAC_2_PI;

use crate::math::elementary::atan2;
use crate::math::{DVec2, Vec2};

/// Integral of the kernel (2/π)·(1 − ρ²) over a convex polygon whose corners are specified in order. It is 1
/// if the polygon contains the disk.
pub fn kernel_integral_over_polygon(corners: &[DVec2]) -> f64 {
    let edges = || corners.iter().zip(corners.iter().cycle().skip(1)).map(|(&a, &b)| (a, b));
    let turn = edges().map(|(a, b)| a.perp_dot(b)).sum::<f64>().signum();
    let (mut is_around, mut is_beside) = (true, false);
    for (a, b) in edges() {
        let inside = turn * a.perp_dot(b);
        let is_beyond_disc = inside * inside >= (b - a).length_squared();
        is_around &= inside > 0.0 && is_beyond_disc;
        is_beside |= inside < 0.0 && is_beyond_disc;
    }
    match (is_around, is_beside) {
        (_, true) => 0.0,
        (true, false) => 1.0,
        (false, false) => {
            FRAC_2_PI * edges().map(|(a, b)| integral_over_center_triangle(a, b)).sum::<f64>().abs()
        }
    }
}

/// Integral of 1 − ρ² over the intersection of the unit disk and the triangle formed by the center and an
/// edge. It is positive if the edge is counterclockwise.
///
/// In polar coordinates, the integral is ∫ R²/2 − R⁴/4 dφ, where R is the smaller of 1 and the distance to
/// the edge. Where the edge is outside the disk, this is a quarter of the angle. For a point on an edge at
/// distance d from the center, at arc length s along the edge, R² = d² + s² and dφ = d/R² ds, so the integral
/// is d·∫ 1/2 − (d² + s²)/4 ds.
fn integral_over_center_triangle(a: DVec2, b: DVec2) -> f64 {
    let length = (b - a).length();
    if !(length > 0.0) {
        return 0.0;
    }
    let along = (b - a) / length;
    let (start, end, distance) = (a.dot(along), b.dot(along), a.perp_dot(along));
    let half_chord = (1.0 - distance * distance).max(0.0).sqrt();
    let (enter, leave) = (start.max(-half_chord), end.min(half_chord));
    if enter >= leave {
        return 0.25 * signed_angle(a, b);
    }
    let (p, q) = (a + along * (enter - start), a + along * (leave - start));
    let cubes = (leave * leave * leave - enter * enter * enter) / 12.0;
    let inside = distance * ((0.5 - 0.25 * distance * distance) * (leave - enter) - cubes);
    let before = if start < enter { signed_angle(a, p) } else { 0.0 };
    let after = if leave < end { signed_angle(q, b) } else { 0.0 };
    inside + 0.25 * (before + after)
}

/// The counterclockwise angle from one direction to another.
fn signed_angle(from: DVec2, to: DVec2) -> f64 {
    f64::from(atan2(from.perp_dot(to) as f32, from.dot(to) as f32))
}

/// Maps a uniform point on the unit disk to a point distributed according to the kernel. The disk of radius ρ
/// contains 2ρ² − ρ⁴ of the kernel's weight and ρ² of the unit disk's area.
pub fn warp_disk_point(on_disk: Vec2) -> Vec2 {
    let squared = on_disk.length_squared().min(1.0);
    // ρ² = 1 − √(1 − u), where u is the squared radius on the disk, rewritten to avoid cancellation: ρ²/u =
    // 1/(1 + √(1 − u)).
    on_disk * (1.0 + (1.0 - squared).sqrt()).recip().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::unit_generator;
    use crate::sampling::warp;

    fn square(corner: DVec2, side: f64) -> [DVec2; 4] {
        [corner, corner + DVec2::X * side, corner + DVec2::splat(side), corner + DVec2::Y * side]
    }

    #[test]
    fn weight_beyond_an_edge_is_exact() {
        // ∫ over x ≥ d: (2/π)·(4/3)·∫(1 − x²)^{3/2} dx, integrated numerically.
        for d in [-0.9, -0.3, 0.0, 0.2, 0.7, 0.99] {
            let steps = 200_000;
            let step = (1.0 - d) / f64::from(steps);
            let at = |i: i32| (1.0 - (d + (f64::from(i) + 0.5) * step).powi(2)).powf(1.5);
            let exact = 8.0 / (3.0 * std::f64::consts::PI) * (0..steps).map(at).sum::<f64>() * step;
            let far = [(d, -9.0), (40.0, -9.0), (40.0, 9.0), (d, 9.0)].map(|(x, y)| DVec2::new(x, y));
            let weight = kernel_integral_over_polygon(&far);
            assert!((weight - exact).abs() < 1e-6, "distance {d}: got {weight}, expected {exact}");
            let mut mirrored = far;
            mirrored.reverse();
            assert_eq!(kernel_integral_over_polygon(&mirrored), weight, "for either orientation");
        }
    }

    #[test]
    fn weights_of_a_tiling_sum_to_one() {
        let mut next = unit_generator(11);
        for _ in 0..200 {
            let side = 0.05 + 2.0 * f64::from(next());
            let corner = DVec2::new(f64::from(next()), f64::from(next())) * side;
            let cells = (2.5 / side) as i32 + 1;
            let of_cell = |i: i32, j: i32| {
                let at = corner + DVec2::new(f64::from(i), f64::from(j)) * side;
                let [a, b, c, d] = square(at, side);
                kernel_integral_over_polygon(&[a, b, c]) + kernel_integral_over_polygon(&[c, d, a])
            };
            let cells = || -cells..=cells;
            let sum: f64 = cells().flat_map(|i| cells().map(move |j| of_cell(i, j))).sum();
            assert!((sum - 1.0).abs() < 2e-5, "{side}: {sum}");
        }
        assert_eq!(kernel_integral_over_polygon(&square(DVec2::splat(-1.5), 3.0)), 1.0);
        assert_eq!(kernel_integral_over_polygon(&square(DVec2::new(1.0, -4.0), 8.0)), 0.0);
    }

    #[test]
    fn samples_follow_the_kernel() {
        let mut next = unit_generator(3);
        let part = square(DVec2::new(-0.3, 0.1), 0.8);
        const DRAWS: u32 = 400_000;
        let mut inside = 0;
        for _ in 0..DRAWS {
            let place = warp_disk_point(warp::disk(Vec2::new(next(), next())));
            assert!(place.length() <= 1.0);
            let from = (place.as_dvec2() - part[0]) / 0.8;
            inside += u32::from(from.min_element() > 0.0 && from.max_element() < 1.0);
        }
        let (found, exact) = (f64::from(inside) / f64::from(DRAWS), kernel_integral_over_polygon(&part));
        assert!(
            (found - exact).abs() < 4.0 * (exact / f64::from(DRAWS)).sqrt(),
            "got {found}, expected {exact}"
        );
    }
}
