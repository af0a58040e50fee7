//! The mouse, the crosshair, and the inspected object.

use crate::event::FilePosition;
use crate::pipeline::protocol::ImagePosition;

/// A press of the left button on the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Press {
    /// Last column of the mouse.
    pub column: u16,
    /// Last row of the mouse.
    pub row: u16,
    pub has_moved: bool,
    /// Position in the image at which the press started.
    pub from: Option<ImagePosition>,
}

/// Purpose of a pick query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum PickPurpose {
    #[default]
    Inspect,
    Focus,
}

/// The mouse, the crosshair, and the inspected object.
pub(crate) struct SelectionState {
    pub is_mouse_on: bool,
    pub press: Option<Press>,
    /// Whether the next click sets the focus.
    pub is_focusing: bool,
    /// Whether the next drag selects the region to render first.
    pub is_marking: bool,
    /// Position of the last click; initially the center of the image.
    pub crosshair: ImagePosition,
    /// Purpose of the last pick query.
    pub purpose: PickPurpose,
    /// Facts about the inspected object, until the next key.
    pub facts: Option<Vec<String>>,
    /// Inspected values of the last click, in one line.
    pub clicked: Option<String>,
    /// Position of the inspected object in the scene file.
    pub picked: Option<FilePosition>,
}

impl SelectionState {
    pub(super) const fn new() -> Self {
        Self {
            is_mouse_on: true,
            press: None,
            is_focusing: false,
            is_marking: false,
            crosshair: ImagePosition { x: 0.5, y: 0.5 },
            purpose: PickPurpose::Inspect,
            facts: None,
            clicked: None,
            picked: None,
        }
    }
}
