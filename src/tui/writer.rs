//! Bytes on their way to the terminal, written by a thread of their own: a terminal that takes nothing holds up that
//! thread, never the loop.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::sync::mpsc::Sender;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use super::event::Event;

/// What waits to be written. There is one standard output, and one of these.
static QUEUE: Queue = Queue {
    waiting: Mutex::new(Waiting { slices: VecDeque::new(), is_writing: false }),
    changed: Condvar::new(),
};

struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

struct Waiting {
    slices: VecDeque<Vec<u8>>,
    is_writing: bool,
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next slice.
    fn take(&self) -> Vec<u8> {
        let mut waiting = self.lock();
        loop {
            if let Some(slice) = waiting.slices.pop_front() {
                waiting.is_writing = true;
                return slice;
            }
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn done(&self) {
        self.lock().is_writing = false;
        self.changed.notify_all();
    }
}

/// Starts the thread. It says of every slice that it was written, or that this is not possible, which ends it.
///
/// # Errors
/// The system has no thread or no descriptor left.
pub(super) fn start(events: &Sender<Event>) -> io::Result<()> {
    let events = events.clone();
    let mut out = output()?;
    let write = move || {
        loop {
            let slice = QUEUE.take();
            let outcome = write_all(&mut out, &slice);
            QUEUE.done();
            let event = match &outcome {
                Ok(()) => Event::Written { bytes: slice.len() },
                Err(error) => Event::Unwritable(error.kind()),
            };
            if events.send(event).is_err() || outcome.is_err() {
                return;
            }
        }
    };
    thread::Builder::new().name("screen".to_owned()).spawn(write)?;
    Ok(())
}

/// Standard output without a buffer and without a lock that a stuck writer could hold.
pub(super) fn output() -> io::Result<File> {
    Ok(File::from(io::stdout().as_fd().try_clone_to_owned()?))
}

/// One slice more to write.
pub(super) fn send(slice: Vec<u8>) {
    QUEUE.lock().slices.push_back(slice);
    QUEUE.changed.notify_all();
}

/// Drops what has not been begun and waits for what has; false: it is still under way after this time.
pub(super) fn discard(patience: Duration) -> bool {
    let mut waiting = QUEUE.lock();
    waiting.slices.clear();
    let (waiting, _) = QUEUE
        .changed
        .wait_timeout_while(waiting, patience, |waiting| waiting.is_writing)
        .unwrap_or_else(PoisonError::into_inner);
    !waiting.is_writing
}

/// Writes all, also where somebody left the terminal in a mode that does not wait.
pub(super) fn write_all(out: &mut File, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match out.write(bytes) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => bytes = &bytes[count..],
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                let mut ends = [PollFd::new(out.as_fd(), PollFlags::POLLOUT)];
                // An error here shows itself again in the next write.
                let _ = poll(&mut ends, PollTimeout::from(100_u8));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
