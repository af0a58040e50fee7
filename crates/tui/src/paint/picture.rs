//! The picture: as near to what is wanted as the bytes allow.

use super::cell::CellContent;
use super::cost_model::CostModel;
use super::cursor_moves::CellPosition;
use super::fidelity::Fidelity;
use super::row_optimizer::{DrawOp, PlannedRow, RowStart, TargetCell, row};
use super::screen::{ScreenModel, Stroke};
use super::stable_cells::StableCells;
use super::target_screen::TargetScreen;

/// Bytes that a cell of a first picture may take, in the mean over the rows so far.
const FIRST_BYTES: u32 = 12;
/// Bytes at the begin of a row that the search does not count: modifiers of words that are turned off.
const ROW_BYTES: u32 = 4;
/// Ratio of the price of a byte from one try to the next.
const STEP: f32 = 1.6;
/// A byte dearer than this buys nothing.
const DEAREST: f32 = 4000.0;

/// Bytes left for the rows of a first picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct ByteBudget {
    bytes: u32,
    model: CostModel,
}

impl Default for ByteBudget {
    fn default() -> Self {
        Self { bytes: 0, model: CostModel::MOVING }
    }
}

impl ByteBudget {
    /// The row at the least error that the bytes allow. Bytes get cheaper after rows that left some.
    fn spend(&mut self, targets: &[TargetCell], start: RowStart) -> PlannedRow {
        let share = FIRST_BYTES * targets.len() as u32;
        self.bytes += share;
        if self.bytes > 2 * share {
            self.model = self.model.at(self.model.byte / STEP);
        }
        loop {
            let found = row(targets, start, self.model);
            let bytes = found.bytes + ROW_BYTES;
            if bytes <= self.bytes || self.model.byte > DEAREST {
                self.bytes = self.bytes.saturating_sub(bytes);
                return found;
            }
            self.model = self.model.at(self.model.byte * STEP);
        }
    }
}

/// Plans the strokes of the picture in a row.
pub(super) fn plan(
    screen: &ScreenModel,
    wanted: &TargetScreen,
    memory: &StableCells,
    y: u16,
    can_repeat: bool,
    budget: &mut ByteBudget,
) -> Vec<Stroke> {
    let columns = wanted.picture.left()..wanted.picture.right();
    let targets: Vec<TargetCell> =
        columns.clone().map(|x| target(screen, wanted, memory, CellPosition { x, y })).collect();
    let start = RowStart {
        fg: screen.pen.fg,
        bg: screen.pen.bg,
        is_there: screen.cursor == Some(CellPosition { x: columns.start, y }),
    };
    let row = match wanted.fidelity {
        Fidelity::Still => row(&targets, start, CostModel::EXACT),
        Fidelity::Following => row(&targets, start, CostModel::ALL),
        Fidelity::Moving => row(&targets, start, CostModel::MOVING),
        Fidelity::First => budget.spend(&targets, start),
    };
    let stroke = |dab: DrawOp| Stroke::Mosaic {
        at: CellPosition { x: columns.start + dab.column as u16, y },
        glyph: dab.glyph,
        mosaic: dab.mosaic,
        count: 1,
    };
    let strokes: Vec<Stroke> = row.dabs.into_iter().map(stroke).collect();
    if can_repeat { Stroke::repeated(&strokes) } else { strokes }
}

fn target(screen: &ScreenModel, wanted: &TargetScreen, memory: &StableCells, at: CellPosition) -> TargetCell {
    let shown = match screen.look(at) {
        CellContent::Mosaic(mosaic) => Some(*mosaic),
        CellContent::Unknown | CellContent::Text(_) | CellContent::Covered => None,
    };
    let wanted = wanted.mosaic(at.x, at.y).map(|wanted| memory.mosaic(at, wanted, shown));
    TargetCell { wanted, shown }
}
