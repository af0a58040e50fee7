//! The panel next to or below the image. During a render, it shows the stages and the assets being loaded;
//! afterwards, it shows the results.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::extras::FileLinksAndDelayedText;
use super::layout::{ENTRY_WIDTH, Layout};
use super::message;
use super::side_panel;
use super::stages::{self, StyledLine};
use super::status_line;
use super::text::{
    TextRole, floor_percent, format_bytes, format_two_digit_percent, nth_row, progress_bar_parts,
    text_columns, truncated_text, wrap_text,
};
use crate::pipeline::protocol::Stage;
use crate::preview_style::PreviewStyle;
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{AssetProgressBar, RequestStatus, State};

/// Width of an asset's progress bar.
const BAR_WIDTH: u16 = 8;
/// Width of a result's label.
const LABEL_WIDTH: usize = 8;

/// Draws the panel, using several columns if necessary and possible. Lines that do not fit are omitted.
pub(super) fn draw(state: &State, area: Rect, buffer: &mut Buffer) -> FileLinksAndDelayedText {
    if area.is_empty() {
        return FileLinksAndDelayedText::default();
    }
    let PanelTextLayout { lines, columns, room } = lay_out_panel_text(state, area);
    let width = room.width / columns;
    let mut drawn = FileLinksAndDelayedText::default();
    for (index, line) in (0..).zip(lines.iter()) {
        let (column, line_of) = (index / room.height, index % room.height);
        if column >= columns {
            break;
        }
        let gap = u16::from(column + 1 < columns);
        let place = Rect { x: room.x + column * width, width: width - gap, ..room };
        drawn.put_line_with_links(state, nth_row(place, line_of), line, buffer);
    }
    drawn.later = side_panel::draw_chart_and_history_strip(
        state,
        area,
        rows_used_by_lines(&lines, columns, room),
        buffer,
    );
    drawn
}

/// Returns the index of the history entry shown at a cell in the history strip.
pub(super) fn history_index_at(state: &State, area: Rect, column: u16, row: u16) -> Option<usize> {
    let PanelTextLayout { lines, columns, room } = lay_out_panel_text(state, area);
    side_panel::history_index_at(state, area, rows_used_by_lines(&lines, columns, room), column, row)
}

/// The panel's lines, the number of columns, and the area available for them.
struct PanelTextLayout {
    lines: Vec<StyledLine>,
    columns: u16,
    room: Rect,
}

fn lay_out_panel_text(state: &State, area: Rect) -> PanelTextLayout {
    let room = Rect { width: side_panel::available_line_width(state, area), ..area };
    let is_one_column = |lines: &[StyledLine]| lines.len() <= usize::from(room.height);
    let mut lines = panel_lines(state, room.width, room.width, true);
    if !is_one_column(&lines) {
        lines = panel_lines(state, room.width, room.width, false);
    }
    let mut room = room;
    if !is_one_column(&lines) {
        room = area;
        lines = panel_lines(state, room.width, room.width.min(ENTRY_WIDTH), false);
    }
    let wanted = lines.len().div_ceil(usize::from(room.height.max(1)));
    let columns = u16::try_from(wanted).unwrap_or(u16::MAX).clamp(1, (room.width / ENTRY_WIDTH).max(1));
    PanelTextLayout { lines, columns, room }
}

/// Number of rows used by the lines. With several columns, all rows are used.
fn rows_used_by_lines(lines: &[StyledLine], columns: u16, room: Rect) -> u16 {
    if columns > 1 { room.height } else { u16::try_from(lines.len()).unwrap_or(u16::MAX).min(room.height) }
}

/// Creates the panel's lines for `width`, with hints wrapped to `column`. Stage reasons are shown in full if
/// `is_in_full`, and otherwise shortened to fit next to the stages.
fn panel_lines(state: &State, width: u16, column: u16, is_in_full: bool) -> Vec<StyledLine> {
    let is_done = matches!(state.work.activity, RequestStatus::Done);
    let mut lines = inspected_lines(state, width);
    // Stages and results describe the newest render.
    if state.preview.history.is_viewing_older() {
        return lines;
    }
    // If the scene is broken, its stages have no visible result.
    if !is_done && !state.is_scene_broken() {
        let of = |stage| if is_in_full { stages::lines_of_stage_with_full_reason } else { stages::stage_line_with_reason }(state, stage, width);
        lines.extend(Stage::ALL.into_iter().flat_map(of));
    }
    if is_done {
        lines.extend(result_lines(state, column));
    }
    lines.extend(wrapped_save_scene_hint(state, column));
    // Progress bars are last because they appear and disappear.
    lines.extend(state.work.assets.iter().map(|asset| asset_progress_line(state, asset, width)));
    lines
}

/// Lines with the inspected values.
fn inspected_lines(state: &State, width: u16) -> Vec<StyledLine> {
    let facts = state
        .selection
        .facts
        .iter()
        .filter(|_| message::inspected_values_fit_panel(state, &Layout::for_state(state)))
        .flatten();
    let lines = facts.flat_map(|fact| wrap_text(fact, usize::from(width.min(2 * ENTRY_WIDTH))));
    let mut lines: Vec<StyledLine> = lines.map(|line| vec![(line, TextRole::Strong)]).collect();
    if !lines.is_empty() {
        lines.push(StyledLine::new());
    }
    lines
}

