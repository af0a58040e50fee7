//! What a cell looks like, however it was drawn.

use ratatui::buffer::Cell;
use ratatui::style::Modifier;
use unicode_width::UnicodeWidthStr;

use super::pen::{Pen, Wish};
use super::shade::{Layer, Shade};
use crate::tui::color::ColorDepth;

/// One cell of the screen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// Nobody knows.
    Unknown,
    /// The colours of its upper and its lower half: a blank is two halves of one colour.
    Halves([Shade; 2]),
    /// A character.
    Text(Text),
    /// The right part of a character that is two columns wide.
    Covered,
}

/// A character, which may be made of several code points, and its style.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Text {
    pub(super) symbol: Box<str>,
    /// 1 or 2.
    pub(super) columns: u16,
    pub(super) pen: Pen,
}

/// The four ways to fill the halves of a cell by the two colours of the pen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Glyph {
    Blank,
    Upper,
    Lower,
    Full,
}

/// Modifiers that are seen on a blank.
const ON_BLANKS: Modifier = Modifier::REVERSED
    .union(Modifier::UNDERLINED)
    .union(Modifier::SLOW_BLINK)
    .union(Modifier::RAPID_BLINK)
    .union(Modifier::CROSSED_OUT);

impl Glyph {
    pub(super) const ALL: [Self; 4] = [Self::Blank, Self::Upper, Self::Lower, Self::Full];

    pub(super) fn symbol(self) -> &'static str {
        match self {
            Self::Blank => " ",
            Self::Upper => "▀",
            Self::Lower => "▄",
            Self::Full => "█",
        }
    }

    /// Which layer fills the upper and the lower half.
    pub(super) fn layers(self) -> [Layer; 2] {
        match self {
            Self::Blank => [Layer::Background; 2],
            Self::Upper => [Layer::Foreground, Layer::Background],
            Self::Lower => [Layer::Background, Layer::Foreground],
            Self::Full => [Layer::Foreground; 2],
        }
    }

    /// What it asks of the pen; nothing of a colour that it does not show.
    pub(super) fn wish(self, halves: [Shade; 2]) -> Wish {
        let color =
            |layer| self.layers().iter().zip(halves).find(|(l, _)| **l == layer).map(|(_, half)| half);
        let matters = if self == Self::Blank { ON_BLANKS } else { Modifier::all() };
        Wish {
            fg: color(Layer::Foreground),
            bg: color(Layer::Background),
            modifier: Modifier::empty(),
            matters,
        }
    }

    /// Whether it can show these colours.
    pub(super) fn shows(self, halves: [Shade; 2]) -> bool {
        let [upper, lower] = self.layers();
        halves[0].fits(upper) && halves[1].fits(lower) && (upper != lower || halves[0] == halves[1])
    }
}

impl Look {
    /// A blank of the terminal's own background.
    pub(super) const BLANK: Self = Self::Halves([Shade::Ground; 2]);

    /// What a cell is to look like on a terminal of this depth.
    pub(super) fn of(cell: &Cell, depth: ColorDepth) -> Self {
        let shade = |color, layer| {
            let color = if depth == ColorDepth::None { ratatui::style::Color::Reset } else { color };
            Shade::of(color, layer)
        };
        let (fg, bg) = (shade(cell.fg, Layer::Foreground), shade(cell.bg, Layer::Background));
        let (symbol, columns) = printable(cell.symbol());
        let halves = match symbol {
            " " if !cell.modifier.intersects(ON_BLANKS) => Some([bg, bg]),
            "▀" if cell.modifier.is_empty() => Some([fg, bg]),
            "▄" if cell.modifier.is_empty() => Some([bg, fg]),
            "█" if cell.modifier.is_empty() => Some([fg, fg]),
            _ => None,
        };
        halves.map_or_else(
            || {
                Self::Text(Text {
                    symbol: symbol.into(),
                    columns,
                    pen: Pen { fg, bg, modifier: cell.modifier },
                })
            },
            Self::Halves,
        )
    }

    /// Columns that it takes.
    pub(super) fn columns(&self) -> u16 {
        match self {
            Self::Text(text) => text.columns,
            Self::Unknown | Self::Halves(_) | Self::Covered => 1,
        }
    }
}

/// The symbol of a cell and its columns; a blank for what would move the cursor or nothing at all.
fn printable(symbol: &str) -> (&str, u16) {
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

    fn look(symbol: &str, fg: Color, bg: Color, modifier: Modifier) -> Look {
        let mut cell = Cell::default();
        cell.set_symbol(symbol).set_fg(fg).set_bg(bg);
        cell.modifier = modifier;
        Look::of(&cell, ColorDepth::TrueColor)
    }

    #[test]
    fn what_looks_the_same_is_the_same() {
        let none = Modifier::empty();
        let (a, b) = (Color::Rgb(1, 2, 3), Color::Rgb(4, 5, 6));
        assert_eq!(look("▀", a, b, none), look("▄", b, a, none));
        assert_eq!(look("█", a, b, none), look(" ", b, a, none));
        assert_eq!(look(" ", a, b, Modifier::BOLD), look(" ", b, b, none));
        assert_ne!(look(" ", a, b, Modifier::UNDERLINED), look(" ", a, b, none));
        assert_ne!(look("▀", a, b, Modifier::DIM), look("▀", a, b, none));
        assert_ne!(look("x", a, b, none), look("x", b, b, none));
        assert_ne!(look("█", Color::Reset, a, none), look(" ", a, Color::Reset, none));
    }

    #[test]
    fn nothing_that_moves_the_cursor_is_printed() {
        for symbol in ["", "\n", "\x1b[2J", "\u{301}", "a\x07"] {
            assert_eq!(
                look(symbol, Color::Reset, Color::Reset, Modifier::empty()),
                Look::BLANK,
                "{symbol:?}"
            );
        }
        assert_eq!(look("日", Color::Red, Color::Reset, Modifier::empty()).columns(), 2);
        assert_eq!(look("e\u{301}", Color::Red, Color::Reset, Modifier::empty()).columns(), 1);
    }

    #[test]
    fn without_colours_there_are_none() {
        let mut cell = Cell::default();
        cell.set_symbol("x").set_fg(Color::Red).set_bg(Color::Blue);
        let Look::Text(text) = Look::of(&cell, ColorDepth::None) else { panic!("a character") };
        assert_eq!((text.pen.fg, text.pen.bg), (Shade::Ink, Shade::Ground));
    }
}
