//! The mouse, and the place of the picture that is picked.

use crate::event::FilePosition;
use crate::pipeline::protocol::Spot;

/// A press of the left button on the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Press {
    /// Column of the mouse when it last moved.
    pub column: u16,
    /// Row of the mouse when it last moved.
    pub row: u16,
    pub has_moved: bool,
    /// Place of the picture at which the press began.
    pub from: Option<Spot>,
}

/// Purpose of a question about a place of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum PickPurpose {
    #[default]
    Inspect,
    Focus,
}

/// The mouse, the crosshair, and the object there.
pub(crate) struct SelectionState {
    pub is_mouse_on: bool,
    pub press: Option<Press>,
    /// Whether the next click sets the focus.
    pub is_focusing: bool,
    /// Whether the next drag marks the section to render first.
    pub is_marking: bool,
    /// Place of the last click, else the middle of the picture.
    pub crosshair: Spot,
    /// Purpose of the last question about a place.
    pub purpose: PickPurpose,
    /// Facts about the picked object, until the next key.
    pub facts: Option<Vec<String>>,
    /// Text of the last click, in one line.
    pub clicked: Option<String>,
    /// Place of the picked object in the scene file.
    pub picked: Option<FilePosition>,
}

impl SelectionState {
    pub(super) const fn new() -> Self {
        Self {
            is_mouse_on: true,
            press: None,
            is_focusing: false,
            is_marking: false,
            crosshair: Spot { x: 0.5, y: 0.5 },
            purpose: PickPurpose::Inspect,
            facts: None,
            clicked: None,
            picked: None,
        }
    }
}
