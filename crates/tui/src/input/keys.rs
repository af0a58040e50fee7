//! Converts control sequences to keys and replies (ECMA-48; xterm, "ctlseqs").

use crossterm::event::{KeyCode, KeyModifiers};
use vte::{Params, Perform};

use super::control_strings::{self, DeviceControlString};
use super::decoded::DecodedInput;
use crate::event::{KeyPress, MouseEvent, MouseEventKind};
use crate::graphics::ImageProtocol;
use crate::terminal_replies::TerminalReply;

/// Parser callbacks that collect the decoded input.
#[derive(Debug, Default)]
pub(super) struct DecodedInputCollector {
    /// Decoded input, in order.
    pub found: Vec<DecodedInput>,
    /// Whether a sequence, recognized or not, has ended.
    pub has_ended: bool,
    /// Whether a paste has started.
    pub is_paste: bool,
    next: NextCharacterMode,
    report: DeviceControlString,
}

/// How to interpret the next input character.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum NextCharacterMode {
    #[default]
    Character,
    /// Last byte of an SS3 key (`ESC O`): F1 to F4, and arrows on some terminals.
    SingleShift,
    /// Last byte of a Linux console function key (`ESC [ [`).
    Console,
    /// Number of bytes remaining in a mouse report in the original format.
    Mouse(u8),
}

impl DecodedInputCollector {
    /// Drops the current sequence.
    pub(super) fn drop_current_sequence(&mut self) {
        self.next = NextCharacterMode::Character;
        self.is_paste = false;
    }

    fn push_decoded_key(&mut self, code: KeyCode, modifiers: KeyModifiers) {
        self.found.push(DecodedInput::Key(KeyPress { code, modifiers }));
    }

    /// Handles a complete application program command (APC).
    pub(super) fn handle_apc(&mut self, text: &[u8]) {
        self.push_decoded_reply(control_strings::parse_apc(text));
    }

    /// Handles a mouse report in SGR format (mode 1006). The report contains the button, its modifier bits
    /// and the cell, counted from 1.
    fn push_mouse(&mut self, code: u16, column: u16, row: u16, is_pressed: bool) {
        const MODIFIERS: u16 = 4 | 8 | 16;
        let kind = match (code & !MODIFIERS, is_pressed) {
            (0, true) => MouseEventKind::Press,
            (0 | 32, false) => MouseEventKind::Release,
            (32, true) => MouseEventKind::Drag,
            (64, true) => MouseEventKind::WheelUp,
            (65, true) => MouseEventKind::WheelDown,
            // Other buttons are ignored.
            _ => return self.push_decoded_reply(TerminalReply::Other),
        };
        let (column, row) = (column.saturating_sub(1), row.saturating_sub(1));
        self.found.push(DecodedInput::Mouse(MouseEvent { kind, column, row }));
    }

    fn push_decoded_reply(&mut self, answer: TerminalReply) {
        self.found.push(DecodedInput::TerminalReply(answer));
    }
}

impl Perform for DecodedInputCollector {
    fn print(&mut self, character: char) {
        self.has_ended = true;
        match std::mem::take(&mut self.next) {
            NextCharacterMode::Character => {
                let key = match character {
                    '\x7f' => KeyCode::Backspace,
                    character => KeyCode::Char(character),
                };
                self.push_decoded_key(key, KeyModifiers::NONE);
            }
            NextCharacterMode::SingleShift => {
                if let Some(code) = key_for_final_byte(character) {
                    self.push_decoded_key(code, KeyModifiers::NONE);
                }
            }
            NextCharacterMode::Console => {
                if let Some(number @ 1..=5) = u8::try_from(character).ok().and_then(|it| it.checked_sub(b'@'))
                {
                    self.push_decoded_key(KeyCode::F(number), KeyModifiers::NONE);
                }
            }
            NextCharacterMode::Mouse(left) => {
                if left > 1 {
                    self.next = NextCharacterMode::Mouse(left - 1);
                    self.has_ended = false;
                }
            }
        }
    }

    fn execute(&mut self, byte: u8) {
        self.next = NextCharacterMode::Character;
        match byte {
            b'\r' => self.push_decoded_key(KeyCode::Enter, KeyModifiers::NONE),
            b'\t' => self.push_decoded_key(KeyCode::Tab, KeyModifiers::NONE),
            0 => self.push_decoded_key(KeyCode::Char(' '), KeyModifiers::CONTROL),
            1..=0x1a => {
                self.push_decoded_key(KeyCode::Char(char::from(byte - 1 + b'a')), KeyModifiers::CONTROL);
            }
            0x1c..=0x1f => {
                self.push_decoded_key(KeyCode::Char(char::from(byte - 0x1c + b'4')), KeyModifiers::CONTROL);
            }
            _ => {}
        }
    }

    fn esc_dispatch(&mut self, intermediates: &[u8], _ignore: bool, byte: u8) {
        match byte {
            b'O' if intermediates.is_empty() => {
                self.next = NextCharacterMode::SingleShift;
                return;
            }
            // A string terminator or an unknown sequence.
            _ => {}
        }
        self.has_ended = true;
    }

