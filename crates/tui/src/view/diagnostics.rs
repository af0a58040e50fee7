//! The pane that lists errors and warnings, next to the image or over its lower part.

use std::collections::HashMap;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Clear, Widget};

use super::layout::Layout;
use super::stages::StyledLine;
use super::text::{TextRole, format_count_with_noun, nth_row, put_text, put_text_right, wrap_text};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::report::{self, ReportTextRole};
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::State;

/// Maximum number of distinct diagnostics shown. The rest appear once the first ones are fixed.
const MAX_DIAGNOSTICS: usize = 100;

/// Maximum number of positions shown per diagnostic.
const MAX_PLACES: usize = 10;

/// Draws the pane, starting at its scroll position.
pub(super) fn draw(state: &State, area: Rect, buffer: &mut Buffer) {
    let area = area.intersection(buffer.area);
    let text = pane_lines(state, area);
    let area = pane_area(area, text.len(), area == Layout::for_state(state).panel);
    let (page, last) = page_size_and_max_scroll(&text, area);
    let first = state.overlays.diagnostics.scroll.min(last);
    Clear.render(area, buffer);
    draw_title(state, nth_row(area, 0), (last > 0).then_some((first, page, text.len())), buffer);
    for (index, line) in (1..area.height).zip(text.iter().skip(first)) {
        let pieces: Vec<(&str, TextRole)> = line.iter().map(|(text, tone)| (text.as_str(), *tone)).collect();
        put_text(buffer, nth_row(area, index), &pieces, state.display.depth);
    }
}

/// The cells covered by the pane, or an empty area if it is closed.
pub(super) fn covered_cells(state: &State) -> Rect {
    let Layout { pane, panel, .. } = Layout::for_state(state);
    if state.overlays.diagnostics.open {
        pane_area(pane, pane_lines(state, pane).len(), pane == panel)
    } else {
        Rect::ZERO
    }
}

/// Returns the bottom part of an area, tall enough for the title and the lines if possible. If the area is
/// the panel, returns all of it.
fn pane_area(area: Rect, lines: usize, is_panel: bool) -> Rect {
    if is_panel {
        return area;
    }
    let height = u16::try_from(lines + 1).unwrap_or(u16::MAX).clamp(area.height.min(4), area.height);
    Rect { y: area.bottom() - height, height, ..area }
}

/// Draws a horizontal rule with the number of errors and, if not all lines fit, the range of visible lines.
fn draw_title(state: &State, area: Rect, shown: Option<(usize, usize, usize)>, buffer: &mut Buffer) {
    let reported = state.warnings_and_write_failure();
    let has_error = reported.iter().any(|one| one.severity == Severity::Error);
    let tone =
        if state.overlays.problems.is_some() || has_error { TextRole::Error } else { TextRole::Warning };
    let rule = "─".repeat(usize::from(area.width));
    put_text(buffer, area, &[(&rule, tone)], state.display.depth);
    let words = match &state.overlays.problems {
        Some(_) => super::header::format_problem_count(state),
        None => report::summarize_diagnostic_counts(&reported),
    };
    let mut room = area;
    if let Some((first, page, all)) = shown {
        let lines = format!(" lines {}-{} of {all} ", first + 1, first + page);
        room.width -= put_text_right(buffer, area, &lines, tone, state.display.depth);
    }
    let room = super::text::remaining_row_area(room, 1);
    put_text(buffer, room, &[(" ", tone), (&words, tone), (" ", tone)], state.display.depth);
}

/// Returns the number of lines per page and the maximum scroll position.
pub(crate) fn page_height_and_max_scroll(state: &State) -> (usize, usize) {
    let area = Layout::for_state(state).pane;
    let text = pane_lines(state, area);
    page_size_and_max_scroll(&text, area)
}

fn page_size_and_max_scroll(text: &[StyledLine], area: Rect) -> (usize, usize) {
    let page = usize::from(area.height.saturating_sub(1)).max(1);
    (page, text.len().saturating_sub(page))
}

