//! The help overlay, generated from the key tables.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Block, BorderType, Clear, Widget};

use super::layout::Layout;
use super::text::{TextRole, nth_row, put_text, text_columns, wrap_text};
use crate::keymap::{KEYMAP, OVERLAY};
use crate::messages;
use crate::state::State;

/// Help entries that explain other parts of the screen.
const NOTES: &[(&str, &str)] = &[
    ("on screen after 9 ms", "from a save to the first changed cell"),
    ("31 kB sent", messages::HELP_BYTES),
    ("noise 2 %", "relative to the brightness of the whole image"),
    ("target 1 % per tile", "noise target per tile; ✓ reached everywhere"),
    ("bold", "changed by the last edit or key press"),
    ("render 1 s −.3 s", messages::HELP_STAGE_TIME),
    ("render 3", "number of finished renders, as in the history"),
];

/// Draws the help in the center of the screen.
pub(super) fn draw(state: &State, buffer: &mut Buffer) {
    let area = help_area(state);
    let inner = inside_border(area);
    let (page, last) = page_height_and_max_scroll(state);
    let first = state.overlays.help.scroll.min(last);
    let lines = help_lines(inner.width);
    let mut title = " keys ".to_owned();
    if last > 0 {
        title = format!(" keys · lines {}–{} of {} · j k ", first + 1, first + page, lines.len());
    }
    Clear.render(area, buffer);
    // Clear lines that the help only partly covers, because they would look truncated.
    let Layout { header, under, .. } = Layout::for_state(state);
    for line in [header, under].into_iter().filter(|line| line.intersects(area)) {
        Clear.render(line.intersection(buffer.area), buffer);
    }
    if inner != area {
        let border = TextRole::Faint.style(state.display.depth);
        let title_style = TextRole::Strong.style(state.display.depth);
        let block = Block::bordered().border_type(BorderType::Rounded).border_style(border);
        block.title_style(title_style).title(title).render(area, buffer);
    }
    let labels = label_column_width(inner.width);
    for (index, (label, help)) in (0..inner.height).zip(lines.iter().skip(first)) {
        let line = nth_row(inner, index);
        let place = Rect { x: line.x + 1, width: labels.min(line.width), ..line };
        put_text(buffer, place, &[(label, TextRole::Strong)], state.display.depth);
        put_text(
            buffer,
            super::text::remaining_row_area(line, labels + LABEL_GAP),
            &[(help, TextRole::Plain)],
            state.display.depth,
        );
    }
}

/// Number of columns between labels and descriptions.
const LABEL_GAP: u16 = 3;

/// Width of the label column if the help is `width` columns wide.
fn label_column_width(width: u16) -> u16 {
    const MIN: u16 = 9;
    max_entry_part_width(|(label, _)| label).min(MIN.max(width / 3))
}

/// The help entries, wrapped into lines.
fn help_lines(width: u16) -> Vec<(String, String)> {
    let labels = label_column_width(width);
    let both = |(label, help)| {
        let label = wrap_text(label, usize::from(labels));
        let help = wrap_text(help, usize::from(width.saturating_sub(labels + LABEL_GAP)));
        let line = |of: &[String], index: usize| of.get(index).cloned().unwrap_or_default();
        let count = label.len().max(help.len());
        (0..count).map(|index| (line(&label, index), line(&help, index))).collect::<Vec<_>>()
    };
    all_help_entries().flat_map(both).collect()
}

/// Returns the number of lines per page and the maximum scroll position.
pub(crate) fn page_height_and_max_scroll(state: &State) -> (usize, usize) {
    let inner = inside_border(help_area(state));
    let page = usize::from(inner.height).max(1);
    (page, help_lines(inner.width).len().saturating_sub(page))
}

fn all_help_entries() -> impl Iterator<Item = (&'static str, &'static str)> {
    let keys = KEYMAP.iter().filter(|it| !it.help.is_empty()).map(|it| (it.label, it.help));
    let overlay = OVERLAY.iter().filter(|it| !it.help.is_empty()).map(|it| (it.label, it.help));
    keys.chain(overlay).chain(NOTES.iter().copied())
}

fn max_entry_part_width(part: impl Fn((&'static str, &'static str)) -> &'static str) -> u16 {
    all_help_entries().map(|entry| text_columns(part(entry))).max().unwrap_or(0)
}

fn help_area(state: &State) -> Rect {
    let window = Rect::new(0, 0, state.display.window.columns, state.display.window.rows);
    // Leave the key line visible, because it shows how to scroll and close the help.
    let above = Rect { height: window.height.saturating_sub(u16::from(window.height > 3)), ..window };
    let width =
        max_entry_part_width(|(label, _)| label) + max_entry_part_width(|(_, help)| help) + LABEL_GAP + 3;
    let wide = centered_area(above, width, above.height);
    let height =
        u16::try_from(help_lines(inside_border(wide).width).len()).unwrap_or(u16::MAX).saturating_add(2);
    centered_area(above, width, height)
}

fn inside_border(area: Rect) -> Rect {
    if area.height > 3 && area.width > 3 { Block::bordered().inner(area) } else { area }
}

fn centered_area(area: Rect, width: u16, height: u16) -> Rect {
    let (width, height) = (width.min(area.width), height.min(area.height));
    Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height }
}
