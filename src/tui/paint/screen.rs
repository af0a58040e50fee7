//! What is on the terminal's screen, as far as it follows from the bytes that were sent.

use super::look::{Glyph, Look, Text};
use super::moves::{self, Place};
use super::pen::{Pen, Wish};
use super::shade::Shade;

/// Bytes that are written in one go.
#[derive(Debug)]
pub(super) struct Slice {
    pub(super) bytes: Vec<u8>,
    /// It gets no longer than this, unless one cell needs more.
    pub(super) most: usize,
}

/// The cells, the pen and the cursor of the terminal.
#[derive(Debug)]
pub(super) struct Screen {
    pub(super) columns: u16,
    pub(super) rows: u16,
    looks: Vec<Look>,
    pub(super) pen: Pen,
    /// None: anywhere.
    pub(super) cursor: Option<Place>,
}

impl Screen {
    /// As it is after [`Screen::clear`].
    pub(super) fn cleared(columns: u16, rows: u16) -> Self {
        Self {
            columns,
            rows,
            looks: vec![Look::BLANK; usize::from(columns) * usize::from(rows)],
            pen: Pen::RESET,
            cursor: Some(Place { x: 0, y: 0 }),
        }
    }

    /// Appends what makes any screen one that is [`Screen::cleared`].
    pub(super) fn clear(slice: &mut Slice) {
        slice.bytes.extend_from_slice(b"\x1b[0m\x1b[2J\x1b[H");
    }

    pub(super) fn look(&self, at: Place) -> &Look {
        &self.looks[self.index(at)]
    }

    fn index(&self, at: Place) -> usize {
        usize::from(at.y) * usize::from(self.columns) + usize::from(at.x)
    }

    /// Draws a character. False: there is no room for it, and nothing was done.
    pub(super) fn draw_text(&mut self, at: Place, text: &Text, slice: &mut Slice) -> bool {
        let is_drawn = self.print(at, &text.symbol, &text.pen.exactly(), slice);
        if is_drawn {
            self.put(at, Look::Text(text.clone()), text.columns);
            // Terminals differ in how wide they think that such characters are.
            if text.columns != 1 || text.symbol.chars().nth(1).is_some() {
                self.cursor = None;
            }
        }
        is_drawn
    }

    /// Draws two halves by a glyph that can show them. False: there is no room for it, and nothing was done.
    pub(super) fn draw_halves(
        &mut self,
        at: Place,
        glyph: Glyph,
        halves: [Shade; 2],
        slice: &mut Slice,
    ) -> bool {
        let is_drawn = self.print(at, glyph.symbol(), &glyph.wish(halves), slice);
        if is_drawn {
            self.put(at, Look::Halves(halves), 1);
        }
        is_drawn
    }

    fn print(&mut self, at: Place, symbol: &str, wish: &Wish, slice: &mut Slice) -> bool {
        let (start, pen) = (slice.bytes.len(), self.pen);
        moves::go(self.cursor, at, &mut slice.bytes);
        self.pen.turn(wish, &mut slice.bytes);
        slice.bytes.extend_from_slice(symbol.as_bytes());
        let has_room = start == 0 || slice.bytes.len() <= slice.most;
        if !has_room {
            slice.bytes.truncate(start);
            self.pen = pen;
        }
        has_room
    }

    /// Keeps what was drawn. Half of a character that was two columns wide is gone as a whole.
    fn put(&mut self, at: Place, look: Look, columns: u16) {
        let start = self.index(at);
        let end = start + usize::from(columns);
        if self.looks[start] == Look::Covered && start > 0 {
            self.looks[start - 1] = Look::Unknown;
        }
        self.looks[start] = look;
        self.looks[start + 1..end].fill(Look::Covered);
        if at.x + columns < self.columns && self.looks[end] == Look::Covered {
            self.looks[end] = Look::Unknown;
        }
        let next = Place { x: at.x + columns, ..at };
        self.cursor = Some(next).filter(|next| next.x < self.columns);
    }
}
