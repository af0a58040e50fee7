//! Threads that the system does not start.

use std::fmt::Display;
use std::io::Error;

use nix::sys::resource::{Resource, getrlimit};

use super::in_words;

/// Bytes of address space that a thread's stack takes, the default of the standard library.
const STACK_BYTES: u64 = 2 << 20;

/// Fails if the stacks of so many threads are more than the process may have. Asked before the first one starts: the standard
/// library ends the process if a thread that has started finds no room for its signal stack.
///
/// # Errors
/// The system's error for a thread that does not start.
pub fn check_room(threads: usize) -> Result<(), Error> {
    let Ok((limit, _)) = getrlimit(Resource::RLIMIT_AS) else { return Ok(()) };
    if (threads as u64).saturating_mul(STACK_BYTES) > limit {
        return Err(Error::from_raw_os_error(nix::libc::EAGAIN));
    }
    Ok(())
}

/// Says why `what` could not be started, and the way out: a limit on memory (for stacks) or on the number of threads refuses it.
pub fn not_started(what: &str, is_number_chosen: bool, error: &impl Display) -> String {
    let why = in_words(&Error::other(error.to_string()));
    let fewer = if is_number_chosen { "use fewer (--threads 1), or " } else { "" };
    format!(
        "cannot start {what}: {why}; {fewer}raise the limits on memory and on processes (ulimit -v, ulimit -u)"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_out_is_said() {
        let error = Error::from_raw_os_error(nix::libc::EAGAIN);
        let limits = "raise the limits on memory and on processes (ulimit -v, ulimit -u)";
        assert_eq!(
            not_started("2 threads", true, &error),
            format!(
                "cannot start 2 threads: resource temporarily unavailable; use fewer (--threads 1), or {limits}"
            )
        );
        let alone = format!("cannot start a thread: resource temporarily unavailable; {limits}");
        assert_eq!(not_started("a thread", false, &error), alone);
    }
}
