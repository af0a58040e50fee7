//! The terminal's screen, as far as it follows from the bytes that were sent.

use ratatui::layout::Rect;

use super::cell::{CellContent, Glyph, Mosaic, Text};
use super::cursor_moves::{self, CellPosition};
use super::hyperlinks::{Hyperlinks, LINK_OFF};
use super::pen::Pen;
use super::terminal_color::TerminalColor;

/// Bytes that are written in one go.
#[derive(Debug)]
pub(super) struct OutputSlice {
    pub(super) bytes: Vec<u8>,
    /// It gets no longer than this, unless one cell needs more.
    pub(super) most: usize,
}

/// A stroke: cells drawn in one go.
#[derive(Clone, Debug)]
pub(super) enum Stroke {
    /// A character.
    Text { at: CellPosition, text: Text },
    /// Two colors, by a glyph that can show them, in this many cells. More than one: by REP.
    Mosaic { at: CellPosition, glyph: Glyph, mosaic: Mosaic, count: u16 },
    /// Blanks of the terminal's own background, this many or, if none, up to the end of the row.
    Erase { at: CellPosition, count: Option<u16> },
}

impl Stroke {
    /// Its first place.
    pub(super) fn at(&self) -> CellPosition {
        match self {
            Self::Text { at, .. } | Self::Mosaic { at, .. } | Self::Erase { at, .. } => *at,
        }
    }

    /// The same strokes with REP in place of equal blanks, if that is shorter. Some terminals repeat ASCII characters only.
    pub(super) fn repeated(strokes: &[Self]) -> Vec<Self> {
        let mut shorter: Vec<Self> = Vec::with_capacity(strokes.len());
        for run in strokes.chunk_by(Self::goes_on) {
            let count = run.len() as u16;
            if let [Self::Mosaic { at, glyph: Glyph::Blank, mosaic, .. }, _, ..] = run
                && run.len() > 1 + cursor_moves::control(count - 1, b'b').len()
            {
                shorter.push(Self::Mosaic { at: *at, glyph: Glyph::Blank, mosaic: *mosaic, count });
            } else {
                shorter.extend_from_slice(run);
            }
        }
        shorter
    }

    /// Whether the next stroke is the same in the next cell.
    fn goes_on(&self, next: &Self) -> bool {
        if let (
            Self::Mosaic { at, glyph, mosaic, .. },
            Self::Mosaic { at: next_at, glyph: next_glyph, mosaic: next_mosaic, .. },
        ) = (self, next)
        {
            (at.x + 1, at.y, glyph, mosaic) == (next_at.x, next_at.y, next_glyph, next_mosaic)
        } else {
            false
        }
    }
}

/// The cells, the pen and the cursor of the terminal.
#[derive(Debug)]
pub(super) struct ScreenModel {
    pub(super) columns: u16,
    pub(super) rows: u16,
    looks: Vec<CellContent>,
    pub(super) pen: Pen,
    /// None: anywhere.
    pub(super) cursor: Option<CellPosition>,
}

impl ScreenModel {
    /// The screen after [`ScreenModel::clear`].
    pub(super) fn cleared(columns: u16, rows: u16) -> Self {
        Self {
            columns,
            rows,
            looks: vec![CellContent::BLANK; usize::from(columns) * usize::from(rows)],
            pen: Pen::RESET,
            cursor: Some(CellPosition { x: 0, y: 0 }),
        }
    }

    /// Appends what makes any screen one that is [`ScreenModel::cleared`].
    pub(super) fn clear(links: &Hyperlinks, slice: &mut OutputSlice) {
        if !links.is_empty() {
            slice.bytes.extend_from_slice(LINK_OFF);
        }
        slice.bytes.extend_from_slice(b"\x1b[0m\x1b[2J\x1b[H");
    }

    pub(super) fn look(&self, at: CellPosition) -> &CellContent {
        &self.looks[self.index(at)]
    }

    /// Whether drawing has left cells of a row in a state that nobody knows.
    pub(super) fn is_damaged(&self, y: u16) -> bool {
        let start = self.index(CellPosition { x: 0, y });
        self.looks[start..start + usize::from(self.columns)].contains(&CellContent::Unknown)
    }

