//! Input from the terminal: keys, pasted text, and the terminal's answers.
//!
//! One thread polls the terminal and reads whatever is there, so that nothing waits for the next byte. [`Decoder`]
//! turns bytes into [`DecodedInput`], and is the one place that knows how keys are encoded.

mod control_strings;
mod decoded;
mod decoder;
mod keys;
mod paste;

use std::io;
use std::os::fd::AsFd;
use std::sync::mpsc::Sender;
use std::sync::{Condvar, Mutex, PoisonError};
use std::thread;
use std::time::Instant;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

pub(super) use self::decoded::DecodedInput;
pub(super) use self::decoder::Decoder;
use super::event::{Event, EventSource};

/// Reads standard input, on a thread of its own, until it ends: then [`EventSource::Keys`] is lost.
///
/// # Errors
/// The system has no thread left.
pub(super) fn start(events: &Sender<Event>) -> io::Result<()> {
    let events = events.clone();
    let read = move || {
        let mut decoder = Decoder::default();
        while let Some(inputs) = next(&mut decoder) {
            for input in inputs {
                if events.send(input.into()).is_err() {
                    return;
                }
            }
        }
        let _ = events.send(Event::Lost(EventSource::Keys));
    };
    thread::Builder::new().name("keys".to_owned()).spawn(read)?;
    Ok(())
}

/// Whether what is typed is for another program.
static HELD: (Mutex<bool>, Condvar) = (Mutex::new(false), Condvar::new());

/// Leaves what is typed from now on to another program, or takes it again.
pub(super) fn hold(is_held: bool) {
    *HELD.0.lock().unwrap_or_else(PoisonError::into_inner) = is_held;
    HELD.1.notify_all();
}

/// Waits for as long as what is typed is another program's; whether it was.
fn was_held() -> bool {
    let held = HELD.0.lock().unwrap_or_else(PoisonError::into_inner);
    let was_held = *held;
    drop(HELD.1.wait_while(held, |held| *held));
    was_held
}

/// Input of the next bytes; empty if there are none while the decoder waits. `None` if the terminal is gone.
fn next(decoder: &mut Decoder) -> Option<Vec<DecodedInput>> {
    let mut bytes = [0; 4096];
    let waited = wait(decoder.deadline());
    if was_held() {
        return Some(Vec::new());
    }
    match waited.and_then(|is_readable| if is_readable { read(&mut bytes) } else { Ok(None) }) {
        Ok(Some(0)) => None,
        Ok(Some(count)) => Some(decoder.decode(&bytes[..count], Instant::now())),
        Ok(None) | Err(Errno::EINTR | Errno::EAGAIN) => Some(decoder.expire(Instant::now())),
        Err(_) => None,
    }
}

fn read(bytes: &mut [u8]) -> nix::Result<Option<usize>> {
    nix::unistd::read(io::stdin().as_fd(), bytes).map(Some)
}

/// Waits for bytes, until the deadline if there is one; whether there are any, or the end.
fn wait(deadline: Option<Instant>) -> nix::Result<bool> {
    let stdin = io::stdin();
    let mut ends = [PollFd::new(stdin.as_fd(), PollFlags::POLLIN)];
    let timeout = deadline.map_or(PollTimeout::NONE, |deadline| {
        let rest = deadline.saturating_duration_since(Instant::now()).as_micros().div_ceil(1000);
        PollTimeout::try_from(rest).unwrap_or(PollTimeout::MAX)
    });
    poll(&mut ends, timeout).map(|count| count > 0)
}
