//! A cell's appearance, independent of how it was drawn.

use ratatui::buffer::Cell;
use ratatui::style::Modifier;
use unicode_width::UnicodeWidthStr;

use super::pen::{Pen, PenRequirements};
use super::terminal_color::{ColorLayer, TerminalColor};
use crate::color::ColorDepth;
use crate::mosaic::{PLACES, TwoPartBlockPattern, pattern_and_inversion_for_symbol};

/// Content of a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum CellContent {
    /// The content of the cell is unknown.
    Unknown,
    /// A tile with two colors. A blank consists of two halves in the same color.
    Mosaic(TwoPartColorCell),
    /// A character.
    Text(TextCell),
    /// The right half of a wide character.
    Covered,
}

/// A cell with two colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TwoPartColorCell {
    pub(super) tile: TwoPartBlockPattern,
    /// Colors of the first and second parts.
    pub(super) pair: [TerminalColor; 2],
}

impl TwoPartColorCell {
    /// Normalizes the tile so that cells with the same appearance are equal.
    pub(super) fn new(tile: TwoPartBlockPattern, pair: [TerminalColor; 2]) -> Self {
        Self { tile: if pair[0] == pair[1] { TwoPartBlockPattern::HALVES } else { tile }, pair }
    }

    pub(super) fn from_halves(pair: [TerminalColor; 2]) -> Self {
        Self { tile: TwoPartBlockPattern::HALVES, pair }
    }

    /// A cell with a single color.
    pub(super) fn uniform(shade: TerminalColor) -> Self {
        Self::from_halves([shade; 2])
    }

    /// The mosaic for a block character, or `None` for any other character.
    fn from_symbol(symbol: &str, fg: TerminalColor, bg: TerminalColor) -> Option<Self> {
        match symbol {
            " " => return Some(Self::uniform(bg)),
            "█" => return Some(Self::uniform(fg)),
            _ => {}
        }
        let (tile, is_second) = pattern_and_inversion_for_symbol(symbol.chars().next()?)?;
        Some(Self::new(tile, if is_second { [bg, fg] } else { [fg, bg] }))
    }

    /// Lists pairs of colors that overlap when this cell is laid over `other`. The weight of each pair is
    /// twice the fraction of the cell where the two colors overlap.
    pub(super) fn color_overlaps_with(
        self,
        other: Self,
    ) -> impl Iterator<Item = (TerminalColor, TerminalColor, f32)> {
        let shared = self.tile.part_overlap_counts(other.tile);
        let pairs = [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter();
        pairs.filter(move |(own, its)| shared[*own][*its] > 0).map(move |(own, its)| {
            let part = 2.0 * shared[own][its] as f32 / PLACES as f32;
            (self.pair[own], other.pair[its], part)
        })
    }
}

/// A character, possibly consisting of several code points, with its style.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TextCell {
    pub(super) symbol: Box<str>,
    /// Width in columns: 1 or 2.
    pub(super) columns: u16,
    pub(super) pen: Pen,
}

impl TextCell {
    /// Whether the character is a single code point and one column wide.
    pub(super) fn is_single_narrow_char(&self) -> bool {
        self.columns == 1 && self.symbol.chars().nth(1).is_none()
    }
}

/// The four ways to fill a cell's two parts with the pen's two colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ForegroundParts {
    Blank,
    First,
    Second,
    Full,
}

/// Modifiers that are visible on a blank.
const ON_BLANKS: Modifier = Modifier::REVERSED
    .union(Modifier::UNDERLINED)
    .union(Modifier::SLOW_BLINK)
    .union(Modifier::RAPID_BLINK)
    .union(Modifier::CROSSED_OUT);

impl ForegroundParts {
    pub(super) const ALL: [Self; 4] = [Self::Blank, Self::First, Self::Second, Self::Full];

    /// The character that draws `tile`.
    pub(super) fn symbol_for_pattern(self, tile: TwoPartBlockPattern) -> char {
        match self {
            Self::Blank => ' ',
            Self::First => tile.symbols()[0],
            Self::Second => tile.symbols()[1],
            Self::Full => '█',
        }
    }

    /// The layers that fill the first and second parts.
    pub(super) fn part_layers(self) -> [ColorLayer; 2] {
        match self {
            Self::Blank => [ColorLayer::Background; 2],
            Self::First => [ColorLayer::Foreground, ColorLayer::Background],
            Self::Second => [ColorLayer::Background, ColorLayer::Foreground],
            Self::Full => [ColorLayer::Foreground; 2],
        }
    }

    /// Returns the glyph's pen requirements. Colors that it does not show are unconstrained.
    pub(super) fn pen_requirements(self, pair: [TerminalColor; 2]) -> PenRequirements {
        let color =
            |layer| self.part_layers().iter().zip(pair).find(|(l, _)| **l == layer).map(|(_, shade)| shade);
        let matters = if self == Self::Blank { ON_BLANKS } else { Modifier::all() };
        PenRequirements {
            fg: color(ColorLayer::Foreground),
            bg: color(ColorLayer::Background),
            modifier: Modifier::empty(),
            matters,
            link: 0,
        }
    }

