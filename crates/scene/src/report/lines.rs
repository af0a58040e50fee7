//! Reports as styled lines, for the terminal UI.

use annotate_snippets::Renderer;
use anstyle::{AnsiColor, Effects};

use super::super::diagnostic::Diagnostic;
use super::render_diagnostics_with_renderer;

/// A line of a report.
pub type ReportLine = Vec<StyledSpan>;

/// A run of text with the same role.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StyledSpan {
    /// The role of the text, which determines its color.
    pub role: ReportTextRole,
    /// The text, without control characters.
    pub text: String,
}

/// Role of a piece of text. Front ends choose the colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportTextRole {
    /// Source text and paths.
    Text,
    /// The word `error`, and underlines and labels for errors.
    Error,
    /// The word `warning`, and underlines and labels for warnings.
    Warning,
    /// Line numbers and rules.
    Frame,
    /// The message and the word `help`.
    Message,
}

/// Returns the same report as [`super::render_diagnostics`], as styled lines.
pub fn render_diagnostics_as_lines(diagnostics: &[Diagnostic], width: usize) -> Vec<ReportLine> {
    let renderer = Renderer::plain()
        .error(AnsiColor::Red.on_default())
        .warning(AnsiColor::Yellow.on_default())
        .line_num(AnsiColor::Blue.on_default())
        .emphasis(Effects::BOLD.into());
    render_diagnostics_with_renderer(diagnostics, width, &renderer).lines().map(parse_styled_spans).collect()
}

/// Splits a line at color escape sequences, all of which come from the renderer because text from files is
/// sanitized.
fn parse_styled_spans(line: &str) -> ReportLine {
    let mut pieces = ReportLine::new();
    let mut role = ReportTextRole::Text;
    for (number, part) in line.split("\u{1b}[").enumerate() {
        let text = match part.split_once('m') {
            Some((codes, text)) if number > 0 => {
                role = role_from_color_code(codes);
                text
            }
            _ => part,
        };
        if !text.is_empty() {
            pieces.push(StyledSpan { role, text: text.to_owned() });
        }
    }
    pieces
}

/// Returns the role that a color code marks in [`render_diagnostics_as_lines`].
fn role_from_color_code(codes: &str) -> ReportTextRole {
    match codes {
        "31" => ReportTextRole::Error,
        "33" => ReportTextRole::Warning,
        "34" => ReportTextRole::Frame,
        "1" => ReportTextRole::Message,
        _ => ReportTextRole::Text,
    }
}
