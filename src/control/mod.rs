//! How long work is stopped, paused and watched: a token that is polled and a sink for progress.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};

/// The work was told to stop; nothing that it made may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cancelled")]
pub struct Cancelled;

/// Where long work reports: work units done, work units in all.
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
    lock: Mutex<()>,
    changed: Condvar,
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
        self.0.paused.store(paused, Ordering::Release);
        self.notify();
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
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_paused() {
            self.wait_while_paused();
        }
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }

    fn notify(&self) {
        let _guard = self.0.lock.lock().unwrap_or_else(PoisonError::into_inner);
        self.0.changed.notify_all();
    }

    fn wait_while_paused(&self) {
        let mut guard = self.0.lock.lock().unwrap_or_else(PoisonError::into_inner);
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
