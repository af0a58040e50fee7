//! Words: exactly as they are wanted.

use super::look::{Glyph, Look};
use super::moves::Place;
use super::screen::{Screen, Slice};
use super::{Reached, Wanted};

/// Draws what differs of the words in a row, from a column on.
pub(super) fn draw(screen: &mut Screen, wanted: &Wanted, y: u16, from: u16, slice: &mut Slice) -> Reached {
    for x in from..wanted.columns {
        let at = Place { x, y };
        let look = &wanted.row(y)[usize::from(x)];
        if wanted.is_picture(x, y) || screen.look(at) == look {
            continue;
        }
        let is_drawn = match look {
            Look::Text(text) => screen.draw_text(at, text, slice),
            Look::Halves(halves) => Glyph::ALL
                .into_iter()
                .find(|glyph| glyph.shows(*halves))
                .is_none_or(|glyph| screen.draw_halves(at, glyph, *halves, slice)),
            Look::Unknown | Look::Covered => true,
        };
        if !is_drawn {
            return Reached::Column(x);
        }
    }
    Reached::End
}
