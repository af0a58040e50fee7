//! Ends the process when an allocation fails or abort(3) is called: glimt restores the terminal, prints a
//! message and exits with code 1.
//!
//! Only this module and the SIMD kernels contain `unsafe` code. All code that runs while the process ends is
//! async-signal-safe (signal-safety(7)): it neither locks nor allocates.

use std::alloc::{GlobalAlloc, Layout, System};
use std::fmt::{Arguments, Write};
use std::io;
use std::os::fd::BorrowedFd;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
use nix::unistd::{pause, write};
use signal_hook::consts::SIGABRT;
use signal_hook::low_level;

use super::memory::caller_handles_alloc_failure;

/// Function that restores the terminal and makes only async-signal-safe calls.
static RESTORE_TERMINAL: OnceLock<fn()> = OnceLock::new();

/// Exit code for failures.
const FAILED: i32 = 1;

/// The system allocator, extended to end the process with a message if an allocation fails. Otherwise, the
/// standard library would print its own message and a backtrace. Allocations with
/// [`try_reserve_exact`](super::memory::try_reserve_exact) are exempt.
pub struct AbortingAllocator;

/// Ends the process if the allocation failed and its caller does not handle the failure.
#[inline(always)]
fn abort_if_allocation_failed(memory: *mut u8, bytes: usize) -> *mut u8 {
    if memory.is_null() && !caller_handles_alloc_failure() {
        abort_out_of_memory(bytes);
    }
    memory
}

#[cold]
fn abort_out_of_memory(bytes: usize) -> ! {
    let (number, unit) = match bytes {
        1 => (bytes, "byte"),
        0..1_000 => (bytes, "bytes"),
        1_000..1_000_000 => (bytes.div_ceil(1_000), "kB"),
        1_000_000.. => (bytes.div_ceil(1_000_000), "MB"),
    };
    let is_limited = getrlimit(Resource::RLIMIT_AS).is_ok_and(|(limit, _)| limit < RLIM_INFINITY);
    let limit = if is_limited { ", or raise the limit (`ulimit -v`)" } else { "" };
    exit_with_message(format_args!(
        "error: out of memory: cannot allocate {number} {unit}; use a smaller image or scene{limit}"
    ))
}

// SAFETY: every call is forwarded to the system allocator with the caller's arguments, and its result is
// returned.
unsafe impl GlobalAlloc for AbortingAllocator {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller upholds the contract of `GlobalAlloc`.
        abort_if_allocation_failed(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        abort_if_allocation_failed(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline]
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, new_bytes: usize) -> *mut u8 {
        // SAFETY: as above.
        abort_if_allocation_failed(unsafe { System.realloc(memory, layout, new_bytes) }, new_bytes)
    }

    #[inline]
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// Installs the SIGABRT handler, which prints a message to stderr and exits with code 1.
///
/// # Errors
/// Returns an error if the handler cannot be installed.
pub fn install_abort_handler() -> io::Result<()> {
    // SAFETY: `handle_abort_signal` makes only async-signal-safe calls.
    unsafe { low_level::register(SIGABRT, handle_abort_signal) }.map(drop)
}

/// Sets the function that restores the terminal before the message is printed. It may only make
/// async-signal-safe calls. Later calls have no effect.
pub fn set_terminal_restore_hook(restore: fn()) {
    let _ = RESTORE_TERMINAL.set(restore);
}

/// Whether a thread is already ending the process.
static IS_ENDING: AtomicBool = AtomicBool::new(false);

fn handle_abort_signal() {
    exit_with_message(format_args!("error: glimt was aborted (SIGABRT)"));
}

/// Restores the terminal, prints the message and exits. If several threads run out of memory at once, the
/// first thread prints and the others wait for the process to end.
fn exit_with_message(words: Arguments<'_>) -> ! {
    while IS_ENDING.swap(true, Ordering::AcqRel) {
        pause();
    }
    if let Some(restore) = RESTORE_TERMINAL.get() {
        restore();
    }
    let mut message = MessageBuffer::default();
    // Truncate messages that do not fit.
    let _ = writeln!(message, "{words}");
    // SAFETY: standard error stays open for the lifetime of the process. If it were closed, the write would
    // fail.
    let _ = write(unsafe { BorrowedFd::borrow_raw(nix::libc::STDERR_FILENO) }, message.bytes());
    low_level::exit(FAILED)
}

/// Stack-allocated text buffer.
struct MessageBuffer {
    bytes: [u8; 256],
    length: usize,
}

impl Default for MessageBuffer {
    fn default() -> Self {
        Self { bytes: [0; 256], length: 0 }
    }
}

impl MessageBuffer {
    fn bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

impl Write for MessageBuffer {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        let end = self.length + text.len();
        let room = self.bytes.get_mut(self.length..end).ok_or(std::fmt::Error)?;
        room.copy_from_slice(text.as_bytes());
        self.length = end;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_messages_are_truncated() {
        let mut message = MessageBuffer::default();
        assert!(write!(message, "{}", "a".repeat(200)).is_ok());
        assert!(write!(message, "{}", "b".repeat(100)).is_err());
        assert_eq!(message.bytes(), [b'a'; 200]);
    }
}
