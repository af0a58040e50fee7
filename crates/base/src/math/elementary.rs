//! Branch-free elementary functions that do not use libm. They return the same bits on every machine and
//! vectorize in loops. Some compute in `f64` internally so that the `f32` result is correct up to the final
//! rounding.

use std::f32::consts::{FRAC_2_PI, FRAC_PI_2, PI};
use std::f64::consts::{LN_2, LOG2_E};

/// xʸ for x ≥ 0, within one ulp. Returns 1 if y = 0, and 0 if x = 0 and y > 0.
#[inline(always)]
pub fn pow(x: f32, y: f32) -> f32 {
    let power = exp2_f64(f64::from(y) * log2_f64(f64::from(x))) as f32;
    let of_nothing = if y > 0.0 { 0.0 } else { f32::INFINITY };
    let power = if x > 0.0 { power } else { of_nothing };
    if (y == 0.0) | (x == 1.0) { 1.0 } else { power }
}

/// xʸ for normal x > 0, with a relative error of at most 1e-11 · y. Underflows to 0 and overflows to ∞ where
/// `f32` does.
#[inline(always)]
pub fn pow_f64(x: f64, y: f64) -> f64 {
    exp2_f64(y * log2_f64(x))
}

/// 2ˣ within one ulp.
#[inline(always)]
pub fn exp2(x: f32) -> f32 {
    exp2_f64(f64::from(x)) as f32
}

/// exp(−x²) within one ulp.
#[inline(always)]
pub fn gaussian(x: f32) -> f32 {
    let x = f64::from(x);
    exp2_f64(-LOG2_E * (x * x)) as f32
}

/// erf(x) within 6e-7, and exp(−x²) (Abramowitz and Stegun, *Handbook of Mathematical Functions*, 1964,
/// equation 7.1.26).
#[inline(always)]
pub fn erf_and_gaussian(x: f32) -> (f32, f32) {
    let gaussian = gaussian(x);
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let series = 1.421_413_7 + t * (-1.453_152 + t * 1.061_405_4);
    let series = t * (0.254_829_6 + t * (-0.284_496_74 + t * series));
    ((1.0 - series * gaussian).copysign(x), gaussian)
}

/// Returns the x at which (1 + erf(x))/2 equals `p`, which is in (0, 1), with a relative error of 1e-6
/// (Giles, *Approximating the erfinv Function*, GPU Computing Gems Jade Edition, 2011).
#[inline(always)]
pub fn half_variance_normal_quantile(p: f32) -> f32 {
    let w = -LN_2 as f32 * log2(4.0 * p * (1.0 - p));
    let (near, far) = (w - 2.5, w.max(0.0).sqrt() - 3.0);
    let center = 2.185_808_7e-4
        + near
            * (-4.391_506_5e-6 + near * (-3.523_387_7e-6 + near * (3.432_739_4e-7 + near * 2.810_226_4e-8)));
    let center = 1.501_409_4
        + near * (0.246_640_73 + near * (-4.177_681_6e-3 + near * (-1.253_725e-3 + near * center)));
    let tail = -3.673_428_4e-3 + far * (1.349_343_2e-3 + far * (1.009_505_6e-4 + far * -2.002_142_6e-4));
    let tail = 9.438_870_5e-3 + far * (-7.622_461_3e-3 + far * (5.739_507_7e-3 + far * tail));
    let tail = 2.832_976_8 + far * (1.001_674 + far * tail);
    (if w < 5.0 { center } else { tail }) * (2.0 * p - 1.0)
}

/// Binary logarithm of a normal x > 0, within one ulp.
#[inline(always)]
pub fn log2(x: f32) -> f32 {
    log2_f64(f64::from(x)) as f32
}

/// Binary logarithm of a normal x > 0, within 1e-11. Splits off the exponent and evaluates the series of
/// 2·artanh((m − 1)/(m + 1)) for the remaining factor m in [√½, √2).
#[inline(always)]
fn log2_f64(x: f64) -> f64 {
    const SQRT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
    const MANTISSA: u64 = (1 << 52) - 1;
    // Adding an integer below 2⁵² to 2⁵² stores the integer in the low bits.
    const WHOLE: u64 = 0x4330_0000_0000_0000;
    let shifted = x.to_bits().wrapping_add(0x3ff0_0000_0000_0000 - SQRT_HALF);
    let exponent = f64::from_bits((shifted >> 52) | WHOLE) - (f64::from_bits(WHOLE) + 1023.0);
    let m = f64::from_bits((shifted & MANTISSA) + SQRT_HALF);
    let s = (m - 1.0) / (m + 1.0);
    let z = s * s;
    let series = 1.0 / 11.0 + z * (1.0 / 13.0 + z * (1.0 / 15.0));
    let series = 1.0 / 5.0 + z * (1.0 / 7.0 + z * (1.0 / 9.0 + z * series));
    let series = s * (1.0 + z * (1.0 / 3.0 + z * series));
    exponent + series * (2.0 / LN_2)
}

