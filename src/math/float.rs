//! Floating-point helpers: bounds on rounding error and products that do not cancel.

/// Half the distance from 1 to the next `f32`: the relative error of one rounding.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error of `n` roundings in a row, `n·ε / (1 − n·ε)`
/// (Higham, *Accuracy and Stability of Numerical Algorithms*, section 3.1).
pub const fn gamma(n: u32) -> f32 {
    let n = n as f32;
    (n * UNIT_ROUNDOFF) / (1.0 - n * UNIT_ROUNDOFF)
}

/// `a·b − c·d` with an error below 2 ulp, also where the products nearly cancel (Kahan; analysed in
/// Jeannerod, Louvet, Muller 2013).
pub fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let cd = c * d;
    let difference = a.mul_add(b, -cd);
    let error = (-c).mul_add(d, cd);
    difference + error
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance in units of the last place between two finite numbers of one sign.
    fn ulps(a: f32, b: f32) -> i64 {
        (i64::from(a.to_bits() as i32) - i64::from(b.to_bits() as i32)).abs()
    }

    #[test]
    fn gamma_bounds_one_and_many_roundings() {
        assert!(gamma(1) >= UNIT_ROUNDOFF && gamma(1) < UNIT_ROUNDOFF * 1.0001);
        assert!(gamma(5) > 5.0 * UNIT_ROUNDOFF);
    }

    #[test]
    fn difference_of_products_survives_cancellation() {
        // 33962.035·−30438.8 − 41563.4·−24871.969: the naive f32 result has no right digit.
        let (a, b, c, d) = (33962.035_f32, -30438.8, 41563.4, -24871.969);
        let exact = f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d);
        assert!(ulps(difference_of_products(a, b, c, d), exact as f32) <= 2);
        assert!(ulps(a * b - c * d, exact as f32) > 100);
    }
}
