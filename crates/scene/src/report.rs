//! Formats diagnostics as text: `file:line:column`, the source line with the span underlined, and the help
//! text.
//!
//! Text from files is sanitized with [`escape_invisible_chars`]. The only control characters in the output
//! are line breaks and, with [`ReportStyle::Ansi`], color escape sequences.

mod lines;

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};

use super::diagnostic::{Diagnostic, Severity};
use super::sanitize::escape_invisible_chars;

pub use lines::{ReportLine, ReportTextRole, StyledSpan, render_diagnostics_as_lines};

/// Report style.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportStyle {
    /// Plain text.
    Plain,
    /// Text with ANSI color escape sequences.
    Ansi,
}

/// Formats diagnostics sorted by file and position, followed by a summary line. Wraps messages at `width`
/// columns and truncates source lines. Returns an empty string if there are no diagnostics.
pub fn render_diagnostics(diagnostics: &[Diagnostic], width: usize, style: ReportStyle) -> String {
    let renderer = match style {
        ReportStyle::Plain => Renderer::plain(),
        ReportStyle::Ansi => Renderer::styled(),
    };
    render_diagnostics_with_renderer(diagnostics, width, &renderer)
}

/// Counts the diagnostics, as in `2 errors, 1 warning`.
pub fn summarize_diagnostic_counts(diagnostics: &[Diagnostic]) -> String {
    let count = |severity| diagnostics.iter().filter(|one| one.severity == severity).count();
    let words = |count: usize, name: &str| match count {
        0 => None,
        1 => Some(format!("1 {name}")),
        _ => Some(format!("{count} {name}s")),
    };
    let parts = [words(count(Severity::Error), "error"), words(count(Severity::Warning), "warning")];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Converts offsets to lines and columns. Caches the line index for the last text.
#[derive(Default)]
pub struct LineColumnLocator(Option<(Arc<str>, LineIndex)>);

impl LineColumnLocator {
    /// Like [`line_and_column`], but fast for repeated calls with the same text.
    pub fn locate(&mut self, source: &Arc<str>, offset: usize) -> (usize, usize) {
        let (source, lines) = self.cached_line_index(source);
        lines.locate(source, offset)
    }

    fn cached_line_index(&mut self, source: &Arc<str>) -> &(Arc<str>, LineIndex) {
        self.0 = self.0.take().filter(|(known, _)| Arc::ptr_eq(known, source));
        self.0.get_or_insert_with(|| (Arc::clone(source), LineIndex::new(source)))
    }
}

/// 1-based line and column of a byte offset. Columns count characters.
pub fn line_and_column(source: &str, offset: usize) -> (usize, usize) {
    LineIndex::new(source).locate(source, offset)
}

fn render_diagnostics_with_renderer(diagnostics: &[Diagnostic], width: usize, renderer: &Renderer) -> String {
    if diagnostics.is_empty() {
        return String::new();
    }
    let renderer = renderer.clone().term_width(width.max(MIN_WIDTH)).decor_style(DecorStyle::Ascii);
    let mut sorted: Vec<&Diagnostic> = diagnostics.iter().collect();
    sorted.sort_by_key(|one| (&one.path, one.place.as_ref().map(|place| place.span.start)));
    let mut index = LineColumnLocator::default();
    let mut text = String::new();
    for diagnostic in sorted {
        text.push_str(&render_diagnostic(diagnostic, width.max(MIN_WIDTH), &renderer, &mut index));
        text.push_str("\n\n");
    }
    text.push_str(&summarize_diagnostic_counts(diagnostics));
    text.push('\n');
    text
}

/// Minimum report width, even if the terminal is narrower.
const MIN_WIDTH: usize = 30;

fn render_diagnostic(
    diagnostic: &Diagnostic,
    width: usize,
    renderer: &Renderer,
    index: &mut LineColumnLocator,
) -> String {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let path = diagnostic.path.to_string_lossy();
    let mut origin = Origin::path(escape_invisible_chars(&path));
    let mut snippet = None;
    let mut note = None;
    if let Some(place) = &diagnostic.place {
        let (source, lines) = index.cached_line_index(&place.source);
        let (line, column) = lines.locate(source, place.span.start);
        origin = origin.line(line).char_column(column);
        let whole = lines.line_span(line - 1, source).unwrap_or_default();
        let excerpt = Excerpt::new(source, whole, &place.span);
        let label = escape_invisible_chars(&place.label);
        let fits = excerpt.label_text_column(line) + display_width(&label) <= width;
        // The renderer does not wrap labels, so show a long label as a note.
        note = (!fits && !label.is_empty()).then_some(place.label.as_str());
        let label = (fits && !label.is_empty()).then(|| label.into_owned());
        let annotation = AnnotationKind::Primary.span(excerpt.span).label(label);
        snippet = Some(Snippet::source(excerpt.text).line_start(line).annotation(annotation));
    }
    let title =
        level.primary_title(escape_and_wrap(&diagnostic.message, width.saturating_sub("warning: ".len())));
    // Errors in command-line arguments have no file.
    let has_origin = !path.is_empty();
    let mut group: Group<'_> = if has_origin { title.element(origin) } else { Group::with_title(title) };
    if let Some(snippet) = snippet {
        group = group.element(snippet);
    }
    if let Some(note) = note {
        group = group.element(Level::NOTE.message(escape_and_wrap(note, width.saturating_sub(14))));
    }
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(escape_and_wrap(help, width.saturating_sub(14))));
    }
    let rendered = remove_repeated_origin(&renderer.render(&[group]));
    if has_origin { rendered } else { remove_lines_equal_to(&rendered, "|") }
}

