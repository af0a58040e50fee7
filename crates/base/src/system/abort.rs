//! Handles abort(3), for example after a failed allocation: glimt restores the terminal, prints a message and
//! exits with code 1.
//!
//! Only this module and the SIMD kernels contain `unsafe` code. Everything that runs in the handler is
//! async-signal-safe (signal-safety(7)): it neither locks nor allocates.

use std::alloc::{GlobalAlloc, Layout, System};
use std::fmt::Write;
use std::io;
use std::os::fd::BorrowedFd;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nix::unistd::{pause, write};
use signal_hook::consts::SIGABRT;
use signal_hook::low_level;

/// Size in bytes of the last failed allocation, or 0.
static REFUSED_BYTES: AtomicUsize = AtomicUsize::new(0);

/// Function that restores the terminal and makes only async-signal-safe calls.
static RESTORE_TERMINAL: OnceLock<fn()> = OnceLock::new();

/// Exit code for failures.
const FAILED: i32 = 1;

/// The system allocator, extended to record failed allocations.
pub struct Allocator;

/// Records `bytes` if the allocation failed.
#[inline(always)]
fn record_failed_allocation(memory: *mut u8, bytes: usize) -> *mut u8 {
    if memory.is_null() {
        REFUSED_BYTES.store(bytes, Ordering::Relaxed);
    }
    memory
}

// SAFETY: every call is forwarded to the system allocator with the caller's arguments, and its result is
// returned.
unsafe impl GlobalAlloc for Allocator {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller upholds the contract of `GlobalAlloc`.
        record_failed_allocation(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        record_failed_allocation(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline]
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, new_bytes: usize) -> *mut u8 {
        // SAFETY: as above.
        record_failed_allocation(unsafe { System.realloc(memory, layout, new_bytes) }, new_bytes)
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
    // SAFETY: `on_abort` makes only async-signal-safe calls.
    unsafe { low_level::register(SIGABRT, on_abort) }.map(drop)
}

/// Sets the function that restores the terminal before the message is printed. It may only make
/// async-signal-safe calls. Later calls have no effect.
pub fn set_terminal_restore(restore: fn()) {
    let _ = RESTORE_TERMINAL.set(restore);
}

/// Whether a thread is already running the handler.
static IS_ENDING: AtomicBool = AtomicBool::new(false);

/// Restores the terminal, prints the reason and exits. If several threads abort at once when memory runs out,
/// the first thread prints and the others wait for the process to end.
fn on_abort() {
    while IS_ENDING.swap(true, Ordering::AcqRel) {
        pause();
    }
    if let Some(restore) = RESTORE_TERMINAL.get() {
        restore();
    }
    let mut message = MessageBuffer::default();
    // Truncate messages that do not fit.
    let _ = match REFUSED_BYTES.load(Ordering::Relaxed) {
        0 => writeln!(message, "error: glimt was aborted (SIGABRT)"),
        bytes => writeln!(
            message,
            "error: out of memory: an allocation of {} MB failed; use a smaller image or scene, or raise the limit (`ulimit -v`)",
            bytes.div_ceil(1_000_000)
        ),
    };
    // SAFETY: standard error stays open for the lifetime of the process; if not, the write fails.
    let _ = write(unsafe { BorrowedFd::borrow_raw(nix::libc::STDERR_FILENO) }, message.bytes());
    low_level::exit(FAILED);
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
    fn failed_allocations_are_recorded() {
        let layout = Layout::from_size_align(usize::MAX / 4, 1).expect("a layout");
        // SAFETY: the layout's size is not 0, and a null pointer is not used.
        let memory = std::hint::black_box(unsafe { Allocator.alloc(layout) });
        assert!(memory.is_null());
        assert_eq!(REFUSED_BYTES.load(Ordering::Relaxed), usize::MAX / 4);
    }

    #[test]
    fn long_messages_are_truncated() {
        let mut message = MessageBuffer::default();
        assert!(write!(message, "{}", "a".repeat(200)).is_ok());
        assert!(write!(message, "{}", "b".repeat(100)).is_err());
        assert_eq!(message.bytes(), [b'a'; 200]);
    }
}
