//! The colors of a cell of two, as the terminal has them.

use std::cell::RefCell;

use super::mix::{Ink, Mixer};
use super::oklab::oklab;
use super::palette::{self, Ansi};
use super::pattern::threshold;
use super::{ColorDepth, NAMES};
use crate::math::color::srgb8_to_linear;
use crate::mosaic::{FittedCell, Tile};
use ratatui::style::Color;

/// Weight of calm in the palette of 256, whose colors are near to each other, and in that of 16.
const CALM_256: f32 = 3.0;
const CALM_16: f32 = 3.0;
/// The same where the two colors of a cell are halves, which show the edges of things.
const CALM_EDGES: f32 = 200.0;
/// Halves that differ by more than this in Oklab, squared, are drawn as halves; else their mean is mixed from shades.
const EDGE: f32 = 0.01;
/// The parts of a shade's foreground in its cell.
const LEVELS: [f32; 3] = [0.25, 0.5, 0.75];

/// A cell as it is drawn: its first part in the first color.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct DrawnCell {
    pub(crate) tile: Tile,
    pub(crate) pair: [Color; 2],
}

/// Two of the 16 colors in one cell.
#[derive(Clone, Copy, Debug)]
struct ColorPair {
    /// None: the first color alone.
    level: Option<usize>,
    colors: [usize; 2],
}

/// Colors as a terminal shows them.
#[derive(Debug)]
pub(crate) struct Shades {
    depth: ColorDepth,
    plain: RefCell<Mixer>,
    /// Mixer of cells of two colors, for terminals of 16.
    mixed: RefCell<Mixer>,
    pairs: Vec<ColorPair>,
}

impl Shades {
    /// For a terminal of that many colors; of 16, these.
    pub(crate) fn new(depth: ColorDepth, ansi: &Ansi) -> Self {
        let none = || RefCell::new(Mixer::default());
        let mut shades = Self { depth, plain: none(), mixed: none(), pairs: Vec::new() };
        match depth {
            ColorDepth::TrueColor | ColorDepth::None => {}
            ColorDepth::Indexed256 => {
                let inks = (palette::FIRST_FIXED..=u8::MAX).filter_map(palette::fixed).map(Ink::plain);
                shades.plain = RefCell::new(Mixer::new(inks.collect(), CALM_256));
            }
            ColorDepth::Ansi16 => {
                let inks: Vec<Ink> = ansi.iter().copied().map(Ink::plain).collect();
                shades.pairs = pairs(&inks);
                let mixed = shades.pairs.iter().map(|pair| {
                    let [front, back] = pair.colors.map(|color| &inks[color]);
                    pair.level.map_or(*front, |level| Ink::shaded(front, back, LEVELS[level]))
                });
                shades.mixed = RefCell::new(Mixer::new(mixed.collect(), CALM_16));
                shades.plain = RefCell::new(Mixer::new(inks, CALM_EDGES));
            }
        }
        shades
    }

    /// A color alone at a place.
    pub(crate) fn color(&self, rgb: [u8; 3], x: usize, y: usize) -> Color {
        let index = || self.plain.borrow_mut().ink(rgb, threshold(x, y));
        match self.depth {
            ColorDepth::TrueColor => Color::Rgb(rgb[0], rgb[1], rgb[2]),
            ColorDepth::Indexed256 => Color::Indexed(palette::FIRST_FIXED.saturating_add(index() as u8)),
            ColorDepth::Ansi16 => NAMES[index() % NAMES.len()],
            ColorDepth::None => Color::Reset,
        }
    }

    /// A cell at this column and row of the picture.
    pub(crate) fn cell(&self, fitted: FittedCell, x: usize, y: usize) -> DrawnCell {
        let [first, second] = fitted.pair;
        if self.depth == ColorDepth::Ansi16 {
            let labs = fitted.pair.map(|rgb| oklab(srgb8_to_linear(rgb)));
            if labs[0].distance_squared(labs[1]) < EDGE {
                return self.shaded(mean(first, second, fitted.tile), x, y);
            }
        }
        let pair = [self.color(first, x, 2 * y), self.color(second, x, 2 * y + 1)];
        DrawnCell { tile: fitted.tile, pair }
    }