    /// Nobody knows what these cells show.
    pub(super) fn damage(&mut self, cells: Rect) {
        let cells = cells.intersection(Rect::new(0, 0, self.columns, self.rows));
        for y in cells.top()..cells.bottom() {
            for x in cells.left()..cells.right() {
                let index = self.index(CellPosition { x, y });
                self.looks[index] = CellContent::Unknown;
            }
        }
    }

    fn index(&self, at: CellPosition) -> usize {
        usize::from(at.y) * usize::from(self.columns) + usize::from(at.x)
    }

    /// False: there is no room for it, and nothing was done.
    pub(super) fn draw(&mut self, stroke: &Stroke, links: &Hyperlinks, slice: &mut OutputSlice) -> bool {
        let (start, pen) = (slice.bytes.len(), self.pen);
        self.write(stroke, links, &mut slice.bytes);
        if start > 0 && slice.bytes.len() > slice.most {
            slice.bytes.truncate(start);
            self.pen = pen;
            return false;
        }
        self.keep(stroke);
        true
    }

    fn write(&mut self, stroke: &Stroke, links: &Hyperlinks, bytes: &mut Vec<u8>) {
        let (at, wish) = match stroke {
            Stroke::Text { at, text } => (at, text.pen.exactly()),
            Stroke::Mosaic { at, glyph, mosaic, .. } => (at, glyph.wish(mosaic.pair)),
            Stroke::Erase { at, .. } => (at, Glyph::Blank.wish([TerminalColor::Ground; 2])),
        };
        cursor_moves::go(self.cursor, *at, bytes);
        if self.pen.link != wish.link {
            links.open(wish.link, bytes);
            self.pen.link = wish.link;
        }
        self.pen.turn(&wish, bytes);
        match stroke {
            Stroke::Text { text, .. } => bytes.extend_from_slice(text.symbol.as_bytes()),
            Stroke::Mosaic { glyph, mosaic, count, .. } => {
                let symbol = glyph.symbol(mosaic.tile);
                bytes.extend_from_slice(symbol.encode_utf8(&mut [0; 4]).as_bytes());
                if *count > 1 {
                    bytes.extend(cursor_moves::control(*count - 1, b'b'));
                }
            }
            Stroke::Erase { count: Some(count), .. } => bytes.extend(cursor_moves::control(*count, b'X')),
            Stroke::Erase { count: None, .. } => bytes.extend_from_slice(b"\x1b[K"),
        }
    }

    /// Notes the cells and the cursor after a stroke.
    fn keep(&mut self, stroke: &Stroke) {
        match stroke {
            Stroke::Text { at, text } => {
                self.put(*at, CellContent::Text(text.clone()), text.columns);
                // Terminals differ in how wide they think that others are.
                self.cursor = if text.is_plain() { self.after(*at, 1) } else { None };
            }
            Stroke::Mosaic { at, mosaic, count, .. } => {
                for x in at.x..at.x + count {
                    self.put(CellPosition { x, ..*at }, CellContent::Mosaic(*mosaic), 1);
                }
                self.cursor = self.after(*at, *count);
            }
            Stroke::Erase { at, count } => {
                for x in at.x..count.map_or(self.columns, |count| at.x + count) {
                    self.put(CellPosition { x, ..*at }, CellContent::BLANK, 1);
                }
                self.cursor = Some(*at);
            }
        }
    }

    /// The cursor after so many columns; behind the last one it may be anywhere.
    fn after(&self, at: CellPosition, columns: u16) -> Option<CellPosition> {
        Some(CellPosition { x: at.x + columns, ..at }).filter(|next| next.x < self.columns)
    }

    /// Keeps what was drawn. Half of a character that was two columns wide is gone as a whole.
    fn put(&mut self, at: CellPosition, look: CellContent, columns: u16) {
        let start = self.index(at);
        let end = start + usize::from(columns);
        if self.looks[start] == CellContent::Covered && start > 0 {
            self.looks[start - 1] = CellContent::Unknown;
        }
        self.looks[start] = look;
        self.looks[start + 1..end].fill(CellContent::Covered);
        if at.x + columns < self.columns && self.looks[end] == CellContent::Covered {
            self.looks[end] = CellContent::Unknown;
        }
    }
}
