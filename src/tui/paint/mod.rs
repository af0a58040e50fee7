//! Bytes for the terminal: only what changes to the eye, in slices.
//!
//! A [`Painter`] knows what is on the screen, because it sent it. It is aimed at a buffer of cells and gives the bytes
//! that lead there, slice by slice; a newer aim takes the place of the rest of the older one. A cell counts as the
//! two colours of its halves, however they are drawn: `▀ ▄ █` and the blank show the same pairs in several ways,
//! and the one that costs least after what was drawn before is taken.

mod look;
mod moves;
mod pen;
mod picture;
mod screen;
mod shade;
#[cfg(test)]
mod tests;
mod words;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use self::look::Look;
use self::screen::{Screen, Slice};
use super::color::ColorDepth;

/// How near to the picture the cells have to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// The first picture of a request, to be refined soon: at most 12 bytes a cell.
    First,
    /// A picture that better ones will follow.
    Moving,
    /// A picture that stays: every colour to 1/255.
    Still,
}

/// Leads the screen to what is wanted.
#[derive(Debug)]
pub struct Painter {
    depth: ColorDepth,
    /// None: its content is unknown.
    screen: Option<Screen>,
    wanted: Wanted,
    /// What is still to be looked at, in order.
    parts: Vec<Part>,
    /// The next of them, and the column in it.
    next: usize,
    column: u16,
}

/// What was aimed at.
#[derive(Debug)]
struct Wanted {
    columns: u16,
    rows: u16,
    looks: Vec<Look>,
    picture: Rect,
    fidelity: Fidelity,
}

/// A part of the screen that is drawn in one go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// The words of a row.
    Words(u16),
    /// The picture in a row.
    Picture(u16),
}

impl Painter {
    /// For a terminal of that many colours, whose content is unknown.
    pub fn new(depth: ColorDepth) -> Self {
        let wanted =
            Wanted { columns: 0, rows: 0, looks: Vec::new(), picture: Rect::ZERO, fidelity: Fidelity::Still };
        Self { depth, screen: None, wanted, parts: Vec::new(), next: 0, column: 0 }
    }

    /// Show this from now on, whatever is left of what was wanted before. `picture`: where cells may differ from
    /// what is wanted as far as the fidelity says; all others are words and come first. A buffer of another size than
    /// the one before means that the screen has been resized.
    pub fn aim(&mut self, wanted: &Buffer, picture: Rect, fidelity: Fidelity) {
        let (columns, rows) = (wanted.area.width, wanted.area.height);
        self.wanted = Wanted {
            columns,
            rows,
            looks: looks(wanted, self.depth),
            picture: picture.intersection(Rect::new(0, 0, columns, rows)),
            fidelity,
        };
        self.screen.take_if(|screen| (screen.columns, screen.rows) != (columns, rows));
        self.parts = (0..rows).map(Part::Words).collect();
        self.parts.extend(self.wanted.rows_from_the_middle().map(Part::Picture));
        (self.next, self.column) = (0, 0);
    }

    /// The next bytes towards what is wanted, at most so many unless one cell needs more. Empty: it is shown. They
    /// have to be written: what follows builds on them.
    pub fn slice(&mut self, most_bytes: usize) -> Vec<u8> {
        let mut slice = Slice { bytes: Vec::new(), most: most_bytes };
        if self.wanted.looks.is_empty() {
            return slice.bytes;
        }
        let (columns, rows) = (self.wanted.columns, self.wanted.rows);
        let screen = self.screen.get_or_insert_with(|| {
            Screen::clear(&mut slice);
            Screen::cleared(columns, rows)
        });
        while let Some(part) = self.parts.get(self.next) {
            let reached = match *part {
                Part::Words(y) => words::draw(screen, &self.wanted, y, self.column, &mut slice),
                Part::Picture(y) => picture::draw(screen, &self.wanted, y, self.column, &mut slice),
            };
            match reached {
                Reached::End => (self.next, self.column) = (self.next + 1, 0),
                Reached::Column(column) => {
                    self.column = column;
                    break;
                }
            }
        }
        slice.bytes
    }

    /// The content of the screen is unknown from now on: it is cleared before anything else is drawn.
    pub fn forget(&mut self) {
        self.screen = None;
        (self.next, self.column) = (0, 0);
    }
}

/// How far a part was drawn.
enum Reached {
    End,
    /// Up to this column, which the slice has no room for.
    Column(u16),
}

impl Wanted {
    fn row(&self, y: u16) -> &[Look] {
        let columns = usize::from(self.columns);
        &self.looks[usize::from(y) * columns..][..columns]
    }

    /// Whether a cell belongs to the picture: words may lie over it.
    fn is_picture(&self, x: u16, y: u16) -> bool {
        self.picture.contains((x, y).into()) && matches!(self.row(y)[usize::from(x)], Look::Halves(_))
    }

    fn rows_from_the_middle(&self) -> impl Iterator<Item = u16> + use<> {
        let (top, bottom) = (self.picture.top(), self.picture.bottom());
        let middle = top + (bottom - top) / 2;
        (0..=bottom - top).flat_map(move |away| {
            let below = middle.checked_add(away).filter(|y| *y < bottom);
            let above = middle.checked_sub(away).filter(|y| away > 0 && *y >= top);
            [below, above].into_iter().flatten()
        })
    }
}

/// What the cells of a buffer look like.
fn looks(buffer: &Buffer, depth: ColorDepth) -> Vec<Look> {
    let columns = usize::from(buffer.area.width.max(1));
    let mut looks: Vec<Look> = buffer.content.iter().map(|cell| Look::of(cell, depth)).collect();
    for row in looks.chunks_mut(columns) {
        let mut x = 0;
        while x < row.len() {
            let end = x + usize::from(row[x].columns());
            if end > row.len() {
                row[x] = Look::BLANK;
            } else {
                row[x + 1..end].fill(Look::Covered);
            }
            x = end;
        }
    }
    looks
}
