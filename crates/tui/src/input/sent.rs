//! Decoded input of the terminal.

use crate::event::{Event, KeyPress, Mouse};
use crate::known::Answer;

/// One thing that the terminal sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Input {
    Key(KeyPress),
    Mouse(Mouse),
    /// Text was pasted; what it was is not kept.
    Paste,
    Answer(Answer),
}

impl From<Input> for Event {
    fn from(input: Input) -> Self {
        match input {
            Input::Key(key) => Self::Key(key),
            Input::Mouse(mouse) => Self::Mouse(mouse),
            Input::Paste => Self::Paste,
            Input::Answer(answer) => Self::Answer(answer),
        }
    }
}
