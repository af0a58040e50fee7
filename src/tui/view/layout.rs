//! Where things are on the screen, and what there is no room for.

use ratatui::layout::Rect;

use crate::pipeline::protocol::PreviewSize;
use crate::tui::state::{PreviewKind, State};

/// The areas of the screen; one that has no room is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::tui) struct Layout {
    pub header: Rect,
    pub preview: Rect,
    pub stages: Rect,
    /// Where errors lie over preview and stages.
    pub pane: Rect,
    pub bar: Rect,
    pub status: Rect,
    pub bottom: Rect,
    /// What is not shown.
    pub hidden: Vec<&'static str>,
}

const STAGES_MIN_WIDTH: u16 = 28;
const STAGES_MAX_WIDTH: u16 = 46;
/// Eight stages and a few lines of results.
const STAGES_MIN_HEIGHT: u16 = 9;
/// Below this the preview gets all of the width.
const SIDE_BY_SIDE_WIDTH: u16 = 68;

impl Layout {
    /// For the state's window.
    pub(in crate::tui) fn of(state: &State) -> Self {
        Self::new(state.window.columns, state.window.rows, state.preview)
    }

    /// The preview that the window has room for: a box of square pixels, as many in the width of a cell as are drawn.
    pub(in crate::tui) fn preview_size(state: &State) -> Option<PreviewSize> {
        if state.preview == PreviewKind::None {
            return None;
        }
        let area = Self::of(state).preview;
        let across = state.pixels_across();
        let height = (f32::from(area.height) * state.window.cell_aspect * across as f32).round() as u32;
        (area.width > 0 && height > 0)
            .then_some(PreviewSize { width: u32::from(area.width) * across, height })
    }

    fn new(columns: u16, rows: u16, preview: PreviewKind) -> Self {
        let mut layout = Self::default();
        let mut rest = Rect::new(0, 0, columns, rows);
        if columns == 0 {
            return layout;
        }
        layout.status = take_bottom(&mut rest, 1);
        if rows >= 6 {
            layout.bottom = take_bottom(&mut rest, 1);
            std::mem::swap(&mut layout.status.y, &mut layout.bottom.y);
        } else {
            layout.hidden.push("messages");
        }
        if rows >= 4 {
            layout.bar = take_bottom(&mut rest, 1);
        } else {
            layout.hidden.push("progress");
        }
        if rows >= 8 {
            layout.header = take_top(&mut rest, 1);
        } else {
            layout.hidden.push("name");
        }
        layout.pane = lower_half(rest);
        layout.divide(rest, preview);
        if layout.preview.is_empty() && preview != PreviewKind::None {
            layout.hidden.push("preview");
        }
        layout
    }

    fn divide(&mut self, rest: Rect, preview: PreviewKind) {
        if preview == PreviewKind::None {
            self.stages = rest;
        } else if rest.width >= SIDE_BY_SIDE_WIDTH && rest.height >= STAGES_MIN_HEIGHT {
            let width = (rest.width / 4).clamp(STAGES_MIN_WIDTH, STAGES_MAX_WIDTH);
            self.stages = Rect { x: rest.right() - width, width, ..rest };
            self.preview = Rect { width: rest.width - width - 1, ..rest };
        } else if rest.height >= 3 * STAGES_MIN_HEIGHT && rest.width >= STAGES_MIN_WIDTH {
            let mut rest = rest;
            self.stages = take_bottom(&mut rest, STAGES_MIN_HEIGHT + 3);
            self.preview = rest;
        } else {
            self.preview = rest;
            self.hidden.push("stages");
        }
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

fn lower_half(rest: Rect) -> Rect {
    let height = (rest.height / 2).max(rest.height.min(3));
    Rect { y: rest.bottom() - height, height, ..rest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_80_by_24_nothing_is_hidden() {
        let layout = Layout::new(80, 24, PreviewKind::HalfBlock);
        assert_eq!(layout.hidden, Vec::<&str>::new());
        assert_eq!(layout.preview, Rect::new(0, 1, 51, 20));
        assert_eq!(layout.stages, Rect::new(52, 1, 28, 20));
        assert_eq!((layout.bar.y, layout.status.y, layout.bottom.y), (21, 22, 23));
    }

    #[test]
    fn small_windows_name_what_they_hide() {
        assert_eq!(Layout::new(40, 12, PreviewKind::HalfBlock).hidden, ["stages"]);
        assert_eq!(
            Layout::new(40, 1, PreviewKind::HalfBlock).hidden,
            ["messages", "progress", "name", "stages", "preview"]
        );
    }

    #[test]
    fn areas_lie_in_the_window_and_do_not_overlap() {
        for columns in 0..130 {
            for rows in 0..60 {
                for kind in [PreviewKind::HalfBlock, PreviewKind::Ascii, PreviewKind::None] {
                    let layout = Layout::new(columns, rows, kind);
                    let window = Rect::new(0, 0, columns, rows);
                    let areas = [
                        layout.header,
                        layout.preview,
                        layout.stages,
                        layout.bar,
                        layout.status,
                        layout.bottom,
                    ];
                    for (i, area) in areas.iter().enumerate() {
                        assert_eq!(window.intersection(*area).area(), area.area(), "{area:?} in {window:?}");
                        for other in &areas[..i] {
                            assert_eq!(
                                area.intersection(*other).area(),
                                0,
                                "{area:?} {other:?} in {window:?}"
                            );
                        }
                    }
                }
            }
        }
    }
}
