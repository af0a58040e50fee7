//! The picture on the screen, and the pictures before it.

use crate::history::{History, ShownImage};
use crate::pipeline::protocol::Spot;

/// The picture on the screen, and how it is looked at.
#[derive(Default)]
pub(crate) struct PictureState {
    pub shown: Option<ShownImage>,
    pub history: History,
    /// Place around which the image is shown pixel by pixel. `None` if all of the image is shown.
    pub close_up: Option<Spot>,
    /// Whether the picture has the screen for itself.
    pub is_alone: bool,
}
