//! The displayed image and the history.

use crate::history::{History, ShownImage};
use crate::pipeline::protocol::ImagePosition;

/// The displayed image, and how it is shown.
#[derive(Default)]
pub(crate) struct PictureState {
    pub shown: Option<ShownImage>,
    pub history: History,
    /// Center of the section that is shown at actual pixels. `None` if the whole image is shown.
    pub close_up: Option<ImagePosition>,
    /// Whether everything but the image is hidden.
    pub is_alone: bool,
}
