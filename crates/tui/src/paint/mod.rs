//! Incremental terminal output. Only visible changes are encoded, in slices.
//!
//! A [`Painter`] keeps track of the screen content. Given a target buffer, it returns the bytes that turn the
//! current content into the target, slice by slice. A new target replaces any unfinished one. Cells are
//! compared by the colors of their two parts, no matter how they are drawn: the same halves can often be
//! drawn with any of several characters (`▀`, `▄`, `█` or a space). The painter picks the one that needs the
//! fewest bytes after the previously drawn cell.
//!
//! Text is always exact. Intermediate previews trade precision for size (except on a fast terminal, where
//! they are exact), and cells unaffected by an edit are not redrawn. The final preview is accurate to 1/255.
//! [`preview_pacing_decision`] decides which previews are worth drawing at the connection's speed.

mod candidates;
mod cell;
mod cost_model;
mod cursor_moves;
mod fidelity;
mod frame_pacing;
mod hyperlinks;
mod lines;
mod pen;
mod preview_rows;
mod rep_support;
mod row_optimizer;
mod screen;
mod stable_cells;
mod target_screen;
mod terminal_color;
#[cfg(test)]
mod tests;
mod words;

use std::vec;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

pub use self::fidelity::PreviewFidelity;
pub use self::frame_pacing::{PacingDecision, PacingInputs, preview_pacing_decision};
use self::hyperlinks::UrlTable;
pub use self::hyperlinks::{Hyperlink, LINK_OFF};
pub use self::lines::buffer_to_ansi_text;
use self::preview_rows::FirstPreviewByteBudget;
pub use self::rep_support::terminal_supports_rep;
use self::screen::{CellRun, LimitedOutputSlice, ScreenModel};
use self::stable_cells::FirstPreviewCells;
use self::target_screen::{TargetScreen, TextOrPreviewRegion};
use super::color::ColorDepth;

/// Draws target screens incrementally.
#[derive(Debug)]
pub struct Painter {
    depth: ColorDepth,
    /// Whether the terminal supports REP.
    can_repeat: bool,
    /// Model of the screen, or `None` if the screen content is unknown.
    screen: Option<ScreenModel>,
    memory: FirstPreviewCells,
    wanted: TargetScreen,
    links: UrlTable,
    budget: FirstPreviewByteBudget,
    /// Remaining drawing steps, in order.
    parts: vec::IntoIter<RowLayerToDraw>,
    /// The drawing step in progress.
    part: Option<RowLayerToDraw>,
    strokes: vec::IntoIter<CellRun>,
    /// Drawing progress for each row of the preview.
    rows: Vec<PreviewRowProgress>,
    aim: u64,
}

/// A layer of a row that has yet to be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RowLayerToDraw {
    /// Draw a row's text.
    Text(u16),
    /// Draw a row of the preview.
    Preview(u16),
    /// Draw the part of a row's text that was delayed until after the preview.
    DelayedText(u16),
}

/// Hyperlinks and drawing hints for a frame.
#[derive(Clone, Debug, Default)]
pub struct LinksAndDelayedText {
    /// Cells whose text is drawn after the preview.
    pub later: Rect,
    /// Hyperlinks in the text.
    pub links: Vec<Hyperlink>,
}

/// Drawing progress for one row of the preview.
#[derive(Clone, Copy, Debug, Default)]
struct PreviewRowProgress {
    /// Number of the last target for which the row was drawn.
    aim: u64,
    /// Whether the row on the screen matches its target.
    is_done: bool,
}

impl Painter {
    /// Creates a painter for a terminal with this color depth and unknown content.
    pub fn new(depth: ColorDepth) -> Self {
        Self {
            depth,
            can_repeat: false,
            screen: None,
            memory: FirstPreviewCells::default(),
            wanted: TargetScreen::empty(depth),
            links: UrlTable::default(),
            budget: FirstPreviewByteBudget::default(),
            parts: Vec::new().into_iter(),
            part: None,
            strokes: Vec::new().into_iter(),
            rows: Vec::new(),
            aim: 0,
        }
    }

    /// Sets whether the terminal supports REP. See [`terminal_supports_rep`].
    pub fn with_repeat_support(self, can_repeat: bool) -> Self {
        Self { can_repeat, ..self }
    }

    /// Sets a new target and drops whatever remains of the previous one. Cells in `picture` may differ from
    /// the target by as much as `fidelity` permits. All other cells are text and are drawn first. If the
    /// buffer has a different size, the screen is assumed to have been resized.
    ///
    /// Drawing of the preview starts with the rows that have waited longest, so every row gets drawn even if
    /// targets change faster than they can be drawn.
    pub fn set_target(&mut self, wanted: &Buffer, picture: Rect, fidelity: PreviewFidelity) {
        self.set_target_with_links(wanted, picture, fidelity, &LinksAndDelayedText::default());
    }

