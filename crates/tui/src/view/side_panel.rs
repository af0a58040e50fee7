//! The noise curve and the history strip, shown below stages and results in the panel of a wide window.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::layout::ENTRY_WIDTH;
use super::{curve, diagnostics, strip};
use crate::state::{RequestStatus, State};

/// Minimum window width for the curve and the history.
const MIN_CURVE_WINDOW_WIDTH: u16 = 120;
/// Width of the lines in a divided panel, enough for a stage and its reason.
const COLUMN_WIDTH: u16 = 44;
/// Minimum panel width at which the lines are next to the curve and the history.
const MIN_DIVIDED_WIDTH: u16 = 3 * ENTRY_WIDTH;

/// Number of columns available for the panel's lines. The remaining columns are used for the curve and the
/// history.
pub(super) fn available_line_width(state: &State, panel: Rect) -> u16 {
    let is_divided = is_wide_enough_for_curve(state) && panel.width >= MIN_DIVIDED_WIDTH;
    if is_divided { COLUMN_WIDTH } else { panel.width }
}

fn is_wide_enough_for_curve(state: &State) -> bool {
    state.display.window.columns >= MIN_CURVE_WINDOW_WIDTH
}

/// Returns the area left for the curve and the history, next to or below the lines.
fn area_beside_or_below_lines(state: &State, panel: Rect, lines: u16) -> Rect {
    if !is_wide_enough_for_curve(state) || state.overlays.views.is_some() {
        return Rect::ZERO;
    }
    let used = available_line_width(state, panel);
    let area = if used < panel.width {
        super::text::remaining_row_area(panel, used + 2)
    } else {
        // Leave one empty row above.
        let used = (lines + u16::from(lines > 0)).min(panel.height);
        Rect { y: panel.y + used, height: panel.height - used, ..panel }
    };
    // Stay above the diagnostics pane.
    let over = diagnostics::covered_cells(state);
    if over.intersects(area) {
        return Rect { height: over.y.saturating_sub(area.y), ..area };
    }
    area
}

/// Draws the curve and the history strip if they fit. Returns the cells used.
pub(super) fn draw_chart_and_history_strip(
    state: &State,
    panel: Rect,
    lines: u16,
    buffer: &mut Buffer,
) -> Rect {
    let (curve, strip) = divide_chart_and_history_strip(state, panel, lines);
    curve::draw_noise_chart(state, curve, buffer);
    strip::draw_history_strip(state, strip, buffer);
    // Skip empty areas, since their origin would extend the union.
    [curve, strip].into_iter().filter(|area| !area.is_empty()).reduce(Rect::union).unwrap_or_default()
}

/// Returns the index of the history entry shown at a cell in the history strip.
pub(super) fn history_index_at(
    state: &State,
    panel: Rect,
    lines: u16,
    column: u16,
    row: u16,
) -> Option<usize> {
    let (_, strip) = divide_chart_and_history_strip(state, panel, lines);
    strip::entry_index_at(state, strip, column, row)
}

/// Divides the area between the curve and the strip. The strip is placed at the bottom so that it does not
/// move when the results change.
fn divide_chart_and_history_strip(state: &State, panel: Rect, lines: u16) -> (Rect, Rect) {
    let area = area_beside_or_below_lines(state, panel, lines);
    let is_over = state.work.activity == RequestStatus::Done && !state.preview.history.is_viewing_older();
    let wants_curve = |area| is_over && curve::chart_and_caption_height(state, area).is_some();
    if area.width >= MIN_DIVIDED_WIDTH {
        // Place them side by side.
        let half = if wants_curve(area) { area.width / 3 } else { 0 };
        let gap = if half > 0 { 2 } else { 0 };
        return (Rect { width: half, ..area }, super::text::remaining_row_area(area, half + gap));
    }
    if !wants_curve(area) {
        return (Rect::ZERO, area);
    }
    // The curve is at the top and the strip gets the remaining space. If the strip would not fit, the curve
    // is omitted.
    let rows = curve::chart_and_caption_height(state, area).unwrap_or(0);
    let rest = area.height.saturating_sub(rows + 1);
    let below = Rect { y: area.bottom() - rest, height: rest, ..area };
    if strip::rows_used_by_strip(state, below) > 0 || strip::rows_used_by_strip(state, area) == 0 {
        return (Rect { height: rows, ..area }, below);
    }
    (Rect::ZERO, area)
}
