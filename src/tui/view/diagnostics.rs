//! The pane of errors and warnings over the lower part of the picture.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Block, Clear, Widget};

use super::layout::Layout;
use super::text::{Tone, put, row};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::report::{self, Role};
use crate::scene::sanitize::visible;
use crate::tui::state::State;

/// Draws it, from the line that the person scrolled to.
pub(super) fn draw(state: &State, area: Rect, buffer: &mut Buffer) {
    let area = area.intersection(buffer.area);
    let text = text(state, area);
    let area = fitting(area, text.len());
    let (page, last) = span(&text, area);
    let first = state.pane.scroll.min(last);
    Clear.render(area, buffer);
    let has_error = state.warnings.iter().any(|one| one.severity == Severity::Error);
    let tone = if state.problems.is_some() || has_error { Tone::Error } else { Tone::Warning };
    let mut title = title(state);
    if last > 0 {
        title = format!("{title}· lines {}-{} of {} ", first + 1, first + page, text.len());
    }
    let block = Block::bordered().border_style(tone.style(state.depth)).title(title);
    let inner = if bordered(area) { block.inner(area) } else { area };
    if bordered(area) {
        block.render(area, buffer);
    }
    for (index, line) in (0..).zip(text.iter().skip(first).take(page)) {
        let pieces: Vec<(&str, Tone)> = line.iter().map(|(text, tone)| (text.as_str(), *tone)).collect();
        put(buffer, row(inner, index), &pieces, state.depth);
    }
}

/// The lower part of an area that this many lines and a border need.
fn fitting(area: Rect, lines: usize) -> Rect {
    let height = u16::try_from(lines + 2).unwrap_or(u16::MAX).clamp(area.height.min(4), area.height);
    Rect { y: area.bottom() - height, height, ..area }
}

/// Lines on a page of the pane, and the furthest line that it can be scrolled to.
pub(in crate::tui) fn extent(state: &State) -> (usize, usize) {
    let area = Layout::of(state).pane;
    let text = text(state, area);
    span(&text, area)
}

fn span(text: &[Line], area: Rect) -> (usize, usize) {
    let page = usize::from(if bordered(area) { area.height - 2 } else { area.height });
    (page.max(1), text.len().saturating_sub(page.max(1)))
}

fn bordered(area: Rect) -> bool {
    area.height >= 4 && area.width >= 10
}

/// Pieces of text with their tones.
type Line = Vec<(String, Tone)>;

fn text(state: &State, area: Rect) -> Vec<Line> {
    let width = usize::from(if bordered(area) { area.width - 2 } else { area.width });
    let Some(problems) = &state.problems else { return reported(&state.warnings, width) };
    let mut text = reported(&problems.diagnostics, width);
    if let Some(work) = &problems.work {
        text.extend(wrapped(&format!("error: {}", visible(work)), width));
    }
    text
}

fn reported(diagnostics: &[Diagnostic], width: usize) -> Vec<Line> {
    let tone = |role| match role {
        Role::Text => Tone::Plain,
        Role::Error => Tone::Error,
        Role::Warning => Tone::Warning,
        Role::Frame => Tone::Faint,
        Role::Message => Tone::Strong,
    };
    let line = |line: report::Line| line.into_iter().map(|piece| (piece.text, tone(piece.role))).collect();
    let mut lines = report::lines(diagnostics, width);
    // The report ends with an empty line and a count, which stands in the title.
    lines.truncate(lines.len().saturating_sub(2));
    lines.into_iter().map(line).collect()
}

fn wrapped(line: &str, width: usize) -> Vec<Line> {
    let characters: Vec<char> = line.chars().collect();
    let part = |part: &[char]| vec![(part.iter().collect(), Tone::Error)];
    characters.chunks(width.max(1)).map(part).collect()
}

fn title(state: &State) -> String {
    let Some(problems) = &state.problems else { return format!(" {} ", report::summary(&state.warnings)) };
    let errors = problems.diagnostics.iter().filter(|it| it.severity == Severity::Error).count()
        + usize::from(problems.work.is_some());
    let errors = counted(errors, "error");
    if state.picture.is_some() { format!("{errors}· the last good picture stays ") } else { errors }
}

fn counted(count: usize, what: &str) -> String {
    format!(" {count} {what}{} ", if count == 1 { "" } else { "s" })
}
