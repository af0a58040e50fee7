//! State of the mouse, the crosshair and the inspected object.

use crate::event::FileLineColumn;
use crate::pipeline::protocol::NormalizedPosition;

/// A left button press on the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HeldMousePress {
    /// Current column of the mouse.
    pub column: u16,
    /// Current row of the mouse.
    pub row: u16,
    pub has_moved: bool,
    /// Image position where the press started.
    pub from: Option<NormalizedPosition>,
}

/// Purpose of a pick query.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum PickPurpose {
    #[default]
    Inspect,
    Focus,
}

/// State of the mouse, the crosshair and the inspected object.
pub(crate) struct PointerState {
    pub is_mouse_on: bool,
    pub press: Option<HeldMousePress>,
    /// Whether the next click sets the focus.
    pub is_focusing: bool,
    /// Whether the next drag selects the region to render first.
    pub is_marking: bool,
    /// Position of the last click. Initially the image center.
    pub crosshair: NormalizedPosition,
    /// Purpose of the last pick query.
    pub purpose: PickPurpose,
    /// Information about the inspected object, until a key is pressed.
    pub facts: Option<Vec<String>>,
    /// Values inspected by the last click, on one line.
    pub clicked: Option<String>,
    /// Where the inspected object is defined in the scene file.
    pub picked: Option<FileLineColumn>,
}

impl PointerState {
    pub(super) const fn new() -> Self {
        Self {
            is_mouse_on: true,
            press: None,
            is_focusing: false,
            is_marking: false,
            crosshair: NormalizedPosition { x: 0.5, y: 0.5 },
            purpose: PickPurpose::Inspect,
            facts: None,
            clicked: None,
            picked: None,
        }
    }
}
