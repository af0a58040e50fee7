//! Bracketed paste: text between two marks, which is skipped.
//!
//! If the closing mark never comes (the line broke, a program in between swallowed it), the keyboard must not be held for ever.
//! The paste is over after a second without text; once it has taken ten seconds or 1 MiB, after a fifth of a second. It is never
//! over while text comes: the rest would count as keys. Control sequences do not count as text: the terminal's answers come all
//! the time while a picture is drawn. Bytes that come later count as keys again, and a late closing mark does nothing.

use std::time::{Duration, Instant};

const SILENCE: Duration = Duration::from_secs(1);
/// The silence that ends what is longer than a paste is expected to be.
const SHORT_SILENCE: Duration = Duration::from_millis(200);
const LONG: Duration = Duration::from_secs(10);
const MANY_BYTES: usize = 1 << 20;
const END: &[u8] = b"\x1b[201~";

/// A paste under way.
#[derive(Debug)]
pub(super) struct Paste {
    begin: Instant,
    last: Instant,
    bytes: usize,
    /// Bytes of the closing mark that have been seen.
    matched: usize,
    sequence: ControlSequence,
}

/// State of a control sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ControlSequence {
    /// There is none.
    Outside,
    /// After ESC.
    Escape,
    /// After ESC [.
    Parameters,
}

impl ControlSequence {
    /// State after one more byte. `None` if the byte is text.
    fn after(self, byte: u8) -> Option<Self> {
        match (self, byte) {
            (Self::Outside | Self::Escape | Self::Parameters, 0x1b) => Some(Self::Escape),
            (Self::Escape, b'[') => Some(Self::Parameters),
            (Self::Parameters, 0x20..=0x3f) => Some(Self::Parameters),
            (Self::Parameters, _) => Some(Self::Outside),
            (Self::Outside | Self::Escape, _) => None,
        }
    }
}

impl Paste {
    pub(super) fn new(now: Instant) -> Self {
        Self { begin: now, last: now, bytes: 0, matched: 0, sequence: ControlSequence::Outside }
    }

    /// When it is over if nothing more comes.
    pub(super) fn deadline(&self) -> Instant {
        let long_at = if self.bytes >= MANY_BYTES { self.last } else { self.begin + LONG };
        (self.last + SILENCE).min(long_at.max(self.last + SHORT_SILENCE))
    }

    /// Takes one byte; whether it ended the closing mark.
    pub(super) fn takes_last(&mut self, byte: u8, now: Instant) -> bool {
        let sequence = self.sequence.after(byte);
        if sequence.is_none() {
            self.last = now;
        }
        self.sequence = sequence.unwrap_or(ControlSequence::Outside);
        self.bytes = self.bytes.saturating_add(1);
        // No suffix of the mark's beginnings is a beginning of the mark but ESC itself.
        self.matched = match byte {
            _ if END[self.matched] == byte => self.matched + 1,
            0x1b => 1,
            _ => 0,
        };
        self.matched == END.len()
    }
}
