//! The view list. It appears briefly in the panel or over the image after a view is selected.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Clear, Widget};

use super::layout::Layout;
use super::text::{TextRole, put_text};
use crate::choice::Choice;
use crate::pipeline::settings::ViewMode;
use crate::state::State;

/// Width of a list entry, including its digit.
const VIEW_ENTRY_WIDTH: u16 = 16;
/// Number of views that can be selected with a digit.
pub(crate) const SELECTABLE_VIEWS: usize = 9;

pub(super) fn draw_view_mode_list(state: &State, layout: &Layout, buffer: &mut Buffer) {
    let current = ViewMode::ALL.iter().position(|view| *view == state.request.view_mode()).unwrap_or(0);
    let area = list_area(layout).intersection(buffer.area);
    if area.is_empty() {
        return;
    }
    // Clear everything that would be partly covered by the list.
    let is_in_panel = layout.panel.intersection(area) == area;
    Clear.render(if is_in_panel { layout.panel } else { area }, buffer);
    let (columns, rows) = (usize::from((area.width / VIEW_ENTRY_WIDTH).max(1)), usize::from(area.height));
    // Center the current view if not all views fit.
    let shown = columns * rows;
    let first = current.saturating_sub(shown / 2).min(ViewMode::ALL.len().saturating_sub(shown));
    for (index, number) in (first..ViewMode::ALL.len()).take(shown).enumerate() {
        let (column, row) = ((index / rows) as u16, (index % rows) as u16);
        let place = Rect {
            x: area.x + column * VIEW_ENTRY_WIDTH,
            y: area.y + row,
            width: VIEW_ENTRY_WIDTH.min(area.width),
            height: 1,
        };
        let is_cut = index == 0 && first > 0 || index + 1 == shown && number + 1 < ViewMode::ALL.len();
        let more = if !is_cut {
            ""
        } else if index == 0 {
            "▴"
        } else {
            "▾"
        };
        draw_view_line(state, number, number == current, more, place, buffer);
    }
}

/// Number of views per column in the view list.
pub(crate) fn views_per_column(state: &State) -> usize {
    usize::from(list_area(&Layout::for_state(state)).height).max(1)
}

/// Draws a view and its digit, with a mark if more views are hidden above or below.
fn draw_view_line(
    state: &State,
    number: usize,
    is_current: bool,
    more: &str,
    place: Rect,
    buffer: &mut Buffer,
) {
    let digit = if number < SELECTABLE_VIEWS { (number + 1).to_string() } else { " ".to_owned() };
    let sign = if is_current { "▸" } else { " " };
    let name = format!(" {:<11}", ViewMode::ALL[number].name());
    let tone = if is_current { TextRole::Chosen } else { TextRole::Plain };
    let more = format!(" {more}");
    let pieces =
        [(sign, TextRole::Strong), (&*digit, TextRole::Strong), (&*name, tone), (&*more, TextRole::Strong)];
    put_text(buffer, place, &pieces, state.display.depth);
}

/// Returns the area for the list, in the panel if it is large enough. The list has two columns if one would
/// not fit.
fn list_area(layout: &Layout) -> Rect {
    let all = ViewMode::ALL.len() as u16;
    let panel = layout.panel;
    if panel.width >= VIEW_ENTRY_WIDTH && panel.height >= all {
        return Rect { height: all, ..panel };
    }
    let around =
        if panel.width >= 2 * VIEW_ENTRY_WIDTH && panel.height >= all / 2 { panel } else { layout.preview };
    let columns = if around.height >= all { 1 } else { 2 };
    let width = (columns * VIEW_ENTRY_WIDTH).min(around.width);
    Rect { x: around.right() - width, width, height: all.div_ceil(columns).min(around.height), ..around }
}
