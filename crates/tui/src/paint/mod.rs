//! Bytes for the terminal: only what changes to the eye, in slices.
//!
//! A [`Painter`] knows what is on the screen, because it sent it. It is aimed at a buffer of cells and gives the bytes
//! that lead there, slice by slice; a newer aim takes the place of the rest of the older one. A cell counts as the
//! two colors of its parts, however they are drawn: `▀ ▄ █` and the blank show the same halves in several ways, as
//! other characters do other parts, and the one that costs least after what was drawn before is taken.
//!
//! Words are exact. A picture that will be followed by better ones is drawn as far as an error is worth its bytes,
//! on a quick terminal exactly, and where an edit changed nothing the screen is left alone. A picture that stays is
//! exact to 1/255.
//! [`advise`] tells which pictures are worth being aimed at on a line of some speed.

mod abilities;
mod candidates;
mod cell;
mod cost_model;
mod cursor_moves;
mod fidelity;
mod frame_pacing;
mod hyperlinks;
mod lines;
mod pen;
mod picture;
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

pub use self::abilities::can_repeat;
pub use self::fidelity::Fidelity;
pub use self::frame_pacing::{FrameTiming, PacingAdvice, advise};
use self::hyperlinks::Hyperlinks;
pub use self::hyperlinks::{Hyperlink, LINK_OFF};
pub use self::lines::in_lines;
use self::picture::ByteBudget;
use self::screen::{OutputSlice, ScreenModel, Stroke};
use self::stable_cells::StableCells;
use self::target_screen::{ScreenRegion, TargetScreen};
use super::color::ColorDepth;

/// Leads the screen to what is wanted.
#[derive(Debug)]
pub struct Painter {
    depth: ColorDepth,
    /// Whether the terminal knows REP.
    can_repeat: bool,
    /// None: its content is unknown.
    screen: Option<ScreenModel>,
    memory: StableCells,
    wanted: TargetScreen,
    links: Hyperlinks,
    budget: ByteBudget,
    /// Parts still to be looked at, in order.
    parts: vec::IntoIter<DrawStep>,
    /// The part that is being drawn.
    part: Option<DrawStep>,
    strokes: vec::IntoIter<Stroke>,
    /// Progress of the picture in each row.
    rows: Vec<RowProgress>,
    aim: u64,
}

/// A part of the screen that is drawn in one go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DrawStep {
    /// The words of a row.
    Words(u16),
    /// The picture in a row.
    Picture(u16),
    /// Words in a row that wait for the picture.
    Later(u16),
}

/// Content of a screen besides its cells.
#[derive(Clone, Debug, Default)]
pub struct FrameExtras {
    /// Words in these cells come after the picture.
    pub later: Rect,
    /// Links in the text.
    pub links: Vec<Hyperlink>,
}

/// Progress of the picture in a row.
#[derive(Clone, Copy, Debug, Default)]
struct RowProgress {
    /// The number of the last aim that it was drawn for.
    aim: u64,
    /// Whether it is as it is wanted.
    is_done: bool,
}

impl Painter {
    /// For a terminal of that many colors, whose content is unknown.
    pub fn new(depth: ColorDepth) -> Self {
        Self {
            depth,
            can_repeat: false,
            screen: None,
            memory: StableCells::default(),
            wanted: TargetScreen::nothing(depth),
            links: Hyperlinks::default(),
            budget: ByteBudget::default(),
            parts: Vec::new().into_iter(),
            part: None,
            strokes: Vec::new().into_iter(),
            rows: Vec::new(),
            aim: 0,
        }
    }

    /// The same for a terminal that knows REP; see [`can_repeat`].
    pub fn repeating(self, can_repeat: bool) -> Self {
        Self { can_repeat, ..self }
    }

    /// Show this from now on, whatever is left of what was wanted before. `picture`: where cells may differ from
    /// what is wanted as far as the fidelity says; all others are words and come first. A buffer of another size than
    /// the one before means that the screen has been resized.
    ///
    /// The picture goes on with the rows that the aims before did not come to, so that aims that follow each other
    /// faster than they are drawn lead to the edge all the same.
    pub fn aim(&mut self, wanted: &Buffer, picture: Rect, fidelity: Fidelity) {
        self.aim_with(wanted, picture, fidelity, &FrameExtras::default());
    }