    fn csi_dispatch(&mut self, params: &Params, intermediates: &[u8], _ignore: bool, action: char) {
        let number = |index: usize| params.iter().nth(index).and_then(|it| it.first().copied()).unwrap_or(0);
        let (first, second) = (number(0), number(1));
        self.has_ended = true;
        match (intermediates, action) {
            ([], 'n') if first == 0 => self.push_decoded_reply(TerminalReply::Ready),
            (b"<", 'M' | 'm') => self.push_mouse(first, second, number(2), action == 'M'),
            (b"?", 'c') => {
                if params.iter().any(|param| param == [4]) {
                    self.push_decoded_reply(TerminalReply::Images(ImageProtocol::Sixel));
                }
                self.push_decoded_reply(TerminalReply::Attributes);
            }
            (b"?$", 'y') if first == 2026 => {
                // 1 means set and 2 means reset. Other values mean that the mode is unknown or permanent.
                self.push_decoded_reply(TerminalReply::Synchronized { is_known: matches!(second, 1 | 2) });
            }
            ([], '~') if first == 200 => self.is_paste = true,
            // The end marker of a paste that has already expired.
            ([], '~') if first == 201 => {}
            ([], '~') => {
                if let Some(code) = key_from_csi_number(first) {
                    self.push_decoded_key(code, decode_modifiers(second));
                }
            }
            ([], 'Z') => self.push_decoded_key(KeyCode::BackTab, KeyModifiers::SHIFT),
            ([], '[') => {
                self.next = NextCharacterMode::Console;
                self.has_ended = false;
            }
            ([], 'M') if params.len() <= 1 && first == 0 => {
                self.next = NextCharacterMode::Mouse(3);
                self.has_ended = false;
            }
            // With two parameters, this is a cursor position report rather than F3.
            ([], 'R') if params.len() > 1 => self.push_decoded_reply(TerminalReply::Other),
            ([], 'I' | 'O') => self.push_decoded_reply(TerminalReply::Focus { is_here: action == 'I' }),
            // A window size report.
            ([], 't') => self.push_decoded_reply(TerminalReply::Other),
            ([], letter) => {
                if let Some(code) = key_for_final_byte(letter) {
                    self.push_decoded_key(code, decode_modifiers(second));
                }
            }
            _ => self.push_decoded_reply(TerminalReply::Other),
        }
    }

    fn osc_dispatch(&mut self, params: &[&[u8]], _bell_terminated: bool) {
        self.has_ended = true;
        self.push_decoded_reply(control_strings::parse_osc(params));
    }

    fn hook(&mut self, params: &Params, intermediates: &[u8], _ignore: bool, action: char) {
        let first = params.iter().next().and_then(|it| it.first().copied()).unwrap_or(0);
        self.report = DeviceControlString::begin(intermediates, first, action);
    }

    fn put(&mut self, byte: u8) {
        self.report.push_byte(byte);
    }

    fn unhook(&mut self) {
        self.has_ended = true;
        let answer = std::mem::take(&mut self.report).parse_reply();
        self.push_decoded_reply(answer);
    }
}

/// Returns the key for a CSI or SS3 sequence that ends in `letter`.
fn key_for_final_byte(letter: char) -> Option<KeyCode> {
    Some(match letter {
        'A' => KeyCode::Up,
        'B' => KeyCode::Down,
        'C' => KeyCode::Right,
        'D' => KeyCode::Left,
        'F' => KeyCode::End,
        'H' => KeyCode::Home,
        'M' => KeyCode::Enter,
        'P' => KeyCode::F(1),
        'Q' => KeyCode::F(2),
        'R' => KeyCode::F(3),
        'S' => KeyCode::F(4),
        _ => return None,
    })
}

fn key_from_csi_number(number: u16) -> Option<KeyCode> {
    let function = |first: u16, key: u8| KeyCode::F(u8::try_from(number - first).map_or(key, |it| key + it));
    Some(match number {
        1 | 7 => KeyCode::Home,
        2 => KeyCode::Insert,
        3 => KeyCode::Delete,
        4 | 8 => KeyCode::End,
        5 => KeyCode::PageUp,
        6 => KeyCode::PageDown,
        11..=15 => function(11, 1),
        17..=21 => function(17, 6),
        23 | 24 => function(23, 11),
        _ => return None,
    })
}

/// Decodes xterm's modifier parameter: 1, plus 1 for shift, 2 for alt, 4 for ctrl, 8 for super.
fn decode_modifiers(number: u16) -> KeyModifiers {
    let bits = number.saturating_sub(1);
    [(1, KeyModifiers::SHIFT), (2, KeyModifiers::ALT), (4, KeyModifiers::CONTROL), (8, KeyModifiers::SUPER)]
        .into_iter()
        .filter(|(bit, _)| bits & bit != 0)
        .fold(KeyModifiers::NONE, |all, (_, modifier)| all | modifier)
}
