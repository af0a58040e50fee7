//! Bounds on rounding error.

/// Half the distance from 1 to the next `f32`: the relative error of one rounding.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error of `n` roundings in a row, `n·ε / (1 − n·ε)`
/// (Higham, *Accuracy and Stability of Numerical Algorithms*, section 3.1).
pub const fn gamma(n: u32) -> f32 {
    let n = n as f32;
    (n * UNIT_ROUNDOFF) / (1.0 - n * UNIT_ROUNDOFF)
}

/// The largest power of two that is not above a number > 0; 0 if there is none.
pub fn power_of_two_below(number: f64) -> f64 {
    f64::from_bits(number.to_bits() & f64::INFINITY.to_bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_bounds_one_and_many_roundings() {
        assert!(gamma(1) >= UNIT_ROUNDOFF && gamma(1) < UNIT_ROUNDOFF * 1.0001);
        assert!(gamma(5) > 5.0 * UNIT_ROUNDOFF);
    }
}
