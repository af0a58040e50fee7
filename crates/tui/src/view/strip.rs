//! The history strip: recent renders from newest to oldest, each listed with the changes since the previous
//! one.

use super::preview;
use super::strip_words::{EntryNumberAndChanges, wrap_entry_text};
use super::text::{TextRole, nth_row, put_text, remaining_row_area};
use crate::action::Action;
use crate::film::Srgb8Image;
use crate::keymap;
use crate::messages;
use crate::state::State;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

/// Row counts in the strip: height of a thumbnail, height of an entry, and distance from one entry's top to
/// the next.
#[derive(Clone, Copy)]
struct EntryRowCounts {
    picture: u16,
    entry: u16,
    pitch: u16,
}

/// In a narrow strip, the row below a thumbnail is empty unless the text needs it.
const NARROW_ROWS: EntryRowCounts = EntryRowCounts { picture: 3, entry: 4, pitch: 4 };
const WIDE_ROWS: EntryRowCounts = EntryRowCounts { picture: 5, entry: 5, pitch: 6 };
/// Minimum width of a wide strip.
const MIN_WIDE_STRIP: u16 = 40;
/// Minimum width of the text next to a thumbnail.
const MIN_WORDS: u16 = 10;
/// Column width in a strip with several columns.
const COLUMN_WIDTH: u16 = 44;

/// A history entry and its position in the strip.
struct StripEntryLayout {
    /// Index into the history.
    index: usize,
    cells: Rect,
    rows: EntryRowCounts,
}

/// Draws the strip at the bottom of an area.
pub(super) fn draw_history_strip(state: &State, area: Rect, buffer: &mut Buffer) {
    let items = visible_entries(state, area);
    let Some(top) = items.iter().map(|item| item.cells.y).min() else { return };
    let depth = state.display.depth;
    let keys = keymap::binding_for_action(Action::OlderRender)
        .map_or("", |binding| binding.label)
        .replace(' ', " / ");
    let title = Rect { y: top - 1, height: 1, ..area };
    put_text(
        buffer,
        title,
        &[
            (messages::HISTORY, TextRole::Strong),
            ("  (", TextRole::Faint),
            (&keys, TextRole::Faint),
            (")", TextRole::Faint),
        ],
        depth,
    );
    for item in items {
        draw_entry(state, &item, buffer);
    }
}

fn draw_entry(
    state: &State,
    StripEntryLayout { index, cells, rows }: &StripEntryLayout,
    buffer: &mut Buffer,
) {
    let history = &state.preview.history;
    let Some(picture) = history.thumbnail(*index) else { return };
    let place = Rect { height: rows.picture, ..*cells };
    let place = Rect { width: thumbnail_width(state, picture, place), ..place };
    preview::draw_history_thumbnail(state, picture, place, buffer);
    let is_looked_at = history.shown_index() == Some(*index);
    let (mark, tone) = if is_looked_at { ("▸", TextRole::Strong) } else { (" ", TextRole::Plain) };
    // The text next to the thumbnail starts in the same column with or without a mark.
    let words = EntryNumberAndChanges {
        head: format!("{mark}{} ", entry_number_text(state, *index)),
        changes: history.describe_changes_since_previous(*index, is_entry_rendering(state, *index)),
    };
    let beside = remaining_row_area(*cells, place.width + 1);
    let lines =
        wrap_entry_text(&words, usize::from(beside.width), [rows.picture, rows.entry].map(usize::from));
    for (y, line) in (0..rows.entry).zip(&lines) {
        put_text(buffer, nth_row(beside, y), &[(line, tone)], state.display.depth);
    }
}

/// Number of the render that produced an entry, or a dash if the render was stopped.
fn entry_number_text(state: &State, index: usize) -> String {
    let under_way = is_entry_rendering(state, index).then_some(state.work.renders + 1);
    state
        .preview
        .history
        .render_number_at(index)
        .or(under_way)
        .map_or("–".to_owned(), |run| run.to_string())
}

/// Whether an entry's render is still running.
fn is_entry_rendering(state: &State, index: usize) -> bool {
    state.work.is_rendering()
        && state.preview.history.entry_belongs_to_request(index, state.request.generation)
}

/// Computes a thumbnail's width from its height, leaving space for text.
fn thumbnail_width(state: &State, picture: &Srgb8Image, cells: Rect) -> u16 {
    let shape = picture.width as f32 / picture.height.max(1) as f32 * state.display.window.cell_aspect;
    let width = (f32::from(cells.height) * shape).round() as u16;
    width.clamp(1, cells.width.saturating_sub(MIN_WORDS + 1).max(1))
}

/// Returns the number of rows that the strip uses in an area, or 0 if there are too few entries or too little
/// space.
pub(super) fn rows_used_by_strip(state: &State, area: Rect) -> u16 {
    let items = visible_entries(state, area);
    let top = items.iter().map(|item| item.cells.y).min();
    top.map_or(0, |top| area.bottom() - top + 1)
}

/// The entries that fit at the bottom of an area, newest first. The entry being viewed is always included.
fn visible_entries(state: &State, area: Rect) -> Vec<StripEntryLayout> {
    let count = state.preview.history.len();
    let rows = if area.width >= MIN_WIDE_STRIP { WIDE_ROWS } else { NARROW_ROWS };
    let columns = (area.width / COLUMN_WIDTH).max(1);
    let gap = rows.pitch - rows.entry;
    // The title uses one row.
    let most = (area.height + gap).saturating_sub(1) / rows.pitch;
    let room = usize::from(most) * usize::from(columns);
    if count < 2 || room < 2 || area.width < MIN_WORDS + 8 {
        return Vec::new();
    }
    let shown = count.min(room);
    let looked_at = state.preview.history.shown_index().unwrap_or(count - 1);
    let first = (count - shown).min(looked_at);
    // Use as few rows as possible.
    let high = shown.div_ceil(usize::from(columns)) as u16;
    let width = area.width / columns;
    let place = |number: u16| {
        let (column, line) = (number / high, number % high);
        let beside = u16::from(column + 1 < columns);
        let y = area.bottom() + gap - (high - line) * rows.pitch;
        Rect { x: area.x + column * width, y, width: width - beside, height: rows.entry }
    };
    let item = |number: usize| StripEntryLayout {
        index: first + shown - 1 - number,
        cells: place(number as u16),
        rows,
    };
    (0..shown).map(item).collect()
}

/// Returns the index of the history entry shown at a cell in the strip.
pub(super) fn entry_index_at(state: &State, area: Rect, column: u16, row: u16) -> Option<usize> {
    let is_there = |item: &StripEntryLayout| item.cells.contains((column, row).into());
    visible_entries(state, area).into_iter().find(is_there).map(|item| item.index)
}
