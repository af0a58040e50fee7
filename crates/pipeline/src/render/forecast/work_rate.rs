//! Estimates the work rate and the remaining time of a render.

/// Time constant for averaging the rate, in seconds.
const MEMORY_SECONDS: f64 = 3.0;
/// Minimum time between two measurements of the rate.
const MIN_INTERVAL: f64 = 0.05;

/// Exponentially decaying average of the work rate.
#[derive(Clone, Debug)]
pub(crate) struct WorkRate {
    fraction: f64,
    rate: Option<f64>,
    measured: (f64, f64),
}

/// Amount of work, and time spent on other activities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WorkAmount {
    pub(crate) done: f64,
    /// Total work, or `None` if unknown.
    pub(crate) total: Option<f64>,
    /// Seconds spent on other activities so far, and seconds expected to be spent on them in the future.
    pub(crate) aside: [f64; 2],
}

impl WorkRate {
    /// Creates a rate. `done` is the work completed before the clock started.
    pub(crate) fn new(done: f64) -> Self {
        Self { fraction: 0.0, rate: None, measured: (0.0, done) }
    }

    /// Work per second, or `None` until it has been measured.
    pub(crate) fn rate(&self) -> Option<f64> {
        self.rate
    }

    /// Returns the completed fraction, which never decreases, and the remaining seconds if the rate is known.
    pub(crate) fn update_fraction_and_time_left(
        &mut self,
        seconds: f64,
        work: WorkAmount,
    ) -> (f64, Option<f64>) {
        let WorkAmount { done, total, aside: [aside, aside_to_come] } = work;
        let seconds = seconds - aside;
        let (since, before) = self.measured;
        let span = seconds - since;
        if span >= MIN_INTERVAL && done > before {
            let rate = (done - before) / span;
            let weight = 1.0 - (-span / MEMORY_SECONDS).exp();
            // Give recent work more weight at the beginning, because the first passes are slower.
            let weight = weight.max(2.0 * span / seconds).min(1.0);
            self.rate = Some(self.rate.map_or(rate, |old| old + weight * (rate - old)));
            self.measured = (seconds, done);
        }
        let Some(total) = total else { return (self.fraction, None) };
        // Count time spent on other activities as work.
        let rate = self.rate.unwrap_or(0.0);
        let all = total + rate * (aside + aside_to_come);
        let fraction = if all > 0.0 { (done + rate * aside) / all } else { 0.0 };
        self.fraction = self.fraction.max(fraction.min(1.0));
        (self.fraction, self.rate.map(|rate| (total - done).max(0.0) / rate + aside_to_come))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates work without other activities.
    fn of(done: f64, total: f64) -> WorkAmount {
        WorkAmount { done, total: Some(total), aside: [0.0; 2] }
    }

    #[test]
    fn eta_includes_time_for_other_activities() {
        // Two seconds are spent on other activities and one second on the first 100 of 400 units of work.
        let mut pace = WorkRate::new(0.0);
        let work = WorkAmount { done: 100.0, total: Some(400.0), aside: [2.0, 6.0] };
        let (fraction, eta) = pace.update_fraction_and_time_left(3.0, work);
        assert_eq!((fraction, eta), (0.25, Some(9.0)));
    }

    #[test]
    fn unknown_total_has_no_eta() {
        let mut pace = WorkRate::new(0.0);
        assert_eq!(
            pace.update_fraction_and_time_left(1.0, WorkAmount { total: None, ..of(100.0, 0.0) }),
            (0.0, None)
        );
        assert_eq!(pace.update_fraction_and_time_left(2.0, of(200.0, 400.0)), (0.5, Some(2.0)));
    }

    #[test]
    fn steady_work_is_predicted_exactly() {
        let mut pace = WorkRate::new(0.0);
        assert_eq!(pace.update_fraction_and_time_left(0.0, of(0.0, 1000.0)), (0.0, None));
        for step in 1..10_u32 {
            let (fraction, eta) =
                pace.update_fraction_and_time_left(f64::from(step), of(f64::from(step) * 100.0, 1000.0));
            assert!((fraction - f64::from(step) / 10.0).abs() < 1e-12);
            assert!((eta.expect("the rate should be known") - f64::from(10 - step)).abs() < 1e-9);
        }
        assert_eq!(pace.update_fraction_and_time_left(10.0, of(1000.0, 1000.0)), (1.0, Some(0.0)));
    }

    #[test]
    fn fraction_is_monotonic_and_eta_ignores_old_work() {
        let mut pace = WorkRate::new(500.0);
        let (fraction, eta) = pace.update_fraction_and_time_left(1.0, of(600.0, 1000.0));
        assert_eq!(fraction, 0.6);
        assert!((eta.expect("a rate") - 4.0).abs() < 1e-9);
        assert_eq!(pace.update_fraction_and_time_left(2.0, of(550.0, 1000.0)).0, 0.6);
    }

    #[test]
    fn rate_adapts_to_speed_changes() {
        let mut pace = WorkRate::new(0.0);
        for step in 1..=100_u32 {
            pace.update_fraction_and_time_left(f64::from(step) * 0.1, of(f64::from(step) * 100.0, 100_000.0));
        }
        let mut eta = None;
        for step in 1..=100_u32 {
            let done = 10_000.0 + f64::from(step) * 10.0;
            eta = pace.update_fraction_and_time_left(10.0 + f64::from(step) * 0.1, of(done, 100_000.0)).1;
        }
        let truth = (100_000.0 - 11_000.0) / 100.0;
        assert!((eta.expect("a rate") / truth - 1.0).abs() < 0.35, "{eta:?} against {truth}");
    }
}
