//! Candidate colors for a cell.

use super::cell::TwoPartColorCell;
use super::cost_model::RateDistortionParameters;
use super::terminal_color::{TerminalColor, decimal_digit_count};
use crate::color::nearest_256_color_index;

/// Maximum number of candidates for each part, and for filling both parts with one color.
const MAX_CANDIDATES: usize = 6;
/// Maximum number of cells that a candidate may cover.
const MAX_CELLS: usize = 8;

/// First palette entry used as a candidate. Base16 themes with 22 colors overwrite the first six entries of
/// the color cube, so only the remaining entries are used.
const FIRST_UNTOUCHED: u8 = 22;

/// Candidate colors for the parts of a cell.
#[derive(Clone, Debug, Default)]
pub(super) struct PartColorCandidates {
    pub(super) first: Vec<TerminalColor>,
    pub(super) second: Vec<TerminalColor>,
    /// Candidates for filling both parts with the same color.
    pub(super) both: Vec<TerminalColor>,
}

/// Returns candidate colors for the first of `cells`. Each color also fits as many of the following cells as
/// possible.
pub(super) fn candidate_colors_for_run_start(
    cells: &[Option<TwoPartColorCell>],
    model: RateDistortionParameters,
) -> PartColorCandidates {
    let column = |part: usize| cells.iter().map_while(move |cell| cell.map(|mosaic| mosaic.pair[part]));
    let both = cells.iter().map_while(|cell| cell.map(|mosaic| mosaic.pair)).flatten();
    PartColorCandidates {
        first: candidate_colors_for_run(&column(0), model),
        second: candidate_colors_for_run(&column(1), model),
        both: candidate_colors_for_run(&both, model),
    }
}

fn candidate_colors_for_run(
    wanted: &(impl Iterator<Item = TerminalColor> + Clone),
    model: RateDistortionParameters,
) -> Vec<TerminalColor> {
    let mut shades = Vec::with_capacity(MAX_CANDIDATES);
    let Some(first) = wanted.clone().next() else { return shades };
    let mut add = |shade| {
        if shades.len() < MAX_CANDIDATES && !shades.contains(&shade) {
            shades.push(shade);
        }
    };
    let TerminalColor::Rgb(_) = first else {
        add(first);
        return shades;
    };
    for span in model.spans {
        let box_ = longest_shared_color_range(wanted.clone(), *span);
        add(TerminalColor::Rgb(box_.color_with_fewest_digits()));
        let index = nearest_256_color_index(box_.clamped_mean_color());
        let fixed = TerminalColor::Palette(index);
        if index >= FIRST_UNTOUCHED && fixed.to_rgb().is_some_and(|rgb| box_.contains(rgb)) {
            add(fixed);
        }
    }
    shades
}

/// The range of colors that fit every cell in a run.
struct RunColorRange {
    low: [u8; 3],
    high: [u8; 3],
    sum: [u32; 3],
    count: u32,
}

/// Intersects the ranges of colors within `span` of each wanted color, stopping before the intersection
/// becomes empty.
fn longest_shared_color_range(wanted: impl Iterator<Item = TerminalColor>, span: u8) -> RunColorRange {
    let mut common = RunColorRange { low: [0; 3], high: [255; 3], sum: [0; 3], count: 0 };
    for shade in wanted.take(MAX_CELLS) {
        let TerminalColor::Rgb(rgb) = shade else { break };
        let low = std::array::from_fn(|i| common.low[i].max(rgb[i].saturating_sub(span)));
        let high = std::array::from_fn(|i| common.high[i].min(rgb[i].saturating_add(span)));
        if (0..3).any(|i| low[i] > high[i]) {
            break;
        }
        (common.low, common.high) = (low, high);
        common.sum = std::array::from_fn(|i| common.sum[i] + u32::from(rgb[i]));
        common.count += 1;
    }
    common
}

impl RunColorRange {
    fn clamped_mean_color(&self) -> [u8; 3] {
        let count = self.count.max(1);
        let mean = |i: usize| u8::try_from((self.sum[i] + count / 2) / count).unwrap_or(u8::MAX);
        std::array::from_fn(|i| mean(i).clamp(self.low[i], self.high[i]))
    }

    /// Returns the color with the fewest decimal digits, preferring the one closest to the mean.
    fn color_with_fewest_digits(&self) -> [u8; 3] {
        let mean = self.clamped_mean_color();
        std::array::from_fn(|i| {
            let fewest = decimal_digit_count(self.low[i]);
            let most = [9, 99, u8::MAX][fewest as usize - 1];
            mean[i].min(most)
        })
    }

    fn contains(&self, rgb: [u8; 3]) -> bool {
        (0..3).all(|i| (self.low[i]..=self.high[i]).contains(&rgb[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(values: &[u8]) -> Vec<Option<TwoPartColorCell>> {
        let halves = |value: &u8| {
            TwoPartColorCell::from_halves([
                TerminalColor::Rgb([*value, 50, 100]),
                TerminalColor::Rgb([0, 0, 0]),
            ])
        };
        values.iter().map(|value| Some(halves(value))).collect()
    }

    #[test]
    fn candidates_cover_many_following_cells() {
        // 21 is within the tolerance of 20, 21 and 22, but not of 24.
        let found = candidate_colors_for_run_start(&row(&[20, 21, 22, 24]), RateDistortionParameters::EXACT);
        assert_eq!(found.first, [TerminalColor::Rgb([21, 50, 99])]);
        assert_eq!(found.second, [TerminalColor::Rgb([0, 0, 0])], "themes may replace color 16");
        assert_eq!(found.both.len(), 1, "no color fits both halves");
        let grays = [Some(TwoPartColorCell::uniform(TerminalColor::Rgb([8, 8, 8])))];
        assert_eq!(
            candidate_colors_for_run_start(&grays, RateDistortionParameters::EXACT).first,
            [TerminalColor::Rgb([8, 8, 8]), TerminalColor::Palette(232)]
        );
    }

    #[test]
    fn palette_colors_are_kept_unchanged() {
        let cells = [
            Some(TwoPartColorCell::from_halves([
                TerminalColor::DefaultBackground,
                TerminalColor::Palette(3),
            ])),
            None,
        ];
        let found = candidate_colors_for_run_start(&cells, RateDistortionParameters::MOVING);
        assert_eq!(
            (found.first, found.second),
            (vec![TerminalColor::DefaultBackground], vec![TerminalColor::Palette(3)])
        );
        let found = candidate_colors_for_run_start(&[None], RateDistortionParameters::MOVING);
        assert!(found.first.is_empty() && found.both.is_empty());
    }
}
