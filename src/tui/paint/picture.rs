//! The picture: as near to what is wanted as the bytes allow.

use super::look::Look;
use super::moves::Place;
use super::screen::{Screen, Stroke};
use super::taste::Taste;
use super::trellis::{Start, Target, dabs};
use super::{Fidelity, Wanted};

/// What is to be drawn of the picture in a row.
pub(super) fn plan(screen: &Screen, wanted: &Wanted, y: u16) -> Vec<Stroke> {
    let columns = wanted.picture.left()..wanted.picture.right();
    let target = |x: u16| Target {
        wanted: wanted.halves(x, y),
        shown: match screen.look(Place { x, y }) {
            Look::Halves(halves) => Some(*halves),
            Look::Unknown | Look::Text(_) | Look::Covered => None,
        },
    };
    let targets: Vec<Target> = columns.clone().map(target).collect();
    let start = Start {
        fg: screen.pen.fg,
        bg: screen.pen.bg,
        is_there: screen.cursor == Some(Place { x: columns.start, y }),
    };
    let taste = match wanted.fidelity {
        Fidelity::Still => Taste::EXACT,
        Fidelity::First | Fidelity::Moving => Taste::MOVING,
    };
    let place = |column: usize| Place { x: columns.start + column as u16, y };
    dabs(&targets, start, taste)
        .into_iter()
        .map(|dab| Stroke::Halves { at: place(dab.column), glyph: dab.glyph, halves: dab.halves })
        .collect()
}
