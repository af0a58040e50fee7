//! The room that stages and results leave in the panel of a wide window: the curve of noise and the last pictures.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::layout::ENTRY_WIDTH;
use super::{curve, diagnostics, strip};
use crate::state::{Activity, State};

/// Columns of a window from which on there is such room.
const WIDE: u16 = 120;
/// Columns of the lines in a panel that is divided: as many as a stage with its reason takes.
const COLUMN: u16 = 44;
/// Columns of a panel that is divided side by side.
const DIVIDED: u16 = 3 * ENTRY_WIDTH;

/// Columns that the lines of a panel may take: the rest is spare.
pub(super) fn columns_of_lines(state: &State, panel: Rect) -> u16 {
    let is_divided = is_wide(state) && panel.width >= DIVIDED;
    if is_divided { COLUMN } else { panel.width }
}

fn is_wide(state: &State) -> bool {
    state.display.window.columns >= WIDE
}

/// The room beside or below the lines of a panel, which take so many rows.
fn area(state: &State, panel: Rect, lines: u16) -> Rect {
    if !is_wide(state) || state.overlays.views.is_some() {
        return Rect::ZERO;
    }
    let used = columns_of_lines(state, panel);
    let area = if used < panel.width {
        super::text::rest(panel, used + 2)
    } else {
        // A line stays free above.
        let used = (lines + u16::from(lines > 0)).min(panel.height);
        Rect { y: panel.y + used, height: panel.height - used, ..panel }
    };
    // What lies over it leaves the rows above.
    let over = diagnostics::covered(state);
    if over.intersects(area) {
        return Rect { height: over.y.saturating_sub(area.y), ..area };
    }
    area
}

/// Draws what there is room for. Returns the cells that it takes.
pub(super) fn draw(state: &State, panel: Rect, lines: u16, buffer: &mut Buffer) -> Rect {
    let (curve, strip) = divided(state, panel, lines);
    curve::draw(state, curve, buffer);
    strip::draw(state, strip, buffer);
    // The union with an empty area would reach to its corner.
    [curve, strip].into_iter().filter(|area| !area.is_empty()).reduce(Rect::union).unwrap_or_default()
}

/// The picture of the strip at a cell.
pub(super) fn picture_at(state: &State, panel: Rect, lines: u16, place: (u16, u16)) -> Option<usize> {
    let (_, strip) = divided(state, panel, lines);
    strip::at(state, strip, place)
}

/// Room of the curve and of the strip. The strip is at the bottom, so that it keeps its place while results change above it.
fn divided(state: &State, panel: Rect, lines: u16) -> (Rect, Rect) {
    let area = area(state, panel, lines);
    let is_over = state.work.activity == Activity::Done && !state.picture.history.is_open();
    let wants_curve = |area| is_over && curve::rows(state, area).is_some();
    if area.width >= DIVIDED {
        // Side by side.
        let half = if wants_curve(area) { area.width / 3 } else { 0 };
        let gap = if half > 0 { 2 } else { 0 };
        return (Rect { width: half, ..area }, super::text::rest(area, half + gap));
    }
    if !wants_curve(area) {
        return (Rect::ZERO, area);
    }
    // The curve takes its rows, then the strip what is left; with too few left, the strip comes first.
    let rows = curve::rows(state, area).unwrap_or(0);
    let rest = area.height.saturating_sub(rows + 1);
    let below = Rect { y: area.bottom() - rest, height: rest, ..area };
    if strip::rows(state, below) > 0 || strip::rows(state, area) == 0 {
        return (Rect { height: rows, ..area }, below);
    }
    (Rect::ZERO, area)
}
