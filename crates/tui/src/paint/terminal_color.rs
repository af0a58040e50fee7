//! Cell colors as terminals store them.

use ratatui::style::Color;

use crate::color::fixed_palette_color;

/// A terminal color.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TerminalColor {
    /// The default background.
    DefaultBackground,
    /// The default foreground.
    DefaultForeground,
    /// A palette entry. The user can change the first 16. The others are the color cube and the grays.
    Palette(u8),
    /// An sRGB color.
    Rgb([u8; 3]),
}

/// A cell's two color layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorLayer {
    Foreground,
    Background,
}

impl TerminalColor {
    /// Converts a ratatui color to a terminal color for this layer.
    pub(super) fn from_ratatui(color: Color, layer: ColorLayer) -> Self {
        match color {
            Color::Reset => match layer {
                ColorLayer::Foreground => Self::DefaultForeground,
                ColorLayer::Background => Self::DefaultBackground,
            },
            Color::Black => Self::Palette(0),
            Color::Red => Self::Palette(1),
            Color::Green => Self::Palette(2),
            Color::Yellow => Self::Palette(3),
            Color::Blue => Self::Palette(4),
            Color::Magenta => Self::Palette(5),
            Color::Cyan => Self::Palette(6),
            Color::Gray => Self::Palette(7),
            Color::DarkGray => Self::Palette(8),
            Color::LightRed => Self::Palette(9),
            Color::LightGreen => Self::Palette(10),
            Color::LightYellow => Self::Palette(11),
            Color::LightBlue => Self::Palette(12),
            Color::LightMagenta => Self::Palette(13),
            Color::LightCyan => Self::Palette(14),
            Color::White => Self::Palette(15),
            Color::Indexed(index) => Self::Palette(index),
            Color::Rgb(r, g, b) => Self::Rgb([r, g, b]),
        }
    }

    /// Whether the color can be used in this layer.
    pub(super) fn is_allowed_in_layer(self, layer: ColorLayer) -> bool {
        match self {
            Self::DefaultBackground => layer == ColorLayer::Background,
            Self::DefaultForeground => layer == ColorLayer::Foreground,
            Self::Palette(_) | Self::Rgb(_) => true,
        }
    }

    /// A unique number for each color.
    pub(super) fn unique_number(self) -> u32 {
        match self {
            Self::DefaultBackground => 1 << 24,
            Self::DefaultForeground => 2 << 24,
            Self::Palette(index) => 3 << 24 | u32::from(index),
            Self::Rgb([r, g, b]) => u32::from_be_bytes([0, r, g, b]),
        }
    }

    /// The sRGB value, if known.
    pub(super) fn to_rgb(self) -> Option<[u8; 3]> {
        match self {
            Self::Rgb(rgb) => Some(rgb),
            Self::Palette(index) => fixed_palette_color(index),
            Self::DefaultBackground | Self::DefaultForeground => None,
        }
    }

    /// Appends the SGR parameters that set the color, which must be allowed in the layer.
    pub(super) fn push_sgr(self, layer: ColorLayer, out: &mut Vec<u8>) {
        let base = match layer {
            ColorLayer::Foreground => 30,
            ColorLayer::Background => 40,
        };
        match self {
            Self::DefaultBackground | Self::DefaultForeground => push_number(base + 9, out),
            Self::Palette(index @ 0..8) => push_number(base + u16::from(index), out),
            Self::Palette(index @ 8..16) => push_number(base + 52 + u16::from(index), out),
            Self::Palette(index) => push_semicolon_list(&[base + 8, 5, u16::from(index)], out),
            Self::Rgb([r, g, b]) => {
                push_semicolon_list(&[base + 8, 2, u16::from(r), u16::from(g), u16::from(b)], out);
            }
        }
    }

    /// Number of bytes that [`TerminalColor::push_sgr`] appends.
    pub(super) fn sgr_length(self) -> u32 {
        match self {
            Self::DefaultBackground | Self::DefaultForeground | Self::Palette(0..8) => 2,
            // Upper bound for 90 to 97 or 100 to 107, since the layer is not known here.
            Self::Palette(8..16) => 3,
            Self::Palette(index) => 5 + decimal_digit_count(index),
            Self::Rgb(rgb) => 7 + rgb.map(decimal_digit_count).iter().sum::<u32>(),
        }
    }
}

/// Number of decimal digits in `number`.
pub(super) fn decimal_digit_count(number: u8) -> u32 {
    1 + u32::from(number > 9) + u32::from(number > 99)
}

/// Appends a decimal number.
pub(super) fn push_number(number: u16, out: &mut Vec<u8>) {
    if number > 9 {
        push_number(number / 10, out);
    }
    out.push(b'0' + (number % 10) as u8);
}

/// Appends numbers separated by semicolons.
fn push_semicolon_list(numbers: &[u16], out: &mut Vec<u8>) {
    for (i, number) in numbers.iter().enumerate() {
        if i > 0 {
            out.push(b';');
        }
        push_number(*number, out);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(shade: TerminalColor, layer: ColorLayer) -> String {
        let mut out = Vec::new();
        shade.push_sgr(layer, &mut out);
        String::from_utf8(out).expect("ASCII")
    }

    #[test]
    fn sgr_parameters_match_ecma_48_and_xterm() {
        use ColorLayer::{Background, Foreground};
        assert_eq!(text(TerminalColor::DefaultForeground, Foreground), "39");
        assert_eq!(text(TerminalColor::DefaultBackground, Background), "49");
        assert_eq!(text(TerminalColor::Palette(3), Foreground), "33");
        assert_eq!(text(TerminalColor::Palette(3), Background), "43");
        assert_eq!(text(TerminalColor::Palette(8), Foreground), "90");
        assert_eq!(text(TerminalColor::Palette(15), Background), "107");
        assert_eq!(text(TerminalColor::Palette(16), Foreground), "38;5;16");
        assert_eq!(text(TerminalColor::Rgb([1, 23, 255]), Background), "48;2;1;23;255");
    }

    #[test]
    fn length_matches_the_written_parameters() {
        for shade in (16..=255)
            .map(TerminalColor::Palette)
            .chain([TerminalColor::Rgb([0, 10, 100]), TerminalColor::Rgb([9, 99, 255])])
        {
            assert_eq!(text(shade, ColorLayer::Foreground).len(), shade.sgr_length() as usize, "{shade:?}");
        }
    }

    #[test]
    fn fixed_colors_match_xterm() {
        assert_eq!(TerminalColor::Palette(16).to_rgb(), Some([0, 0, 0]));
        assert_eq!(TerminalColor::Palette(67).to_rgb(), Some([95, 135, 175]));
        assert_eq!(TerminalColor::Palette(231).to_rgb(), Some([255, 255, 255]));
        assert_eq!(TerminalColor::Palette(255).to_rgb(), Some([238, 238, 238]));
        assert_eq!(TerminalColor::Palette(15).to_rgb(), None);
    }
}
