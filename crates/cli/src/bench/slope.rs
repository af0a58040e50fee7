//! Convergence rates, as slopes of error over time on log–log axes.

use serde::{Deserialize, Serialize};

use super::statistics::mean_and_standard_error;

/// A slope on log–log axes: −1 for independent samples, 0 if the error does not decrease.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorOverTimeSlope {
    /// Mean slope over all series.
    pub value: f64,
    /// Standard error across the series.
    pub error: f64,
}

/// Returns the mean slope of independent series of (time, error) points, or `None` if no series has two
/// points at different times. Skips errors that are zero or negative.
pub fn mean_loglog_slope(series: &[Vec<(f64, f64)>]) -> Option<ErrorOverTimeSlope> {
    let slopes: Vec<f64> = series.iter().filter_map(|points| fit_error_over_time_slope(points)).collect();
    let (value, error) = mean_and_standard_error(&slopes);
    (!slopes.is_empty())
        .then_some(ErrorOverTimeSlope { value, error: if error.is_finite() { error } else { 0.0 } })
}

/// Least-squares slope of one series.
fn fit_error_over_time_slope(points: &[(f64, f64)]) -> Option<f64> {
    let usable = points.iter().filter(|(time, error)| *time > 0.0 && *error > 0.0);
    let logs: Vec<(f64, f64)> = usable.map(|&(time, error)| (libm::log(time), libm::log(error))).collect();
    let count = logs.len() as f64;
    let middle = logs.iter().fold((0.0, 0.0), |sum, log| (sum.0 + log.0 / count, sum.1 + log.1 / count));
    let (mut square, mut product) = (0.0, 0.0);
    for (x, y) in logs {
        square += (x - middle.0) * (x - middle.0);
        product += (x - middle.0) * (y - middle.1);
    }
    (square > 1e-12).then(|| product / square)
}

/// Returns the time at which the error reaches `target`, interpolated linearly on log–log axes or
/// extrapolated from the last two points. Returns `None` if the first error is below the target, if the error
/// does not decrease, or if the time is more than 1000 times the last measured time.
pub fn interpolate_time_to_error(target: f64, points: &[(f64, f64)]) -> Option<TimeToError> {
    let after = points.iter().position(|(_, error)| *error <= target);
    let (index, is_measured) = match after {
        Some(0) | None if points.len() < 2 => return None,
        Some(0) => return None,
        Some(index) => (index, true),
        None => (points.len() - 1, false),
    };
    let [(t0, e0), (t1, e1)] = [points[index - 1], points[index]];
    if !(t0 > 0.0 && t1 > t0 && e1 > 0.0 && e0 > e1) {
        return None;
    }
    let share = libm::log(e0 / target) / libm::log(e0 / e1);
    let seconds = t0 * libm::pow(t1 / t0, share);
    (seconds <= 1000.0 * t1).then_some(TimeToError { seconds, is_measured })
}

/// The time at which an error reaches a target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeToError {
    /// Rendering time in seconds.
    pub seconds: f64,
    /// Whether the time is interpolated rather than extrapolated.
    pub is_measured: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(slope: f64, floor: f64) -> Vec<(f64, f64)> {
        let times = (0..5).map(|step| 0.01 * 4.0_f64.powi(step));
        times.map(|time| (time, 0.001 * time.powf(slope) + floor)).collect()
    }

    #[test]
    fn slopes_of_power_laws_are_exact() {
        for value in [-1.0, -2.0 / 3.0, 0.0] {
            let found = mean_loglog_slope(&[points(value, 0.0), points(value, 0.0)]).expect("a slope");
            assert!((found.value - value).abs() < 1e-12 && found.error < 1e-12, "{found:?}");
        }
        let of_both = mean_loglog_slope(&[points(-1.0, 0.0), points(-0.5, 0.0)]).expect("a slope");
        assert!((of_both.value + 0.75).abs() < 1e-12 && (of_both.error - 0.25).abs() < 1e-12, "{of_both:?}");
    }

    #[test]
    fn constant_bias_flattens_the_last_slope() {
        let flat = points(-1.0, 0.05);
        let last = mean_loglog_slope(&[flat[3..].to_vec()]).expect("a slope");
        assert!(last.value > -0.05, "{last:?}");
    }

    #[test]
    fn nonpositive_errors_are_skipped() {
        let mut some = points(-1.0, 0.0);
        some[4].1 = -1e-9;
        assert!((mean_loglog_slope(&[some]).expect("a slope").value + 1.0).abs() < 1e-12);
        assert_eq!(mean_loglog_slope(&[vec![(1.0, 1.0), (2.0, 0.0)], vec![(1.0, 1.0)]]), None);
        assert_eq!(mean_loglog_slope(&[]), None);
    }

    #[test]
    fn times_are_interpolated_or_extrapolated() {
        let fall = points(-1.0, 0.0);
        let inside = interpolate_time_to_error(0.01, &fall).expect("a time");
        assert!(inside.is_measured && (inside.seconds - 0.1).abs() < 1e-9, "{inside:?}");
        let beyond = interpolate_time_to_error(1e-4, &fall).expect("a time");
        assert!(!beyond.is_measured && (beyond.seconds - 10.0).abs() < 1e-6, "{beyond:?}");
        assert_eq!(interpolate_time_to_error(1e-9, &fall), None, "too far");
        assert_eq!(interpolate_time_to_error(0.5, &fall), None, "the first point is below the target");
        assert_eq!(interpolate_time_to_error(0.001, &points(0.0, 0.0)), None, "the error does not decrease");
        assert_eq!(interpolate_time_to_error(0.1, &[(1.0, 1.0)]), None);
    }
}
