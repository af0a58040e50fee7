//! Precision of a drawn preview.

/// Precision with which cells show the preview.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// The first preview of a request, soon refined: at most 12 bytes per cell.
    First,
    /// A later preview that will still be refined.
    Moving,
    /// Like `Moving`, but with exact colors, for terminals fast enough to follow the render.
    Following,
    /// A final preview: colors exact to 1/255.
    Still,
}
