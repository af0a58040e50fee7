//! A token to stop and pause long work, which polls it, and a sink for its progress.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Says that the work was stopped; nobody may use what it made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// A sink to which long work reports: work units done, work units in all.
pub type Progress<'a> = &'a (dyn Fn(u64, u64) + Sync);

/// A sink for work that nobody watches.
pub fn unwatched(_done: u64, _total: u64) {}

/// A flag shared by those who stop or pause work and those who do it. Workers poll [`CancelToken::check`] often
/// enough that work stops within 10 ms.
#[derive(Clone, Debug, Default)]
pub struct CancelToken(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    cancelled: AtomicBool,
    paused: AtomicBool,
    held: Mutex<Held>,
    changed: Condvar,
}

/// Time for which work was held before, and the start of the current hold.
#[derive(Debug, Default)]
struct Held {
    before: Duration,
    since: Option<Instant>,
}

impl CancelToken {
    /// A token that nobody has cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// Stop the work, for good.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Release);
        self.notify();
    }

    /// Hold the work at its next [`CancelToken::check`], or let it go on.
    pub fn set_paused(&self, paused: bool) {
        let mut held = self.lock();
        self.0.paused.store(paused, Ordering::Release);
        if paused {
            held.since.get_or_insert_with(Instant::now);
        } else if let Some(since) = held.since.take() {
            held.before += since.elapsed();
        }
        self.0.changed.notify_all();
    }

    /// Total time for which the work has been held.
    pub fn held(&self) -> Duration {
        let held = self.lock();
        held.before + held.since.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Whether the work is being held.
    pub fn is_paused(&self) -> bool {
        self.0.paused.load(Ordering::Acquire)
    }

    /// Whether [`CancelToken::cancel`] was called.
    pub fn is_cancelled(&self) -> bool {
        self.0.cancelled.load(Ordering::Acquire)
    }

    /// Go on, wait while paused, or stop.
    ///
    /// # Errors
    /// [`Cancelled`] once [`CancelToken::cancel`] was called.
    #[inline]
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_paused() {
            self.wait_while_paused();
        }
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }

    fn notify(&self) {
        let _guard = self.lock();
        self.0.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, Held> {
        self.0.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait_while_paused(&self) {
        let mut guard = self.lock();
        while self.is_paused() && !self.is_cancelled() {
            guard = self.0.changed.wait(guard).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cancelling_reaches_every_clone() {
        let token = CancelToken::new();
        let other = token.clone();
        assert_eq!(other.check(), Ok(()));
        token.cancel();
        assert_eq!(other.check(), Err(Cancelled));
    }

    #[test]
    fn the_time_for_which_work_is_held_is_known_while_it_is_and_after() {
        const HOLD: Duration = Duration::from_millis(20);
        let token = CancelToken::new();
        token.set_paused(false);
        assert_eq!(token.held(), Duration::ZERO);
        token.set_paused(true);
        std::thread::sleep(HOLD);
        token.set_paused(true);
        let during = token.held();
        token.set_paused(false);
        let after = token.held();
        std::thread::sleep(HOLD);
        assert!(HOLD <= during && during <= after);
        assert_eq!(token.held(), after, "it works again");
    }

    #[test]
    fn a_paused_worker_waits_and_a_cancel_frees_it() {
        let token = CancelToken::new();
        token.set_paused(true);
        let worker = {
            let token = token.clone();
            std::thread::spawn(move || token.check())
        };
        assert!(!worker.is_finished());
        token.cancel();
        assert_eq!(worker.join().expect("the worker does not panic"), Err(Cancelled));
    }
}
