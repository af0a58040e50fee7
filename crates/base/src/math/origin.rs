//! Local coordinate origins for single precision.

use super::DVec3;
use super::float::floor_to_power_of_two;

/// Spacing of the origin grid, in units of the scene size. At this distance, the rounding error of single
/// precision is a few millionths of the scene size.
const GRID_SPACING: f64 = 64.0;

/// Factor that keeps typical sizes such as 1, 2 and 5 away from the powers of two at which the grid spacing
/// changes.
const OFF_POWERS: f64 = 1.37;

/// Local origin for a scene of this size around `place`. Returns 0 if `place` is near 0, and otherwise a
/// point on a grid whose spacing is a power of two. Subtracting the origin is therefore exact, and small
/// changes to `place` do not move the origin.
pub fn local_coordinate_origin(place: DVec3, size: f64) -> DVec3 {
    let step = GRID_SPACING * floor_to_power_of_two(size * OFF_POWERS);
    // Adding 0 converts −0 to 0.
    let origin = (place / step).round() * step + DVec3::ZERO;
    if step > 0.0 && origin.is_finite() { origin } else { DVec3::ZERO }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origin_is_zero_or_within_half_a_step() {
        assert_eq!(local_coordinate_origin(DVec3::new(20.0, -20.0, 0.0), 1.0), DVec3::ZERO);
        let far = DVec3::new(1e8, -3e5, 7.0);
        for size in [0.1, 1.0, 5.0, 1e3] {
            let origin = local_coordinate_origin(far, size);
            assert!(
                (far - origin).abs().max_element() <= 0.5 * GRID_SPACING * OFF_POWERS * size,
                "{size}: {origin}"
            );
            // Doubling all numbers doubles the origin.
            assert_eq!(local_coordinate_origin(far * 2.0, size * 2.0), origin * 2.0);
        }
        assert_eq!(
            local_coordinate_origin(far, 5.0),
            local_coordinate_origin(far + DVec3::ONE, 5.0 * (1.0 - 1e-12))
        );
    }

    #[test]
    fn invalid_scenes_have_origin_zero() {
        for (place, size) in [
            (1e8, 0.0),
            (1e8, f64::NAN),
            (f64::NAN, 1.0),
            (f64::INFINITY, 1.0),
            (1.0, 1e-310),
            (1e308, 1e-300),
        ] {
            assert_eq!(local_coordinate_origin(DVec3::splat(place), size), DVec3::ZERO, "{place} {size}");
        }
    }
}
