//! The picture.

use super::look::{Glyph, Look};
use super::moves::Place;
use super::screen::{Screen, Slice};
use super::shade::Shade;
use super::{Fidelity, Reached, Wanted};

/// Draws what differs of the picture in a row, from a column on.
pub(super) fn draw(screen: &mut Screen, wanted: &Wanted, y: u16, from: u16, slice: &mut Slice) -> Reached {
    for x in from.max(wanted.picture.left())..wanted.picture.right() {
        let at = Place { x, y };
        let Look::Halves(halves) = wanted.row(y)[usize::from(x)] else { continue };
        if is_shown(screen.look(at), halves, wanted.fidelity) {
            continue;
        }
        let pen = screen.pen;
        let cost = |glyph: &Glyph| {
            let wish = glyph.wish(halves);
            let fg = wish.fg.filter(|shade| *shade != pen.fg).map_or(0, Shade::length);
            let bg = wish.bg.filter(|shade| *shade != pen.bg).map_or(0, Shade::length);
            fg + bg + glyph.symbol().len() as u32
        };
        let glyph = Glyph::ALL.into_iter().filter(|glyph| glyph.shows(halves)).min_by_key(cost);
        if !glyph.is_none_or(|glyph| screen.draw_halves(at, glyph, halves, slice)) {
            return Reached::Column(x);
        }
    }
    Reached::End
}

/// Whether a cell is near enough to what is wanted.
fn is_shown(look: &Look, wanted: [Shade; 2], fidelity: Fidelity) -> bool {
    let Look::Halves(halves) = look else { return false };
    let most = match fidelity {
        Fidelity::Still => 1,
        Fidelity::First | Fidelity::Moving => 9,
    };
    let is_near = |a: Shade, b: Shade| {
        let apart = |(a, b): ([u8; 3], [u8; 3])| a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= most);
        a == b || a.rgb().zip(b.rgb()).is_some_and(apart)
    };
    halves.iter().zip(wanted).all(|(a, b)| is_near(*a, b))
}
