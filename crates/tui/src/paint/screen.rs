//! A model of the terminal's screen, updated from the bytes sent to the terminal.

use ratatui::layout::Rect;

use super::cell::{CellContent, ForegroundParts, TextCell, TwoPartColorCell};
use super::cursor_moves::{self, CellPosition};
use super::hyperlinks::{LINK_OFF, UrlTable};
use super::pen::Pen;
use super::terminal_color::TerminalColor;

/// Bytes to be written together.
#[derive(Debug)]
pub(super) struct LimitedOutputSlice {
    pub(super) bytes: Vec<u8>,
    /// Maximum length, unless a single cell needs more.
    pub(super) most: usize,
}

/// A group of cells drawn with a single glyph.
#[derive(Clone, Debug)]
pub(super) enum CellRun {
    /// A character.
    Text { at: CellPosition, text: TextCell },
    /// Two colors drawn with the same glyph in `count` cells, using REP for more than one cell.
    Mosaic { at: CellPosition, glyph: ForegroundParts, mosaic: TwoPartColorCell, count: u16 },
    /// `count` blanks with the terminal's default background, or a sequence that erases to the end of the row
    /// if `count` is `None`.
    Erase { at: CellPosition, count: Option<u16> },
}

impl CellRun {
    /// Position of the stroke's first cell.
    pub(super) fn position(&self) -> CellPosition {
        match self {
            Self::Text { at, .. } | Self::Mosaic { at, .. } | Self::Erase { at, .. } => *at,
        }
    }

    /// Replaces runs of equal blanks with REP where this is shorter. Only blanks are repeated because some
    /// terminals support REP only for ASCII characters.
    pub(super) fn replace_blanks_with_repeat(strokes: &[Self]) -> Vec<Self> {
        let mut shorter: Vec<Self> = Vec::with_capacity(strokes.len());
        for run in strokes.chunk_by(Self::is_repeated_by) {
            let count = run.len() as u16;
            if let [Self::Mosaic { at, glyph: ForegroundParts::Blank, mosaic, .. }, _, ..] = run
                && run.len() > 1 + cursor_moves::csi_with_count(count - 1, b'b').len()
            {
                shorter.push(Self::Mosaic { at: *at, glyph: ForegroundParts::Blank, mosaic: *mosaic, count });
            } else {
                shorter.extend_from_slice(run);
            }
        }
        shorter
    }

