//! Screen layout.
//!
//! Positions depend only on the window size, the image's aspect ratio and whether `tab` hides everything but
//! the image. They do not depend on the state of the render, so nothing moves during a render.

use ratatui::layout::Rect;

use crate::pipeline::protocol::{PreviewBounds, Stage};
use crate::preview_style::PreviewStyle;
use crate::state::State;

/// Areas of the screen. An area is empty if there is no space for it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Layout {
    /// The header with state and name. If `tab` hides everything but the image, this is the only line of
    /// text.
    pub header: Rect,
    pub preview: Rect,
    /// Stages and results, next to or below the image. If the panel is empty, the status line shows them.
    pub panel: Rect,
    /// The status line below the image: message, progress or result.
    pub under: Rect,
    /// The key line.
    pub keys: Rect,
    /// Diagnostics pane, next to the image or over its lower part.
    pub pane: Rect,
}

/// Width of the state block, which is fixed so that the name following it does not move.
pub(super) const STATE_BLOCK_WIDTH: usize = 13;
/// Windows with fewer rows than this have only one line of text.
const TWO_LINES: u16 = 6;
/// Windows with fewer rows than this have two lines of text.
const THREE_LINES: u16 = 14;
/// Combined width of a stage's name, time and time difference.
const SIDE_WIDTH: u16 = 23;
/// Width of a stage entry, including the gap between stages.
pub(super) const ENTRY_WIDTH: u16 = 26;
/// Minimum height of a panel next to the image, enough for half of the stages.
const SIDE_HEIGHT: u16 = 4;
/// Minimum fraction of the image's cells that must remain when a panel is added. If fewer would remain, the
/// panel is omitted.
const KEPT: f32 = 0.9;
/// Minimum sizes for a panel that shows diagnostics. Narrower panels must be taller.
const TEXT_SIZES: [(u16, u16); 2] = [(44, 8), (34, 16)];
/// Maximum height of a diagnostics pane over the image.
const PANE_HEIGHT: u16 = 12;

impl Layout {
    /// Computes the layout for the state's window and image.
    pub(crate) fn for_state(state: &State) -> Self {
        let shape = state.request.aspect() * state.display.window.cell_aspect;
        let shape = (state.display.kind != PreviewStyle::None).then_some(shape);
        Self::new(state.display.window.columns, state.display.window.rows, shape, state.preview.is_image_only)
    }

    /// Size of the largest preview that fits into the window, assuming square pixels.
    pub(crate) fn max_preview_size(state: &State) -> Option<PreviewBounds> {
        let area = Self::for_state(state).preview;
        let across = state.display.horizontal_pixels_per_cell();
        let height =
            (f32::from(area.height) * state.display.window.cell_aspect * across as f32).round() as u32;
        (area.width > 0 && height > 0).then_some(PreviewBounds {
            width: u32::from(area.width) * across,
            height,
            around: state.preview.close_up,
        })
    }

    /// Computes the layout for a window. `shape` is the image's aspect ratio in cells, or `None` if no image
    /// is shown.
    fn new(columns: u16, rows: u16, shape: Option<f32>, is_image_only: bool) -> Self {
        let mut layout = Self::default();
        let mut rest = Rect::new(0, 0, columns, rows);
        let is_image_only = is_image_only && shape.is_some();
        if is_image_only || rows < TWO_LINES {
            layout.header = take_bottom(&mut rest, 1);
        } else {
            layout.header = take_top(&mut rest, 1);
            layout.keys = take_bottom(&mut rest, 1);
            layout.under = take_bottom(&mut rest, u16::from(rows >= THREE_LINES));
        }
        (layout.preview, layout.panel) = match shape {
            None => (Rect::ZERO, rest),
            Some(_) if is_image_only => (rest, Rect::ZERO),
            Some(shape) => divide_image_and_panel(rest, shape),
        };
        let holds = |(width, height)| layout.panel.width >= width && layout.panel.height >= height;
        let has_room = TEXT_SIZES.into_iter().any(holds);
        layout.pane = if has_room { layout.panel } else { bottom_pane_area(rest) };
        layout
    }
}

/// Divides the space between image and panel so that the image is as large as possible. The panel is omitted
/// if it would take too much space.
fn divide_image_and_panel(rest: Rect, shape: f32) -> (Rect, Rect) {
    let cells = |area| {
        let (width, height) = largest_image_size_in_area(area, shape);
        u32::from(width) * u32::from(height)
    };
    let panels =
        [image_and_panel_below(rest, shape), image_and_panel_beside(rest, shape)].into_iter().flatten();
    let best = panels.max_by_key(|(preview, _)| cells(*preview));
    let is_kept = |(preview, _): &(Rect, Rect)| cells(*preview) as f32 >= KEPT * cells(rest) as f32;
    best.filter(is_kept).unwrap_or((rest, Rect::ZERO))
}

fn image_and_panel_beside(rest: Rect, shape: f32) -> Option<(Rect, Rect)> {
    let room = Rect { width: rest.width.checked_sub(SIDE_WIDTH + 1)?, ..rest };
    let (width, _) = largest_image_size_in_area(room, shape);
    let panel = Rect { x: rest.x + width + 1, width: rest.width - width - 1, ..rest };
    (rest.height >= SIDE_HEIGHT).then_some((Rect { width, ..rest }, panel))
}

