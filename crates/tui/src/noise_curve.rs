//! Noise against the time of a render.

/// Points that are kept; with more, every second one goes.
const MOST: usize = 256;
/// Least ratio of the times of two points: the axis of time is logarithmic.
const STEP: f64 = 1.02;

/// Seconds of a render, and the noise that was measured after them, in the order of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NoiseCurve(Vec<(f64, f64)>);

impl NoiseCurve {
    /// Notes the noise after so many seconds.
    pub(super) fn note(&mut self, seconds: f64, noise: f64) {
        let is_later = self.0.last().is_none_or(|(last, _)| seconds > last * STEP);
        if !(seconds > 0.0 && seconds.is_finite() && noise > 0.0 && noise.is_finite() && is_later) {
            return;
        }
        self.0.push((seconds, noise));
        if self.0.len() > MOST {
            let mut index = 0;
            self.0.retain(|_| {
                index += 1;
                index % 2 == 1
            });
        }
    }

    /// The last noise, which was measured when the render was over.
    pub(super) fn end(&mut self, seconds: f64, noise: f64) {
        self.0.retain(|(time, _)| time * STEP < seconds);
        self.note(seconds, noise);
    }

    pub(super) fn points(&self) -> &[(f64, f64)] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_can_be_drawn_is_kept_and_the_end_is_what_was_measured() {
        let mut curve = NoiseCurve::default();
        for (seconds, noise) in
            [(0.0, 0.1), (0.5, f64::NAN), (0.5, 0.1), (0.505, 0.09), (1.0, 0.0), (2.0, 0.05)]
        {
            curve.note(seconds, noise);
        }
        assert_eq!(curve.points(), [(0.5, 0.1), (2.0, 0.05)]);
        curve.end(2.01, 0.04);
        assert_eq!(curve.points(), [(0.5, 0.1), (2.01, 0.04)]);
        for step in 0..2000 {
            curve.note(2.01 * 1.03_f64.powi(step), 0.04);
        }
        assert!(curve.points().len() <= MOST);
        assert!(curve.points().windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}
