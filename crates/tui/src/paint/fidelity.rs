//! Precision of drawn previews.

/// Precision with which the preview is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PreviewFidelity {
    /// A request's first preview, which will be refined soon. Uses at most 12 bytes per cell.
    First,
    /// A later preview that will still be refined.
    Moving,
    /// Like `Moving`, but with exact colors. For terminals fast enough to follow the render.
    Following,
    /// A final preview. Colors are accurate to 1/255.
    Still,
}
