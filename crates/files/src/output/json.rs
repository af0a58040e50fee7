//! Writes JSON that is safe to print on a terminal. Control characters and invisible characters are escaped,
//! as in `\u200d`.

use std::fmt::Write;

use serde::Serialize;

use crate::system::text::is_terminal_safe_char;

/// Formats a value on a single line, without a line feed.
///
/// # Errors
/// The value cannot be serialized.
pub fn to_line_without_newline(value: &impl Serialize) -> serde_json::Result<String> {
    serde_json::to_string(value).map(escape_terminal_unsafe)
}

/// Formats a value for a file: indented, with a final line feed.
///
/// # Errors
/// The value cannot be serialized.
pub fn to_pretty_text(value: &impl Serialize) -> serde_json::Result<String> {
    serde_json::to_string_pretty(value).map(|text| escape_terminal_unsafe(text) + "\n")
}

/// Escapes unsafe characters, which occur only inside strings. Line feeds occur only between tokens and are
/// kept.
fn escape_terminal_unsafe(text: String) -> String {
    let is_safe = |c: char| c == '\n' || is_terminal_safe_char(c);
    if text.chars().all(is_safe) {
        return text;
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_safe(c) {
            escaped.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                // Writing to a string cannot fail.
                let _ = write!(escaped, "\\u{unit:04x}");
            }
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unsafe_characters_are_escaped_reversibly() {
        let odd = "a\u{9b}\u{7f}\u{202e}\u{200d}\u{e0041}\u{1b}\n\t\"\\ä木🌳";
        let text = to_line_without_newline(&[odd]).expect("JSON");
        assert_eq!(text, "[\"a\\u009b\\u007f\\u202e\\u200d\\udb40\\udc41\\u001b\\n\\t\\\"\\\\ä木🌳\"]");
        assert_eq!(serde_json::from_str::<[String; 1]>(&text).expect("JSON"), [odd]);
        let laid_out = to_pretty_text(&[odd]).expect("JSON");
        assert_eq!(laid_out.lines().count(), 3);
        assert_eq!(serde_json::from_str::<[String; 1]>(&laid_out).expect("JSON"), [odd]);
    }
}
