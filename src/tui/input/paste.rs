//! Bracketed paste: text between two marks, which is skipped.
//!
//! Where the closing mark never comes (the line broke, a program in between swallowed it), the keyboard must not be
//! held for ever: the paste is over after a second without text, after ten seconds, or after 1 MiB, whichever comes
//! first. Control sequences are no text: the terminal's answers come all the time while a picture is drawn. What comes later counts as keys again, a late closing mark as nothing.

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
    sequence: Sequence,
}

/// How far a control sequence has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sequence {
    /// There is none.
    Outside,
    /// After ESC.
    Escape,
    /// After ESC [.
    Parameters,
}

impl Sequence {
    /// After one more byte; none: the byte is text.
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
        Self { begin: now, last: now, bytes: 0, matched: 0, sequence: Sequence::Outside }
    }

    /// When it is over if nothing more comes.
    pub(super) fn deadline(&self) -> Instant {
        (self.last + SILENCE).min(self.begin + LONGEST)
    }

    /// Takes one byte; whether it was the last one.
    pub(super) fn takes_last(&mut self, byte: u8, now: Instant) -> bool {
        let sequence = self.sequence.after(byte);
        if sequence.is_none() {
            self.last = now;
        }
        self.sequence = sequence.unwrap_or(Sequence::Outside);
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
