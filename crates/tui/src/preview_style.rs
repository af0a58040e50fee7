//! How the preview is drawn, as chosen by the user within the terminal's limits.

use super::color::ColorDepth;
use super::graphics::ImageProtocol;
use super::mosaic::CellGrid;
use super::options::PreviewChoice;
use super::pixel_request::UnconfirmedImageProtocol;

/// How the preview is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PreviewStyle {
    HalfBlock,
    Quadrant,
    Sextant,
    Octant,
    Ascii,
    /// Pixels, or half blocks while the preview is covered by text.
    Pixels(ImageProtocol),
    None,
}

impl PreviewStyle {
    /// Determines the preview style from the user's choice and the color depth.
    pub(super) fn from_choice(choice: PreviewChoice, depth: ColorDepth) -> Self {
        match choice {
            PreviewChoice::None => Self::None,
            PreviewChoice::Ascii => Self::Ascii,
            PreviewChoice::Kitty => Self::Pixels(ImageProtocol::Kitty),
            PreviewChoice::Sixel => Self::Pixels(ImageProtocol::Sixel),
            PreviewChoice::Iterm2 => Self::Pixels(ImageProtocol::Iterm),
            // Block characters require colors.
            _ if depth == ColorDepth::None => Self::Ascii,
            PreviewChoice::Auto | PreviewChoice::HalfBlock => Self::HalfBlock,
            PreviewChoice::Quadrant => Self::Quadrant,
            PreviewChoice::Sextant => Self::Sextant,
            PreviewChoice::Octant => Self::Octant,
        }
    }

    /// The initial preview style. Pixels are used only if the terminal is known to support them.
    pub(super) fn initial(
        choice: PreviewChoice,
        depth: ColorDepth,
        pixels: Option<UnconfirmedImageProtocol>,
    ) -> Self {
        match (Self::from_choice(choice, depth), pixels) {
            (Self::Pixels(_), Some(request)) if !request.is_known => {
                Self::from_choice(PreviewChoice::HalfBlock, depth)
            }
            (kind, _) => kind,
        }
    }

    /// The grid that divides a cell into parts, or `None` if cells are not divided.
    pub(super) fn grid(self) -> Option<CellGrid> {
        match self {
            Self::HalfBlock => Some(CellGrid::Halves),
            Self::Quadrant => Some(CellGrid::Quadrants),
            Self::Sextant => Some(CellGrid::Sextants),
            Self::Octant => Some(CellGrid::Octants),
            Self::Ascii | Self::Pixels(_) | Self::None => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn preview_without_colors_uses_ascii() {
        assert_eq!(PreviewStyle::from_choice(PreviewChoice::Auto, ColorDepth::None), PreviewStyle::Ascii);
        assert_eq!(
            PreviewStyle::from_choice(PreviewChoice::HalfBlock, ColorDepth::None),
            PreviewStyle::Ascii
        );
        assert_eq!(
            PreviewStyle::from_choice(PreviewChoice::Auto, ColorDepth::Ansi16),
            PreviewStyle::HalfBlock
        );
        assert_eq!(PreviewStyle::from_choice(PreviewChoice::None, ColorDepth::TrueColor), PreviewStyle::None);
    }
}
