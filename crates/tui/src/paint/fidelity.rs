//! The precision that a picture is drawn with.

/// Precision with which cells show the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// The first picture of a request, to be refined soon: at most 12 bytes a cell.
    First,
    /// A picture of the same request that better ones will follow.
    Moving,
    /// The same on a terminal that can follow the render: every color.
    Following,
    /// A picture that stays: every color to 1/255.
    Still,
}