/// 2ˣ with a relative error of 1e-11. Clamps x to [−200, 200], beyond which `f32` is 0 or ∞, splits off the
/// integer part and uses a Taylor series for the rest in [−½, ½].
#[inline(always)]
fn exp2_f64(x: f64) -> f64 {
    // Adding 1.5·2⁵² rounds to an integer and stores it in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let x = if x < 200.0 { x } else { 200.0 };
    let x = if x > -200.0 { x } else { -200.0 };
    let sum = x + ROUND;
    let r = (x - (sum - ROUND)) * LN_2;
    let series = 1.0 / 5040.0 + r * (1.0 / 40_320.0 + r * (1.0 / 362_880.0 + r * (1.0 / 3_628_800.0)));
    let series = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * series));
    let series = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * series)));
    f64::from_bits(series.to_bits().wrapping_add(sum.to_bits() << 52))
}

/// Arc cosine of x in [−1, 1], within 2 ulp. Uses the arc sine for |x| up to ½ and the half-angle arc sine
/// for larger |x|, with the polynomial from Moshier's Cephes library.
#[inline(always)]
pub fn acos(x: f32) -> f32 {
    let size = x.abs();
    let is_large = size > 0.5;
    let half = (1.0 - size) * 0.5;
    let z = if is_large { half } else { size * size };
    let s = if is_large { half.sqrt() } else { size };
    let p = 2.418_131e-2 + z * 4.216_32e-2;
    let p = 7.495_300_3e-2 + z * (4.547_002_6e-2 + z * p);
    let arcsine = s + s * z * (1.666_675_2e-1 + z * p);
    let of_size = if is_large { 2.0 * arcsine } else { FRAC_PI_2 - arcsine };
    // Rounding errors of π/2 and π in `f32`.
    let rest = if is_large { 0.0 } else { -4.371_139e-8 };
    let negative = if is_large { PI - (of_size + 8.742_278e-8) } else { FRAC_PI_2 + (arcsine + rest) };
    if x < 0.0 { negative } else { of_size + rest }
}

/// Angle of (x, y) from the x axis in [−π, π], within 3 ulp. Returns 0 at (0, 0). Computes the arc tangent of
/// a ratio in [0, 1], reduced to ±tan(π/8), with the polynomial from Moshier's Cephes library.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    const TAN_EIGHTH: f32 = 0.414_213_57;
    let (ax, ay) = (x.abs(), y.abs());
    let is_steep = ay > ax;
    let (large, small) = if is_steep { (ay, ax) } else { (ax, ay) };
    let is_far = small > TAN_EIGHTH * large;
    let above = if is_far { small - large } else { small };
    let below = if is_far { small + large } else { large };
    let t = above / if below > 0.0 { below } else { 1.0 };
    let z = t * t;
    let p = 1.997_771_1e-1 + z * (-1.387_768_6e-1 + z * 8.053_744_5e-2);
    let rest = t + t * z * (-3.333_295e-1 + z * p);
    let first = if is_far { FRAC_PI_2 * 0.5 + rest } else { rest };
    // Rounding errors of π/2 and π in `f32`.
    let quarter = if is_steep { FRAC_PI_2 - (first + 4.371_139e-8) } else { first };
    let half = if x < 0.0 { PI - (quarter + 8.742_278e-8) } else { quarter };
    half.copysign(y)
}

