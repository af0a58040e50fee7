//! How long work has gone on, and how long it will still take.

use std::time::{Duration, Instant};

/// Seconds over which the rate is averaged.
const MEMORY_SECONDS: f64 = 3.0;
/// Shortest time between two measurements of the rate.
const SHORTEST_SECONDS: f64 = 0.05;

/// A clock that stands still while work is held.
#[derive(Debug)]
pub(super) struct Clock {
    last: Instant,
    active: Duration,
}

impl Clock {
    pub(super) fn start() -> Self {
        Self { last: Instant::now(), active: Duration::ZERO }
    }

    /// Seconds at work until now; the time since the last call counts unless work was held.
    pub(super) fn seconds(&mut self, held: bool) -> f64 {
        let now = Instant::now();
        if !held {
            self.active += now - self.last;
        }
        self.last = now;
        self.active.as_secs_f64()
    }
}

/// Work done against time, with a rate that forgets slowly.
#[derive(Clone, Debug)]
pub(super) struct Pace {
    total: u64,
    fraction: f64,
    rate: Option<f64>,
    measured: (f64, u64),
}

impl Pace {
    /// Of `total` units, `done` were there before the clock started.
    pub(super) fn new(done: u64, total: u64) -> Self {
        Self { total, fraction: 0.0, rate: None, measured: (0.0, done) }
    }

    /// There is as much to do in all.
    pub(super) fn expect(&mut self, total: u64) {
        self.total = total;
    }

    /// Units a second, once they can be told.
    pub(super) fn rate(&self) -> Option<f64> {
        self.rate
    }

    /// The fraction done, never falling, and the seconds to go once they can be told.
    pub(super) fn at(&mut self, seconds: f64, done: u64) -> (f64, Option<f64>) {
        let (since, before) = self.measured;
        let span = seconds - since;
        if span >= SHORTEST_SECONDS && done > before {
            let rate = (done - before) as f64 / span;
            let weight = 1.0 - (-span / MEMORY_SECONDS).exp();
            // Early on every measurement counts alike: the mean of what there is.
            let weight = weight.max(span / seconds);
            self.rate = Some(self.rate.map_or(rate, |old| old + weight * (rate - old)));
            self.measured = (seconds, done);
        }
        self.fraction = self.fraction.max((done as f64 / self.total.max(1) as f64).min(1.0));
        let to_go = self.total.saturating_sub(done) as f64;
        (self.fraction, self.rate.map(|rate| to_go / rate))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steady_work_is_foretold_exactly() {
        let mut pace = Pace::new(0, 1000);
        assert_eq!(pace.at(0.0, 0), (0.0, None));
        for step in 1..10_u32 {
            let (fraction, eta) = pace.at(f64::from(step), u64::from(step) * 100);
            assert!((fraction - f64::from(step) / 10.0).abs() < 1e-12);
            assert!((eta.expect("a rate is known") - f64::from(10 - step)).abs() < 1e-9);
        }
        assert_eq!(pace.at(10.0, 1000), (1.0, Some(0.0)));
    }

    #[test]
    fn the_fraction_never_falls_and_work_from_before_is_no_speed() {
        let mut pace = Pace::new(500, 1000);
        let (fraction, eta) = pace.at(1.0, 600);
        assert_eq!(fraction, 0.6);
        assert!((eta.expect("a rate") - 4.0).abs() < 1e-9);
        assert_eq!(pace.at(2.0, 550).0, 0.6);
    }

    #[test]
    fn a_change_of_speed_is_learnt() {
        let mut pace = Pace::new(0, 100_000);
        for step in 1..=100_u64 {
            pace.at(step as f64 * 0.1, step * 100);
        }
        let mut eta = None;
        for step in 1..=100_u64 {
            eta = pace.at(10.0 + step as f64 * 0.1, 10_000 + step * 10).1;
        }
        let truth = (100_000.0 - 11_000.0) / 100.0;
        assert!((eta.expect("a rate") / truth - 1.0).abs() < 0.35, "{eta:?} against {truth}");
    }
}
