//! Messages and inspected values. A message shares the status line with progress or results. If there is not
//! enough space, it covers the last rows of the image. If there is no status line, it replaces the key line
//! or the header.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Clear, Widget};

use super::layout::Layout;
use super::status_line;
use super::text::{TextRole, nth_row, put_text, remaining_row_area, text_columns, wrap_text};
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::State;

/// Panel height needed for the inspected values.
const INSPECTOR_HEIGHT: u16 = 10;
/// Number of columns between a message and the rest of the status line.
const MESSAGE_GAP: u16 = 2;

/// Where a message is shown.
enum MessagePosition {
    /// The message is on a single line.
    Line(Rect),
    /// The message covers the last rows of this area.
    Over(Rect),
}

pub(super) fn draw(state: &State, layout: &Layout, buffer: &mut Buffer) {
    let Some((words, tone)) = message_text(state, layout) else { return };
    let room = match message_position(state, layout, &words) {
        MessagePosition::Line(line) => {
            Clear.render(line.intersection(buffer.area), buffer);
            put_text(buffer, line, &[(&words, tone)], state.display.depth);
            return;
        }
        MessagePosition::Over(room) => room,
    };
    let lines = wrap_text(&words, usize::from(room.width));
    let height = u16::try_from(lines.len()).unwrap_or(u16::MAX).min(room.height);
    let area = Rect { y: room.bottom() - height, height, ..room };
    Clear.render(area.intersection(buffer.area), buffer);
    for (index, line) in (0..height).zip(&lines) {
        // Lines that do not fit are truncated with an ellipsis.
        let is_cut = index + 1 == height && lines.len() > usize::from(height);
        let rest = if is_cut { lines[usize::from(index)..].join(" ") } else { line.clone() };
        put_text(buffer, nth_row(area, index), &[(&rest, tone)], state.display.depth);
    }
}

/// Whether a message replaces an entire line. The status line is shared, not replaced.
pub(super) fn has_message_to_show(state: &State, layout: &Layout) -> bool {
    message_text(state, layout).is_some()
}

/// Returns the part of the status line that no message uses.
pub(super) fn status_line_area_beside_message(state: &State, layout: &Layout) -> Rect {
    let spot = message_text(state, layout).map(|(words, _)| message_position(state, layout, &words));
    let used = match spot {
        Some(MessagePosition::Line(line)) if line.y == layout.under.y => line.width + MESSAGE_GAP,
        Some(MessagePosition::Over(room)) if room.bottom() > layout.under.y => layout.under.width,
        Some(MessagePosition::Line(_) | MessagePosition::Over(_)) | None => 0,
    };
    remaining_row_area(layout.under, used)
}

/// Whether the message covers the image.
pub(super) fn covers_preview(state: &State) -> bool {
    let layout = Layout::for_state(state);
    message_text(state, &layout).is_some_and(|(words, _)| {
        matches!(message_position(state, &layout, &words), MessagePosition::Over(_))
    })
}

/// Whether the panel has space for the inspected values.
pub(super) fn inspected_values_fit_panel(state: &State, layout: &Layout) -> bool {
    let is_covered = state.overlays.diagnostics.open && layout.pane == layout.panel;
    layout.panel.height >= INSPECTOR_HEIGHT && !is_covered
}

fn message_text(state: &State, layout: &Layout) -> Option<(String, TextRole)> {
    if let Some(facts) = state.selection.facts.as_ref().filter(|_| !inspected_values_fit_panel(state, layout))
    {
        return Some((facts.join(" · "), TextRole::Strong));
    }
    let message = state.overlays.message.as_ref().filter(|message| !message.words.is_empty())?;
    let words = escape_invisible_chars(&message.words).into_owned();
    // The view list hides a long message. The list's keys hide a short message that has no line of its own.
    let has_place = !layout.under.is_empty()
        && matches!(message_position(state, layout, &words), MessagePosition::Line(_));
    if state.overlays.views.is_some() && !has_place {
        return None;
    }
    let tone = if words.starts_with("error") { TextRole::Error } else { TextRole::Strong };
    Some((words, tone))
}

fn message_position(state: &State, layout: &Layout, words: &str) -> MessagePosition {
    let width = text_columns(words);
    let under = layout.under;
    if under.is_empty() {
        // Do not cover the state block.
        let beside = remaining_row_area(layout.header, super::layout::STATE_BLOCK_WIDTH as u16 + 1);
        let line = if layout.keys.is_empty() { beside } else { layout.keys };
        let fits = width <= line.width && !line.is_empty();
        return if fits {
            MessagePosition::Line(line)
        } else {
            MessagePosition::Over(message_area_covering_rows_above(layout, line))
        };
    }
    let needed = match status_line::columns_reserved_for_status(state, layout) {
        0 => 0,
        needed => needed + MESSAGE_GAP,
    };
    if width.saturating_add(needed) <= under.width {
        return MessagePosition::Line(Rect { width, ..under });
    }
    let room = message_area_covering_rows_above(layout, under);
    let above = Rect { height: room.height.saturating_sub(under.height), ..room };
    MessagePosition::Over(if needed == 0 || above.is_empty() { room } else { above })
}

/// A line, together with the rows above it that a long message may cover.
fn message_area_covering_rows_above(layout: &Layout, line: Rect) -> Rect {
    // Skip empty areas, since their origin would extend the union.
    let areas = [layout.preview, layout.panel].into_iter().filter(|area| !area.is_empty());
    let rest = areas.reduce(Rect::union).unwrap_or(line);
    if line.y == layout.header.y {
        return rest;
    }
    Rect { height: line.y + 1 - rest.y.min(line.y), y: rest.y.min(line.y), x: line.x, width: line.width }
}