/// Sine and cosine, within 1.2e-7, of an angle between −1000 and 1000. Subtracts the nearest multiple of π/2
/// in three parts (Cody and Waite, *Software Manual for the Elementary Functions*, 1980), then uses the
/// polynomials from Moshier's Cephes library on [−π/4, π/4].
#[inline(always)]
pub fn sin_cos(angle: f32) -> (f32, f32) {
    // Adding 1.5·2²³ rounds to an integer, as in `exp2_f64`.
    const ROUND: f32 = 12_582_912.0;
    let sum = angle * FRAC_2_PI + ROUND;
    let (k, quarter) = (sum - ROUND, sum.to_bits());
    let r = ((angle - k * 1.570_312_5) - k * 4.837_513e-4) - k * 7.549_79e-8;
    let z = r * r;
    let sin = r + r * z * (-1.666_665_5e-1 + z * (8.332_161e-3 + z * -1.951_529_6e-4));
    let cos = 1.0 - 0.5 * z + z * z * (4.166_664_6e-2 + z * (-1.388_731_6e-3 + z * 2.443_315_7e-5));
    let is_odd = quarter & 1 == 1;
    let (of_sin, of_cos) = if is_odd { (cos, sin) } else { (sin, cos) };
    let sign = |value: f32, is_negative: u32| f32::from_bits(value.to_bits() ^ (is_negative & 2) << 30);
    (sign(of_sin, quarter), sign(of_cos, quarter.wrapping_add(1)))
}

