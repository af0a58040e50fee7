//! Words: exactly as they are wanted.

use super::Wanted;
use super::look::{Glyph, Look};
use super::moves::Place;
use super::screen::{Screen, Stroke};

/// What is to be drawn of the words in a row.
pub(super) fn plan(screen: &Screen, wanted: &Wanted, y: u16) -> Vec<Stroke> {
    let mut strokes = Vec::new();
    for x in 0..wanted.columns {
        let at = Place { x, y };
        let look = &wanted.row(y)[usize::from(x)];
        if wanted.halves(x, y).is_some() || screen.look(at) == look {
            continue;
        }
        match look {
            Look::Text(text) => strokes.push(Stroke::Text { at, text: text.clone() }),
            Look::Halves(halves) => {
                let glyph = Glyph::ALL.into_iter().find(|glyph| glyph.shows(*halves));
                strokes.extend(glyph.map(|glyph| Stroke::Halves { at, glyph, halves: *halves }));
            }
            Look::Unknown | Look::Covered => {}
        }
    }
    strokes
}
