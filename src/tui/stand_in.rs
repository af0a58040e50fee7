//! Text from files made harmless, and diagnostics as lines.

use std::borrow::Cow;

use crate::scene::diagnostic::{Diagnostic, Severity};

/// The text with every character that could steer a terminal replaced: control characters (C0, C1, DEL) and
/// those that turn the direction of writing or are invisible.
pub(super) fn visible(text: &str) -> Cow<'_, str> {
    if text.chars().any(is_harmful) {
        Cow::Owned(text.chars().map(|c| if is_harmful(c) { '\u{fffd}' } else { c }).collect())
    } else {
        Cow::Borrowed(text)
    }
}

fn is_harmful(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

/// The diagnostics as lines for a pane of this many columns: message, place, source line, underline, help.
pub(super) fn lines(diagnostics: &[Diagnostic], width: usize) -> Vec<String> {
    let mut lines = Vec::new();
    for diagnostic in diagnostics {
        if !lines.is_empty() {
            lines.push(String::new());
        }
        one(diagnostic, &mut lines);
    }
    lines.iter().flat_map(|line| wrap(line, width.max(1))).collect()
}

fn one(diagnostic: &Diagnostic, lines: &mut Vec<String>) {
    let kind = match diagnostic.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    lines.push(format!("{kind}: {}", visible(&diagnostic.message)));
    let path = diagnostic.path.to_string_lossy();
    let Some(place) = &diagnostic.place else {
        lines.push(format!("  --> {}", visible(&path)));
        return help(diagnostic, lines);
    };
    let start = (0..=place.span.start.min(place.source.len()))
        .rev()
        .find(|&at| place.source.is_char_boundary(at))
        .unwrap_or(0);
    let before = &place.source[..start];
    let line = before.matches('\n').count() + 1;
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    let column = before[line_start..].chars().count() + 1;
    let text = place.source[line_start..].lines().next().unwrap_or("");
    let underlined = place.span.len().clamp(1, text.chars().count().saturating_sub(column - 1).max(1));
    lines.push(format!("  --> {}:{line}:{column}", visible(&path)));
    lines.push(format!("{line:4} | {}", visible(text)));
    let label = visible(&place.label);
    lines.push(format!("     | {}{} {label}", " ".repeat(column - 1), "^".repeat(underlined)));
    help(diagnostic, lines);
}

fn help(diagnostic: &Diagnostic, lines: &mut Vec<String>) {
    if let Some(help) = &diagnostic.help {
        lines.push(format!("     = help: {}", visible(help)));
    }
}

fn wrap(line: &str, width: usize) -> Vec<String> {
    let characters: Vec<char> = line.trim_end().chars().collect();
    if characters.is_empty() {
        return vec![String::new()];
    }
    characters.chunks(width).map(|chunk| chunk.iter().collect()).collect()
}
