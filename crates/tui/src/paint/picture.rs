//! The picture: as near to what is wanted as the bytes allow.

use super::cost_model::CostModel;
use super::fidelity::Fidelity;
use super::look::Look;
use super::memory::Memory;
use super::moves::Place;
use super::row_optimizer::{Dab, Row, Start, Target, row};
use super::screen::{Screen, Stroke};
use super::wanted::Wanted;

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
pub(super) struct Budget {
    bytes: u32,
    model: CostModel,
}

impl Default for Budget {
    fn default() -> Self {
        Self { bytes: 0, model: CostModel::MOVING }
    }
}

impl Budget {
    /// The row at the least error that the bytes allow. Bytes get cheaper after rows that left some.
    fn spend(&mut self, targets: &[Target], start: Start) -> Row {
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
    screen: &Screen,
    wanted: &Wanted,
    memory: &Memory,
    y: u16,
    can_repeat: bool,
    budget: &mut Budget,
) -> Vec<Stroke> {
    let columns = wanted.picture.left()..wanted.picture.right();
    let targets: Vec<Target> =
        columns.clone().map(|x| target(screen, wanted, memory, Place { x, y })).collect();
    let start = Start {
        fg: screen.pen.fg,
        bg: screen.pen.bg,
        is_there: screen.cursor == Some(Place { x: columns.start, y }),
    };
    let row = match wanted.fidelity {
        Fidelity::Still => row(&targets, start, CostModel::EXACT),
        Fidelity::Following => row(&targets, start, CostModel::ALL),
        Fidelity::Moving => row(&targets, start, CostModel::MOVING),
        Fidelity::First => budget.spend(&targets, start),
    };
    let stroke = |dab: Dab| Stroke::Mosaic {
        at: Place { x: columns.start + dab.column as u16, y },
        glyph: dab.glyph,
        mosaic: dab.mosaic,
        count: 1,
    };
    let strokes: Vec<Stroke> = row.dabs.into_iter().map(stroke).collect();
    if can_repeat { Stroke::repeated(&strokes) } else { strokes }
}

fn target(screen: &Screen, wanted: &Wanted, memory: &Memory, at: Place) -> Target {
    let shown = match screen.look(at) {
        Look::Mosaic(mosaic) => Some(*mosaic),
        Look::Unknown | Look::Text(_) | Look::Covered => None,
    };
    let wanted = wanted.mosaic(at.x, at.y).map(|wanted| memory.mosaic(at, wanted, shown));
    Target { wanted, shown }
}
