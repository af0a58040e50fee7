//! Memory of the cells that an edit did not change.
//!
//! The first pictures of two requests have the same random numbers, so that they differ only where the scene does. A cell that is
//! alike in both keeps its look on the screen, which has converged, through all the noise until the new picture has converged
//! too.

use ratatui::layout::Rect;

use super::cell::{CellContent, Mosaic};
use super::cursor_moves::CellPosition;
use super::fidelity::Fidelity;
use super::screen::ScreenModel;
use super::target_screen::TargetScreen;
use super::terminal_color::TerminalColor;

/// First pictures are alike where no channel differs by more.
const ALIKE: u8 = 2;
/// Noise that a cell is left in spite of is no larger than this.
const MOST_NOISE: u8 = 12;

/// The first picture of the request that the screen shows, cell by cell.
#[derive(Debug, Default)]
pub(super) struct StableCells {
    columns: usize,
    picture: Rect,
    /// None: nothing is known.
    firsts: Vec<Option<Mosaic>>,
    /// The first picture of the request under way; empty: it had none.
    newest: Vec<Option<Mosaic>>,
    /// Whether the cell is alike in the first pictures of the request under way and of the one that it shows.
    steady: Vec<bool>,
    /// Greatest difference between the requested and the shown cell that counts as noise, in steady parts.
    noise: u8,
}

impl StableCells {
    /// Nothing of what is on the screen is known.
    pub(super) fn forget(&mut self) {
        self.firsts.fill(None);
        self.steady.fill(false);
    }

    pub(super) fn aim(&mut self, wanted: &TargetScreen, screen: Option<&ScreenModel>) {
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
            Fidelity::First => self.begin(wanted),
            Fidelity::Moving => self.noise = noise(self.median(wanted, screen)),
            Fidelity::Following => match self.median(wanted, screen) {
                // There is hardly any left to hide.
                ..=1 => self.steady.fill(false),
                median => self.noise = noise(median),
            },
            Fidelity::Still => self.steady.fill(false),
        }
    }

    /// A request shows its first picture.
    fn begin(&mut self, wanted: &TargetScreen) {
        let places = (0..wanted.rows).flat_map(|y| (0..wanted.columns).map(move |x| (x, y)));
        self.newest = places.map(|(x, y)| wanted.mosaic(x, y)).collect();
        self.noise = u8::MAX;
        for (steady, (first, newest)) in self.steady.iter_mut().zip(self.firsts.iter().zip(&self.newest)) {
            *steady = first.zip(*newest).is_some_and(|(a, b)| apart(a, b) <= ALIKE);
        }
    }

    /// The median of how far what is wanted is off the cells that did not change.
    fn median(&self, wanted: &TargetScreen, screen: Option<&ScreenModel>) -> usize {
        let mut counts = [0_u32; 256];
        let Some(screen) = screen else { return 0 };
        for y in wanted.picture.top()..wanted.picture.bottom() {
            for x in wanted.picture.left()..wanted.picture.right() {
                if let (true, CellContent::Mosaic(shown), Some(wanted)) = (
                    self.is_steady(CellPosition { x, y }),
                    screen.look(CellPosition { x, y }),
                    wanted.mosaic(x, y),
                ) {
                    counts[usize::from(apart(*shown, wanted))] += 1;
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

    /// The mosaic for a cell: the one already shown, if only noise separates it from the requested one.
    pub(super) fn mosaic(&self, at: CellPosition, wanted: Mosaic, shown: Option<Mosaic>) -> Mosaic {
        shown
            .filter(|shown| {
                self.is_steady(at) && (self.noise == u8::MAX || apart(*shown, wanted) <= self.noise)
            })
            .unwrap_or(wanted)
    }

    fn is_steady(&self, at: CellPosition) -> bool {
        self.steady.get(self.index(at)).copied().unwrap_or(false)
    }

    fn index(&self, at: CellPosition) -> usize {
        usize::from(at.y) * self.columns + usize::from(at.x)
    }

    /// Cells of the picture were drawn for the request under way.
    pub(super) fn drawn(&mut self, at: CellPosition, count: u16) {
        let first = self.index(at);
        for index in first..first + usize::from(count) {
            if let Some(kept) = self.firsts.get_mut(index) {
                *kept = self.newest.get(index).copied().flatten();
                self.steady[index] = false;
            }
        }
    }

    /// All that had to be drawn of the picture in a row was drawn: the cells that were left show the request under
    /// way as well.
    pub(super) fn row_done(&mut self, y: u16) {
        for x in self.picture.left()..self.picture.right() {
            let index = self.index(CellPosition { x, y });
            if let Some(Some(newest)) = self.newest.get(index)
                && !self.steady[index]
            {
                self.firsts[index] = Some(*newest);
            }
        }
    }

    /// The picture is shown as it stays: what comes next is another request's.
    pub(super) fn finish(&mut self) {
        self.newest.clear();
    }
}

/// The noise not worth drawing, if the median difference is this.
fn noise(median: usize) -> u8 {
    u8::try_from(4 * median + 2).unwrap_or(u8::MAX).min(MOST_NOISE)
}

/// The largest difference of a channel; 255 if the mosaics cannot be compared.
fn apart(a: Mosaic, b: Mosaic) -> u8 {
    let one = |a: TerminalColor, b: TerminalColor| match (a.rgb(), b.rgb()) {
        _ if a == b => 0,
        (Some(a), Some(b)) => a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0),
        _ => u8::MAX,
    };
    a.against(b).map(|(a, b, _)| one(a, b)).max().unwrap_or(0)
}