fn pane_lines(state: &State, area: Rect) -> Vec<StyledLine> {
    let width = usize::from(area.width);
    let Some(problems) = &state.overlays.problems else {
        return format_diagnostics(&state.warnings_and_write_failure(), width);
    };
    let mut text = Vec::new();
    if let Some(work) = &problems.work {
        text.extend(wrap_text_in_role(
            &format!("error: {}", escape_invisible_chars(work)),
            width,
            TextRole::Error,
        ));
    }
    text.extend(format_diagnostics(&problems.diagnostics, width));
    text
}

/// Formats the diagnostics, errors first. A diagnostic that is reported at several positions is listed only
/// once.
fn format_diagnostics(diagnostics: &[Diagnostic], width: usize) -> Vec<StyledLine> {
    let mut numbers = HashMap::new();
    let mut faults: Vec<Vec<&Diagnostic>> = Vec::new();
    for one in diagnostics {
        let label = one.place.as_ref().map(|place| place.label.as_str());
        let is_error = one.severity == Severity::Error;
        let number =
            *numbers.entry((is_error, &one.message, &one.path, &one.help, label)).or_insert(faults.len());
        match faults.get_mut(number) {
            Some(fault) => fault.push(one),
            None => faults.push(vec![one]),
        }
    }
    let start = |one: &Diagnostic| one.place.as_ref().map(|place| place.span.start);
    for fault in &mut faults {
        fault.sort_by_key(|one| start(one));
    }
    faults.sort_by_key(|fault| (fault[0].severity != Severity::Error, &fault[0].path, start(fault[0])));
    let mut lines: Vec<StyledLine> = faults
        .iter()
        .take(MAX_DIAGNOSTICS)
        .flat_map(|fault| format_diagnostic_with_positions(fault, width))
        .collect();
    lines.pop();
    if let Some(more @ 1..) = faults.len().checked_sub(MAX_DIAGNOSTICS) {
        lines.push(StyledLine::new());
        lines.push(vec![(
            format!("… {} not shown", format_count_with_noun(more, "more diagnostic")),
            TextRole::Plain,
        )]);
    }
    lines
}

/// Formats a diagnostic with its first position in full and the others only as line and column, followed by
/// an empty line.
fn format_diagnostic_with_positions(fault: &[&Diagnostic], width: usize) -> Vec<StyledLine> {
    let tone = |role| match role {
        ReportTextRole::Text => TextRole::Plain,
        ReportTextRole::Error => TextRole::Error,
        ReportTextRole::Warning => TextRole::Warning,
        ReportTextRole::Frame => TextRole::Faint,
        ReportTextRole::Message => TextRole::Strong,
    };
    let line =
        |line: report::ReportLine| line.into_iter().map(|piece| (piece.text, tone(piece.role))).collect();
    let mut lines = report::render_diagnostics_as_lines(std::slice::from_ref(fault[0]), width);
    // Drop the empty line and the count that end the report, because the title already contains the count.
    lines.truncate(lines.len().saturating_sub(2));
    let mut lines: Vec<StyledLine> = lines.into_iter().map(line).collect();
    let places: Vec<String> = fault[1..].iter().filter_map(|one| format_line_and_column(one)).collect();
    if !places.is_empty() {
        let shown = places.len().min(MAX_PLACES - 1);
        let more = match places.len() - shown {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let number = format_count_with_noun(places.len(), "place");
        let text = format!("  = also in {number}: {}{more}", places[..shown].join(", "));
        lines.extend(wrap_text_in_role(&text, width, TextRole::Plain));
    }
    lines.push(StyledLine::new());
    lines
}

/// Formats a diagnostic's position as `line:column`.
fn format_line_and_column(one: &Diagnostic) -> Option<String> {
    let place = one.place.as_ref()?;
    let (line, column) = report::line_and_column(&place.source, place.span.start);
    Some(format!("{line}:{column}"))
}

fn wrap_text_in_role(text: &str, width: usize, tone: TextRole) -> Vec<StyledLine> {
    wrap_text(text, width).into_iter().map(|line| vec![(line, tone)]).collect()
}