    /// Whether this glyph can show the two colors of a cell.
    pub(super) fn can_represent_color_pair(self, pair: [TerminalColor; 2]) -> bool {
        let [first, second] = self.part_layers();
        pair[0].is_allowed_in_layer(first)
            && pair[1].is_allowed_in_layer(second)
            && (first != second || pair[0] == pair[1])
    }
}

impl CellContent {
    /// A blank with the terminal's default background.
    pub(super) const BLANK: Self = Self::Mosaic(TwoPartColorCell {
        tile: TwoPartBlockPattern::HALVES,
        pair: [TerminalColor::DefaultBackground; 2],
    });

    /// Converts a ratatui cell for a terminal with the given color depth.
    pub(super) fn from_cell(cell: &Cell, depth: ColorDepth) -> Self {
        let shade = |color, layer| {
            let color = if depth == ColorDepth::None { ratatui::style::Color::Reset } else { color };
            TerminalColor::from_ratatui(color, layer)
        };
        let (fg, bg) = (shade(cell.fg, ColorLayer::Foreground), shade(cell.bg, ColorLayer::Background));
        let (symbol, columns) = printable_symbol_and_width(cell.symbol());
        let harmless = if symbol == " " { Modifier::all() - ON_BLANKS } else { Modifier::empty() };
        let mosaic =
            harmless.contains(cell.modifier).then(|| TwoPartColorCell::from_symbol(symbol, fg, bg)).flatten();
        mosaic.map_or_else(
            || {
                Self::Text(TextCell {
                    symbol: symbol.into(),
                    columns,
                    pen: Pen { fg, bg, modifier: cell.modifier, link: 0 },
                })
            },
            Self::Mosaic,
        )
    }

    /// Width in columns.
    pub(super) fn columns(&self) -> u16 {
        match self {
            Self::Text(text) => text.columns,
            Self::Unknown | Self::Mosaic(_) | Self::Covered => 1,
        }
    }
}

/// Returns a cell's symbol and its width, or a blank if the symbol would move the cursor or print nothing.
fn printable_symbol_and_width(symbol: &str) -> (&str, u16) {
    let columns = symbol.width();
    if columns == 0 || columns > 2 || symbol.chars().any(char::is_control) {
        (" ", 1)
    } else {
        (symbol, if columns == 2 { 2 } else { 1 })
    }
}

#[cfg(test)]
mod tests {
    use ratatui::style::Color;

    use super::*;

    fn content(symbol: &str, fg: Color, bg: Color, modifier: Modifier) -> CellContent {
        let mut cell = Cell::default();
        cell.set_symbol(symbol).set_fg(fg).set_bg(bg);
        cell.modifier = modifier;
        CellContent::from_cell(&cell, ColorDepth::TrueColor)
    }

    #[test]
    fn cells_that_look_alike_are_equal() {
        let none = Modifier::empty();
        let (a, b) = (Color::Rgb(1, 2, 3), Color::Rgb(4, 5, 6));
        assert_eq!(content("▀", a, b, none), content("▄", b, a, none));
        assert_eq!(content("█", a, b, none), content(" ", b, a, none));
        assert_eq!(content("▚", a, b, none), content("▞", b, a, none));
        assert_eq!(content("▚", a, a, none), content(" ", b, a, none));
        assert_ne!(content("▚", a, b, none), content("▀", a, b, none));
        assert_eq!(content(" ", a, b, Modifier::BOLD), content(" ", b, b, none));
        assert_ne!(content(" ", a, b, Modifier::UNDERLINED), content(" ", a, b, none));
        assert_ne!(content("▀", a, b, Modifier::DIM), content("▀", a, b, none));
        assert_ne!(content("x", a, b, none), content("x", b, b, none));
        assert_ne!(content("█", Color::Reset, a, none), content(" ", a, Color::Reset, none));
    }

    #[test]
    fn cursor_movements_are_not_printed() {
        for symbol in ["", "\n", "\x1b[2J", "\u{301}", "a\x07"] {
            assert_eq!(
                content(symbol, Color::Reset, Color::Reset, Modifier::empty()),
                CellContent::BLANK,
                "{symbol:?}"
            );
        }
        assert_eq!(content("日", Color::Red, Color::Reset, Modifier::empty()).columns(), 2);
        assert_eq!(content("e\u{301}", Color::Red, Color::Reset, Modifier::empty()).columns(), 1);
    }

    #[test]
    fn monochrome_terminals_get_no_colors() {
        let mut cell = Cell::default();
        cell.set_symbol("x").set_fg(Color::Red).set_bg(Color::Blue);
        let CellContent::Text(text) = CellContent::from_cell(&cell, ColorDepth::None) else {
            panic!("a character")
        };
        assert_eq!(
            (text.pen.fg, text.pen.bg),
            (TerminalColor::DefaultForeground, TerminalColor::DefaultBackground)
        );
    }
}
