//! Runs image decoders on a separate thread, because they do not poll the cancel token. If a call is
//! canceled, its thread is abandoned.

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::assets::read::Monitor;
use crate::control::{CancelToken, Canceled};
use crate::system::threads::spawn;

/// Polling interval for the cancel token.
const POLL: Duration = Duration::from_millis(2);

/// Maximum number of unread progress reports.
const QUEUE_LENGTH: usize = 16;

/// Abandoned threads that are still running.
static ABANDONED: Mutex<Vec<JoinHandle<()>>> = Mutex::new(Vec::new());

/// Reports a decoder's progress.
#[derive(Clone)]
pub(super) struct ProgressReporter(Option<SyncSender<u64>>);

impl ProgressReporter {
    /// Reports that `done` bytes were read. Returns an error if the call was canceled, so that the decoder
    /// can stop early.
    pub(super) fn report_bytes_read(&self, done: u64) -> io::Result<()> {
        match &self.0 {
            Some(receiver) => receiver.send(done).map_err(|_| io::Error::other(Canceled)),
            None => Ok(()),
        }
    }
}

/// Runs `work` on another thread and forwards its progress reports, which count up to `total`. Returns `None`
/// if `work` panics. If no thread can be started, runs `work` on the calling thread, without progress reports
/// or cancellation.
///
/// Abandoned work still uses memory, so new work starts only after all abandoned work has finished.
pub(super) fn run_on_thread<T: Send + 'static>(
    monitor: Monitor<'_>,
    total: u64,
    work: impl FnOnce(ProgressReporter) -> T + Send + 'static,
) -> Result<Option<T>, Canceled> {
    wait_for_abandoned_threads(monitor.token)?;
    let (report, reports) = mpsc::sync_channel(QUEUE_LENGTH);
    let (send, result) = mpsc::channel();
    // Keep a handle to the work in case the thread does not start.
    let work = Arc::new(Mutex::new(Some(work)));
    let take = |work: &Mutex<Option<_>>| work.lock().unwrap_or_else(PoisonError::into_inner).take();
    let shared = Arc::clone(&work);
    let run = move || {
        if let Some(work) = take(&shared) {
            let _ = send.send(work(ProgressReporter(Some(report))));
        }
    };
    let Ok(thread) = spawn("glimt-image", run) else {
        return Ok(take(&work).map(|work| work(ProgressReporter(None))));
    };
    let waited = wait_for_result(&reports, &result, monitor, total);
    if waited.is_err() {
        lock_abandoned_threads().push(thread);
    }
    waited
}

fn wait_for_result<T>(
    reports: &Receiver<u64>,
    result: &Receiver<T>,
    monitor: Monitor<'_>,
    total: u64,
) -> Result<Option<T>, Canceled> {
    loop {
        match reports.recv_timeout(POLL) {
            Ok(done) => monitor.report_and_check_cancel(done as usize, total as usize)?,
            Err(RecvTimeoutError::Timeout) => monitor.token.check_pause_and_cancel()?,
            // The decoder has dropped its reporter, so it has read everything.
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    loop {
        match result.recv_timeout(POLL) {
            Ok(value) => return Ok(Some(value)),
            Err(RecvTimeoutError::Timeout) => monitor.token.check_pause_and_cancel()?,
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
        }
    }
}

fn wait_for_abandoned_threads(token: &CancelToken) -> Result<(), Canceled> {
    loop {
        token.check_pause_and_cancel()?;
        let mut threads = lock_abandoned_threads();
        threads.retain(|thread| !thread.is_finished());
        if threads.is_empty() {
            return Ok(());
        }
        drop(threads);
        thread::sleep(POLL);
    }
}

fn lock_abandoned_threads() -> std::sync::MutexGuard<'static, Vec<JoinHandle<()>>> {
    ABANDONED.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::ignore_progress;

    #[test]
    fn new_work_waits_for_canceled_work() {
        let token = CancelToken::new();
        let (release, released) = mpsc::channel::<()>();
        let (send, ended) = mpsc::channel();
        let cancel = token.clone();
        let stuck = move |report: ProgressReporter| {
            cancel.cancel();
            // The test unblocks the work after the call has returned. If the call does not return, the wait
            // times out after 20 s.
            let in_time = released.recv_timeout(Duration::from_secs(20)).is_ok();
            let _ = send.send((in_time, report.report_bytes_read(1).is_err()));
        };
        let monitor = Monitor { progress: &ignore_progress, token: &token };
        assert_eq!(run_on_thread(monitor, 1, stuck).err(), Some(Canceled));
        release.send(()).expect("the work is still running");
        let fresh = CancelToken::new();
        let next = move |_| ended.try_recv();
        let ended = run_on_thread(Monitor { progress: &ignore_progress, token: &fresh }, 1, next)
            .expect("not canceled");
        assert_eq!(ended, Some(Ok((true, true))));
    }

    #[test]
    fn reports_are_in_order_and_panics_become_errors() {
        let token = CancelToken::new();
        let seen = Mutex::new(Vec::new());
        let note = |done, total| seen.lock().expect("no panic").push((done, total));
        let monitor = Monitor { progress: &note, token: &token };
        let work = |report: ProgressReporter| {
            (1..=3).map(|i| report.report_bytes_read(i).is_ok()).collect::<Vec<_>>()
        };
        assert_eq!(run_on_thread(monitor, 3, work), Ok(Some(vec![true; 3])));
        assert_eq!(*seen.lock().expect("no panic"), [(1, 3), (2, 3), (3, 3)]);
        let panics = |_| crate::assets::catch_panic::catch_panic(|| panic!("broken"));
        assert_eq!(
            run_on_thread::<Result<(), String>>(monitor, 3, panics),
            Ok(Some(Err("broken".to_owned())))
        );
    }
}
