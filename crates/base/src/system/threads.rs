//! Checks and messages for threads that the system cannot start.

use std::fmt::Display;
use std::io::Error;

use nix::sys::resource::{Resource, getrlimit};

use super::describe_error;

/// Address space per thread stack in bytes (the standard library's default).
const STACK_BYTES: u64 = 2 << 20;

/// Checks that the stacks of `threads` threads fit within the process's address-space limit. Must be called
/// before the first thread is started, because the standard library terminates the process if a new thread
/// has no room for its signal stack.
///
/// # Errors
/// If the stacks do not fit, returns the error that the system reports when it cannot start a thread.
pub fn check_stack_space(threads: usize) -> Result<(), Error> {
    let Ok((limit, _)) = getrlimit(Resource::RLIMIT_AS) else { return Ok(()) };
    if (threads as u64).saturating_mul(STACK_BYTES) > limit {
        return Err(Error::from_raw_os_error(nix::libc::EAGAIN));
    }
    Ok(())
}

/// Explains why `what` could not be started and how to fix it: raise the limits on memory (for stacks) or on
/// the number of threads, or use fewer threads.
pub fn describe_start_failure(what: &str, is_number_chosen: bool, error: &impl Display) -> String {
    let why = describe_error(&Error::other(error.to_string()));
    let fewer = if is_number_chosen { "use fewer (--threads 1), or " } else { "" };
    format!(
        "cannot start {what}: {why}; {fewer}raise the limits on memory and on processes (ulimit -v, ulimit -u)"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_suggests_a_fix() {
        let error = Error::from_raw_os_error(nix::libc::EAGAIN);
        let limits = "raise the limits on memory and on processes (ulimit -v, ulimit -u)";
        assert_eq!(
            describe_start_failure("2 threads", true, &error),
            format!(
                "cannot start 2 threads: resource temporarily unavailable; use fewer (--threads 1), or {limits}"
            )
        );
        let alone = format!("cannot start a thread: resource temporarily unavailable; {limits}");
        assert_eq!(describe_start_failure("a thread", false, &error), alone);
    }
}
