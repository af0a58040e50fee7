//! Bracketed paste: text between two marks, which is skipped.
//!
//! Where the closing mark never comes (the line broke, a program in between swallowed it), the keyboard must not be
//! held for ever: the paste is over after a second without a byte, after ten seconds, or after 1 MiB, whichever comes
//! first. What comes later counts as keys again, a late closing mark as nothing.

use std::time::{Duration, Instant};

const SILENCE: Duration = Duration::from_secs(1);
const LONGEST: Duration = Duration::from_secs(10);
const MOST_BYTES: usize = 1 << 20;
const END: &[u8] = b"\x1b[201~";

/// A paste under way.
#[derive(Debug)]
pub(super) struct Paste {
    begin: Instant,
    last: Instant,
    bytes: usize,
    /// How much of the closing mark has been seen.
    matched: usize,
}

impl Paste {
    pub(super) fn new(now: Instant) -> Self {
        Self { begin: now, last: now, bytes: 0, matched: 0 }
    }

    /// When it is over if nothing more comes.
    pub(super) fn deadline(&self) -> Instant {
        (self.last + SILENCE).min(self.begin + LONGEST)
    }

    /// Takes one byte; whether it was the last one.
    pub(super) fn takes_last(&mut self, byte: u8, now: Instant) -> bool {
        self.last = now;
        self.bytes += 1;
        // No suffix of the mark's beginnings is a beginning of the mark but ESC itself.
        self.matched = match byte {
            _ if END[self.matched] == byte => self.matched + 1,
            0x1b => 1,
            _ => 0,
        };
        self.matched == END.len() || self.bytes >= MOST_BYTES
    }
}
