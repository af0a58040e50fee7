//! The last pictures as a strip, the newest at its top, each with what changed since the one before.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::preview;
use super::text::{Tone, put, row, wrapped};
use crate::film::Picture;
use crate::tui::action::Action;
use crate::tui::keymap;
use crate::tui::state::State;

/// Rows of a picture in a narrow strip, and in a wide one.
const ROWS: u16 = 3;
const WIDE_ROWS: u16 = 5;
/// A strip of so many columns is wide.
const WIDE: u16 = 40;
/// Columns of the words beside a picture.
const LEAST_WORDS: u16 = 10;
/// Columns of a column of pictures, where there are several.
const COLUMN: u16 = 44;

/// A picture of the strip and its place.
struct Item {
    /// Index among the pictures that are kept.
    index: usize,
    cells: Rect,
}

/// Draws it at the bottom of an area.
pub(super) fn draw(state: &State, area: Rect, buffer: &mut Buffer) {
    let items = items(state, area);
    let Some(top) = items.iter().map(|item| item.cells.y).min() else { return };
    let depth = state.display.depth;
    let keys = keymap::of(Action::OlderPicture).map_or("", |binding| binding.label);
    let title = Rect { y: top - 1, height: 1, ..area };
    put(buffer, title, &[("the last pictures", Tone::Strong), ("  ", Tone::Plain), (keys, Tone::Faint)], depth);
    for item in items {
        draw_item(state, &item, buffer);
    }
}

fn draw_item(state: &State, Item { index, cells }: &Item, buffer: &mut Buffer) {
    let history = &state.picture.history;
    let Some(picture) = history.small(*index) else { return };
    let width = width(state, picture, *cells);
    preview::draw_small(state, picture, Rect { width, ..*cells }, buffer);
    let beside = super::text::rest(*cells, width + 1);
    let (mark, tone) = if history.looked_at() == Some(*index) { ("▸", Tone::Chosen) } else { ("", Tone::Plain) };
    let words = format!("{mark}{} {}", index + 1, history.change(*index));
    let lines = wrapped(&words, usize::from(beside.width));
    for (y, line) in (0..beside.height).zip(&lines) {
        let is_cut = y + 1 == beside.height && lines.len() > usize::from(beside.height);
        let rest = if is_cut { lines[usize::from(y)..].join(" ") } else { line.clone() };
        put(buffer, row(beside, y), &[(&rest, tone)], state.display.depth);
    }
}

/// Columns of a picture of this height, so that words have room beside it.
fn width(state: &State, picture: &Picture, cells: Rect) -> u16 {
    let shape = picture.width as f32 / picture.height.max(1) as f32 * state.display.window.cell_aspect;
    let width = (f32::from(cells.height) * shape).round() as u16;
    width.clamp(1, cells.width.saturating_sub(LEAST_WORDS + 1).max(1))
}

/// Rows of the whole strip in an area. 0 if there is nothing to choose from, or no room.
pub(super) fn rows(state: &State, area: Rect) -> u16 {
    let items = items(state, area);
    let top = items.iter().map(|item| item.cells.y).min();
    top.map_or(0, |top| area.bottom() - top + 1)
}

/// The pictures that have room, at the bottom of an area: the newest at the top, and of older ones the one that is looked at.
fn items(state: &State, area: Rect) -> Vec<Item> {
    let count = state.picture.history.len();
    let rows = if area.width >= WIDE { WIDE_ROWS } else { ROWS };
    let columns = (area.width / COLUMN).max(1);
    let most = area.height / (rows + 1);
    let room = usize::from(most) * usize::from(columns);
    if count < 2 || room < 2 || area.width < LEAST_WORDS + 8 {
        return Vec::new();
    }
    let shown = count.min(room);
    let looked_at = state.picture.history.looked_at().unwrap_or(count - 1);
    let first = (count - shown).min(looked_at);
    // As few rows as hold them all.
    let high = shown.div_ceil(usize::from(columns)) as u16;
    let width = area.width / columns;
    let place = |number: u16| {
        let (column, line) = (number / high, number % high);
        let gap = u16::from(column + 1 < columns);
        let y = area.bottom() - (high - line) * (rows + 1) + 1;
        Rect { x: area.x + column * width, y, width: width - gap, height: rows }
    };
    (0..shown).map(|number| Item { index: first + shown - 1 - number, cells: place(number as u16) }).collect()
}

/// The picture of the strip in this area at a cell.
pub(super) fn at(state: &State, area: Rect, (column, row): (u16, u16)) -> Option<usize> {
    let is_there = |item: &Item| item.cells.contains((column, row).into());
    items(state, area).into_iter().find(is_there).map(|item| item.index)
}
