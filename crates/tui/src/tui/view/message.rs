//! The last message, until the next key: in the line under the picture, without one in the last line, or in the first. Longer
//! messages go on over the picture.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Clear, Widget};

use super::layout::Layout;
use super::text::{Tone, columns, put, row, wrapped};
use crate::scene::sanitize::visible;
use crate::tui::state::State;

/// Rows that a panel needs to hold what was found at a place.
const FACTS: u16 = 10;

pub(super) fn draw(state: &State, layout: &Layout, buffer: &mut Buffer) {
    let Some((words, tone)) = words(state, layout) else { return };
    let line = line(layout);
    if columns(&words) <= line.width && !line.is_empty() {
        Clear.render(line.intersection(buffer.area), buffer);
        put(buffer, line, &[(&words, tone)], state.display.depth);
        return;
    }
    let room = over_picture(layout, line);
    let lines = wrapped(&words, usize::from(room.width));
    let height = u16::try_from(lines.len()).unwrap_or(u16::MAX).min(room.height);
    let area = Rect { y: room.bottom() - height, height, ..room };
    Clear.render(area.intersection(buffer.area), buffer);
    for (index, line) in (0..height).zip(&lines) {
        // What there is no row for is cut with a mark.
        let is_cut = index + 1 == height && lines.len() > usize::from(height);
        let rest = if is_cut { lines[usize::from(index)..].join(" ") } else { line.clone() };
        put(buffer, row(area, index), &[(&rest, tone)], state.display.depth);
    }
}

/// Whether it takes a line of this layout from what else stands there.
pub(super) fn is_said(state: &State, layout: &Layout) -> bool {
    words(state, layout).is_some()
}

/// Whether some of it lies over the picture.
pub(super) fn is_over_picture(state: &State) -> bool {
    let layout = Layout::of(state);
    words(state, &layout).is_some_and(|(words, _)| columns(&words) > line(&layout).width)
}

/// Whether the panel has room for what was found at a place.
pub(super) fn is_in_panel(state: &State, layout: &Layout) -> bool {
    let is_covered = state.overlays.diagnostics.open && layout.pane == layout.panel;
    layout.panel.height >= FACTS && !is_covered
}

fn words(state: &State, layout: &Layout) -> Option<(String, Tone)> {
    if let Some(facts) = state.selection.facts.as_ref().filter(|_| !is_in_panel(state, layout)) {
        return Some((facts.join(" · "), Tone::Strong));
    }
    let message = state.overlays.message.as_ref().filter(|message| !message.is_empty())?;
    let message = visible(message).into_owned();
    // The list of views lies where a long one would, and its keys where a short one would without a line of its own.
    let has_place = !layout.under.is_empty() && columns(&message) <= layout.under.width;
    if state.overlays.views.is_some() && !has_place {
        return None;
    }
    let tone = if message.starts_with("error") { Tone::Error } else { Tone::Strong };
    Some((message, tone))
}

/// The line that a short one takes.
fn line(layout: &Layout) -> Rect {
    let lines = [layout.under, layout.keys];
    // The block of the state stays in sight.
    let beside = super::text::rest(layout.header, super::layout::BLOCK as u16 + 1);
    lines.into_iter().find(|line| !line.is_empty()).unwrap_or(beside)
}

/// The rows that a longer one may take, the last of them the lowest.
fn over_picture(layout: &Layout, line: Rect) -> Rect {
    // The union with an empty area would reach to its corner.
    let areas = [layout.preview, layout.panel].into_iter().filter(|area| !area.is_empty());
    let rest = areas.reduce(Rect::union).unwrap_or(line);
    if line.y == layout.header.y {
        return rest;
    }
    Rect { height: line.y + 1 - rest.y.min(line.y), y: rest.y.min(line.y), x: line.x, width: line.width }
}
