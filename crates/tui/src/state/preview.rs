//! The displayed image and the history.

use crate::history::RenderHistory;
use crate::pipeline::protocol::{NormalizedPosition, PreviewUpdate};

/// The displayed image, and how it is shown.
#[derive(Default)]
pub(crate) struct DisplayedImageState {
    pub shown: Option<PreviewUpdate>,
    pub history: RenderHistory,
    /// Center of the section shown at 1:1 scale, or `None` if the whole image is shown.
    pub close_up: Option<NormalizedPosition>,
    /// Whether everything but the image is hidden.
    pub is_image_only: bool,
}
