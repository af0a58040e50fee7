//! The price of a byte in error.

use super::terminal_color::TerminalColor;

/// Weights of bytes against error. The error of a half of a cell is the sum of the squared differences of its channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CostModel {
    /// Error that a byte may save.
    pub(super) byte: f32,
    /// No channel may be farther off than this.
    pub(super) most: u8,
    /// Neighbours that differ by twice this in no channel may become one color: colors are tried for each.
    pub(super) spans: &'static [u8],
}

impl CostModel {
    /// Every color to 1/255.
    pub(super) const EXACT: Self = Self { byte: 64.0, most: 1, spans: &[1] };

    /// Every color, whatever it takes.
    pub(super) const ALL: Self = Self { byte: 64.0, most: 0, spans: &[0] };

    /// An error of 14/255 in all channels of a half is about worth the bytes of a color.
    pub(super) const MOVING: Self = Self { byte: 32.0, most: 255, spans: &[1, 4, 9] };

    /// The same where a byte is worth this much, or as much as for a moving picture at least.
    pub(super) fn at(self, byte: f32) -> Self {
        let byte = byte.max(Self::MOVING.byte);
        let spans: &[u8] = match byte {
            ..40.0 => Self::MOVING.spans,
            40.0..100.0 => &[3, 8, 16],
            100.0..400.0 => &[6, 14, 28],
            _ => &[12, 28, 60],
        };
        Self { byte, spans, ..self }
    }

    /// The error of showing one color for another; infinite where that must not be.
    pub(super) fn error(self, shown: TerminalColor, wanted: TerminalColor) -> f32 {
        if shown == wanted {
            return 0.0;
        }
        let (Some(shown), Some(wanted)) = (shown.rgb(), wanted.rgb()) else { return f32::INFINITY };
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
    fn errors_are_sums_of_squares_up_to_a_limit() {
        let (a, b) = (TerminalColor::Rgb([10, 20, 30]), TerminalColor::Rgb([11, 20, 32]));
        assert_eq!(CostModel::MOVING.error(a, b), 5.0);
        assert_eq!(CostModel::EXACT.error(a, b), f32::INFINITY);
        assert_eq!(CostModel::EXACT.error(a, TerminalColor::Rgb([9, 21, 30])), 2.0);
        assert_eq!(CostModel::MOVING.error(TerminalColor::Palette(16), TerminalColor::Rgb([1, 1, 0])), 2.0);
        assert_eq!(CostModel::MOVING.error(TerminalColor::Ground, TerminalColor::Palette(0)), f32::INFINITY);
        assert_eq!(CostModel::MOVING.error(TerminalColor::Ground, TerminalColor::Ground), 0.0);
    }
}
