//! Starts threads and explains why the system cannot start them.

use std::fmt::Display;
use std::io::{Error, Result};
use std::num::NonZero;
use std::thread::{Builder, JoinHandle, available_parallelism};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{describe_io_error, memory};

/// Address space used by a thread: its stack (with the standard library's default size) and its signal stack.
pub const STACK_BYTES: u64 = (2 << 20) + (64 << 10);

/// Additional address space for everything else that is allocated while threads start. If there is none left,
/// the C library terminates the process, for example when a thread registers its first thread-local variable.
const SPARE_BYTES: u64 = 1 << 20;

/// Starts a thread.
///
/// # Errors
/// Returns an error if the system has run out of memory or threads.
pub fn spawn<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<JoinHandle<T>> {
    check_thread_stack_memory(1)?;
    Builder::new().name(name.to_owned()).spawn(work)
}

/// Number of logical CPUs available to this process.
pub fn logical_cpu_count() -> usize {
    available_parallelism().map_or(1, NonZero::get)
}

/// Starts a pool with one thread per logical CPU.
///
/// # Errors
/// Returns the message from [`describe_thread_start_failure`].
pub fn start_logical_cpu_pool() -> std::result::Result<ThreadPool, String> {
    let threads = logical_cpu_count();
    let failed = |error: &dyn Display| describe_thread_start_failure(threads, false, &error);
    check_thread_stack_memory(threads).map_err(|error| failed(&error))?;
    ThreadPoolBuilder::new().num_threads(threads).build().map_err(|error| failed(&error))
}

/// Checks that the stacks of `threads` more threads fit within the process's memory limits, with room to
/// spare. The standard library terminates the process if a new thread has no room for its signal stack.
///
/// # Errors
/// Returns the system's out-of-memory error if the stacks do not fit.
pub fn check_thread_stack_memory(threads: usize) -> Result<()> {
    match name_of_exceeded_stack_limit(threads) {
        Some(_) => Err(Error::from_raw_os_error(nix::libc::ENOMEM)),
        None => Ok(()),
    }
}

/// Setting whose limit leaves no room for the stacks of `threads` more threads, or `None` if they fit.
fn name_of_exceeded_stack_limit(threads: usize) -> Option<&'static str> {
    memory::limit_preventing_mapping((threads as u64).saturating_mul(STACK_BYTES).saturating_add(SPARE_BYTES))
}

/// Explains why `threads` threads could not be started and how to fix it. The system reports the same error
/// whether memory or threads run out.
pub fn describe_thread_start_failure(
    threads: usize,
    has_threads_option: bool,
    error: &impl Display,
) -> String {
    let what = if threads == 1 { "a thread".to_owned() } else { format!("{threads} threads") };
    let fewer = if has_threads_option && threads > 1 { "use fewer (--threads 1), or " } else { "" };
    match name_of_exceeded_stack_limit(threads) {
        Some(setting) => {
            format!("out of memory: cannot start {what}; {fewer}raise the memory limit ({setting})")
        }
        None => {
            let why = describe_io_error(&Error::other(error.to_string()));
            format!("cannot start {what}: {why}; {fewer}raise the limit on processes (`ulimit -u`)")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_suggests_a_fix() {
        let error = Error::from_raw_os_error(nix::libc::EAGAIN);
        let limit = "raise the limit on processes (`ulimit -u`)";
        assert_eq!(
            describe_thread_start_failure(2, true, &error),
            format!(
                "cannot start 2 threads: resource temporarily unavailable; use fewer (--threads 1), or {limit}"
            )
        );
        for has_threads_option in [true, false] {
            let alone = format!("cannot start a thread: resource temporarily unavailable; {limit}");
            assert_eq!(describe_thread_start_failure(1, has_threads_option, &error), alone);
        }
    }

    #[test]
    fn threads_are_named() {
        let name = || std::thread::current().name().map(str::to_owned);
        let thread = spawn("a name", name).expect("a thread");
        assert_eq!(thread.join().expect("no panic"), Some("a name".to_owned()));
    }
}
