//! Decoded terminal input.

use crate::event::{Event, KeyPress, MouseEvent};
use crate::terminal_replies::TerminalReply;

/// Input from the terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DecodedInput {
    Key(KeyPress),
    Mouse(MouseEvent),
    /// Pasted text. Its content is discarded.
    Paste,
    TerminalReply(TerminalReply),
}

impl From<DecodedInput> for Event {
    fn from(input: DecodedInput) -> Self {
        match input {
            DecodedInput::Key(key) => Self::Key(key),
            DecodedInput::Mouse(mouse) => Self::Mouse(mouse),
            DecodedInput::Paste => Self::Paste,
            DecodedInput::TerminalReply(answer) => Self::TerminalReply(answer),
        }
    }
}
