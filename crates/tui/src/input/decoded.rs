//! Decoded input of the terminal.

use crate::event::{Event, KeyPress, Mouse};
use crate::terminal_replies::TerminalReply;

/// One thing that the terminal sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DecodedInput {
    Key(KeyPress),
    Mouse(Mouse),
    /// Text was pasted; what it was is not kept.
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
