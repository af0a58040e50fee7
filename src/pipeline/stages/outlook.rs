//! How much noise is left while a render goes on, and how fast it falls.

use std::time::{Duration, Instant};

use super::super::protocol::NoiseProgress;
use super::adaptive::LEAST;
use crate::film::Film;

/// Before that nobody reads it, and afterwards it is told as seldom: it is the sum of all pixels.
const INTERVAL: Duration = Duration::from_millis(500);
/// A level is told that the noise is this many times above.
const STEP: f64 = 1.5;

/// The noise as it was told last.
#[derive(Debug)]
pub(super) struct Outlook {
    due: Instant,
    /// And pixels times samples that there were.
    told: Option<(f64, u64)>,
}

/// Where a render is: pixels times samples done and to do in all, and those a second.
#[derive(Clone, Copy, Debug)]
pub(super) struct Work {
    pub(super) done: u64,
    pub(super) total: u64,
    pub(super) rate: Option<f64>,
}

impl Outlook {
    pub(super) fn new() -> Self {
        Self { due: Instant::now() + INTERVAL, told: None }
    }

    /// Look again, where it is time: pixels have `samples` at least, a power of two of them.
    pub(super) fn look(&mut self, film: &Film, samples: u32, done: u64) {
        if samples < LEAST || Instant::now() < self.due {
            return;
        }
        self.told = film.relative_error().map(|noise| (noise, done));
        self.due = Instant::now() + INTERVAL;
    }

    /// What is to be expected, where something was told.
    pub(super) fn at(&self, film: &Film, work: Work) -> Option<NoiseProgress> {
        let (noise, done) = self.told?;
        Some(expected(noise * fall(film, work.done as f64 / done as f64), work, |part| fall(film, part)))
    }
}

/// The part of the noise that so many times the samples leave.
fn fall(film: &Film, times: f64) -> f64 {
    libm::pow(times, -0.5 * film.convergence().power())
}

/// The noise now, the next round level below it, or what it will be in the end where that comes first, and when.
fn expected(now: f64, work: Work, fall: impl Fn(f64) -> f64) -> NoiseProgress {
    let Work { done, total, rate } = work;
    let to_go = total.saturating_sub(done) as f64;
    let end = now * fall(total.max(done) as f64 / done.max(1) as f64);
    let level = level_below(now / STEP).max(end);
    let next = rate.filter(|_| to_go > 0.0 && now > 0.0).map(|rate| {
        // The power by which the noise falls, from twice the samples.
        let power = -libm::log2(fall(2.0));
        let units = done as f64 * (libm::pow(now / level, 1.0 / power) - 1.0);
        (level, units.min(to_go) / rate)
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
        let work = Work { done: 100, total: 10_000, rate: Some(10.0) };
        let (level, seconds) = expected(0.021, work, root).next.expect("a level");
        assert!((level - 0.01).abs() < 1e-12 && (seconds - 34.1).abs() < 1e-6, "{level} {seconds}");
    }

    #[test]
    fn a_render_that_ends_first_says_what_is_left_then() {
        let work = Work { done: 100, total: 200, rate: Some(10.0) };
        let (level, seconds) = expected(0.021, work, root).next.expect("a level");
        assert!((level - 0.021 / 2.0_f64.sqrt()).abs() < 1e-12 && (seconds - 10.0).abs() < 1e-6);
        let over = Work { done: 200, total: 200, rate: Some(10.0) };
        assert_eq!(expected(0.021, over, root), NoiseProgress { now: 0.021, next: None });
        let unknown = Work { rate: None, ..work };
        assert_eq!(expected(0.021, unknown, root).next, None);
    }
}
