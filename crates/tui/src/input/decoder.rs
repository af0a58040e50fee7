//! Decodes terminal input that may be split at any byte.
//!
//! An escape character can be the Escape key or the start of a sequence. Only timing distinguishes the two. A
//! sequence that does not end in time is dropped, so no input can block the keyboard.

use std::time::{Duration, Instant};

use crossterm::event::KeyCode;

use super::decoded::DecodedInput;
use super::keys::DecodedInputCollector;
use super::paste::ActivePaste;
use crate::event::KeyPress;

const ESCAPE: u8 = 0x1b;
/// Bytes that can follow the escape character in a terminal sequence: CSI, OSC, SS3, DCS, SOS, PM, APC, and
/// the string terminator.
const INTRODUCERS: &[u8] = b"[]OPX^_\\";
/// An escape character followed by silence for this long is a key press.
const LONE_ESCAPE: Duration = Duration::from_millis(50);
/// Timeout between bytes of a sequence, for connections that lose packets.
const SEQUENCE_TIMEOUT: Duration = Duration::from_secs(1);
/// Maximum duration and length of a sequence. Without these limits, a key press such as alt-`]`, which looks
/// like the start of a sequence, would block all further input.
const MAX_DURATION: Duration = Duration::from_secs(2);
const MAX_BYTES: usize = 4096;
/// Maximum delay of a `[` after its escape character, which has already been treated as a key press.
const LATE_SEQUENCE: Duration = Duration::from_secs(2);
/// Maximum time to wait for the next byte after a late `[`, and maximum number of bytes to hold back.
const DOUBT_TIMEOUT: Duration = Duration::from_millis(300);
const MAX_DOUBTFUL_BYTES: usize = 32;

/// Decodes terminal input from bytes.
#[derive(Default)]
pub(crate) struct Decoder {
    parser: vte::Parser,
    meaning: DecodedInputCollector,
    held: PendingSequence,
    /// Time when the last byte arrived.
    last: Option<Instant>,
    /// Time when an escape character was treated as a key press.
    escaped: Option<Instant>,
    /// Text of the current application program command (APC). The VTE parser ignores such commands.
    command: Vec<u8>,
}

/// A sequence that has started but not ended.
#[derive(Debug, Default)]
enum PendingSequence {
    #[default]
    Nothing,
    /// An escape character, which may be a key press or start a sequence.
    Escape,
    /// An escape character that ends a control string.
    StringEnd,
    /// A sequence with its start time and length. `introducer` is the byte that follows the escape character.
    Sequence {
        begin: Instant,
        bytes: usize,
        introducer: u8,
    },
    /// Either the rest of a sequence whose escape character was treated as a key press, or separate key
    /// presses.
    Doubtful(Vec<u8>),
    Paste(ActivePaste),
}

impl Decoder {
    /// Decodes the next input bytes.
    pub(crate) fn decode(&mut self, bytes: &[u8], now: Instant) -> Vec<DecodedInput> {
        // An escape character or doubtful bytes do not expire here, because the bytes that follow have
        // arrived, even if late. A paste does not expire either, because its text may have been waiting for a
        // busy reader.
        if matches!(self.held, PendingSequence::Sequence { .. }) {
            self.expire_pending(now);
        }
        self.last = Some(now);
        for &byte in bytes {
            self.process_byte(byte, now);
        }
        std::mem::take(&mut self.meaning.found)
    }

