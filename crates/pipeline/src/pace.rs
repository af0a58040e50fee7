//! Clocks that stand still while work is paused.

use std::time::{Duration, Instant};

use crate::control::CancelToken;

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

/// Seconds since it was started, without those in which work was held.
#[derive(Debug)]
pub(super) struct Stopwatch<'a> {
    begin: Instant,
    token: &'a CancelToken,
    held: Duration,
}

impl<'a> Stopwatch<'a> {
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
    fn a_stopwatch_stands_while_work_is_held() {
        const HOLD: Duration = Duration::from_millis(300);
        let (token, begin) = (CancelToken::new(), Instant::now());
        let watch = Stopwatch::start(&token);
        token.set_paused(true);
        std::thread::sleep(HOLD);
        // Of all the time that went by, what was held is not in it, however slow the machine is.
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
