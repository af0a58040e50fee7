//! Cost model for trading output bytes against color error.

use super::terminal_color::TerminalColor;

/// Relative weight of bytes and color error. The error of half a cell is the sum of its squared channel
/// differences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RateDistortionParameters {
    /// Color error that is acceptable for each byte saved.
    pub(super) byte: f32,
    /// Maximum color difference per channel.
    pub(super) most: u8,
    /// Half-widths of the ranges within which neighboring colors may be merged. Each range gets its own
    /// candidate colors.
    pub(super) spans: &'static [u8],
}

impl RateDistortionParameters {
    /// Cost model for colors accurate to 1/255 per channel.
    pub(super) const EXACT: Self = Self { byte: 64.0, most: 1, spans: &[1] };

    /// Cost model for exact colors.
    pub(super) const ALL: Self = Self { byte: 64.0, most: 0, spans: &[0] };

    /// Cost model for intermediate previews. An error of 14/255 in every channel of half a cell costs about
    /// as much as a color change.
    pub(super) const MOVING: Self = Self { byte: 32.0, most: 255, spans: &[1, 4, 9] };

    /// Returns the model with its cost per byte changed to `byte`, but never below
    /// [`RateDistortionParameters::MOVING`].
    pub(super) fn with_cost_per_byte(self, byte: f32) -> Self {
        let byte = byte.max(Self::MOVING.byte);
        let spans: &[u8] = match byte {
            ..40.0 => Self::MOVING.spans,
            40.0..100.0 => &[3, 8, 16],
            100.0..400.0 => &[6, 14, 28],
            _ => &[12, 28, 60],
        };
        Self { byte, spans, ..self }
    }

    /// Returns the error from showing one color instead of another, or infinity if that is not allowed.
    pub(super) fn squared_color_error(self, shown: TerminalColor, wanted: TerminalColor) -> f32 {
        if shown == wanted {
            return 0.0;
        }
        let (Some(shown), Some(wanted)) = (shown.to_rgb(), wanted.to_rgb()) else { return f32::INFINITY };
        let apart: [u8; 3] = std::array::from_fn(|i| shown[i].abs_diff(wanted[i]));
        if apart.iter().any(|apart| *apart > self.most) {
            return f32::INFINITY;
        }
        apart.iter().map(|apart| f32::from(*apart) * f32::from(*apart)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_is_a_bounded_sum_of_squares() {
        let (a, b) = (TerminalColor::Rgb([10, 20, 30]), TerminalColor::Rgb([11, 20, 32]));
        assert_eq!(RateDistortionParameters::MOVING.squared_color_error(a, b), 5.0);
        assert_eq!(RateDistortionParameters::EXACT.squared_color_error(a, b), f32::INFINITY);
        assert_eq!(
            RateDistortionParameters::EXACT.squared_color_error(a, TerminalColor::Rgb([9, 21, 30])),
            2.0
        );
        assert_eq!(
            RateDistortionParameters::MOVING
                .squared_color_error(TerminalColor::Palette(16), TerminalColor::Rgb([1, 1, 0])),
            2.0
        );
        assert_eq!(
            RateDistortionParameters::MOVING
                .squared_color_error(TerminalColor::DefaultBackground, TerminalColor::Palette(0)),
            f32::INFINITY
        );
        assert_eq!(
            RateDistortionParameters::MOVING
                .squared_color_error(TerminalColor::DefaultBackground, TerminalColor::DefaultBackground),
            0.0
        );
    }
}