    /// Time when [`Decoder::expire`] must be called.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let after = |wait| self.last.map(|last| last + wait);
        match &self.held {
            PendingSequence::Nothing => None,
            PendingSequence::Escape => after(LONE_ESCAPE),
            PendingSequence::StringEnd => after(SEQUENCE_TIMEOUT),
            PendingSequence::Sequence { begin, .. } => {
                after(SEQUENCE_TIMEOUT).map(|end| end.min(*begin + MAX_DURATION))
            }
            PendingSequence::Doubtful(_) => after(DOUBT_TIMEOUT),
            PendingSequence::Paste(paste) => Some(paste.deadline()),
        }
    }

    /// Handles a sequence that has not been continued by its [`Decoder::deadline`].
    pub(super) fn expire(&mut self, now: Instant) -> Vec<DecodedInput> {
        self.expire_pending(now);
        std::mem::take(&mut self.meaning.found)
    }

    fn expire_pending(&mut self, now: Instant) {
        if self.deadline().is_some_and(|deadline| now >= deadline) {
            match self.take_pending_sequence() {
                PendingSequence::Escape => {
                    self.escaped = Some(now);
                    self.push_escape_key();
                }
                PendingSequence::Doubtful(bytes) => self.replay(&bytes),
                PendingSequence::Paste(_) => self.meaning.found.push(DecodedInput::Paste),
                // Nothing followed, so these are two key presses.
                PendingSequence::Sequence { bytes: 2, introducer, .. } => {
                    self.push_escape_key();
                    self.replay(&[introducer]);
                }
                PendingSequence::Nothing | PendingSequence::StringEnd | PendingSequence::Sequence { .. } => {}
            }
        }
    }

    fn process_byte(&mut self, byte: u8, now: Instant) {
        match std::mem::take(&mut self.held) {
            PendingSequence::Nothing => self.process_byte_outside_sequence(byte, now),
            PendingSequence::Escape | PendingSequence::StringEnd => self.continue_after_escape(byte, now),
            PendingSequence::Sequence { introducer, .. } if byte == ESCAPE => {
                if introducer == b'_' {
                    self.meaning.handle_apc(&std::mem::take(&mut self.command));
                }
                self.process_byte_outside_sequence(byte, now);
                if b"]P_X^".contains(&introducer) {
                    self.held = PendingSequence::StringEnd;
                }
            }
            PendingSequence::Sequence { bytes: 2, introducer, .. }
                if are_three_key_presses(introducer, byte) =>
            {
                self.take_pending_sequence();
                self.push_escape_key();
                self.replay(&[introducer]);
                self.process_byte_outside_sequence(byte, now);
            }
            PendingSequence::Sequence { begin, bytes, introducer } => {
                if introducer == b'_' {
                    self.command.push(byte);
                }
                self.continue_sequence(byte, begin, bytes + 1, introducer, now);
            }
            PendingSequence::Doubtful(bytes) => self.continue_ambiguous_sequence(bytes, byte, now),
            PendingSequence::Paste(mut paste) => {
                if paste.push_byte_and_check_end(byte, now) {
                    self.meaning.found.push(DecodedInput::Paste);
                } else {
                    self.held = PendingSequence::Paste(paste);
                }
            }
        }
    }

    fn process_byte_outside_sequence(&mut self, byte: u8, now: Instant) {
        let escaped = self.escaped.take().filter(|escaped| now < *escaped + LATE_SEQUENCE);
        match byte {
            ESCAPE => {
                self.meaning.drop_current_sequence();
                self.parser.advance(&mut self.meaning, &[byte]);
                self.held = PendingSequence::Escape;
            }
            b'[' if escaped.is_some() => {
                self.parser.advance(&mut self.meaning, &[ESCAPE, byte]);
                self.held = PendingSequence::Doubtful(vec![byte]);
            }
            _ => self.parser.advance(&mut self.meaning, &[byte]),
        }
    }

    fn continue_after_escape(&mut self, byte: u8, now: Instant) {
        match byte {
            ESCAPE => {
                self.push_escape_key();
                self.held = PendingSequence::Escape;
            }
            // Not the start of any terminal sequence.
            byte if !INTRODUCERS.contains(&byte) => {
                self.take_pending_sequence();
                self.push_escape_key();
                self.process_byte_outside_sequence(byte, now);
            }
            _ => self.continue_sequence(byte, now, 2, byte, now),
        }
    }

    /// Continues a sequence with one more byte.
    fn continue_sequence(&mut self, byte: u8, begin: Instant, bytes: usize, introducer: u8, now: Instant) {
        self.meaning.has_ended = false;
        self.parser.advance(&mut self.meaning, &[byte]);
        if std::mem::take(&mut self.meaning.is_paste) {
            self.held = PendingSequence::Paste(ActivePaste::new(now));
        } else if bytes >= MAX_BYTES {
            self.take_pending_sequence();
        } else if !self.meaning.has_ended {
            self.held = PendingSequence::Sequence { begin, bytes, introducer };
        }
    }

    fn continue_ambiguous_sequence(&mut self, mut bytes: Vec<u8>, byte: u8, now: Instant) {
        let before = self.meaning.found.len();
        if (0x20..0x7f).contains(&byte) {
            self.continue_sequence(byte, now, bytes.len(), b'[', now);
        }
        let is_known = self.meaning.found.len() > before || matches!(self.held, PendingSequence::Paste(_));
        if is_known {
            return;
        }
        let is_middle = matches!(byte, b' '..=b'?') && bytes.len() < MAX_DOUBTFUL_BYTES;
        if is_middle {
            bytes.push(byte);
            self.held = PendingSequence::Doubtful(bytes);
        } else {
            self.take_pending_sequence();
            self.replay(&bytes);
            self.process_byte_outside_sequence(byte, now);
        }
    }

    /// Drops the current sequence and returns it.
    fn take_pending_sequence(&mut self) -> PendingSequence {
        self.meaning.drop_current_sequence();
        self.command.clear();
        self.parser = vte::Parser::default();
        std::mem::take(&mut self.held)
    }

    fn replay(&mut self, bytes: &[u8]) {
        self.parser.advance(&mut self.meaning, bytes);
    }

    fn push_escape_key(&mut self) {
        self.meaning.found.push(DecodedInput::Key(KeyPress::special(KeyCode::Esc)));
    }
}

/// Whether `byte` cannot follow an escape character and `introducer` in any terminal sequence, in which case
/// all three are key presses.
fn are_three_key_presses(introducer: u8, byte: u8) -> bool {
    match introducer {
        // rxvt uses `a` to `d` for shifted arrows, and reports end with `n` or `t`.
        b'[' => matches!(byte, b'e'..=b'm' | b'o'..=b's' | b'u'..=b'~'),
        b']' => !byte.is_ascii_digit() && byte != ESCAPE,
        b'P' => byte.is_ascii_lowercase(),
        _ => false,
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
