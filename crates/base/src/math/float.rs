//! Rounding-error bounds.

/// Unit roundoff of `f32`: the largest relative error of one rounding.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error of `n` successive roundings, `n·ε / (1 − n·ε)` (Higham, *Accuracy and
/// Stability of Numerical Algorithms*, section 3.1).
pub const fn gamma(n: u32) -> f32 {
    let n = n as f32;
    (n * UNIT_ROUNDOFF) / (1.0 - n * UNIT_ROUNDOFF)
}

/// Largest power of two not greater than `number`, for `number` > 0. Returns 0 for subnormal numbers.
pub fn floor_to_power_of_two(number: f64) -> f64 {
    f64::from_bits(number.to_bits() & f64::INFINITY.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_bounds_rounding_errors() {
        assert!(gamma(1) >= UNIT_ROUNDOFF && gamma(1) < UNIT_ROUNDOFF * 1.0001);
        assert!(gamma(5) > 5.0 * UNIT_ROUNDOFF);
    }
}