    /// The same with links, and with words that come after the picture.
    pub fn aim_with(&mut self, wanted: &Buffer, picture: Rect, fidelity: Fidelity, besides: &FrameExtras) {
        let mut wanted = TargetScreen::new(wanted, picture, fidelity, self.depth).with_later(besides.later);
        for Hyperlink { cells, address } in &besides.links {
            wanted.link(*cells, self.links.number(address));
        }
        let size = (wanted.columns, wanted.rows);
        if self.screen.as_ref().is_some_and(|screen| (screen.columns, screen.rows) != size) {
            self.screen = None;
        }
        if self.screen.is_none() || self.rows.len() != usize::from(wanted.rows) {
            self.rows = vec![RowProgress::default(); usize::from(wanted.rows)];
        }
        for (y, row) in (0..wanted.rows).zip(&mut self.rows) {
            row.is_done = row.is_done && self.wanted.serves(&wanted, y);
            if fidelity == Fidelity::First && !row.is_done {
                row.aim = 0;
            }
        }
        self.memory.aim(&wanted, self.screen.as_ref());
        self.wanted = wanted;
        self.aim += 1;
        self.start_over();
    }

    fn start_over(&mut self) {
        let mut rows: Vec<u16> = self.wanted.rows_from_the_middle().collect();
        rows.sort_by_key(|y| self.rows[usize::from(*y)].aim);
        let words = (0..self.wanted.rows).map(DrawStep::Words);
        let later =
            (self.wanted.later.top()..self.wanted.later.bottom().min(self.wanted.rows)).map(DrawStep::Later);
        let picture = rows.into_iter().map(DrawStep::Picture);
        self.parts = words.chain(picture).chain(later).collect::<Vec<_>>().into_iter();
        self.part = None;
        self.strokes = Vec::new().into_iter();
        self.budget = ByteBudget::default();
    }

    /// The next bytes towards what is wanted, at most so many unless one cell needs more. Empty: it is shown. They
    /// have to be written: what follows builds on them. Between two slices nobody else may move the cursor or
    /// change the colors.
    pub fn slice(&mut self, most_bytes: usize) -> Vec<u8> {
        self.slice_until(most_bytes, || false)
    }

    /// The next slice; if `is_late` says so, only the bytes so far. It is asked before each row: to plan a picture takes longer
    /// than a key may wait.
    pub fn slice_until(&mut self, most_bytes: usize, is_late: impl Fn() -> bool) -> Vec<u8> {
        let mut slice = OutputSlice { bytes: Vec::new(), most: most_bytes };
        if self.wanted.is_empty() {
            return slice.bytes;
        }
        let (columns, rows) = (self.wanted.columns, self.wanted.rows);
        let screen = self.screen.get_or_insert_with(|| {
            ScreenModel::clear(&self.links, &mut slice);
            ScreenModel::cleared(columns, rows)
        });
        loop {
            while let Some(stroke) = self.strokes.as_slice().first() {
                if !screen.draw(stroke, &self.links, &mut slice) {
                    return slice.bytes;
                }
                if let (Some(DrawStep::Picture(_)), Stroke::Mosaic { at, count, .. }) = (self.part, stroke) {
                    self.memory.drawn(*at, *count);
                }
                self.strokes.next();
            }
            if let Some(DrawStep::Picture(y)) = self.part {
                self.memory.row_done(y);
                self.rows[usize::from(y)] = RowProgress { aim: self.aim, is_done: true };
            }
            if !slice.bytes.is_empty() && is_late() {
                self.part = None;
                return slice.bytes;
            }
            self.part = self.parts.next();
            let strokes = match self.part {
                Some(DrawStep::Words(y)) => words::plan(screen, &self.wanted, y, ScreenRegion::Words),
                Some(DrawStep::Later(y)) => words::plan(screen, &self.wanted, y, ScreenRegion::Later),
                Some(DrawStep::Picture(y)) if self.rows[usize::from(y)].is_done && !screen.is_damaged(y) => {
                    Vec::new()
                }
                Some(DrawStep::Picture(y)) if self.wanted.is_ramp() => {
                    words::plan(screen, &self.wanted, y, ScreenRegion::Picture)
                }
                Some(DrawStep::Picture(y)) => {
                    picture::plan(screen, &self.wanted, &self.memory, y, self.can_repeat, &mut self.budget)
                }
                None => break,
            };
            self.strokes = strokes.into_iter();
        }
        if self.wanted.fidelity == Fidelity::Still {
            self.memory.finish();
        }
        slice.bytes
    }

    /// The content of these cells is unknown from now on.
    pub fn damage(&mut self, cells: Rect) {
        if let Some(screen) = &mut self.screen {
            screen.damage(cells);
            self.start_over();
        }
    }

    /// The content of the screen is unknown from now on: it is cleared before anything else is drawn.
    pub fn forget(&mut self) {
        self.screen = None;
        self.memory.forget();
        self.rows.fill(RowProgress::default());
        self.start_over();
    }
}
