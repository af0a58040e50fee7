//! Draws the preview as close to its target as the byte budget allows.

use super::cell::CellContent;
use super::cost_model::RateDistortionParameters;
use super::cursor_moves::CellPosition;
use super::fidelity::PreviewFidelity;
use super::row_optimizer::{CellDrawOp, PlannedRow, RowStart, WantedAndShownCell, plan_row};
use super::screen::{CellRun, ScreenModel};
use super::stable_cells::FirstPreviewCells;
use super::target_screen::TargetScreen;

/// Average number of bytes per cell available for a first preview.
const FIRST_BYTES: u32 = 12;
/// Bytes reserved at the start of each row for resetting modifiers left over from text. The search does not
/// count them.
const ROW_BYTES: u32 = 4;
/// Factor by which the cost per byte changes between attempts.
const COST_STEP: f32 = 1.6;
/// Cost per byte above which no further bytes can be saved.
const MAX_BYTE_COST: f32 = 4000.0;

/// Byte budget for a first preview.
#[derive(Clone, Copy, Debug)]
pub(super) struct FirstPreviewByteBudget {
    bytes: u32,
    model: RateDistortionParameters,
}

impl Default for FirstPreviewByteBudget {
    fn default() -> Self {
        Self { bytes: 0, model: RateDistortionParameters::MOVING }
    }
}

impl FirstPreviewByteBudget {
    /// Plans a row with the smallest error that fits into the budget. If the unused bytes exceed one row's
    /// share, first lowers the cost per byte.
    fn plan_row_in_budget(&mut self, targets: &[WantedAndShownCell], start: RowStart) -> PlannedRow {
        let share = FIRST_BYTES * targets.len() as u32;
        self.bytes += share;
        if self.bytes > 2 * share {
            self.model = self.model.with_cost_per_byte(self.model.byte / COST_STEP);
        }
        loop {
            let found = plan_row(targets, start, self.model);
            let bytes = found.bytes + ROW_BYTES;
            if bytes <= self.bytes || self.model.byte > MAX_BYTE_COST {
                self.bytes = self.bytes.saturating_sub(bytes);
                return found;
            }
            self.model = self.model.with_cost_per_byte(self.model.byte * COST_STEP);
        }
    }
}

/// Plans the strokes for a row of the preview.
pub(super) fn plan_preview_row(
    screen: &ScreenModel,
    wanted: &TargetScreen,
    memory: &FirstPreviewCells,
    y: u16,
    can_repeat: bool,
    budget: &mut FirstPreviewByteBudget,
) -> Vec<CellRun> {
    let columns = wanted.picture.left()..wanted.picture.right();
    let targets: Vec<WantedAndShownCell> = columns
        .clone()
        .map(|x| wanted_and_shown_cell(screen, wanted, memory, CellPosition { x, y }))
        .collect();
    let start = RowStart {
        fg: screen.pen.fg,
        bg: screen.pen.bg,
        is_at_start: screen.cursor == Some(CellPosition { x: columns.start, y }),
    };
    let row = match wanted.fidelity {
        PreviewFidelity::Still => plan_row(&targets, start, RateDistortionParameters::EXACT),
        PreviewFidelity::Following => plan_row(&targets, start, RateDistortionParameters::ALL),
        PreviewFidelity::Moving => plan_row(&targets, start, RateDistortionParameters::MOVING),
        PreviewFidelity::First => budget.plan_row_in_budget(&targets, start),
    };
    let stroke = |op: CellDrawOp| CellRun::Mosaic {
        at: CellPosition { x: columns.start + op.column as u16, y },
        glyph: op.glyph,
        mosaic: op.mosaic,
        count: 1,
    };
    let strokes: Vec<CellRun> = row.ops.into_iter().map(stroke).collect();
    if can_repeat { CellRun::replace_blanks_with_repeat(&strokes) } else { strokes }
}

fn wanted_and_shown_cell(
    screen: &ScreenModel,
    wanted: &TargetScreen,
    memory: &FirstPreviewCells,
    at: CellPosition,
) -> WantedAndShownCell {
    let shown = match screen.content_at(at) {
        CellContent::Mosaic(mosaic) => Some(*mosaic),
        CellContent::Unknown | CellContent::Text(_) | CellContent::Covered => None,
    };
    let wanted = wanted.preview_cell(at.x, at.y).map(|wanted| memory.stabilized_cell(at, wanted, shown));
    WantedAndShownCell { wanted, shown }
}
