//! Kinds of previews, depending on the user's choice and the terminal.

use super::color::ColorDepth;
use super::graphics::Protocol;
use super::mosaic::Grid;
use super::options::PreviewChoice;
use super::pixel_request::PixelRequest;

/// How the preview is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PreviewKind {
    HalfBlock,
    Quadrant,
    Sextant,
    Octant,
    Ascii,
    /// Pixels, or half blocks while text covers it.
    Pixels(Protocol),
    None,
}

impl PreviewKind {
    /// The kind for a choice and color depth.
    pub(super) fn of(choice: PreviewChoice, depth: ColorDepth) -> Self {
        match choice {
            PreviewChoice::None => Self::None,
            // Half blocks need colors.
            PreviewChoice::Ascii => Self::Ascii,
            PreviewChoice::Kitty => Self::Pixels(Protocol::Kitty),
            PreviewChoice::Sixel => Self::Pixels(Protocol::Sixel),
            PreviewChoice::Iterm2 => Self::Pixels(Protocol::Iterm),
            _ if depth == ColorDepth::None => Self::Ascii,
            PreviewChoice::Auto | PreviewChoice::HalfBlock => Self::HalfBlock,
            PreviewChoice::Quadrant => Self::Quadrant,
            PreviewChoice::Sextant => Self::Sextant,
            PreviewChoice::Octant => Self::Octant,
        }
    }

    /// The kind to start with: pixels only if support is known.
    pub(super) fn initial(choice: PreviewChoice, depth: ColorDepth, pixels: Option<PixelRequest>) -> Self {
        match (Self::of(choice, depth), pixels) {
            (Self::Pixels(_), Some(request)) if !request.is_known => {
                Self::of(PreviewChoice::HalfBlock, depth)
            }
            (kind, _) => kind,
        }
    }

    /// The grid of parts of a cell. `None` if cells have no parts.
    pub(super) fn grid(self) -> Option<Grid> {
        match self {
            Self::HalfBlock => Some(Grid::Halves),
            Self::Quadrant => Some(Grid::Quadrants),
            Self::Sextant => Some(Grid::Sextants),
            Self::Octant => Some(Grid::Octants),
            Self::Ascii | Self::Pixels(_) | Self::None => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn preview_without_colors_is_a_ramp() {
        assert_eq!(PreviewKind::of(PreviewChoice::Auto, ColorDepth::None), PreviewKind::Ascii);
        assert_eq!(PreviewKind::of(PreviewChoice::HalfBlock, ColorDepth::None), PreviewKind::Ascii);
        assert_eq!(PreviewKind::of(PreviewChoice::Auto, ColorDepth::Ansi16), PreviewKind::HalfBlock);
        assert_eq!(PreviewKind::of(PreviewChoice::None, ColorDepth::TrueColor), PreviewKind::None);
    }
}
