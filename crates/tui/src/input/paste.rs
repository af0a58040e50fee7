//! Bracketed paste: text between two markers, which is ignored.
//!
//! The keyboard must not be blocked forever if the end marker is lost on the way. A paste expires after one
//! second without text, or after 200 ms once it has lasted ten seconds or exceeds 1 MiB. It never expires
//! while text arrives, because the rest would count as keys. Control sequences are not text, since the
//! terminal sends replies continuously while a preview is drawn. After that, bytes count as keys again and a
//! late end marker has no effect.

use std::time::{Duration, Instant};

const SILENCE: Duration = Duration::from_secs(1);
/// Silence that ends an unusually long paste.
const SHORT_SILENCE: Duration = Duration::from_millis(200);
const LONG: Duration = Duration::from_secs(10);
const MANY_BYTES: usize = 1 << 20;
const END: &[u8] = b"\x1b[201~";

/// A paste in progress.
#[derive(Debug)]
pub(super) struct Paste {
    begin: Instant,
    last: Instant,
    bytes: usize,
    /// Matched bytes of the end marker.
    matched: usize,
    sequence: ControlSequence,
}

/// Parser state of a control sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ControlSequence {
    /// Outside of a sequence.
    Outside,
    /// After ESC.
    Escape,
    /// After ESC [.
    Parameters,
}

impl ControlSequence {
    /// The state after one more byte. `None` if the byte is text.
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

    /// Time at which the paste expires if nothing more arrives.
    pub(super) fn deadline(&self) -> Instant {
        let long_at = if self.bytes >= MANY_BYTES { self.last } else { self.begin + LONG };
        (self.last + SILENCE).min(long_at.max(self.last + SHORT_SILENCE))
    }

    /// Takes one byte. Returns whether it completed the end marker.
    pub(super) fn push(&mut self, byte: u8, now: Instant) -> bool {
        let sequence = self.sequence.after(byte);
        if sequence.is_none() {
            self.last = now;
        }
        self.sequence = sequence.unwrap_or(ControlSequence::Outside);
        self.bytes = self.bytes.saturating_add(1);
        // No suffix of a partial marker is a prefix of the marker except ESC itself.
        self.matched = match byte {
            _ if END[self.matched] == byte => self.matched + 1,
            0x1b => 1,
            _ => 0,
        };
        self.matched == END.len()
    }
}
