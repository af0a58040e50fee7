//! The cheapest paths to a cell, with different pens and cursor positions.

use super::super::cell::ForegroundParts;
use super::super::terminal_color::{TerminalColor, decimal_digit_count};

/// Number of paths kept per cell.
pub(super) const BEAM_WIDTH: usize = 5;

/// A path through the row up to some cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowPrefixPlan {
    pub(super) fg: TerminalColor,
    pub(super) bg: TerminalColor,
    /// Both colors of the pen, packed into one key.
    pub(super) pen: u64,
    pub(super) gap: CursorDistance,
    pub(super) bytes: u32,
    /// Weighted sum of bytes and errors.
    pub(super) cost: f32,
    /// Index of the path to the previous cell.
    pub(super) parent: usize,
    /// The glyph drawn in the cell, or `None` if the cell was kept.
    pub(super) glyph: Option<ForegroundParts>,
}

/// Packs two colors into one key.
pub(super) fn color_pair_key(fg: TerminalColor, bg: TerminalColor) -> u64 {
    u64::from(fg.unique_number()) << 32 | u64::from(bg.unique_number())
}

/// Distance between the cursor and the next cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CursorDistance {
    /// The cursor is in another row.
    Far,
    Cells(u8),
}

impl CursorDistance {
    pub(super) fn move_byte_count(self) -> u32 {
        match self {
            Self::Far => 8,
            Self::Cells(0) => 0,
            Self::Cells(1) => 3,
            Self::Cells(count) => 3 + decimal_digit_count(count),
        }
    }

    pub(super) fn plus_one_cell(self) -> Self {
        match self {
            Self::Far => Self::Far,
            Self::Cells(count) => Self::Cells(count.saturating_add(1)),
        }
    }
}

/// The best paths found so far for a cell.
pub(super) struct SearchBeam {
    pub(super) paths: Vec<RowPrefixPlan>,
    /// Paths that cost more than the best path by at least this amount are dropped.
    pub(super) limit: f32,
}

impl SearchBeam {
    pub(super) fn add(&mut self, path: RowPrefixPlan) {
        let is_same = |other: &RowPrefixPlan| other.pen == path.pen && other.gap == path.gap;
        if let Some(other) = self.paths.iter_mut().find(|other| is_same(other)) {
            if path.cost < other.cost {
                *other = path;
            }
        } else if self.paths.len() < BEAM_WIDTH {
            self.paths.push(path);
        } else if let Some(worst) = self.paths.iter_mut().max_by(|a, b| a.cost.total_cmp(&b.cost))
            && path.cost < worst.cost
        {
            *worst = path;
        }
    }

    /// Returns the cost above which a path cannot enter the beam.
    pub(super) fn pruning_cost_threshold(&self) -> f32 {
        let (mut best, mut worst) = (f32::INFINITY, 0.0_f32);
        for path in &self.paths {
            (best, worst) = (best.min(path.cost), worst.max(path.cost));
        }
        if self.paths.len() < BEAM_WIDTH { best + self.limit } else { worst.min(best + self.limit) }
    }
}