    /// Whether `next` draws the same content in the following cell.
    fn is_repeated_by(&self, next: &Self) -> bool {
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

/// The terminal's cells, pen and cursor.
#[derive(Debug)]
pub(super) struct ScreenModel {
    pub(super) columns: u16,
    pub(super) rows: u16,
    contents: Vec<CellContent>,
    pub(super) pen: Pen,
    /// Cursor position, or `None` if unknown.
    pub(super) cursor: Option<CellPosition>,
}

impl ScreenModel {
    /// The state of the screen after [`ScreenModel::push_clear_sequence`].
    pub(super) fn new_cleared(columns: u16, rows: u16) -> Self {
        Self {
            columns,
            rows,
            contents: vec![CellContent::BLANK; usize::from(columns) * usize::from(rows)],
            pen: Pen::RESET,
            cursor: Some(CellPosition { x: 0, y: 0 }),
        }
    }

    /// Appends the bytes that clear the screen. The resulting state is [`ScreenModel::new_cleared`].
    pub(super) fn push_clear_sequence(links: &UrlTable, slice: &mut LimitedOutputSlice) {
        if !links.is_empty() {
            slice.bytes.extend_from_slice(LINK_OFF);
        }
        slice.bytes.extend_from_slice(b"\x1b[0m\x1b[2J\x1b[H");
    }

    pub(super) fn content_at(&self, at: CellPosition) -> &CellContent {
        &self.contents[self.index(at)]
    }

    /// Whether a row has cells with unknown content.
    pub(super) fn is_row_damaged(&self, y: u16) -> bool {
        let start = self.index(CellPosition { x: 0, y });
        self.contents[start..start + usize::from(self.columns)].contains(&CellContent::Unknown)
    }

    /// Marks the content of `cells` as unknown.
    pub(super) fn mark_cells_unknown(&mut self, cells: Rect) {
        let cells = cells.intersection(Rect::new(0, 0, self.columns, self.rows));
        for y in cells.top()..cells.bottom() {
            for x in cells.left()..cells.right() {
                let index = self.index(CellPosition { x, y });
                self.contents[index] = CellContent::Unknown;
            }
        }
    }

    fn index(&self, at: CellPosition) -> usize {
        usize::from(at.y) * usize::from(self.columns) + usize::from(at.x)
    }

    /// Draws a stroke and returns true, or returns false and does nothing if it does not fit into the slice.
    pub(super) fn draw_stroke_if_output_fits(
        &mut self,
        stroke: &CellRun,
        links: &UrlTable,
        slice: &mut LimitedOutputSlice,
    ) -> bool {
        let (start, pen) = (slice.bytes.len(), self.pen);
        self.encode_stroke(stroke, links, &mut slice.bytes);
        if start > 0 && slice.bytes.len() > slice.most {
            slice.bytes.truncate(start);
            self.pen = pen;
            return false;
        }
        self.record_stroke(stroke);
        true
    }

    fn encode_stroke(&mut self, stroke: &CellRun, links: &UrlTable, bytes: &mut Vec<u8>) {
        let (at, requirements) = match stroke {
            CellRun::Text { at, text } => (at, text.pen.exact_requirements()),
            CellRun::Mosaic { at, glyph, mosaic, .. } => (at, glyph.pen_requirements(mosaic.pair)),
            CellRun::Erase { at, .. } => {
                (at, ForegroundParts::Blank.pen_requirements([TerminalColor::DefaultBackground; 2]))
            }
        };
        cursor_moves::push_shortest_move(self.cursor, *at, bytes);
        if self.pen.link != requirements.link {
            links.push_link_start(requirements.link, bytes);
            self.pen.link = requirements.link;
        }
        self.pen.switch_to(&requirements, bytes);
        match stroke {
            CellRun::Text { text, .. } => bytes.extend_from_slice(text.symbol.as_bytes()),
            CellRun::Mosaic { glyph, mosaic, count, .. } => {
                let symbol = glyph.symbol_for_pattern(mosaic.tile);
                bytes.extend_from_slice(symbol.encode_utf8(&mut [0; 4]).as_bytes());
                if *count > 1 {
                    bytes.extend(cursor_moves::csi_with_count(*count - 1, b'b'));
                }
            }
            CellRun::Erase { count: Some(count), .. } => {
                bytes.extend(cursor_moves::csi_with_count(*count, b'X'));
            }
            CellRun::Erase { count: None, .. } => bytes.extend_from_slice(b"\x1b[K"),
        }
    }

    /// Updates the cells and cursor after a stroke.
    fn record_stroke(&mut self, stroke: &CellRun) {
        match stroke {
            CellRun::Text { at, text } => {
                self.store_cell(*at, CellContent::Text(text.clone()), text.columns);
                // Terminals disagree about the width of other characters.
                self.cursor =
                    if text.is_single_narrow_char() { self.position_after_columns(*at, 1) } else { None };
            }
            CellRun::Mosaic { at, mosaic, count, .. } => {
                for x in at.x..at.x + count {
                    self.store_cell(CellPosition { x, ..*at }, CellContent::Mosaic(*mosaic), 1);
                }
                self.cursor = self.position_after_columns(*at, *count);
            }
            CellRun::Erase { at, count } => {
                for x in at.x..count.map_or(self.columns, |count| at.x + count) {
                    self.store_cell(CellPosition { x, ..*at }, CellContent::BLANK, 1);
                }
                self.cursor = Some(*at);
            }
        }
    }

    /// Returns the cursor position `columns` to the right, or `None` past the last column, where terminals
    /// differ.
    fn position_after_columns(&self, at: CellPosition, columns: u16) -> Option<CellPosition> {
        Some(CellPosition { x: at.x + columns, ..at }).filter(|next| next.x < self.columns)
    }

    /// Stores a drawn cell. Overwriting half of a wide character makes the other half unknown.
    fn store_cell(&mut self, at: CellPosition, look: CellContent, columns: u16) {
        let start = self.index(at);
        let end = start + usize::from(columns);
        if self.contents[start] == CellContent::Covered && start > 0 {
            self.contents[start - 1] = CellContent::Unknown;
        }
        self.contents[start] = look;
        self.contents[start + 1..end].fill(CellContent::Covered);
        if at.x + columns < self.columns && self.contents[end] == CellContent::Covered {
            self.contents[end] = CellContent::Unknown;
        }
    }
}