    /// Like [`Painter::set_target`], but with hyperlinks and with text to be drawn after the preview.
    pub fn set_target_with_links(
        &mut self,
        wanted: &Buffer,
        picture: Rect,
        fidelity: PreviewFidelity,
        extras: &LinksAndDelayedText,
    ) {
        let mut wanted =
            TargetScreen::new(wanted, picture, fidelity, self.depth).with_delayed_text_area(extras.later);
        for Hyperlink { cells, address } in &extras.links {
            wanted.link_cells(*cells, self.links.assign_url_number(address));
        }
        let size = (wanted.columns, wanted.rows);
        if self.screen.as_ref().is_some_and(|screen| (screen.columns, screen.rows) != size) {
            self.screen = None;
        }
        if self.screen.is_none() || self.rows.len() != usize::from(wanted.rows) {
            self.rows = vec![PreviewRowProgress::default(); usize::from(wanted.rows)];
        }
        for (y, row) in (0..wanted.rows).zip(&mut self.rows) {
            row.is_done = row.is_done && self.wanted.row_also_satisfies_other(&wanted, y);
            if fidelity == PreviewFidelity::First && !row.is_done {
                row.aim = 0;
            }
        }
        self.memory.set_target(&wanted, self.screen.as_ref());
        self.wanted = wanted;
        self.aim += 1;
        self.queue_all_draw_steps();
    }

    fn queue_all_draw_steps(&mut self) {
        let mut rows: Vec<u16> = self.wanted.preview_rows_center_outward().collect();
        rows.sort_by_key(|y| self.rows[usize::from(*y)].aim);
        let words = (0..self.wanted.rows).map(RowLayerToDraw::Text);
        let later = (self.wanted.later.top()..self.wanted.later.bottom().min(self.wanted.rows))
            .map(RowLayerToDraw::DelayedText);
        let picture = rows.into_iter().map(RowLayerToDraw::Preview);
        self.parts = words.chain(picture).chain(later).collect::<Vec<_>>().into_iter();
        self.part = None;
        self.strokes = Vec::new().into_iter();
        self.budget = FirstPreviewByteBudget::default();
    }

    /// Returns the next bytes to output, at most `max_bytes` unless a single cell needs more, or no bytes
    /// once the screen matches the target. The caller must write the bytes because later slices build on
    /// them. No other output may move the cursor or change colors between slices.
    pub fn next_slice(&mut self, max_bytes: usize) -> Vec<u8> {
        self.next_slice_before_deadline(max_bytes, || false)
    }

    /// Like [`Painter::next_slice`], but stops early once `is_late` returns true. `is_late` is called before
    /// each row because planning a whole preview would delay the response to a key press too much.
    pub fn next_slice_before_deadline(&mut self, max_bytes: usize, is_late: impl Fn() -> bool) -> Vec<u8> {
        let mut slice = LimitedOutputSlice { bytes: Vec::new(), most: max_bytes };
        if self.wanted.is_empty() {
            return slice.bytes;
        }
        let (columns, rows) = (self.wanted.columns, self.wanted.rows);
        let screen = self.screen.get_or_insert_with(|| {
            ScreenModel::push_clear_sequence(&self.links, &mut slice);
            ScreenModel::new_cleared(columns, rows)
        });
        loop {
            while let Some(stroke) = self.strokes.as_slice().first() {
                if !screen.draw_stroke_if_output_fits(stroke, &self.links, &mut slice) {
                    return slice.bytes;
                }
                if let (Some(RowLayerToDraw::Preview(_)), CellRun::Mosaic { at, count, .. }) =
                    (self.part, stroke)
                {
                    self.memory.record_drawn_cells(*at, *count);
                }
                self.strokes.next();
            }
            if let Some(RowLayerToDraw::Preview(y)) = self.part {
                self.memory.mark_row_as_drawn(y);
                self.rows[usize::from(y)] = PreviewRowProgress { aim: self.aim, is_done: true };
            }
            if !slice.bytes.is_empty() && is_late() {
                self.part = None;
                return slice.bytes;
            }
            self.part = self.parts.next();
            let strokes = match self.part {
                Some(RowLayerToDraw::Text(y)) => {
                    words::plan_text_row(screen, &self.wanted, y, TextOrPreviewRegion::Text)
                }
                Some(RowLayerToDraw::DelayedText(y)) => {
                    words::plan_text_row(screen, &self.wanted, y, TextOrPreviewRegion::DelayedText)
                }
                Some(RowLayerToDraw::Preview(y))
                    if self.rows[usize::from(y)].is_done && !screen.is_row_damaged(y) =>
                {
                    Vec::new()
                }
                Some(RowLayerToDraw::Preview(y)) if self.wanted.uses_ascii_ramp() => {
                    words::plan_text_row(screen, &self.wanted, y, TextOrPreviewRegion::Preview)
                }
                Some(RowLayerToDraw::Preview(y)) => preview_rows::plan_preview_row(
                    screen,
                    &self.wanted,
                    &self.memory,
                    y,
                    self.can_repeat,
                    &mut self.budget,
                ),
                None => break,
            };
            self.strokes = strokes.into_iter();
        }
        if self.wanted.fidelity == PreviewFidelity::Still {
            self.memory.finish_request();
        }
        slice.bytes
    }

    /// Marks the content of `cells` as unknown.
    pub fn damage(&mut self, cells: Rect) {
        if let Some(screen) = &mut self.screen {
            screen.mark_cells_unknown(cells);
            self.queue_all_draw_steps();
        }
    }

    /// Marks the whole screen as unknown. It is cleared before the next draw.
    pub fn invalidate(&mut self) {
        self.screen = None;
        self.memory.invalidate();
        self.rows.fill(PreviewRowProgress::default());
        self.queue_all_draw_steps();
    }
}
