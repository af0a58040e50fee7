//! A render's measured noise and its predicted decrease.

use std::time::{Duration, Instant};

use super::work_rate::WorkAmount;
use crate::film::{Film, NoiseAndConvergenceRate};
use crate::protocol::NoiseAndTimeToNextLevel;
use crate::render::noise_goals::MIN_SAMPLES;

/// Minimum time before the first measurement and between measurements, each of which requires a sum over all
/// pixels.
const INTERVAL: Duration = Duration::from_millis(500);
/// Minimum factor between the current noise and the noise level for which a time is predicted.
const MIN_LEVEL_RATIO: f64 = 1.5;

/// The last noise measurement and the time when the next one is due.
#[derive(Debug)]
pub(crate) struct NoiseTracker {
    due: Instant,
    last_measurement: Option<NoiseMeasurement>,
}

/// A noise measurement.
#[derive(Clone, Copy, Debug)]
struct NoiseMeasurement {
    noise: NoiseAndConvergenceRate,
    /// Amount of work done when the noise was measured.
    done: f64,
    /// Seconds from the start of the stage to the measurement.
    seconds: f64,
}

impl NoiseTracker {
    pub(crate) fn new() -> Self {
        Self { due: Instant::now() + INTERVAL, last_measurement: None }
    }

    /// Measures the noise if a measurement is due. `samples` is the minimum number of samples per pixel.
    pub(crate) fn measure_if_due(&mut self, film: &Film, samples: u32, done: f64, seconds: f64) {
        if samples < MIN_SAMPLES || Instant::now() < self.due {
            return;
        }
        self.last_measurement =
            film.noise_and_convergence().map(|noise| NoiseMeasurement { noise, done, seconds });
        self.due = Instant::now() + INTERVAL;
    }

    /// Returns the last measured noise and its predicted decrease. `rate` is the work done per second, and
    /// `left` is the number of seconds until the end. Returns `None` before the first measurement.
    pub(crate) fn noise_and_next_level(
        &self,
        work: WorkAmount,
        rate: Option<f64>,
        left: Option<f64>,
    ) -> Option<NoiseAndTimeToNextLevel> {
        let NoiseMeasurement { noise: NoiseAndConvergenceRate { relative_error, power }, done, seconds } =
            self.last_measurement?;
        // Returns the fraction of the noise that remains with `times` times as many samples.
        let fall = |times: f64| libm::pow(times, -0.5 * power);
        let by_now = if done > 0.0 { relative_error * fall(work.done / done) } else { relative_error };
        let next = rate
            .zip(left)
            .and_then(|(rate, left)| predict_next_noise_milestone(by_now, work, rate, power, left));
        Some(NoiseAndTimeToNextLevel { now: relative_error, seconds, next })
    }
}

/// Returns the next lower round noise level and the number of seconds until it is reached. Returns `None` if
/// the render ends before that.
fn predict_next_noise_milestone(
    by_now: f64,
    work: WorkAmount,
    rate: f64,
    power: f64,
    left: f64,
) -> Option<(f64, f64)> {
    let WorkAmount { done, aside: [aside, _], .. } = work;
    let level = round_down_to_1_2_5_series(by_now / MIN_LEVEL_RATIO);
    let more = done * (libm::pow(by_now / level, 2.0 / power) - 1.0);
    // Assume that other activities keep taking the same fraction of the time.
    let seconds = more / rate * (1.0 + aside * rate / done);
    (level > 0.0 && seconds <= left).then_some((level, seconds))
}

/// Returns the largest value in the series …, 1, 2, 5, 10, … % that does not exceed `most`.
fn round_down_to_1_2_5_series(most: f64) -> f64 {
    if !(most > 0.0) {
        return 0.0;
    }
    let decade = libm::pow(10.0, libm::floor(libm::log10(most)));
    [5.0, 2.0].into_iter().map(|times| times * decade).find(|level| *level <= most).unwrap_or(decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_round_numbers() {
        for (most, level) in [(0.02, 0.02), (0.0199, 0.01), (0.07, 0.05), (0.0049, 0.002), (3.0, 2.0)] {
            assert!(
                (round_down_to_1_2_5_series(most) / level - 1.0).abs() < 1e-9,
                "{most}: {}",
                round_down_to_1_2_5_series(most)
            );
        }
        assert_eq!(round_down_to_1_2_5_series(0.0), 0.0);
    }

    /// Noise of independent samples: 2.1 % after 100 units of work and 9 seconds.
    fn measured() -> NoiseTracker {
        let noise = NoiseAndConvergenceRate { relative_error: 0.021, power: 1.0 };
        NoiseTracker {
            due: Instant::now(),
            last_measurement: Some(NoiseMeasurement { noise, done: 100.0, seconds: 9.0 }),
        }
    }

    #[test]
    fn next_level_is_predicted_from_sample_count() {
        // Reaching 1 % takes 4.41 times as many samples. The rate is 10 units per second.
        let work = WorkAmount { done: 100.0, total: Some(10_000.0), aside: [0.0; 2] };
        let last_measurement = measured().noise_and_next_level(work, Some(10.0), Some(100.0)).expect("noise");
        let (level, seconds) = last_measurement.next.expect("a level");
        assert!((level - 0.01).abs() < 1e-12 && (seconds - 34.1).abs() < 1e-6, "{level} {seconds}");
        assert_eq!((last_measurement.now, last_measurement.seconds), (0.021, 9.0));
        // Half of the time is spent on other activities.
        let half = WorkAmount { aside: [10.0, 10.0], ..work };
        let (_, seconds) = measured()
            .noise_and_next_level(half, Some(10.0), Some(100.0))
            .expect("noise")
            .next
            .expect("a level");
        assert!((seconds - 68.2).abs() < 1e-6, "{seconds}");
    }

    #[test]
    fn prediction_accounts_for_work_since_measurement() {
        let work = WorkAmount { done: 400.0, total: Some(10_000.0), aside: [0.0; 2] };
        let last_measurement =
            measured().noise_and_next_level(work, Some(10.0), Some(1000.0)).expect("noise");
        assert_eq!(last_measurement.now, 0.021);
        // The expected current noise is 1.05 %, so reaching 0.5 % takes 4.41 times as many samples.
        let (level, seconds) = last_measurement.next.expect("a level");
        assert!((level - 0.005).abs() < 1e-12 && (seconds - 136.4).abs() < 1e-6, "{level} {seconds}");
    }

    #[test]
    fn no_level_is_predicted_after_render_end() {
        let work = WorkAmount { done: 100.0, total: Some(200.0), aside: [0.0; 2] };
        for left in [Some(10.0), Some(34.0), None] {
            assert_eq!(
                measured().noise_and_next_level(work, Some(10.0), left).expect("noise").next,
                None,
                "{left:?}"
            );
        }
        assert_eq!(measured().noise_and_next_level(work, None, Some(100.0)).expect("noise").next, None);
    }
}