    fn shaded(&self, rgb: [u8; 3], x: usize, y: usize) -> DrawnCell {
        let index = self.mixed.borrow_mut().ink(rgb, threshold(x, y));
        let ColorPair { level, colors } =
            self.pairs.get(index).copied().unwrap_or(ColorPair { level: None, colors: [0; 2] });
        let [front, back] = colors.map(|color| NAMES[color]);
        match level {
            None => DrawnCell { tile: Tile::HALVES, pair: [front; 2] },
            Some(0) => DrawnCell { tile: Tile::LIGHT, pair: [front, back] },
            Some(1) => DrawnCell { tile: Tile::MEDIUM, pair: [front, back] },
            Some(_) => DrawnCell { tile: Tile::LIGHT, pair: [back, front] },
        }
    }
}

/// Each color alone, and each pair at each level.
fn pairs(inks: &[Ink]) -> Vec<ColorPair> {
    let alone = (0..inks.len()).map(|color| ColorPair { level: None, colors: [color; 2] });
    let both = (0..inks.len()).flat_map(|a| (0..a).map(move |b| [a, b]));
    let shaded =
        both.flat_map(|colors| (0..LEVELS.len()).map(move |level| ColorPair { level: Some(level), colors }));
    alone.chain(shaded).collect()
}

fn mean(first: [u8; 3], second: [u8; 3], tile: Tile) -> [u8; 3] {
    let [a, b] = tile.sizes().map(|size| size as f32);
    let mixed = (srgb8_to_linear(first) * a + srgb8_to_linear(second) * b) / (a + b);
    mixed.to_array().map(crate::math::color::linear_to_srgb8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::XTERM;

    fn cell(shades: &Shades, rgb: [u8; 3], x: usize, y: usize) -> DrawnCell {
        shades.cell(FittedCell { tile: Tile::HALVES, pair: [rgb; 2] }, x, y)
    }

    #[test]
    fn a_cell_hangs_on_its_colors_and_place_alone() {
        for depth in [ColorDepth::Indexed256, ColorDepth::Ansi16] {
            let (one, other) = (Shades::new(depth, &XTERM), Shades::new(depth, &XTERM));
            for i in 0..200 {
                // Other colors, in another order.
                cell(&other, [i as u8, 90, 200 - i as u8], i, 3);
            }
            for (x, y) in [(0, 0), (3, 1), (7, 5)] {
                assert_eq!(cell(&one, [150, 75, 50], x, y), cell(&other, [150, 75, 50], x + 8, y + 8));
            }
        }
    }

    #[test]
    fn exact_colors_of_16_stay_at_every_place() {
        let shades = Shades::new(ColorDepth::Ansi16, &XTERM);
        for (rgb, name) in XTERM.into_iter().zip(NAMES) {
            for place in 0..64 {
                assert_eq!(cell(&shades, rgb, place % 8, place / 8).pair, [name; 2], "{rgb:?}");
            }
        }
    }

    #[test]
    fn a_gray_between_two_of_16_is_mixed_of_grays_in_its_cells() {
        let shades = Shades::new(ColorDepth::Ansi16, &XTERM);
        for place in 0..64 {
            let DrawnCell { pair, .. } = cell(&shades, [70; 3], place % 8, place / 8);
            assert!(pair.iter().all(|color| [Color::Black, Color::DarkGray].contains(color)), "{pair:?}");
        }
    }

    #[test]
    fn edges_are_drawn_as_halves_and_other_colors_of_the_terminal_are_heeded() {
        let mut ansi = XTERM;
        ansi[1] = [150, 75, 50];
        let shades = Shades::new(ColorDepth::Ansi16, &ansi);
        assert_eq!(cell(&shades, [150, 75, 50], 2, 2).pair, [Color::Red; 2]);
        let edge = FittedCell { tile: Tile::HALVES, pair: [[255; 3], [0; 3]] };
        assert_eq!(
            shades.cell(edge, 1, 1),
            DrawnCell { tile: Tile::HALVES, pair: [Color::White, Color::Black] }
        );
    }
}
