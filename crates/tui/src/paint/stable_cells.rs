//! Keeps converged cells on the screen if an edit did not change them.
//!
//! The first previews of two requests use the same random numbers, so they differ only where the scene has
//! changed. If a cell is the same in both previews, the screen keeps showing its converged state until the
//! new render has also converged.

use ratatui::layout::Rect;

use super::cell::{CellContent, TwoPartColorCell};
use super::cursor_moves::CellPosition;
use super::fidelity::PreviewFidelity;
use super::screen::ScreenModel;
use super::target_screen::TargetScreen;
use super::terminal_color::TerminalColor;

/// Maximum channel difference between first previews that are considered equal.
const MAX_EQUAL_DIFFERENCE: u8 = 2;
/// Upper limit for the noise threshold. Differences up to the threshold do not cause a redraw.
const MAX_NOISE: u8 = 12;

/// Stores, for each cell, the first preview of the request whose result is on the screen.
#[derive(Debug, Default)]
pub(super) struct FirstPreviewCells {
    columns: usize,
    picture: Rect,
    /// For each cell, its content in the first preview of the request on the screen, or `None` if unknown.
    firsts: Vec<Option<TwoPartColorCell>>,
    /// The first preview of the current request, or empty if there was none.
    newest: Vec<Option<TwoPartColorCell>>,
    /// For each cell, whether it looks the same in the first previews of the current request and of the
    /// request on the screen.
    steady: Vec<bool>,
    /// Noise threshold: larger differences between a stable cell and its target cause a redraw.
    noise: u8,
}

impl FirstPreviewCells {
    /// Marks the whole screen as unknown.
    pub(super) fn invalidate(&mut self) {
        self.firsts.fill(None);
        self.steady.fill(false);
    }

    pub(super) fn set_target(&mut self, wanted: &TargetScreen, screen: Option<&ScreenModel>) {
        let cells = usize::from(wanted.columns) * usize::from(wanted.rows);
        if self.picture != wanted.picture || self.firsts.len() != cells {
            *self = Self {
                columns: usize::from(wanted.columns),
                picture: wanted.picture,
                firsts: vec![None; cells],
                steady: vec![false; cells],
                ..Self::default()
            };
        }
        match wanted.fidelity {
            PreviewFidelity::First => self.compare_first_previews(wanted),
            PreviewFidelity::Moving => {
                self.noise = noise_threshold_from_median(self.median_stable_cell_difference(wanted, screen));
            }
            PreviewFidelity::Following => match self.median_stable_cell_difference(wanted, screen) {
                // There is hardly any noise left to hide, so redraw everything.
                ..=1 => self.steady.fill(false),
                median => self.noise = noise_threshold_from_median(median),
            },
            PreviewFidelity::Still => self.steady.fill(false),
        }
    }

    /// Compares a new request's first preview with the previous request's.
    fn compare_first_previews(&mut self, wanted: &TargetScreen) {
        let places = (0..wanted.rows).flat_map(|y| (0..wanted.columns).map(move |x| (x, y)));
        self.newest = places.map(|(x, y)| wanted.preview_cell(x, y)).collect();
        self.noise = u8::MAX;
        for (steady, (first, newest)) in self.steady.iter_mut().zip(self.firsts.iter().zip(&self.newest)) {
            *steady = first
                .zip(*newest)
                .is_some_and(|(a, b)| max_channel_difference_between_cells(a, b) <= MAX_EQUAL_DIFFERENCE);
        }
    }

    /// Median difference between the target and the stable cells on the screen.
    fn median_stable_cell_difference(&self, wanted: &TargetScreen, screen: Option<&ScreenModel>) -> usize {
        let mut counts = [0_u32; 256];
        let Some(screen) = screen else { return 0 };
        for y in wanted.picture.top()..wanted.picture.bottom() {
            for x in wanted.picture.left()..wanted.picture.right() {
                if let (true, CellContent::Mosaic(shown), Some(wanted)) = (
                    self.is_cell_unchanged_by_edit(CellPosition { x, y }),
                    screen.content_at(CellPosition { x, y }),
                    wanted.preview_cell(x, y),
                ) {
                    counts[usize::from(max_channel_difference_between_cells(*shown, wanted))] += 1;
                }
            }
        }
        let all: u32 = counts.iter().sum();
        let mut below = 0;
        let median = counts.iter().take_while(|count| {
            below += **count;
            below * 2 < all
        });
        median.count()
    }

    /// Returns the mosaic to draw: the displayed one if it differs from the target only by noise, otherwise
    /// the target.
    pub(super) fn stabilized_cell(
        &self,
        at: CellPosition,
        wanted: TwoPartColorCell,
        shown: Option<TwoPartColorCell>,
    ) -> TwoPartColorCell {
        shown
            .filter(|shown| {
                self.is_cell_unchanged_by_edit(at)
                    && (self.noise == u8::MAX
                        || max_channel_difference_between_cells(*shown, wanted) <= self.noise)
            })
            .unwrap_or(wanted)
    }

    fn is_cell_unchanged_by_edit(&self, at: CellPosition) -> bool {
        self.steady.get(self.index(at)).copied().unwrap_or(false)
    }

    fn index(&self, at: CellPosition) -> usize {
        usize::from(at.y) * self.columns + usize::from(at.x)
    }

    /// Records that cells were drawn for the current request.
    pub(super) fn record_drawn_cells(&mut self, at: CellPosition, count: u16) {
        let first = self.index(at);
        for index in first..first + usize::from(count) {
            if let Some(kept) = self.firsts.get_mut(index) {
                *kept = self.newest.get(index).copied().flatten();
                self.steady[index] = false;
            }
        }
    }

    /// Records that a row is complete. Cells that were not redrawn also show the current request.
    pub(super) fn mark_row_as_drawn(&mut self, y: u16) {
        for x in self.picture.left()..self.picture.right() {
            let index = self.index(CellPosition { x, y });
            if let Some(Some(newest)) = self.newest.get(index)
                && !self.steady[index]
            {
                self.firsts[index] = Some(*newest);
            }
        }
    }

    /// Ends the current request after its final preview has been drawn.
    pub(super) fn finish_request(&mut self) {
        self.newest.clear();
    }
}

/// Noise threshold for a median difference.
fn noise_threshold_from_median(median: usize) -> u8 {
    u8::try_from(4 * median + 2).unwrap_or(u8::MAX).min(MAX_NOISE)
}

/// The largest channel difference between two mosaics, or 255 if their colors cannot be compared.
fn max_channel_difference_between_cells(a: TwoPartColorCell, b: TwoPartColorCell) -> u8 {
    let one = |a: TerminalColor, b: TerminalColor| match (a.to_rgb(), b.to_rgb()) {
        _ if a == b => 0,
        (Some(a), Some(b)) => a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0),
        _ => u8::MAX,
    };
    a.color_overlaps_with(b).map(|(a, b, _)| one(a, b)).max().unwrap_or(0)
}
