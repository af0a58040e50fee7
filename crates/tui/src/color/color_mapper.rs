//! Maps sRGB colors to the colors that the terminal supports, with dithering.

use std::cell::RefCell;

use super::bayer::bayer_threshold;
use super::oklab::linear_to_oklab;
use super::palette::{self, AnsiColors};
use super::recipes::{DitherRecipeCache, SolidOrPatternColor};
use super::{ANSI_COLORS, ColorDepth};
use crate::math::color::srgb8_color_to_linear;
use crate::mosaic::{FittedCell, TwoPartBlockPattern};
use ratatui::style::Color;

/// How strongly dithering favors inks close to the target color on 256-color and 16-color terminals.
const CLOSENESS_256: f32 = 3.0;
const CLOSENESS_16: f32 = 3.0;
/// How strongly dithering favors inks close to the target color in cells whose halves are drawn separately.
const CLOSENESS_EDGES: f32 = 200.0;
/// Squared Oklab distance above which the two halves of a cell are drawn separately. Below it, a shade
/// character approximates their mean color.
const EDGE: f32 = 0.01;
/// Fraction of the cell that each shade character fills with the foreground color.
const SHADE_COVERAGES: [f32; 3] = [0.25, 0.5, 0.75];

/// A tile and the colors of its two parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MappedCell {
    pub(crate) tile: TwoPartBlockPattern,
    pub(crate) pair: [Color; 2],
}

/// Two of the 16 ANSI colors, mixed in one cell.
#[derive(Clone, Copy, Debug)]
struct AnsiColorMix {
    /// Index of the shade character, or `None` if only the first color is used.
    level: Option<usize>,
    colors: [usize; 2],
}

/// Maps sRGB colors to terminal colors.
#[derive(Debug)]
pub(crate) struct ColorMapper {
    depth: ColorDepth,
    plain: RefCell<DitherRecipeCache>,
    /// Ditherer for cells drawn with shade characters on 16-color terminals.
    mixed: RefCell<DitherRecipeCache>,
    pairs: Vec<AnsiColorMix>,
}

impl ColorMapper {
    /// Creates a mapper for this color depth. `ansi` are the terminal's 16 ANSI colors.
    pub(crate) fn new(depth: ColorDepth, ansi: &AnsiColors) -> Self {
        let none = || RefCell::new(DitherRecipeCache::default());
        let mut shades = Self { depth, plain: none(), mixed: none(), pairs: Vec::new() };
        match depth {
            ColorDepth::TrueColor | ColorDepth::None => {}
            ColorDepth::Indexed256 => {
                let inks = (palette::FIRST_FIXED..=u8::MAX)
                    .filter_map(palette::fixed_palette_color)
                    .map(SolidOrPatternColor::solid);
                shades.plain = RefCell::new(DitherRecipeCache::new(inks.collect(), CLOSENESS_256));
            }
            ColorDepth::Ansi16 => {
                let inks: Vec<SolidOrPatternColor> =
                    ansi.iter().copied().map(SolidOrPatternColor::solid).collect();
                shades.pairs = ansi_color_mixes(&inks);
                let mixed = shades.pairs.iter().map(|pair| {
                    let [front, back] = pair.colors.map(|color| &inks[color]);
                    pair.level.map_or(*front, |level| {
                        SolidOrPatternColor::from_two_color_pattern(front, back, SHADE_COVERAGES[level])
                    })
                });
                shades.mixed = RefCell::new(DitherRecipeCache::new(mixed.collect(), CLOSENESS_16));
                shades.plain = RefCell::new(DitherRecipeCache::new(inks, CLOSENESS_EDGES));
            }
        }
        shades
    }

    /// Returns the terminal color to draw for an sRGB color at this pixel position.
    pub(crate) fn terminal_color_at(&self, rgb: [u8; 3], x: usize, y: usize) -> Color {
        let index = || self.plain.borrow_mut().select_color_index(rgb, bayer_threshold(x, y));
        match self.depth {
            ColorDepth::TrueColor => Color::Rgb(rgb[0], rgb[1], rgb[2]),
            ColorDepth::Indexed256 => Color::Indexed(palette::FIRST_FIXED.saturating_add(index() as u8)),
            ColorDepth::Ansi16 => ANSI_COLORS[index() % ANSI_COLORS.len()],
            ColorDepth::None => Color::Reset,
        }
    }

    /// Returns the cell to draw at this column and row of the preview.
    pub(crate) fn map_cell(&self, fitted: FittedCell, x: usize, y: usize) -> MappedCell {
        let [first, second] = fitted.pair;
        if self.depth == ColorDepth::Ansi16 {
            let labs = fitted.pair.map(|rgb| linear_to_oklab(srgb8_color_to_linear(rgb)));
            if labs[0].distance_squared(labs[1]) < EDGE {
                return self.dithered_cell(pattern_weighted_mean_color(first, second, fitted.tile), x, y);
            }
        }
        let pair = [self.terminal_color_at(first, x, 2 * y), self.terminal_color_at(second, x, 2 * y + 1)];
        MappedCell { tile: fitted.tile, pair }
    }

