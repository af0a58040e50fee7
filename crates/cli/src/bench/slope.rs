//! Convergence of an error: the slope of its logarithm over that of the time.

use serde::{Deserialize, Serialize};

use super::statistics::mean;

/// A slope on log axes: −1 is what random samples do, 0 is an error that more time does not make less.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slope {
    /// The slope.
    pub value: f64,
    /// Its standard error, from series to series.
    pub error: f64,
}

/// The mean slope of some series of times and errors that are independent of each other. Errors that are not above 0 have no
/// logarithm and are left out; none, where no series has two points at different times.
pub fn slope(series: &[Vec<(f64, f64)>]) -> Option<Slope> {
    let slopes: Vec<f64> = series.iter().filter_map(|points| of_one(points)).collect();
    let (value, error) = mean(&slopes);
    (!slopes.is_empty()).then_some(Slope { value, error: if error.is_finite() { error } else { 0.0 } })
}

/// Least squares.
fn of_one(points: &[(f64, f64)]) -> Option<f64> {
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

/// When an error falls to `target`: on the straight line between the two points around it on log axes; beyond the last point, on
/// the line of the last two. None where it was below it at once, does not fall, or would take more than a thousand times as long
/// as was measured.
pub fn time_to(target: f64, points: &[(f64, f64)]) -> Option<TimeTo> {
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
    (seconds <= 1000.0 * t1).then_some(TimeTo { seconds, is_measured })
}

/// When an error falls to a target.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeTo {
    /// After so many seconds of rendering.
    pub seconds: f64,
    /// Whether what was measured goes so far.
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
    fn slopes_of_straight_lines_are_found() {
        for value in [-1.0, -2.0 / 3.0, 0.0] {
            let found = slope(&[points(value, 0.0), points(value, 0.0)]).expect("a slope");
            assert!((found.value - value).abs() < 1e-12 && found.error < 1e-12, "{found:?}");
        }
        let of_both = slope(&[points(-1.0, 0.0), points(-0.5, 0.0)]).expect("a slope");
        assert!((of_both.value + 0.75).abs() < 1e-12 && (of_both.error - 0.25).abs() < 1e-12, "{of_both:?}");
    }

    #[test]
    fn a_floor_makes_the_last_slope_flat() {
        let flat = points(-1.0, 0.05);
        let last = slope(&[flat[3..].to_vec()]).expect("a slope");
        assert!(last.value > -0.05, "{last:?}");
    }

    #[test]
    fn what_has_no_logarithm_is_left_out() {
        let mut some = points(-1.0, 0.0);
        some[4].1 = -1e-9;
        assert!((slope(&[some]).expect("a slope").value + 1.0).abs() < 1e-12);
        assert_eq!(slope(&[vec![(1.0, 1.0), (2.0, 0.0)], vec![(1.0, 1.0)]]), None);
        assert_eq!(slope(&[]), None);
    }

    #[test]
    fn the_time_to_an_error_is_measured_or_expected() {
        let fall = points(-1.0, 0.0);
        let inside = time_to(0.01, &fall).expect("a time");
        assert!(inside.is_measured && (inside.seconds - 0.1).abs() < 1e-9, "{inside:?}");
        let beyond = time_to(1e-4, &fall).expect("a time");
        assert!(!beyond.is_measured && (beyond.seconds - 10.0).abs() < 1e-6, "{beyond:?}");
        assert_eq!(time_to(1e-9, &fall), None, "too far");
        assert_eq!(time_to(0.5, &fall), None, "from the start");
        assert_eq!(time_to(0.001, &points(0.0, 0.0)), None, "it does not fall");
        assert_eq!(time_to(0.1, &[(1.0, 1.0)]), None);
    }
}
