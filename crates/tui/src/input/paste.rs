//! Bracketed paste: text between two markers. The text is ignored.
//!
//! A lost end marker must not block the keyboard forever, so a paste expires after one second without text,
//! or after 200 ms once it has lasted ten seconds or exceeded 1 MiB. It never expires while text is arriving,
//! because the rest would be interpreted as key presses. Control sequences do not count as text, because the
//! terminal keeps sending replies while a preview is drawn. After a paste expires, bytes are interpreted as
//! key presses again and a late end marker is ignored.

use std::time::{Duration, Instant};

const SILENCE: Duration = Duration::from_secs(1);
/// Length of the silence that ends an unusually long paste.
const SHORT_SILENCE: Duration = Duration::from_millis(200);
const LONG: Duration = Duration::from_secs(10);
const MANY_BYTES: usize = 1 << 20;
const END: &[u8] = b"\x1b[201~";

/// A paste in progress.
#[derive(Debug)]
pub(super) struct ActivePaste {
    begin: Instant,
    last: Instant,
    bytes: usize,
    /// Number of end marker bytes matched so far.
    matched: usize,
    sequence: ControlSequenceState,
}

/// Parser state of a control sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ControlSequenceState {
    /// Outside a control sequence.
    Outside,
    /// After the escape character.
    Escape,
    /// After the introducer `ESC [`.
    Parameters,
}

impl ControlSequenceState {
    /// The state after another byte, or `None` if the byte is text.
    fn next_state(self, byte: u8) -> Option<Self> {
        match (self, byte) {
            (Self::Outside | Self::Escape | Self::Parameters, 0x1b) => Some(Self::Escape),
            (Self::Escape, b'[') => Some(Self::Parameters),
            (Self::Parameters, 0x20..=0x3f) => Some(Self::Parameters),
            (Self::Parameters, _) => Some(Self::Outside),
            (Self::Outside | Self::Escape, _) => None,
        }
    }
}

impl ActivePaste {
    pub(super) fn new(now: Instant) -> Self {
        Self { begin: now, last: now, bytes: 0, matched: 0, sequence: ControlSequenceState::Outside }
    }

    /// Time when the paste expires if nothing more arrives.
    pub(super) fn deadline(&self) -> Instant {
        let long_at = if self.bytes >= MANY_BYTES { self.last } else { self.begin + LONG };
        (self.last + SILENCE).min(long_at.max(self.last + SHORT_SILENCE))
    }

    /// Processes one byte. Returns true if it completes the end marker.
    pub(super) fn push_byte_and_check_end(&mut self, byte: u8, now: Instant) -> bool {
        let sequence = self.sequence.next_state(byte);
        if sequence.is_none() {
            self.last = now;
        }
        self.sequence = sequence.unwrap_or(ControlSequenceState::Outside);
        self.bytes = self.bytes.saturating_add(1);
        // Only ESC itself is both a suffix of a partial marker and a prefix of the marker.
        self.matched = match byte {
            _ if END[self.matched] == byte => self.matched + 1,
            0x1b => 1,
            _ => 0,
        };
        self.matched == END.len()
    }
}
