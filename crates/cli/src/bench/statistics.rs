//! Medians, means and Student's t distribution.

/// Returns the median, or NaN for an empty slice.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => f64::NAN,
        length if length % 2 == 1 => sorted[middle],
        _ => (sorted[middle - 1] + sorted[middle]) / 2.0,
    }
}

/// Returns the mean and its standard error. The error is infinite for a single value.
pub fn mean_and_standard_error(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    let error = if values.len() < 2 { f64::INFINITY } else { (squares / (count - 1.0) / count).sqrt() };
    (mean, error)
}

/// The probability that Student's t with `freedom` degrees of freedom exceeds `t`.
pub fn student_t_tail(t: f64, freedom: f64) -> f64 {
    let x = freedom / (freedom + t * t);
    let tail = if t.is_infinite() { 0.0 } else { 0.5 * incomplete_beta(x, freedom / 2.0, 0.5) };
    if t >= 0.0 { tail } else { 1.0 - tail }
}

/// The inverse of [`student_t_tail`], for probabilities below 0.5.
pub fn student_t_upper_quantile(probability: f64, freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while student_t_tail(high, freedom) > probability && high < 1e12 {
        high *= 2.0;
    }
    for _ in 0..100 {
        let middle = (low + high) / 2.0;
        if student_t_tail(middle, freedom) > probability { low = middle } else { high = middle }
    }
    high
}

/// Returns the difference between the means, b − a, with its standard error and degrees of freedom
/// (Welch–Satterthwaite).
pub fn welch_difference(a: &[f64], b: &[f64]) -> (f64, f64, f64) {
    let ((mean_a, error_a), (mean_b, error_b)) = (mean_and_standard_error(a), mean_and_standard_error(b));
    let (square_a, square_b) = (error_a * error_a, error_b * error_b);
    let square = square_a + square_b;
    let of = |square: f64, count: usize| square * square / (count as f64 - 1.0).max(1.0);
    let freedom = square * square / (of(square_a, a.len()) + of(square_b, b.len()));
    (mean_b - mean_a, square.sqrt(), if freedom.is_finite() { freedom } else { 1.0 })
}

/// The regularized incomplete beta function I_x(a, b), from its continued fraction (modified Lentz's method).
fn incomplete_beta(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return x.clamp(0.0, 1.0);
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(1.0 - x, b, a);
    }
    let logarithm = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b);
    let front = libm::exp(logarithm + a * libm::log(x) + b * libm::log1p(-x)) / a;
    let away = |value: f64| if value.abs() < 1e-300 { 1e-300 } else { value };
    let (mut numerator, mut denominator) = (1.0, 1.0 / away(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = denominator;
    for step in 1..300 {
        let m = f64::from(step);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        for term in [even, odd] {
            denominator = 1.0 / away(1.0 + term * denominator);
            numerator = away(1.0 + term / numerator);
            fraction *= denominator * numerator;
        }
        if (denominator * numerator - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_means_are_correct() {
        assert_eq!((median(&[3.0, 1.0, 2.0]), median(&[4.0, 1.0, 2.0, 3.0])), (2.0, 2.5));
        assert!(median(&[]).is_nan());
        let (value, error) = mean_and_standard_error(&[1.0, 2.0, 3.0, 4.0]);
        assert!((value - 2.5).abs() < 1e-15 && (error - (5.0_f64 / 12.0).sqrt()).abs() < 1e-15);
        assert_eq!(mean_and_standard_error(&[1.0]), (1.0, f64::INFINITY));
    }

    /// Compares with tables of one-sided quantiles.
    #[test]
    fn student_t_matches_tables() {
        for (freedom, probability, t) in [
            (1.0, 0.05, 6.313_752),
            (5.0, 0.001, 5.893_430),
            (10.0, 0.025, 2.228_139),
            (100.0, 0.01, 2.364_217),
        ] {
            assert!(
                (student_t_tail(t, freedom) / probability - 1.0).abs() < 1e-5,
                "{freedom}: {}",
                student_t_tail(t, freedom)
            );
            assert!(
                (student_t_upper_quantile(probability, freedom) - t).abs() < 1e-4,
                "{}",
                student_t_upper_quantile(probability, freedom)
            );
        }
        assert!((student_t_tail(-1.0, 3.0) + student_t_tail(1.0, 3.0) - 1.0).abs() < 1e-14);
        assert!((student_t_tail(0.0, 7.0) - 0.5).abs() < 1e-14);
        assert_eq!(student_t_tail(f64::INFINITY, 7.0), 0.0);
    }

    #[test]
    fn welch_matches_a_manual_computation() {
        let (difference, error, freedom) = welch_difference(&[1.0, 2.0, 3.0], &[5.0, 7.0, 9.0, 11.0]);
        assert!((difference - 6.0).abs() < 1e-14);
        // The variances are 1 and 20/3. Squared error: 1/3 + 5/3 = 2. Degrees of freedom: 4/((1/9)/2 +
        // (25/9)/3).
        assert!((error - 2.0_f64.sqrt()).abs() < 1e-14);
        assert!((freedom - 4.0 / (1.0 / 18.0 + 25.0 / 27.0)).abs() < 1e-12, "{freedom}");
    }
}