/// Removes color escape sequences and surrounding whitespace from a rendered line.
fn strip_color_codes(line: &str) -> String {
    let parts = line.split("\u{1b}[").enumerate().map(|(number, part)| match part.split_once('m') {
        Some((_, text)) if number > 0 => text,
        _ => part,
    });
    parts.collect::<String>().trim().to_owned()
}

/// Removes the rendered lines that contain nothing but `text`.
fn remove_lines_equal_to(rendered: &str, text: &str) -> String {
    rendered.split_inclusive('\n').filter(|line| strip_color_codes(line) != text).collect()
}

/// Removes the line `:::`, which the renderer inserts before a snippet whose origin it has already shown.
fn remove_repeated_origin(rendered: &str) -> String {
    let Some(second) = rendered.lines().find(|line| strip_color_codes(line) == ":::") else {
        return rendered.to_owned();
    };
    rendered.replacen(&format!("{second}\n"), "", 1)
}

/// A source line that is safe to display, and the underlined span.
struct Excerpt {
    text: String,
    span: Range<usize>,
}

impl Excerpt {
    /// Number of bytes of a long line to keep on each side of the span.
    const NEAR_BYTES: usize = 1_000;

    fn new(source: &str, line: Range<usize>, place: &Range<usize>) -> Self {
        let start = floor_char_boundary(source, place.start.clamp(line.start, line.end));
        let end = floor_char_boundary(source, place.end.clamp(start, line.end));
        let end = end.min(floor_char_boundary(source, start + Self::NEAR_BYTES)).max(start);
        let left = floor_char_boundary(source, line.start.max(start.saturating_sub(Self::NEAR_BYTES)));
        let right = floor_char_boundary(source, line.end.min(end + Self::NEAR_BYTES));
        let (before, inside, after) = (
            escape_invisible_chars(&source[left..start]),
            escape_invisible_chars(&source[start..end]),
            escape_invisible_chars(&source[end..right]),
        );
        let from = before.len();
        Self { span: from..from + inside.len(), text: format!("{before}{inside}{after}") }
    }

    /// Returns the column where the label starts, after the line number, ` | `, the text before the span, the
    /// carets and a space.
    fn label_text_column(&self, line: usize) -> usize {
        let frame = line.to_string().len() + " | ".len();
        frame
            + display_width(&self.text[..self.span.start])
            + display_width(&self.text[self.span.clone()]).max(1)
            + 1
    }
}

/// Display width of a string.
fn display_width(text: &str) -> usize {
    unicode_width::UnicodeWidthStr::width(text)
}

fn floor_char_boundary(source: &str, offset: usize) -> usize {
    let mut offset = offset.min(source.len());
    while !source.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}

/// The byte offset of the start of each line, and character counts for finding columns in long lines.
pub(crate) struct LineIndex {
    starts: Vec<usize>,
    /// Number of characters before each multiple of [`STEP`] bytes.
    characters: Vec<usize>,
}

/// Number of bytes between two character counts.
const STEP: usize = 1024;

/// Number of characters that start in these bytes.
fn count_characters(bytes: &[u8]) -> usize {
    #[cfg(test)]
    tests::BYTES_READ.set(tests::BYTES_READ.get() + bytes.len());
    let is_start = |byte: &&u8| **byte & 0b1100_0000 != 0b1000_0000;
    bytes.iter().filter(is_start).count()
}

impl LineIndex {
    pub(super) fn new(source: &str) -> Self {
        let after = source.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
        let mut counts = vec![0];
        for step in source.as_bytes().chunks(STEP) {
            counts.push(counts[counts.len() - 1] + count_characters(step));
        }
        Self { starts: std::iter::once(0).chain(after).collect(), characters: counts }
    }

    /// The number of characters between the start of the text and a byte offset.
    fn count_text_characters_before(&self, source: &str, offset: usize) -> usize {
        let step = offset / STEP;
        self.characters[step] + count_characters(&source.as_bytes()[step * STEP..offset])
    }

    /// The 1-based line number of a byte offset.
    pub(super) fn line_number(&self, offset: usize) -> usize {
        self.starts.partition_point(|start| *start <= offset)
    }

    /// Returns the 1-based line and column of a byte offset. A byte order mark is not counted.
    pub(super) fn locate(&self, source: &str, offset: usize) -> (usize, usize) {
        let offset = floor_char_boundary(source, offset);
        let line = self.line_number(offset);
        let start = self.starts[line - 1];
        let before = self.count_text_characters_before(source, offset)
            - self.count_text_characters_before(source, start);
        let has_mark = source[start..offset].starts_with('\u{feff}');
        (line, before + 1 - usize::from(has_mark))
    }

    /// Returns the byte range of the 0-based line `line`, without its line ending or a byte order mark.
    pub(super) fn line_span(&self, line: usize, source: &str) -> Option<Range<usize>> {
        let start = *self.starts.get(line)?;
        let end = self.starts.get(line + 1).map_or(source.len(), |next| next - 1);
        let text = &source[start..end];
        let mark = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
        Some(start + mark..start + text.strip_suffix('\r').unwrap_or(text).len().max(mark))
    }
}

/// Makes text safe to display and wraps it at word boundaries after at most `width` characters.
fn escape_and_wrap(text: &str, width: usize) -> Cow<'static, str> {
    let text = escape_invisible_chars(text);
    let mut lines = String::with_capacity(text.len());
    let mut column = 0;
    for word in text.split(' ') {
        let length = word.chars().count();
        if column > 0 && column + 1 + length > width {
            lines.push('\n');
            column = 0;
        } else if !lines.is_empty() {
            lines.push(' ');
            column += 1;
        }
        lines.push_str(word);
        column += length;
    }
    lines.into()
}

#[cfg(test)]
mod tests;
