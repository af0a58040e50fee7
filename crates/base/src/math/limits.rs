//! Limits on the numbers in a scene. They do not depend on the file format.

use super::DVec3;

/// Largest allowed magnitude. Products of larger numbers may overflow 32-bit floats.
pub const MAX_MAGNITUDE: f64 = 1e18;

/// Shortest allowed nonzero length. Products of shorter lengths may underflow 32-bit floats.
pub const MIN_LENGTH: f64 = 1e-18;

/// Length of a vector, correct even if the squared length underflows or overflows.
pub fn robust_length(vector: DVec3) -> f64 {
    let largest = vector.abs().max_element();
    if largest > 0.0 { (vector / largest).length() * largest } else { 0.0 }
}

/// Whether a length is nonzero but too short to compute with.
pub fn is_nonzero_but_too_short(length: f64) -> bool {
    length != 0.0 && length.abs() < MIN_LENGTH
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn length_is_correct_if_its_square_overflows() {
        assert_eq!(robust_length(DVec3::ZERO), 0.0);
        for scale in [1e-300, 1e-200, 1.0, 1e200] {
            assert!(
                (robust_length(DVec3::new(3.0, -4.0, 12.0) * scale) / (13.0 * scale) - 1.0).abs() < 1e-15
            );
        }
        assert!(
            is_nonzero_but_too_short(1e-200)
                && is_nonzero_but_too_short(-1e-19)
                && !is_nonzero_but_too_short(0.0)
                && !is_nonzero_but_too_short(1e-18)
        );
    }
}