fn image_and_panel_below(rest: Rect, shape: f32) -> Option<(Rect, Rect)> {
    let columns = usize::from(rest.width / ENTRY_WIDTH);
    // Rows for the stages and one line of results.
    let rows = u16::try_from(Stage::ALL.len().div_ceil(columns.max(1)) + 1).unwrap_or(u16::MAX);
    let room = Rect { height: rest.height.checked_sub(rows)?, ..rest };
    let (_, height) = largest_image_size_in_area(room, shape);
    let panel = Rect { y: rest.y + height, height: rest.height - height, ..rest };
    (columns > 0).then_some((Rect { height, ..rest }, panel))
}

/// Returns the columns and rows of the largest image with this aspect ratio that fits into an area.
fn largest_image_size_in_area(area: Rect, shape: f32) -> (u16, u16) {
    let rows = (f32::from(area.width) / shape).ceil();
    if rows <= f32::from(area.height) {
        (area.width, rows as u16)
    } else {
        (((f32::from(area.height) * shape).round() as u16).min(area.width), area.height)
    }
}

fn take_bottom(rest: &mut Rect, height: u16) -> Rect {
    let height = height.min(rest.height);
    rest.height -= height;
    Rect { y: rest.bottom(), height, ..*rest }
}

fn take_top(rest: &mut Rect, height: u16) -> Rect {
    let taken = Rect { height: height.min(rest.height), ..*rest };
    rest.y += taken.height;
    rest.height -= taken.height;
    taken
}

fn bottom_pane_area(rest: Rect) -> Rect {
    let height = (rest.height / 2).max(PANE_HEIGHT).min(rest.height);
    Rect { y: rest.bottom() - height, height, ..rest }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(columns: u16, rows: u16, aspect: f32) -> Layout {
        Layout::new(columns, rows, Some(aspect * 2.0), false)
    }

    #[test]
    fn panel_position_maximizes_the_image() {
        let four_by_three = layout(80, 24, 4.0 / 3.0);
        assert_eq!(four_by_three.preview, Rect::new(0, 1, 56, 21));
        assert_eq!(four_by_three.panel, Rect::new(57, 1, 23, 21));
        assert_eq!((four_by_three.under.y, four_by_three.keys.y), (22, 23));
        let wide = layout(80, 24, 16.0 / 9.0);
        assert_eq!((wide.preview, wide.panel), (Rect::new(0, 1, 80, 21), Rect::ZERO));
        let wide = layout(120, 40, 16.0 / 9.0);
        assert_eq!((wide.preview, wide.panel), (Rect::new(0, 1, 120, 34), Rect::new(0, 35, 120, 3)));
        let tall = layout(80, 60, 4.0 / 3.0);
        assert_eq!((tall.preview, tall.panel), (Rect::new(0, 1, 80, 30), Rect::new(0, 31, 80, 27)));
    }

    #[test]
    fn diagnostics_are_next_to_the_image_if_possible() {
        let square = layout(120, 40, 1.0);
        assert_eq!(square.pane, square.panel);
        let tall = layout(80, 60, 4.0 / 3.0);
        assert_eq!(tall.pane, tall.panel);
        assert_eq!(layout(80, 24, 16.0 / 9.0).pane, Rect::new(0, 10, 80, 12));
        assert_eq!(layout(30, 8, 1.0).pane, Rect::new(0, 1, 30, 6));
    }

    #[test]
    fn small_windows_have_fewer_text_lines() {
        let lines = |rows| {
            let layout = layout(40, rows, 4.0 / 3.0);
            [layout.header, layout.under, layout.keys, layout.preview].map(|area| area.height)
        };
        assert_eq!(lines(14), [1, 1, 1, 11]);
        assert_eq!(lines(12), [1, 0, 1, 10]);
        assert_eq!(lines(8), [1, 0, 1, 6]);
        assert_eq!(lines(5), [1, 0, 0, 4]);
        assert_eq!(lines(1), [1, 0, 0, 0]);
    }

    #[test]
    fn tab_hides_all_text_except_the_header() {
        let alone = Layout::new(80, 24, Some(2.0), true);
        assert_eq!((alone.preview, alone.header), (Rect::new(0, 0, 80, 23), Rect::new(0, 23, 80, 1)));
        let none = Layout::new(80, 24, None, true);
        assert_eq!(none.panel, Rect::new(0, 1, 80, 21), "without an image, tab should have no effect");
    }

    #[test]
    fn areas_are_disjoint_and_inside_the_window() {
        let shapes = [None, Some(0.1), Some(1.0), Some(2.7), Some(3.6), Some(40.0)];
        for (columns, rows) in (0..130).flat_map(|columns| (0..60).map(move |rows| (columns, rows))) {
            for (shape, is_image_only) in shapes.into_iter().flat_map(|shape| [(shape, false), (shape, true)])
            {
                let layout = Layout::new(columns, rows, shape, is_image_only);
                let window = Rect::new(0, 0, columns, rows);
                let areas = [layout.header, layout.preview, layout.panel, layout.under, layout.keys];
                for (i, area) in areas.iter().enumerate() {
                    assert_eq!(window.intersection(*area).area(), area.area(), "{area:?} in {window:?}");
                    for other in &areas[..i] {
                        assert_eq!(area.intersection(*other).area(), 0, "{area:?} {other:?} in {window:?}");
                    }
                }
                assert_eq!(window.intersection(layout.pane).area(), layout.pane.area());
            }
        }
    }
}
