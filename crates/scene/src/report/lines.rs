//! The same report as lines of coloured pieces, for a pane of a terminal UI.

use annotate_snippets::Renderer;
use anstyle::{AnsiColor, Effects};

use super::super::diagnostic::Diagnostic;
use super::render_with;

/// A line of a report.
pub type Line = Vec<Piece>;

/// A run of text of one role.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Its role.
    pub role: Role,
    /// Without control characters.
    pub text: String,
}

/// Role of a piece of a report, so that each front end gives it its own colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Source text, paths.
    Text,
    /// The word `error`, underlines and labels of errors.
    Error,
    /// The word `warning`, underlines and labels of warnings.
    Warning,
    /// Line numbers and rules.
    Frame,
    /// The message, and the word `help`.
    Message,
}

/// The report of [`super::render`] line by line.
pub fn lines(diagnostics: &[Diagnostic], width: usize) -> Vec<Line> {
    let renderer = Renderer::plain()
        .error(AnsiColor::Red.on_default())
        .warning(AnsiColor::Yellow.on_default())
        .line_num(AnsiColor::Blue.on_default())
        .emphasis(Effects::BOLD.into());
    render_with(diagnostics, width, &renderer).lines().map(pieces).collect()
}

/// Splits a line at its colour sequences. Those are the renderer's own: text from files has none.
fn pieces(line: &str) -> Line {
    let mut pieces = Line::new();
    let mut role = Role::Text;
    for (number, part) in line.split("\u{1b}[").enumerate() {
        let text = match part.split_once('m') {
            Some((codes, text)) if number > 0 => {
                role = role_of(codes);
                text
            }
            _ => part,
        };
        if !text.is_empty() {
            pieces.push(Piece { role, text: text.to_owned() });
        }
    }
    pieces
}

/// The role whose colour in [`lines`] has this code.
fn role_of(codes: &str) -> Role {
    match codes {
        "31" => Role::Error,
        "33" => Role::Warning,
        "34" => Role::Frame,
        "1" => Role::Message,
        _ => Role::Text,
    }
}
