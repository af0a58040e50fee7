//! Cancellation, pausing and progress reporting for long-running work.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Error returned by canceled work. Its partial results must not be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("canceled")]
pub struct Canceled;

/// Progress callback. Receives the number of finished work units and the total number.
pub type Progress<'a> = &'a (dyn Fn(u64, u64) + Sync);

/// Progress callback that ignores all reports.
pub fn ignore_progress(_done: u64, _total: u64) {}

/// Shared flag that cancels or pauses work. Workers poll [`CancelToken::check_pause_and_cancel`] often enough
/// to stop within 10 ms.
#[derive(Clone, Debug, Default)]
pub struct CancelToken(Arc<TokenState>);

#[derive(Debug, Default)]
struct TokenState {
    canceled: AtomicBool,
    paused: AtomicBool,
    held: Mutex<PauseTime>,
    changed: Condvar,
}

/// Total duration of past pauses, and the start time of the current pause.
#[derive(Debug, Default)]
struct PauseTime {
    before: Duration,
    since: Option<Instant>,
}

impl CancelToken {
    /// Creates a token that is neither canceled nor paused.
    pub fn new() -> Self {
        Self::default()
    }

    /// Cancels the work permanently.
    pub fn cancel(&self) {
        self.0.canceled.store(true, Ordering::Release);
        self.notify();
    }

    /// Pauses the work at its next [`CancelToken::check_pause_and_cancel`], or resumes it.
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

    /// Total time the work has been paused.
    pub fn paused_time(&self) -> Duration {
        let held = self.lock();
        held.before + held.since.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Whether the work is paused.
    pub fn is_paused(&self) -> bool {
        self.0.paused.load(Ordering::Acquire)
    }

    /// Whether [`CancelToken::cancel`] was called.
    pub fn is_canceled(&self) -> bool {
        self.0.canceled.load(Ordering::Acquire)
    }

    /// Blocks while the work is paused, and reports cancellation.
    ///
    /// # Errors
    /// [`Canceled`] if [`CancelToken::cancel`] was called.
    #[inline]
    pub fn check_pause_and_cancel(&self) -> Result<(), Canceled> {
        if self.is_paused() {
            self.wait_while_paused();
        }
        if self.is_canceled() { Err(Canceled) } else { Ok(()) }
    }

    fn notify(&self) {
        let _guard = self.lock();
        self.0.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, PauseTime> {
        self.0.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait_while_paused(&self) {
        let mut guard = self.lock();
        while self.is_paused() && !self.is_canceled() {
            guard = self.0.changed.wait(guard).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cancel_affects_all_clones() {
        let token = CancelToken::new();
        let other = token.clone();
        assert_eq!(other.check_pause_and_cancel(), Ok(()));
        token.cancel();
        assert_eq!(other.check_pause_and_cancel(), Err(Canceled));
    }

    #[test]
    fn paused_time_includes_current_and_past_pauses() {
        const HOLD: Duration = Duration::from_millis(20);
        let token = CancelToken::new();
        token.set_paused(false);
        assert_eq!(token.paused_time(), Duration::ZERO);
        token.set_paused(true);
        std::thread::sleep(HOLD);
        token.set_paused(true);
        let during = token.paused_time();
        token.set_paused(false);
        let after = token.paused_time();
        std::thread::sleep(HOLD);
        assert!(HOLD <= during && during <= after);
        assert_eq!(token.paused_time(), after, "the work should have resumed");
    }

    #[test]
    fn cancel_releases_a_paused_worker() {
        let token = CancelToken::new();
        token.set_paused(true);
        let worker = {
            let token = token.clone();
            std::thread::spawn(move || token.check_pause_and_cancel())
        };
        assert!(!worker.is_finished());
        token.cancel();
        assert_eq!(worker.join().expect("the worker should not panic"), Err(Canceled));
    }
}
