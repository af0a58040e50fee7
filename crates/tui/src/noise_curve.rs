//! Noise as a function of render time.

/// Maximum number of points. If there are more, every second point is dropped.
const MAX_POINTS: usize = 256;
/// Minimum ratio between the times of successive points. It is a ratio because the time axis is logarithmic.
const MIN_TIME_RATIO: f64 = 1.02;

/// Render times in seconds and the noise measured at each time, in chronological order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NoiseCurve(Vec<(f64, f64)>);

impl NoiseCurve {
    /// Records the noise after `seconds`.
    pub(super) fn record(&mut self, seconds: f64, noise: f64) {
        let is_later = self.0.last().is_none_or(|(last, _)| seconds > last * MIN_TIME_RATIO);
        if !(seconds > 0.0 && seconds.is_finite() && noise > 0.0 && noise.is_finite() && is_later) {
            return;
        }
        self.0.push((seconds, noise));
        if self.0.len() > MAX_POINTS {
            let mut index = 0;
            self.0.retain(|_| {
                index += 1;
                index % 2 == 1
            });
        }
    }

    /// Records the final noise, measured at the end of the render.
    pub(super) fn record_final(&mut self, seconds: f64, noise: f64) {
        self.0.retain(|(time, _)| time * MIN_TIME_RATIO < seconds);
        self.record(seconds, noise);
    }

    pub(super) fn points(&self) -> &[(f64, f64)] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curve_is_bounded_and_ends_at_final_noise() {
        let mut curve = NoiseCurve::default();
        for (seconds, noise) in
            [(0.0, 0.1), (0.5, f64::NAN), (0.5, 0.1), (0.505, 0.09), (1.0, 0.0), (2.0, 0.05)]
        {
            curve.record(seconds, noise);
        }
        assert_eq!(curve.points(), [(0.5, 0.1), (2.0, 0.05)]);
        curve.record_final(2.01, 0.04);
        assert_eq!(curve.points(), [(0.5, 0.1), (2.01, 0.04)]);
        for step in 0..2000 {
            curve.record(2.01 * 1.03_f64.powi(step), 0.04);
        }
        assert!(curve.points().len() <= MAX_POINTS);
        assert!(curve.points().windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}
