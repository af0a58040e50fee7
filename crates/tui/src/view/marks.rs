//! Marks over the image: the crosshair, and the corners of the region to render first.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::TextRole;
use crate::pipeline::protocol::{NormalizedPosition, NormalizedRect};
use crate::preview_style::PreviewStyle;
use crate::state::State;

/// Draws the marks over an image that covers `cells`.
pub(super) fn draw_marks(state: &State, cells: Rect, buffer: &mut Buffer) {
    let mut mark = |spot: NormalizedPosition, symbols: [&str; 2]| {
        let symbol = symbols[usize::from(state.display.kind == PreviewStyle::Ascii)];
        let cell = cell_for_position(state, spot, cells).and_then(|place| buffer.cell_mut(place));
        if let Some(cell) = cell {
            cell.reset();
            cell.set_symbol(symbol).set_style(TextRole::Chosen.style(state.display.depth));
        }
    };
    if let Some(NormalizedRect { left, top, width, height }) =
        state.request.first_section.filter(|_| are_region_marks_visible(state))
    {
        // Keep the marks inside the region.
        let (right, bottom) = (left + width * 0.999, top + height * 0.999);
        mark(NormalizedPosition { x: left, y: top }, ["┌", "+"]);
        mark(NormalizedPosition { x: right, y: top }, ["┐", "+"]);
        mark(NormalizedPosition { x: left, y: bottom }, ["└", "+"]);
        mark(NormalizedPosition { x: right, y: bottom }, ["┘", "+"]);
    }
    if state.selection.is_focusing
        || state.selection.is_marking && state.request.first_section.is_none()
        || state.selection.facts.is_some()
    {
        mark(state.selection.crosshair, ["┼", "+"]);
    }
}

/// Whether to mark the region. It is marked while it is being selected or rendered.
fn are_region_marks_visible(state: &State) -> bool {
    state.selection.is_marking || state.work.is_request_running()
}

/// The cell at a position in the image, if visible.
fn cell_for_position(state: &State, spot: NormalizedPosition, cells: Rect) -> Option<(u16, u16)> {
    let section = state.preview.shown.as_ref().and_then(|shown| shown.section);
    let NormalizedRect { left, top, width, height } =
        section.unwrap_or(NormalizedRect { left: 0.0, top: 0.0, width: 1.0, height: 1.0 });
    let along = |at: f64, start: f64, length: f64, cells: u16| {
        let share = (at - start) / length;
        (0.0..1.0).contains(&share).then(|| ((share * f64::from(cells)) as u16).min(cells.saturating_sub(1)))
    };
    let column = along(spot.x, left, width, cells.width)?;
    let row = along(spot.y, top, height, cells.height)?;
    (!cells.is_empty()).then_some((cells.x + column, cells.y + row))
}
