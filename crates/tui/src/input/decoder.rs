//! Bytes as they come, split anywhere, into inputs.
//!
//! The escape character is a key and the beginning of nearly everything else; only time tells. What begins and does
//! not end in time is given up, so that no byte can hold the keyboard.

use std::time::{Duration, Instant};

use crossterm::event::KeyCode;

use super::decoded::DecodedInput;
use super::keys::KeyParser;
use super::paste::Paste;
use crate::event::KeyPress;

const ESCAPE: u8 = 0x1b;
/// Bytes after an escape character with which a terminal begins a sequence: CSI, OSC, SS3, DCS, SOS, PM, APC, and the end of a string.
const INTRODUCERS: &[u8] = b"[]OPX^_\\";
/// After this much silence an escape character was the key.
const LONE_ESCAPE: Duration = Duration::from_millis(50);
/// A sequence goes on within this time. Lines that lose packets are this slow.
const SEQUENCE: Duration = Duration::from_secs(1);
/// A sequence ends within this time and length, whatever comes: alt and `]` begin one that no key ends.
const LONGEST: Duration = Duration::from_secs(2);
const MOST_BYTES: usize = 4096;
/// Time after an escape key within which `[` can still show that a sequence began.
const REGRET: Duration = Duration::from_secs(2);
/// Time that such a `[` waits for the next byte; and most bytes kept in doubt.
const DOUBT: Duration = Duration::from_millis(300);
const LONGEST_ANSWER: usize = 32;

/// Turns bytes into inputs.
#[derive(Default)]
pub(crate) struct Decoder {
    parser: vte::Parser,
    meaning: KeyParser,
    held: PendingSequence,
    /// When the last byte came.
    last: Option<Instant>,
    /// When silence made a key of an escape character.
    escaped: Option<Instant>,
    /// Text of the application program command (APC) under way, which the parser ignores.
    command: Vec<u8>,
}

/// A sequence that has begun and not ended.
#[derive(Debug, Default)]
enum PendingSequence {
    #[default]
    Nothing,
    /// An escape character alone.
    Escape,
    /// An escape character in a string, which it ends.
    StringEnd,
    /// A sequence that began then and has so many bytes. `introducer`: the byte after the escape character.
    Sequence {
        begin: Instant,
        bytes: usize,
        introducer: u8,
    },
    /// Perhaps the rest of a sequence whose escape character was taken for the key; else these keys.
    Doubtful(Vec<u8>),
    Paste(Paste),
}

impl Decoder {
    /// Decodes these bytes, together with those before.
    pub(crate) fn decode(&mut self, bytes: &[u8], now: Instant) -> Vec<DecodedInput> {
        // An escape character and a doubt are not over: what had to follow them is here, if late. Nor is a paste: its text
        // may have waited for a busy reader, which is no silence.
        if matches!(self.held, PendingSequence::Sequence { .. }) {
            self.expire_into_found(now);
        }
        self.last = Some(now);
        for &byte in bytes {
            self.take(byte, now);
        }
        std::mem::take(&mut self.meaning.found)
    }

