//! Terminal input: keys, pasted text and replies.
//!
//! A single thread polls the terminal and reads whatever is available, so it never blocks waiting for the
//! rest of a sequence. [`Decoder`] converts bytes to [`DecodedInput`] and is the only code that depends on
//! key encodings.

mod control_strings;
mod decoded;
mod decoder;
mod keys;
mod paste;

use std::io;
use std::os::fd::AsFd;
use std::sync::mpsc::Sender;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Instant;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

pub(super) use self::decoded::DecodedInput;
pub(super) use self::decoder::Decoder;
use super::event::{Event, RequiredEventSource};
use crate::system::threads::spawn;

/// Starts a thread that reads standard input. At end-of-file, the thread reports that
/// [`RequiredEventSource::Keys`] was lost.
///
/// # Errors
/// The thread could not be created.
pub(super) fn start_reader(events: &Sender<Event>) -> io::Result<()> {
    let events = events.clone();
    let read = move || {
        let mut decoder = Decoder::default();
        while let Some(inputs) = read_next_input_batch(&mut decoder) {
            for input in inputs {
                if events.send(input.into()).is_err() {
                    return;
                }
            }
        }
        let _ = events.send(Event::SourceEnded(RequiredEventSource::Keys));
    };
    spawn("keys", read)?;
    Ok(())
}

/// Whether another program is currently reading the input.
static HELD: (Mutex<bool>, Condvar) = (Mutex::new(false), Condvar::new());

/// Lets another program read the input, or resumes reading it.
pub(super) fn set_input_paused(is_held: bool) {
    *HELD.0.lock().unwrap_or_else(PoisonError::into_inner) = is_held;
    HELD.1.notify_all();
}

/// Waits while another program is reading the input. Returns true if it had to wait.
fn wait_while_input_paused() -> bool {
    let held = HELD.0.lock().unwrap_or_else(PoisonError::into_inner);
    let was_held = *held;
    drop(HELD.1.wait_while(held, |held| *held));
    was_held
}

/// Reads and decodes input. Returns an empty list after a timeout, or `None` if the terminal was closed.
fn read_next_input_batch(decoder: &mut Decoder) -> Option<Vec<DecodedInput>> {
    let mut bytes = [0; 4096];
    let waited = wait_for_input(decoder.deadline());
    if wait_while_input_paused() {
        return Some(Vec::new());
    }
    match waited.and_then(|is_readable| if is_readable { read_stdin(&mut bytes) } else { Ok(None) }) {
        Ok(Some(0)) => None,
        Ok(Some(count)) => Some(decoder.decode(&bytes[..count], Instant::now())),
        Ok(None) | Err(Errno::EINTR | Errno::EAGAIN) => Some(decoder.expire(Instant::now())),
        Err(_) => None,
    }
}

fn read_stdin(bytes: &mut [u8]) -> nix::Result<Option<usize>> {
    nix::unistd::read(io::stdin().as_fd(), bytes).map(Some)
}

/// Waits for input until the deadline, or indefinitely if there is none. Returns whether input or end-of-file
/// is available.
fn wait_for_input(deadline: Option<Instant>) -> nix::Result<bool> {
    let stdin = io::stdin();
    let mut ends = [PollFd::new(stdin.as_fd(), PollFlags::POLLIN)];
    let timeout = deadline.map_or(PollTimeout::NONE, |deadline| {
        let rest = deadline.saturating_duration_since(Instant::now()).as_micros().div_ceil(1000);
        PollTimeout::try_from(rest).unwrap_or(PollTimeout::MAX)
    });
    poll(&mut ends, timeout).map(|count| count > 0)
}
