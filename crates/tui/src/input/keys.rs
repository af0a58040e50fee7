//! Sequences as keys and answers (ECMA-48; xterm, "ctlseqs").

use crossterm::event::{KeyCode, KeyModifiers};
use vte::{Params, Perform};

use super::control_strings::{self, ControlString};
use super::decoded::DecodedInput;
use crate::event::{KeyPress, Mouse, MouseKind};
use crate::graphics::Protocol;
use crate::terminal_replies::TerminalReply;

/// The parser's callbacks; holds the meaning of what was read last.
#[derive(Debug, Default)]
pub(super) struct KeyParser {
    /// Decoded input, in order.
    pub found: Vec<DecodedInput>,
    /// Whether a sequence has ended, known or not.
    pub has_ended: bool,
    /// Whether text began to be pasted.
    pub is_paste: bool,
    next: NextCharacter,
    report: ControlString,
}

/// Kind of the next character.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum NextCharacter {
    #[default]
    Character,
    /// The end of a key that began with SS3 (`ESC O`): arrows of some terminals, F1 to F4.
    SingleShift,
    /// The end of a function key of the Linux console (`ESC [ [`).
    Console,
    /// One of so many bytes of a report of the mouse in its oldest form.
    Mouse(u8),
}

impl KeyParser {
    /// Drops the sequence that has begun.
    pub(super) fn forget(&mut self) {
        self.next = NextCharacter::Character;
        self.is_paste = false;
    }

    fn key(&mut self, code: KeyCode, modifiers: KeyModifiers) {
        self.found.push(DecodedInput::Key(KeyPress { code, modifiers }));
    }

    /// An application program command has ended.
    pub(super) fn end_command(&mut self, text: &[u8]) {
        self.answer(control_strings::application(text));
    }

    /// A report in SGR form (mode 1006): the button with bits for what else is, and the cell from 1.
    fn mouse(&mut self, code: u16, (column, row): (u16, u16), is_pressed: bool) {
        const MODIFIERS: u16 = 4 | 8 | 16;
        let kind = match (code & !MODIFIERS, is_pressed) {
            (0, true) => MouseKind::Press,
            (0 | 32, false) => MouseKind::Release,
            (32, true) => MouseKind::Drag,
            (64, true) => MouseKind::WheelUp,
            (65, true) => MouseKind::WheelDown,
            // Other buttons.
            _ => return self.answer(TerminalReply::Other),
        };
        let (column, row) = (column.saturating_sub(1), row.saturating_sub(1));
        self.found.push(DecodedInput::Mouse(Mouse { kind, column, row }));
    }

    fn answer(&mut self, answer: TerminalReply) {
        self.found.push(DecodedInput::TerminalReply(answer));
    }
}

impl Perform for KeyParser {
    fn print(&mut self, character: char) {
        self.has_ended = true;
        match std::mem::take(&mut self.next) {
            NextCharacter::Character => {
                let key = match character {
                    '\x7f' => KeyCode::Backspace,
                    character => KeyCode::Char(character),
                };
                self.key(key, KeyModifiers::NONE);
            }
            NextCharacter::SingleShift => {
                if let Some(code) = letter_key(character) {
                    self.key(code, KeyModifiers::NONE);
                }
            }
            NextCharacter::Console => {
                if let Some(number @ 1..=5) = u8::try_from(character).ok().and_then(|it| it.checked_sub(b'@'))
                {
                    self.key(KeyCode::F(number), KeyModifiers::NONE);
                }
            }
            NextCharacter::Mouse(left) => {
                if left > 1 {
                    self.next = NextCharacter::Mouse(left - 1);
                    self.has_ended = false;
                }
            }
        }
    }

    fn execute(&mut self, byte: u8) {
        self.next = NextCharacter::Character;
        match byte {
            b'\r' => self.key(KeyCode::Enter, KeyModifiers::NONE),
            b'\t' => self.key(KeyCode::Tab, KeyModifiers::NONE),
            0 => self.key(KeyCode::Char(' '), KeyModifiers::CONTROL),
            1..=0x1a => self.key(KeyCode::Char(char::from(byte - 1 + b'a')), KeyModifiers::CONTROL),
            0x1c..=0x1f => self.key(KeyCode::Char(char::from(byte - 0x1c + b'4')), KeyModifiers::CONTROL),
            _ => {}
        }
    }

