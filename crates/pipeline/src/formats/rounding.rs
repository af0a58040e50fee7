//! Rounds the numbers in generated scenes to keep imported scene files short.

use crate::math::{DVec3, Vec2};
use crate::scene::SceneDocumentValue;

/// Returns the number with the fewest decimal digits that rounds to the same single-precision value. Numbers
/// from 10,000 to 1e15 in magnitude are returned unchanged.
pub(super) fn shorten_number(value: f64) -> f64 {
    if (1e4..1e15).contains(&value.abs()) {
        return value;
    }
    format!("{:e}", value as f32).parse().unwrap_or(value)
}

/// Shortens the components of a vector.
pub(super) fn shorten_vector(value: DVec3) -> DVec3 {
    DVec3::from(value.to_array().map(shorten_number))
}

/// Shortens the components of a pair.
pub(super) fn shorten_pair(value: Vec2) -> [f64; 2] {
    [value.x, value.y].map(|part| shorten_number(part.into()))
}

/// Shortens the components of a color. Grays become a single number.
pub(super) fn shorten_color(value: DVec3) -> SceneDocumentValue {
    let [red, green, blue] = value.to_array();
    if red == green && green == blue { shorten_number(red).into() } else { shorten_vector(value).into() }
}

/// Rounds to `digits` significant digits.
pub(super) fn round_significant(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let unit = libm::pow(10.0, f64::from(digits - 1) - libm::floor(libm::log10(value.abs())));
    (value * unit).round() / unit
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_few_digits() {
        for (value, short) in [
            (0.0, 0.0),
            (f64::from(0.3_f32), 0.3),
            (1.0 / 3.0, 0.333_333_34),
            (f64::from(1e-7_f32), 1e-7),
            (500_000.125, 500_000.125),
            (f64::from(3e20_f32), 3e20),
            (1e300, f64::INFINITY),
        ] {
            assert_eq!(shorten_number(value), short);
        }
        assert!(shorten_number(f64::NAN).is_nan());
        assert_eq!(shorten_color(DVec3::ONE), 1.0.into());
        assert_eq!(
            (round_significant(1234.56, 3), round_significant(-0.012345, 2), round_significant(0.0, 2)),
            (1230.0, -0.012, 0.0)
        );
    }
}