/// Sine and cosine, within 1e-13, of an angle between −100,000 and 100,000. Subtracts the nearest multiple of
/// π/2 in two parts, as in [`sin_cos`], then uses Taylor series on [−π/4, π/4].
#[inline(always)]
pub fn sin_cos_f64(angle: f64) -> (f64, f64) {
    // Adding 1.5·2⁵² rounds to an integer, as in `exp2_f64`.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let sum = angle * std::f64::consts::FRAC_2_PI + ROUND;
    let (k, quarter) = (sum - ROUND, sum.to_bits());
    // The first part of π/2 has 33 significant bits.
    let r = (angle - k * 1.570_796_326_734_125_6) - k * 6.077_100_506_506_192e-11;
    let z = r * r;
    let sin = -1.0 / 39_916_800.0 + z * (1.0 / 6_227_020_800.0);
    let sin = -1.0 / 5040.0 + z * (1.0 / 362_880.0 + z * sin);
    let sin = r + r * z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * sin));
    let cos = 1.0 / 479_001_600.0 + z * (-1.0 / 87_178_291_200.0);
    let cos = 1.0 / 40_320.0 + z * (-1.0 / 3_628_800.0 + z * cos);
    let cos = 1.0 + z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * cos)));
    let is_odd = quarter & 1 == 1;
    let (of_sin, of_cos) = if is_odd { (cos, sin) } else { (sin, cos) };
    let sign = |value: f64, is_negative: u64| f64::from_bits(value.to_bits() ^ (is_negative & 2) << 62);
    (sign(of_sin, quarter), sign(of_cos, quarter.wrapping_add(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error of `value` in ulps of the exact result.
    fn ulps(value: f32, exact: f64) -> f64 {
        let near = exact as f32;
        let ulp = f64::from((near.abs().next_up() - near.abs()).max(f32::MIN_POSITIVE * f32::EPSILON));
        (f64::from(value) - exact).abs() / ulp
    }

    #[test]
    fn acos_is_within_two_ulp() {
        let mut worst = 0.0_f64;
        for bits in (0..=1.0_f32.to_bits()).step_by(101).chain([1.0_f32.to_bits(), 0.5_f32.to_bits()]) {
            let x = f32::from_bits(bits);
            for x in [x, -x] {
                worst = worst.max(ulps(acos(x), libm::acos(f64::from(x))));
            }
        }
        assert!(worst <= 2.0, "{worst} ulp");
        assert_eq!((acos(1.0), acos(-1.0), acos(0.0)), (0.0, PI, FRAC_PI_2));
    }

    #[test]
    fn atan2_is_within_three_ulp() {
        let mut worst = 0.0_f64;
        for i in 0..400_000 {
            let angle = f64::from(i) / 400_000.0 * std::f64::consts::TAU - std::f64::consts::PI;
            for radius in [1.0, 1e-20, 3e18] {
                let (x, y) = ((libm::cos(angle) * radius) as f32, (libm::sin(angle) * radius) as f32);
                worst = worst.max(ulps(atan2(y, x), libm::atan2(f64::from(y), f64::from(x))));
            }
        }
        assert!(worst <= 3.0, "{worst} ulp");
        for (y, x, angle) in
            [(0.0, 1.0, 0.0), (1.0, 0.0, FRAC_PI_2), (0.0, -1.0, PI), (-1.0, 0.0, -FRAC_PI_2)]
        {
            assert_eq!(atan2(y, x), angle);
        }
        assert_eq!([atan2(0.0, 0.0), atan2(-0.0, -1.0)], [0.0, -PI]);
    }

    #[test]
    fn powers_and_logarithms_are_within_one_ulp() {
        let mut worst = [0.0_f64; 3];
        for i in 0..2_000_000_u32 {
            let spread = i.wrapping_mul(2_654_435_761);
            let x = f32::from_bits(0x0080_0000 + spread % (0x7f00_0000 - 0x0080_0000));
            let y = (f64::from(i) / 1e6 - 1.0) as f32 * 40.0;
            let exact = libm::pow(f64::from(x), f64::from(y));
            if (f64::from(f32::MIN_POSITIVE)..f64::from(f32::MAX)).contains(&exact) {
                worst[0] = worst[0].max(ulps(pow(x, y), exact));
            }
            worst[1] = worst[1].max(ulps(exp2(y), libm::exp2(f64::from(y))));
            worst[2] = worst[2].max(ulps(log2(x), libm::log2(f64::from(x))));
        }
        assert!(worst.iter().all(|worst| *worst <= 1.0), "{worst:?} ulp");
        // Bases just below 1 with exponents of any size, as in cosine lobes.
        for (i, shininess) in (1..4000).flat_map(|i| [1.0, 7.5, 300.0, 1e5].map(|n| (i, n))) {
            let x = 1.0 - i as f32 * 1e-6;
            assert!(ulps(pow(x, shininess), libm::pow(f64::from(x), f64::from(shininess))) <= 1.0);
        }
    }

    #[test]
    fn gaussian_functions_match_libm() {
        for i in -120_000..=120_000_i32 {
            let x = i as f32 * 1e-4;
            let (erf, gaussian) = erf_and_gaussian(x);
            let off = (f64::from(erf) - libm::erf(f64::from(x))).abs();
            assert!(off < 6e-7, "erf({x}) is off by {off}");
            let exact = libm::exp(-f64::from(x) * f64::from(x));
            let is_normal = exact > f64::from(f32::MIN_POSITIVE);
            assert!(!is_normal || ulps(gaussian, exact) <= 1.0, "exp(−{x}²)");
        }
        assert_eq!([f32::INFINITY, f32::NEG_INFINITY].map(erf_and_gaussian), [(1.0, 0.0), (-1.0, 0.0)]);
        for i in 1..200_000 {
            let p = (i as f32 / 200_000.0).powi(2);
            let x = f64::from(half_variance_normal_quantile(p));
            let found = 0.5 * libm::erfc(-x);
            // Above ½, 1 − p is rounded.
            let error = 4e-6 * f64::from(p.min(1.0 - p)) + 1.2e-7;
            assert!((found - f64::from(p)).abs() < error, "{p}: {found}");
        }
    }

    #[test]
    fn powers_are_exact_in_edge_cases() {
        assert_eq!([pow(0.0, 2.0), pow(0.0, 0.0), pow(3.0, 0.0), pow(1.0, f32::MAX)], [0.0, 1.0, 1.0, 1.0]);
        assert_eq!([pow(0.5, 1e30), pow(2.0, 1e30), pow(2.0, 3.0)], [0.0, f32::INFINITY, 8.0]);
        assert_eq!([exp2(0.0), exp2(-3.0), exp2(200.0), exp2(-300.0)], [1.0, 0.125, f32::INFINITY, 0.0]);
        assert_eq!([log2(1.0), log2(8.0), log2(0.25)], [0.0, 3.0, -2.0]);
    }

    #[test]
    fn sin_cos_is_accurate_over_many_turns() {
        for i in -200_000..=200_000_i32 {
            let angle = i as f32 * 1e-4;
            let (sin, cos) = sin_cos(angle);
            let (exact_sin, exact_cos) = libm::sincos(f64::from(angle));
            assert!((f64::from(sin) - exact_sin).abs() < 1.2e-7, "sin {angle}: {sin}");
            assert!((f64::from(cos) - exact_cos).abs() < 1.2e-7, "cos {angle}: {cos}");
        }
    }

    #[test]
    fn sin_cos_f64_is_accurate_over_many_turns() {
        for (i, scale) in (-20_000..=20_000_i32).flat_map(|i| [1e-4, 3.1, 4.9].map(|scale| (i, scale))) {
            let angle = f64::from(i) * scale;
            let (sin, cos) = sin_cos_f64(angle);
            let (exact_sin, exact_cos) = libm::sincos(angle);
            assert!((sin - exact_sin).abs() < 1e-13, "sin {angle}: {sin}");
            assert!((cos - exact_cos).abs() < 1e-13, "cos {angle}: {cos}");
        }
    }
}