    /// When [`Decoder::expire`] has something to do.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let after = |wait| self.last.map(|last| last + wait);
        match &self.held {
            PendingSequence::Nothing => None,
            PendingSequence::Escape => after(LONE_ESCAPE),
            PendingSequence::StringEnd => after(SEQUENCE),
            PendingSequence::Sequence { begin, .. } => after(SEQUENCE).map(|end| end.min(*begin + LONGEST)),
            PendingSequence::Doubtful(_) => after(DOUBT),
            PendingSequence::Paste(paste) => Some(paste.deadline()),
        }
    }

    /// Decodes silence.
    pub(super) fn expire(&mut self, now: Instant) -> Vec<DecodedInput> {
        self.expire_into_found(now);
        std::mem::take(&mut self.meaning.found)
    }

    fn expire_into_found(&mut self, now: Instant) {
        if self.deadline().is_some_and(|deadline| now >= deadline) {
            match self.give_up() {
                PendingSequence::Escape => {
                    self.escaped = Some(now);
                    self.press_escape();
                }
                PendingSequence::Doubtful(bytes) => self.replay(&bytes),
                PendingSequence::Paste(_) => self.meaning.found.push(DecodedInput::Paste),
                // Nothing followed: two keys.
                PendingSequence::Sequence { bytes: 2, introducer, .. } => {
                    self.press_escape();
                    self.replay(&[introducer]);
                }
                PendingSequence::Nothing | PendingSequence::StringEnd | PendingSequence::Sequence { .. } => {}
            }
        }
    }

    fn take(&mut self, byte: u8, now: Instant) {
        match std::mem::take(&mut self.held) {
            PendingSequence::Nothing => self.begin(byte, now),
            PendingSequence::Escape | PendingSequence::StringEnd => self.follow_escape(byte, now),
            PendingSequence::Sequence { introducer, .. } if byte == ESCAPE => {
                if introducer == b'_' {
                    self.meaning.end_command(&std::mem::take(&mut self.command));
                }
                self.begin(byte, now);
                if b"]P_X^".contains(&introducer) {
                    self.held = PendingSequence::StringEnd;
                }
            }
            PendingSequence::Sequence { bytes: 2, introducer, .. } if is_key_behind(introducer, byte) => {
                self.give_up();
                self.press_escape();
                self.replay(&[introducer]);
                self.begin(byte, now);
            }
            PendingSequence::Sequence { begin, bytes, introducer } => {
                if introducer == b'_' {
                    self.command.push(byte);
                }
                self.go_on(byte, (begin, bytes + 1, introducer), now);
            }
            PendingSequence::Doubtful(bytes) => self.follow_doubt(bytes, byte, now),
            PendingSequence::Paste(mut paste) => {
                if paste.takes_last(byte, now) {
                    self.meaning.found.push(DecodedInput::Paste);
                } else {
                    self.held = PendingSequence::Paste(paste);
                }
            }
        }
    }

    fn begin(&mut self, byte: u8, now: Instant) {
        let escaped = self.escaped.take().filter(|escaped| now < *escaped + REGRET);
        match byte {
            ESCAPE => {
                self.meaning.forget();
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

    fn follow_escape(&mut self, byte: u8, now: Instant) {
        match byte {
            ESCAPE => {
                self.press_escape();
                self.held = PendingSequence::Escape;
            }
            // No terminal sends a sequence that goes on like this.
            byte if !INTRODUCERS.contains(&byte) => {
                self.give_up();
                self.press_escape();
                self.begin(byte, now);
            }
            _ => self.go_on(byte, (now, 2, byte), now),
        }
    }

    /// The next byte of a sequence that began then, has so many bytes with this one, and has this introducer.
    fn go_on(&mut self, byte: u8, (begin, bytes, introducer): (Instant, usize, u8), now: Instant) {
        self.meaning.has_ended = false;
        self.parser.advance(&mut self.meaning, &[byte]);
        if std::mem::take(&mut self.meaning.is_paste) {
            self.held = PendingSequence::Paste(Paste::new(now));
        } else if bytes >= MOST_BYTES {
            self.give_up();
        } else if !self.meaning.has_ended {
            self.held = PendingSequence::Sequence { begin, bytes, introducer };
        }
    }

    fn follow_doubt(&mut self, mut bytes: Vec<u8>, byte: u8, now: Instant) {
        let before = self.meaning.found.len();
        if (0x20..0x7f).contains(&byte) {
            self.go_on(byte, (now, bytes.len(), b'['), now);
        }
        let is_known = self.meaning.found.len() > before || matches!(self.held, PendingSequence::Paste(_));
        if is_known {
            return;
        }
        let is_middle = matches!(byte, b' '..=b'?') && bytes.len() < LONGEST_ANSWER;
        if is_middle {
            bytes.push(byte);
            self.held = PendingSequence::Doubtful(bytes);
        } else {
            self.give_up();
            self.replay(&bytes);
            self.begin(byte, now);
        }
    }

    /// Forgets what began.
    fn give_up(&mut self) -> PendingSequence {
        self.meaning.forget();
        self.command.clear();
        self.parser = vte::Parser::default();
        std::mem::take(&mut self.held)
    }

    fn replay(&mut self, bytes: &[u8]) {
        self.parser.advance(&mut self.meaning, bytes);
    }

    fn press_escape(&mut self) {
        self.meaning.found.push(DecodedInput::Key(KeyPress::special(KeyCode::Esc)));
    }
}

/// Whether a byte right behind these two is a key, as are they: it does not continue any sequence that a terminal sends.
fn is_key_behind(introducer: u8, byte: u8) -> bool {
    match introducer {
        // rxvt has `a` to `d` for shifted arrows; `n` and `t` end reports.
        b'[' => matches!(byte, b'e'..=b'm' | b'o'..=b's' | b'u'..=b'~'),
        b']' => !byte.is_ascii_digit() && byte != ESCAPE,
        b'P' => byte.is_ascii_lowercase(),
        _ => false,
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
