//! The end of a process by abort(3), as after a failed allocation: glimt restores the terminal, writes a sentence, and
//! exits with code 1.
//!
//! `unsafe` code is here and in the SIMD kernels alone. Everything that runs in the handler is async-signal-safe
//! (signal-safety(7)): no lock, no allocation.

use std::alloc::{GlobalAlloc, Layout, System};
use std::fmt::Write;
use std::io;
use std::os::fd::BorrowedFd;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use nix::unistd::{pause, write};
use signal_hook::consts::SIGABRT;
use signal_hook::low_level;

/// Size in bytes of the last allocation that was refused; 0 if none was.
static REFUSED_BYTES: AtomicUsize = AtomicUsize::new(0);

/// Restores the terminal, by async-signal-safe calls alone.
static GIVE_BACK: OnceLock<fn()> = OnceLock::new();

/// Exit code of work that failed.
const FAILED: i32 = 1;

/// The system's allocator, which remembers what it refused.
pub struct Allocator;

/// Remembers the size if the allocation was refused.
#[inline(always)]
fn noted(memory: *mut u8, bytes: usize) -> *mut u8 {
    if memory.is_null() {
        REFUSED_BYTES.store(bytes, Ordering::Relaxed);
    }
    memory
}

// SAFETY: every call is the system allocator's own, with the caller's arguments and its result.
unsafe impl GlobalAlloc for Allocator {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller keeps the contract of `GlobalAlloc`.
        noted(unsafe { System.alloc(layout) }, layout.size())
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        noted(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    #[inline]
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, new_bytes: usize) -> *mut u8 {
        // SAFETY: as above.
        noted(unsafe { System.realloc(memory, layout, new_bytes) }, new_bytes)
    }

    #[inline]
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// Catches SIGABRT: from now on an abort ends the process with exit code 1 and a sentence on stderr.
///
/// # Errors
/// The handler cannot be set up.
pub fn catch() -> io::Result<()> {
    // SAFETY: `last_words` makes async-signal-safe calls alone.
    unsafe { low_level::register(SIGABRT, last_words) }.map(drop)
}

/// Sets the function that restores the terminal before the sentence is written. It may only make async-signal-safe
/// calls. The first one that is set stays.
pub fn give_back_by(give_back: fn()) {
    let _ = GIVE_BACK.set(give_back);
}

/// Whether a thread is already at its last words.
static IS_ENDING: AtomicBool = AtomicBool::new(false);

/// Restores the terminal, says why the process ends, and ends it. If memory is out, several threads abort at once: the first one
/// speaks, the others wait until the process is gone.
fn last_words() {
    while IS_ENDING.swap(true, Ordering::AcqRel) {
        pause();
    }
    if let Some(give_back) = GIVE_BACK.get() {
        give_back();
    }
    let mut sentence = Sentence::default();
    // A sentence that does not fit is cut.
    let _ = match REFUSED_BYTES.load(Ordering::Relaxed) {
        0 => writeln!(sentence, "error: glimt was ended by SIGABRT"),
        bytes => writeln!(
            sentence,
            "error: out of memory: {} MB more were refused; a smaller image or scene, or a higher limit (`ulimit -v`) helps",
            bytes.div_ceil(1_000_000)
        ),
    };
    // SAFETY: standard error is open for the whole life of the process, or the write fails.
    let _ = write(unsafe { BorrowedFd::borrow_raw(nix::libc::STDERR_FILENO) }, sentence.bytes());
    low_level::exit(FAILED);
}

/// Text on the stack.
struct Sentence {
    bytes: [u8; 256],
    length: usize,
}

impl Default for Sentence {
    fn default() -> Self {
        Self { bytes: [0; 256], length: 0 }
    }
}

impl Sentence {
    fn bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

impl Write for Sentence {
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
    fn a_refused_allocation_is_remembered() {
        let layout = Layout::from_size_align(usize::MAX / 4, 1).expect("a layout");
        // SAFETY: the layout has a size; a null pointer is not used.
        let memory = std::hint::black_box(unsafe { Allocator.alloc(layout) });
        assert!(memory.is_null());
        assert_eq!(REFUSED_BYTES.load(Ordering::Relaxed), usize::MAX / 4);
    }

    #[test]
    fn a_sentence_is_cut_where_it_does_not_fit() {
        let mut sentence = Sentence::default();
        assert!(write!(sentence, "{}", "a".repeat(200)).is_ok());
        assert!(write!(sentence, "{}", "b".repeat(100)).is_err());
        assert_eq!(sentence.bytes(), [b'a'; 200]);
    }
}
