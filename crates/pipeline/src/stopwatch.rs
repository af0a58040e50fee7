//! Clocks that stop while work is paused.

use std::time::{Duration, Instant};

use crate::control::CancelToken;

/// A clock that excludes pauses. The caller tells it whether work is paused.
#[derive(Debug)]
pub(super) struct PausableClock {
    last: Instant,
    active: Duration,
}

impl PausableClock {
    pub(super) fn start() -> Self {
        Self { last: Instant::now(), active: Duration::ZERO }
    }

    /// Returns the seconds of active work. Includes the time since the last call unless work was paused
    /// (`held`).
    pub(super) fn update_active_seconds(&mut self, held: bool) -> f64 {
        let now = Instant::now();
        if !held {
            self.active += now - self.last;
        }
        self.last = now;
        self.active.as_secs_f64()
    }
}

/// Measures the seconds since the start, excluding pauses.
#[derive(Debug)]
pub(super) struct PausableStopwatch<'a> {
    begin: Instant,
    token: &'a CancelToken,
    held: Duration,
}

impl<'a> PausableStopwatch<'a> {
    pub(super) fn start(token: &'a CancelToken) -> Self {
        Self { begin: Instant::now(), token, held: token.paused_time() }
    }

    pub(super) fn seconds(&self) -> f64 {
        let held = self.token.paused_time().saturating_sub(self.held);
        self.begin.elapsed().saturating_sub(held).as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stopwatch_stops_while_work_is_paused() {
        const HOLD: Duration = Duration::from_millis(300);
        let (token, begin) = (CancelToken::new(), Instant::now());
        let watch = PausableStopwatch::start(&token);
        token.set_paused(true);
        std::thread::sleep(HOLD);
        // The pause must not be included, no matter how slow the machine is.
        let most = || begin.elapsed().saturating_sub(HOLD).as_secs_f64();
        let during = watch.seconds();
        assert!(during <= most(), "{during}");
        token.set_paused(false);
        let on = Instant::now();
        std::thread::sleep(Duration::from_millis(20));
        let (went, after) = (on.elapsed().as_secs_f64(), watch.seconds());
        assert!(went <= after && after <= most(), "{went} {after}");
    }
}