    fn esc_dispatch(&mut self, intermediates: &[u8], _ignore: bool, byte: u8) {
        match byte {
            b'O' if intermediates.is_empty() => {
                self.next = NextCharacter::SingleShift;
                return;
            }
            // The end of a string, or an unknown one.
            _ => {}
        }
        self.has_ended = true;
    }

    fn csi_dispatch(&mut self, params: &Params, intermediates: &[u8], _ignore: bool, action: char) {
        let number = |index: usize| params.iter().nth(index).and_then(|it| it.first().copied()).unwrap_or(0);
        let (first, second) = (number(0), number(1));
        self.has_ended = true;
        match (intermediates, action) {
            ([], 'n') if first == 0 => self.answer(TerminalReply::Ready),
            (b"<", 'M' | 'm') => self.mouse(first, (second, number(2)), action == 'M'),
            (b"?", 'c') => {
                if params.iter().any(|param| param == [4]) {
                    self.answer(TerminalReply::Images(Protocol::Sixel));
                }
                self.answer(TerminalReply::Attributes);
            }
            (b"?$", 'y') if first == 2026 => {
                // 1: set, 2: reset; others: not known, or it cannot be changed.
                self.answer(TerminalReply::Synchronized { is_known: matches!(second, 1 | 2) });
            }
            ([], '~') if first == 200 => self.is_paste = true,
            // A paste that was over before its end came.
            ([], '~') if first == 201 => {}
            ([], '~') => {
                if let Some(code) = numbered_key(first) {
                    self.key(code, modifiers(second));
                }
            }
            ([], 'Z') => self.key(KeyCode::BackTab, KeyModifiers::SHIFT),
            ([], '[') => {
                self.next = NextCharacter::Console;
                self.has_ended = false;
            }
            ([], 'M') if params.len() <= 1 && first == 0 => {
                self.next = NextCharacter::Mouse(3);
                self.has_ended = false;
            }
            // With two numbers it is where the cursor is, not F3.
            ([], 'R') if params.len() > 1 => self.answer(TerminalReply::Other),
            ([], 'I' | 'O') => self.answer(TerminalReply::Focus { is_here: action == 'I' }),
            // The window's size.
            ([], 't') => self.answer(TerminalReply::Other),
            ([], letter) => {
                if let Some(code) = letter_key(letter) {
                    self.key(code, modifiers(second));
                }
            }
            _ => self.answer(TerminalReply::Other),
        }
    }

    fn osc_dispatch(&mut self, params: &[&[u8]], _bell_terminated: bool) {
        self.has_ended = true;
        self.answer(control_strings::command(params));
    }

    fn hook(&mut self, params: &Params, intermediates: &[u8], _ignore: bool, action: char) {
        let first = params.iter().next().and_then(|it| it.first().copied()).unwrap_or(0);
        self.report = ControlString::begin(intermediates, first, action);
    }

    fn put(&mut self, byte: u8) {
        self.report.put(byte);
    }

    fn unhook(&mut self) {
        self.has_ended = true;
        let answer = std::mem::take(&mut self.report).answer();
        self.answer(answer);
    }
}

fn letter_key(letter: char) -> Option<KeyCode> {
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

fn numbered_key(number: u16) -> Option<KeyCode> {
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

/// xterm's number: one more than shift 1, alt 2, ctrl 4, super 8.
fn modifiers(number: u16) -> KeyModifiers {
    let bits = number.saturating_sub(1);
    [(1, KeyModifiers::SHIFT), (2, KeyModifiers::ALT), (4, KeyModifiers::CONTROL), (8, KeyModifiers::SUPER)]
        .into_iter()
        .filter(|(bit, _)| bits & bit != 0)
        .fold(KeyModifiers::NONE, |all, (_, modifier)| all | modifier)
}
