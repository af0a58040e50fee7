//! Writes to the terminal on a separate thread so that a stalled terminal never blocks the event loop.

use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::sync::mpsc::Sender;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::unistd::ttyname;

use super::event::Event;
use crate::system::threads::spawn;

/// Slices to be written. There is a single queue because there is only one standard output.
static QUEUE: WriteQueue = WriteQueue {
    waiting: Mutex::new(PendingWrites { slices: VecDeque::new(), is_writing: false, is_given_up: false }),
    changed: Condvar::new(),
};

struct WriteQueue {
    waiting: Mutex<PendingWrites>,
    changed: Condvar,
}

struct PendingWrites {
    slices: VecDeque<Vec<u8>>,
    is_writing: bool,
    /// Whether to drop bytes that the terminal does not accept immediately.
    is_given_up: bool,
}

impl WriteQueue {
    fn lock(&self) -> MutexGuard<'_, PendingWrites> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the next slice and returns it.
    fn wait_and_pop_slice(&self) -> Vec<u8> {
        let mut waiting = self.lock();
        loop {
            if let Some(slice) = waiting.slices.pop_front() {
                waiting.is_writing = true;
                return slice;
            }
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn mark_write_finished(&self) {
        self.lock().is_writing = false;
        self.changed.notify_all();
    }
}

/// Starts the writer thread, which reports each written slice and ends after the first error.
///
/// # Errors
/// The thread or file descriptor could not be created.
pub(super) fn start_writer(events: &Sender<Event>) -> io::Result<()> {
    let events = events.clone();
    let mut out = open_terminal_output()?;
    let write = move || {
        loop {
            let slice = QUEUE.wait_and_pop_slice();
            let outcome = write_all_unless_canceled(&mut out, &slice, || QUEUE.lock().is_given_up);
            QUEUE.mark_write_finished();
            let event = match &outcome {
                Ok(()) => Event::Written { bytes: slice.len() },
                Err(error) => Event::Unwritable(error.kind()),
            };
            if events.send(event).is_err() || outcome.is_err() {
                return;
            }
        }
    };
    spawn("screen", write)?;
    Ok(())
}

/// Opens the terminal connected to standard output. This bypasses the buffer and lock of `stdout`, because a
/// stalled writer could hold the lock. The terminal is opened in nonblocking mode, which does not affect
/// other users of the terminal.
pub(super) fn open_terminal_output() -> io::Result<File> {
    let stdout = io::stdout();
    let terminal = ttyname(stdout.as_fd()).map_err(io::Error::from).and_then(|name| {
        let flags = OFlag::O_NONBLOCK | OFlag::O_NOCTTY;
        OpenOptions::new().write(true).custom_flags(flags.bits()).open(name)
    });
    // If the terminal has no name, standard output is used directly.
    terminal.or_else(|_| Ok(File::from(stdout.as_fd().try_clone_to_owned()?)))
}

/// Queues a slice for the writer thread.
pub(super) fn queue_slice(slice: Vec<u8>) {
    let mut waiting = QUEUE.lock();
    waiting.is_given_up = false;
    waiting.slices.push_back(slice);
    drop(waiting);
    QUEUE.changed.notify_all();
}

/// Drops queued slices and waits for the slice being written. If this takes longer than `patience`, also
/// drops the rest of that slice and returns false.
pub(super) fn discard_queued_and_wait(patience: Duration) -> bool {
    let mut waiting = QUEUE.lock();
    waiting.slices.clear();
    let wait = |waiting, patience| {
        let is_writing = |waiting: &mut PendingWrites| waiting.is_writing;
        let ended = QUEUE.changed.wait_timeout_while(waiting, patience, is_writing);
        ended.unwrap_or_else(PoisonError::into_inner).0
    };
    waiting = wait(waiting, patience);
    let is_whole = !waiting.is_writing;
    waiting.is_given_up = !is_whole;
    drop(wait(waiting, 2 * POLL_INTERVAL));
    is_whole
}

/// Poll interval while the terminal does not accept output.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Writes all bytes, but stops if `is_given_up` returns true.
pub(super) fn write_all_unless_canceled(
    out: &mut File,
    mut bytes: &[u8],
    is_given_up: impl Fn() -> bool,
) -> io::Result<()> {
    while !bytes.is_empty() {
        match out.write(bytes) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => bytes = &bytes[count..],
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                if is_given_up() {
                    return Ok(());
                }
                let mut ends = [PollFd::new(out.as_fd(), PollFlags::POLLOUT)];
                let look = PollTimeout::try_from(POLL_INTERVAL).unwrap_or(PollTimeout::ZERO);
                // Errors are reported by the next write.
                let _ = poll(&mut ends, look);
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
