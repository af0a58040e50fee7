//! The image on the screen and the history.

use crate::history::{History, ShownImage};
use crate::pipeline::protocol::ImagePosition;

/// The image on the screen, and how it is shown.
#[derive(Default)]
pub(crate) struct PictureState {
    pub shown: Option<ShownImage>,
    pub history: History,
    /// Position around which the image is shown pixel by pixel. `None` if the whole image is shown.
    pub close_up: Option<ImagePosition>,
    /// Whether only the image is shown.
    pub is_alone: bool,
}
