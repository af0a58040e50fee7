//! Noise of the render now, and how fast it falls.

use std::time::{Duration, Instant};

use super::pace::Work;
use crate::film::{Film, PictureNoise};
use crate::pipeline::protocol::NoiseProgress;
use crate::pipeline::render::noise_goals::LEAST;

/// Shortest time between two measurements, and before the first: each is a sum over all pixels.
const INTERVAL: Duration = Duration::from_millis(500);
/// Least ratio of the noise to the next level reported.
const STEP: f64 = 1.5;

/// The last measurement of noise.
#[derive(Debug)]
pub(in crate::pipeline) struct NoiseForecast {
    due: Instant,
    /// And the work that was done.
    told: Option<(PictureNoise, f64)>,
}

impl NoiseForecast {
    pub(in crate::pipeline) fn new() -> Self {
        Self { due: Instant::now() + INTERVAL, told: None }
    }

    /// Measures again, if it is time: every pixel has at least `samples`, a power of two.
    pub(in crate::pipeline) fn look(&mut self, film: &Film, samples: u32, done: f64) {
        if samples < LEAST || Instant::now() < self.due {
            return;
        }
        self.told = film.noise().map(|noise| (noise, done));
        self.due = Instant::now() + INTERVAL;
    }

    /// Expected noise, once it has been measured.
    pub(in crate::pipeline) fn at(&self, work: Work, rate: Option<f64>) -> Option<NoiseProgress> {
        let (PictureNoise { relative_error, power }, done) = self.told.filter(|(_, done)| *done > 0.0)?;
        // The part of the noise that so many times the samples leave.
        let fall = |times: f64| libm::pow(times, -0.5 * power);
        Some(expected(relative_error * fall(work.done / done), work, rate, fall))
    }
}

/// The noise now; the next round level below it, or the noise at the end of the render if that is higher; and the seconds until
/// then, at `rate` of work a second.
fn expected(now: f64, work: Work, rate: Option<f64>, fall: impl Fn(f64) -> f64) -> NoiseProgress {
    let Work { done, total, aside: [aside, _] } = work;
    let total = total.unwrap_or(f64::INFINITY).max(done);
    let to_go = total - done;
    let end = now * fall(total / done.max(f64::MIN_POSITIVE));
    let level = level_below(now / STEP).max(end);
    let next = rate.filter(|rate| to_go > 0.0 && now > 0.0 && *rate > 0.0).map(|rate| {
        // The power by which the noise falls, from twice the samples.
        let power = -libm::log2(fall(2.0));
        let more = done * (libm::pow(now / level, 1.0 / power) - 1.0);
        // What goes on aside takes its part of the time from here on too.
        let seconds_of_done = done / rate;
        (level, more.min(to_go) / rate * (1.0 + aside / seconds_of_done))
    });
    NoiseProgress { now, next }
}

/// The largest of 1, 2, 5, 10, … %, up and down, that is not above a number.
fn level_below(most: f64) -> f64 {
    if !(most > 0.0) {
        return 0.0;
    }
    let decade = libm::pow(10.0, libm::floor(libm::log10(most)));
    [5.0, 2.0].into_iter().map(|times| times * decade).find(|level| *level <= most).unwrap_or(decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Independent samples.
    fn root(times: f64) -> f64 {
        1.0 / times.sqrt()
    }

    #[test]
    fn levels_are_round_and_well_below() {
        for (most, level) in [(0.02, 0.02), (0.0199, 0.01), (0.07, 0.05), (0.0049, 0.002), (3.0, 2.0)] {
            assert!((level_below(most) / level - 1.0).abs() < 1e-9, "{most}: {}", level_below(most));
        }
        assert_eq!(level_below(0.0), 0.0);
    }

    #[test]
    fn the_next_level_comes_when_so_many_samples_are_done() {
        // 2.1 % after 100 of 10,000 units, 10 a second: 1 % takes 4.41 times as many.
        let work = Work { done: 100.0, total: Some(10_000.0), aside: [0.0; 2] };
        let (level, seconds) = expected(0.021, work, Some(10.0), root).next.expect("a level");
        assert!((level - 0.01).abs() < 1e-12 && (seconds - 34.1).abs() < 1e-6, "{level} {seconds}");
    }

    #[test]
    fn a_render_that_ends_first_says_what_is_left_then() {
        let work = Work { done: 100.0, total: Some(200.0), aside: [0.0; 2] };
        let (level, seconds) = expected(0.021, work, Some(10.0), root).next.expect("a level");
        assert!((level - 0.021 / 2.0_f64.sqrt()).abs() < 1e-12 && (seconds - 10.0).abs() < 1e-6);
        let over = Work { done: 200.0, ..work };
        assert_eq!(expected(0.021, over, Some(10.0), root), NoiseProgress { now: 0.021, next: None });
        assert_eq!(expected(0.021, work, None, root).next, None);
        // As much time goes by aside as at work.
        let half = Work { aside: [10.0, 10.0], ..work };
        assert_eq!(expected(0.021, half, Some(10.0), root).next.map(|(_, seconds)| seconds), Some(20.0));
    }
}
