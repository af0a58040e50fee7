//! Decoders do not poll the token. They work on a thread of their own, for which nobody waits once the token is
//! cancelled.

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::assets::read::Watch;
use crate::control::{CancelToken, Cancelled};

/// Time between two polls of the token.
const POLL: Duration = Duration::from_millis(2);

/// Most reports that wait to be received.
const WAITING: usize = 16;

/// Threads that nobody waits for any more and that have not ended.
static LEFT: Mutex<Vec<JoinHandle<()>>> = Mutex::new(Vec::new());

/// Reports the progress of the work.
#[derive(Clone)]
pub(super) struct Reporter(Option<SyncSender<u64>>);

impl Reporter {
    /// Reports the progress so far. Returns an error if nobody waits any more: then the work may end.
    pub(super) fn reached(&self, done: u64) -> io::Result<()> {
        match &self.0 {
            Some(receiver) => receiver.send(done).map_err(|_| io::Error::other(Cancelled)),
            None => Ok(()),
        }
    }
}

/// Does `work` on another thread and passes its reports on, out of `total`. `None` if the work panicked. Where no thread can be
/// started, the work is done here: without reports, and a cancel waits for its end.
///
/// Abandoned work holds memory: new work begins only when all of it has ended.
pub(super) fn run<T: Send + 'static>(
    watch: Watch<'_>,
    total: u64,
    work: impl FnOnce(Reporter) -> T + Send + 'static,
) -> Result<Option<T>, Cancelled> {
    wait_for_left(watch.token)?;
    let (report, reports) = mpsc::sync_channel(WAITING);
    let (send, result) = mpsc::channel();
    // A thread that does not start drops what it was given.
    let work = Arc::new(Mutex::new(Some(work)));
    let take = |work: &Mutex<Option<_>>| work.lock().unwrap_or_else(PoisonError::into_inner).take();
    let shared = Arc::clone(&work);
    let run = move || {
        if let Some(work) = take(&shared) {
            let _ = send.send(work(Reporter(Some(report))));
        }
    };
    let Ok(thread) = thread::Builder::new().name("glimt-image".to_owned()).spawn(run) else {
        return Ok(take(&work).map(|work| work(Reporter(None))));
    };
    let waited = wait(&reports, &result, watch, total);
    if waited.is_err() {
        left().push(thread);
    }
    waited
}

fn wait<T>(
    reports: &Receiver<u64>,
    result: &Receiver<T>,
    watch: Watch<'_>,
    total: u64,
) -> Result<Option<T>, Cancelled> {
    loop {
        match reports.recv_timeout(POLL) {
            Ok(done) => watch.tick(done as usize, total as usize)?,
            Err(RecvTimeoutError::Timeout) => watch.token.check()?,
            // The decoder has read everything.
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    loop {
        match result.recv_timeout(POLL) {
            Ok(value) => return Ok(Some(value)),
            Err(RecvTimeoutError::Timeout) => watch.token.check()?,
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
        }
    }
}

fn wait_for_left(token: &CancelToken) -> Result<(), Cancelled> {
    loop {
        token.check()?;
        let mut threads = left();
        threads.retain(|thread| !thread.is_finished());
        if threads.is_empty() {
            return Ok(());
        }
        drop(threads);
        thread::sleep(POLL);
    }
}

fn left() -> std::sync::MutexGuard<'static, Vec<JoinHandle<()>>> {
    LEFT.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::ignore_progress;

    #[test]
    fn a_cancel_does_not_wait_for_the_work_and_new_work_does() {
        let token = CancelToken::new();
        let (release, released) = mpsc::channel::<()>();
        let (said, ended) = mpsc::channel();
        let cancel = token.clone();
        let stuck = move |report: Reporter| {
            cancel.cancel();
            // The work is released only after the call has returned; 20 s let a wrong program fail.
            let in_time = released.recv_timeout(Duration::from_secs(20)).is_ok();
            let _ = said.send((in_time, report.reached(1).is_err()));
        };
        let watch = Watch { progress: &ignore_progress, token: &token };
        assert_eq!(run(watch, 1, stuck).err(), Some(Cancelled));
        release.send(()).expect("the work goes on");
        let fresh = CancelToken::new();
        let next = move |_| ended.try_recv();
        let ended =
            run(Watch { progress: &ignore_progress, token: &fresh }, 1, next).expect("nobody cancels");
        assert_eq!(ended, Some(Ok((true, true))));
    }

    #[test]
    fn reports_come_in_order_and_a_panic_is_no_result() {
        let token = CancelToken::new();
        let seen = Mutex::new(Vec::new());
        let note = |done, total| seen.lock().expect("no panic").push((done, total));
        let watch = Watch { progress: &note, token: &token };
        let work = |report: Reporter| (1..=3).map(|i| report.reached(i).is_ok()).collect::<Vec<_>>();
        assert_eq!(run(watch, 3, work), Ok(Some(vec![true; 3])));
        assert_eq!(*seen.lock().expect("no panic"), [(1, 3), (2, 3), (3, 3)]);
        let breaks = |_| crate::assets::contain::contain(|| panic!("broken"));
        assert_eq!(run::<Result<(), String>>(watch, 3, breaks), Ok(Some(Err("broken".to_owned()))));
    }
}