    fn dithered_cell(&self, rgb: [u8; 3], x: usize, y: usize) -> MappedCell {
        let index = self.mixed.borrow_mut().select_color_index(rgb, bayer_threshold(x, y));
        let AnsiColorMix { level, colors } =
            self.pairs.get(index).copied().unwrap_or(AnsiColorMix { level: None, colors: [0; 2] });
        let [front, back] = colors.map(|color| ANSI_COLORS[color]);
        match level {
            None => MappedCell { tile: TwoPartBlockPattern::HALVES, pair: [front; 2] },
            Some(0) => MappedCell { tile: TwoPartBlockPattern::LIGHT, pair: [front, back] },
            Some(1) => MappedCell { tile: TwoPartBlockPattern::MEDIUM, pair: [front, back] },
            Some(_) => MappedCell { tile: TwoPartBlockPattern::LIGHT, pair: [back, front] },
        }
    }
}

/// Returns all single colors, followed by every pair of colors mixed with each shade character.
fn ansi_color_mixes(inks: &[SolidOrPatternColor]) -> Vec<AnsiColorMix> {
    let alone = (0..inks.len()).map(|color| AnsiColorMix { level: None, colors: [color; 2] });
    let both = (0..inks.len()).flat_map(|a| (0..a).map(move |b| [a, b]));
    let shaded = both.flat_map(|colors| {
        (0..SHADE_COVERAGES.len()).map(move |level| AnsiColorMix { level: Some(level), colors })
    });
    alone.chain(shaded).collect()
}

fn pattern_weighted_mean_color(first: [u8; 3], second: [u8; 3], tile: TwoPartBlockPattern) -> [u8; 3] {
    let [a, b] = tile.part_sizes().map(|size| size as f32);
    let mixed = (srgb8_color_to_linear(first) * a + srgb8_color_to_linear(second) * b) / (a + b);
    mixed.to_array().map(crate::math::color::linear_to_srgb8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::XTERM;

    fn cell(shades: &ColorMapper, rgb: [u8; 3], x: usize, y: usize) -> MappedCell {
        shades.map_cell(FittedCell { tile: TwoPartBlockPattern::HALVES, pair: [rgb; 2] }, x, y)
    }

    #[test]
    fn cell_depends_only_on_color_and_position() {
        for depth in [ColorDepth::Indexed256, ColorDepth::Ansi16] {
            let (one, other) = (ColorMapper::new(depth, &XTERM), ColorMapper::new(depth, &XTERM));
            for i in 0..200 {
                // Earlier calls with other colors must not affect the result.
                cell(&other, [i as u8, 90, 200 - i as u8], i, 3);
            }
            for (x, y) in [(0, 0), (3, 1), (7, 5)] {
                assert_eq!(cell(&one, [150, 75, 50], x, y), cell(&other, [150, 75, 50], x + 8, y + 8));
            }
        }
    }

    #[test]
    fn exact_ansi_colors_are_not_dithered() {
        let shades = ColorMapper::new(ColorDepth::Ansi16, &XTERM);
        for (rgb, name) in XTERM.into_iter().zip(ANSI_COLORS) {
            for place in 0..64 {
                assert_eq!(cell(&shades, rgb, place % 8, place / 8).pair, [name; 2], "{rgb:?}");
            }
        }
    }

    #[test]
    fn intermediate_gray_is_mixed_from_ansi_grays() {
        let shades = ColorMapper::new(ColorDepth::Ansi16, &XTERM);
        for place in 0..64 {
            let MappedCell { pair, .. } = cell(&shades, [70; 3], place % 8, place / 8);
            assert!(pair.iter().all(|color| [Color::Black, Color::DarkGray].contains(color)), "{pair:?}");
        }
    }

    #[test]
    fn edges_are_drawn_as_halves_in_reported_colors() {
        let mut ansi = XTERM;
        ansi[1] = [150, 75, 50];
        let shades = ColorMapper::new(ColorDepth::Ansi16, &ansi);
        assert_eq!(cell(&shades, [150, 75, 50], 2, 2).pair, [Color::Red; 2]);
        let edge = FittedCell { tile: TwoPartBlockPattern::HALVES, pair: [[255; 3], [0; 3]] };
        assert_eq!(
            shades.map_cell(edge, 1, 1),
            MappedCell { tile: TwoPartBlockPattern::HALVES, pair: [Color::White, Color::Black] }
        );
    }
}
