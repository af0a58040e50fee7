//! Finds the cheapest byte sequence that draws a row of the preview.
//!
//! Each cell is either kept or drawn with one of four glyphs, changing neither, one or both of the pen's
//! colors. The cost depends on the pen and the cursor position, so the search keeps the best path for each of
//! a few pens (Viterbi algorithm with beam search) and traces the path back from the cheapest end.

mod beam;
mod cell_drawing;

use super::candidates::{PartColorCandidates, candidate_colors_for_run_start};
use super::cell::{ForegroundParts, TwoPartColorCell};
use super::cost_model::RateDistortionParameters;
use super::terminal_color::{ColorLayer, TerminalColor};
use beam::{BEAM_WIDTH, CursorDistance, RowPrefixPlan, SearchBeam, color_pair_key};
use cell_drawing::ColorChangesToTry;

/// Upper bound on the bytes needed to reach any pen and cursor position from any other. A path that costs
/// this much more than the best path cannot win.
const MAX_BYTES: f32 = 46.0;

/// A cell in the row, with its target and its current content.
#[derive(Clone, Copy, Debug)]
pub(super) struct WantedAndShownCell {
    /// Target content, or `None` if the cell is not part of the preview.
    pub(super) wanted: Option<TwoPartColorCell>,
    /// Content on the screen, or `None` if unknown, in which case the cell must be drawn.
    pub(super) shown: Option<TwoPartColorCell>,
}

/// State of the pen and cursor at the start of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowStart {
    pub(super) fg: TerminalColor,
    pub(super) bg: TerminalColor,
    /// Whether the cursor is at the first cell.
    pub(super) is_at_start: bool,
}

/// An operation that draws one cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CellDrawOp {
    /// Column relative to the first target cell.
    pub(super) column: usize,
    pub(super) glyph: ForegroundParts,
    pub(super) mosaic: TwoPartColorCell,
}

/// A row's drawing operations.
#[derive(Clone, Debug)]
pub(super) struct PlannedRow {
    pub(super) ops: Vec<CellDrawOp>,
    pub(super) bytes: u32,
}

/// Finds the cheapest path through a row of cells.
pub(super) fn plan_row(
    targets: &[WantedAndShownCell],
    start: RowStart,
    model: RateDistortionParameters,
) -> PlannedRow {
    let gap = if start.is_at_start { CursorDistance::Cells(0) } else { CursorDistance::Far };
    let RowStart { fg, bg, .. } = start;
    let first = RowPrefixPlan {
        fg,
        bg,
        pen: color_pair_key(fg, bg),
        gap,
        bytes: 0,
        cost: 0.0,
        parent: 0,
        glyph: None,
    };
    let mut paths = vec![vec![first]];
    let wanted: Vec<_> = targets.iter().map(|target| target.wanted).collect();
    for (column, target) in targets.iter().enumerate() {
        let last = &paths[column];
        paths.push(extend_plans(last, *target, &wanted[column..], model));
    }
    trace_back_cheapest_plan(&paths, &wanted)
}

/// Extends the paths by one cell.
fn extend_plans(
    last: &[RowPrefixPlan],
    target: WantedAndShownCell,
    wanted: &[Option<TwoPartColorCell>],
    model: RateDistortionParameters,
) -> Vec<RowPrefixPlan> {
    let mut beam = SearchBeam { paths: Vec::with_capacity(BEAM_WIDTH), limit: MAX_BYTES * model.byte };
    let leave = match (target.wanted, target.shown) {
        (None, _) => 0.0,
        (Some(wanted), Some(shown)) => shown
            .color_overlaps_with(wanted)
            .map(|(shown, wanted, part)| part * model.squared_color_error(shown, wanted))
            .sum(),
        (Some(_), None) => f32::INFINITY,
    };
    if leave.is_finite() {
        for (parent, path) in last.iter().enumerate() {
            beam.add(RowPrefixPlan {
                gap: path.gap.plus_one_cell(),
                cost: path.cost + leave,
                parent,
                glyph: None,
                ..*path
            });
        }
    }
    let Some(mosaic) = target.wanted else { return beam.paths };
    // A cell that is close enough to its target is not worth a color change, but redrawing it may be cheaper
    // than skipping it.
    let changes = if leave <= model.byte {
        PartColorCandidates::default()
    } else {
        candidate_colors_for_run_start(wanted, model)
    };
    let changes = ColorChangesToTry::new(&changes, mosaic, model);
    for (parent, path) in last.iter().enumerate() {
        changes.try_single_changes(parent, path, &mut beam);
    }
    // If both colors are set, the previous pen does not matter, so extend only the cheapest path.
    let base = |path: &RowPrefixPlan| path.cost + path.gap.move_byte_count() as f32 * model.byte;
    if let Some((parent, path)) = last.iter().enumerate().min_by(|(_, a), (_, b)| base(a).total_cmp(&base(b)))
    {
        changes.try_paired_changes(parent, path, &mut beam);
    }
    beam.paths
}

/// Traces the cheapest path back from the last cell.
fn trace_back_cheapest_plan(paths: &[Vec<RowPrefixPlan>], wanted: &[Option<TwoPartColorCell>]) -> PlannedRow {
    let last = paths.last().into_iter().flatten().enumerate();
    let best = last.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let (mut index, bytes) = best.map_or((0, 0), |(index, path)| (index, path.bytes));
    let mut ops = Vec::new();
    for (column, paths) in paths.iter().enumerate().skip(1).rev() {
        let Some(path) = paths.get(index) else { break };
        if let (Some(glyph), Some(mosaic)) = (path.glyph, wanted[column - 1]) {
            let pair = glyph.part_layers().map(|layer| match layer {
                ColorLayer::Foreground => path.fg,
                ColorLayer::Background => path.bg,
            });
            ops.push(CellDrawOp {
                column: column - 1,
                glyph,
                mosaic: TwoPartColorCell::new(mosaic.tile, pair),
            });
        }
        index = path.parent;
    }
    ops.reverse();
    PlannedRow { ops, bytes }
}

#[cfg(test)]
mod tests;