fn asset_progress_line(state: &State, asset: &AssetProgressBar, width: u16) -> StyledLine {
    let fraction = stages::asset_loaded_fraction(asset);
    let (filled_squares, empty) =
        progress_bar_parts(fraction, BAR_WIDTH, state.display.kind == PreviewStyle::Ascii);
    let percent = format!(" {:3} %", floor_percent(fraction));
    let room = width.min(2 * ENTRY_WIDTH).saturating_sub(BAR_WIDTH + text_columns(&percent) + 1);
    let name = truncated_text(&escape_invisible_chars(&asset.progress.name), room);
    let pad = usize::from(room - text_columns(&name).min(room)) + 1;
    let name = name + &" ".repeat(pad);
    vec![
        (name, TextRole::Plain),
        (filled_squares, TextRole::Working),
        (empty, TextRole::Faint),
        (percent, TextRole::Plain),
    ]
}

/// The results as lines, each with a label and a value.
fn result_lines(state: &State, width: u16) -> Vec<StyledLine> {
    let fact = |label: &str, value: String| {
        vec![(format!("{label:<LABEL_WIDTH$} "), TextRole::Faint), (value, TextRole::Plain)]
    };
    let mut lines = Vec::new();
    lines.extend(state.saving.unwritten.iter().map(|why| vec![(why.clone(), TextRole::Error)]));
    let mut add = |words: &str, tone| {
        lines.extend(wrap_text(words, usize::from(width)).into_iter().map(|line| vec![(line, tone)]));
    };
    status_line::unsaved_image_messages(state).iter().for_each(|words| add(words, TextRole::Faint));
    status_line::externally_changed_output_messages(state).for_each(|words| add(&words, TextRole::Warning));
    for written in status_line::files_containing_current_image(state) {
        lines.push(vec![("→ ".to_owned(), TextRole::Good), (written.escaped_path(), TextRole::File)]);
        let size = state.request.effective.as_ref().map(|it| format!(", {}×{}", it.width, it.height));
        lines.push(vec![(
            format!("  {}{}", format_bytes(written.bytes), size.unwrap_or_default()),
            TextRole::Faint,
        )]);
    }
    if let Some(report) = &state.work.report {
        let samples = report.image.samples;
        lines.push(fact(
            "samples",
            if samples.min == samples.max {
                samples.max.to_string()
            } else {
                format!("{} to {}", samples.min, samples.max)
            },
        ));
        lines.extend(report.image.error.map(|error| fact("noise", format_two_digit_percent(error))));
        lines.extend(state.request.effective.as_ref().filter(|it| it.error > 0.0).map(|it| {
            let label =
                if reached_render_limit(state) == Some(RenderLimit::Error) { "target ✓" } else { "target" };
            fact(label, format!("{} % per tile", f64::from((it.error * 1e4).round()) / 100.0))
        }));
    }
    match reached_render_limit(state) {
        Some(RenderLimit::Time) => lines.push(fact("stopped", "at time limit".to_owned())),
        Some(RenderLimit::Samples) => lines.push(fact("stopped", "at max samples".to_owned())),
        Some(RenderLimit::Error) | None => {}
    }
    lines.extend(status_line::save_to_screen_text(state).map(|words| vec![(words, TextRole::Faint)]));
    lines
}

/// A limit that can end a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RenderLimit {
    Time,
    Samples,
    /// All tiles have reached the requested `error`.
    Error,
}

/// Determines which limit ended the render, or returns `None` if only one was set.
fn reached_render_limit(state: &State) -> Option<RenderLimit> {
    let (image, effective) = (&state.work.report.as_ref()?.image, state.request.effective.as_ref()?);
    let is_by_error = effective.error > 0.0;
    match () {
        () if !is_by_error && state.request.command_line.time_seconds.is_none() => None,
        () if !image.complete => Some(RenderLimit::Time),
        // If a tile has reached the maximum number of samples, its error may still be too large.
        () if is_by_error && image.samples.max < effective.samples => Some(RenderLimit::Error),
        () => Some(RenderLimit::Samples),
    }
}

/// A wrapped hint for users who have not saved yet. If the scene is broken and there is no image, the status
/// line shows the hint instead.
fn wrapped_save_scene_hint(state: &State, width: u16) -> Vec<StyledLine> {
    if state.is_scene_broken() && state.preview.shown.is_none() {
        return Vec::new();
    }
    let mut lines: Vec<String> = Vec::new();
    for word in status_line::save_scene_hint(state).split_whitespace() {
        match lines.last_mut() {
            Some(line) if text_columns(line) + 1 + text_columns(word) <= width => {
                *line += &format!(" {word}");
            }
            Some(_) | None => lines.push(word.to_owned()),
        }
    }
    if !lines.is_empty() {
        lines.insert(0, String::new());
    }
    lines.into_iter().map(|line| vec![(line, TextRole::Faint)]).collect()
}
