//! JSON that is safe on a terminal: characters that it would act on, or not show, are escaped as `\u200d`.

use std::fmt::Write;

use serde::Serialize;

use crate::system::text::is_plain;

/// A value in one line, without a line end.
///
/// # Errors
/// The errors of the value's own serialisation.
pub fn in_a_line(value: &impl Serialize) -> serde_json::Result<String> {
    serde_json::to_string(value).map(harmless)
}

/// A value as the text of a file: indented, with a line end.
///
/// # Errors
/// The errors of the value's own serialisation.
pub fn file(value: &impl Serialize) -> serde_json::Result<String> {
    serde_json::to_string_pretty(value).map(|text| harmless(text) + "\n")
}

/// Escapes such characters. Line ends come from the layout, as they are escaped within strings; every other such
/// character is within a string.
fn harmless(text: String) -> String {
    let is_harmless = |c: char| c == '\n' || is_plain(c);
    if text.chars().all(is_harmless) {
        return text;
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_harmless(c) {
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
    fn what_a_terminal_acts_on_is_escaped_and_comes_back() {
        let odd = "a\u{9b}\u{7f}\u{202e}\u{200d}\u{e0041}\u{1b}\n\t\"\\ä木🌳";
        let text = in_a_line(&[odd]).expect("JSON");
        assert_eq!(text, "[\"a\\u009b\\u007f\\u202e\\u200d\\udb40\\udc41\\u001b\\n\\t\\\"\\\\ä木🌳\"]");
        assert_eq!(serde_json::from_str::<[String; 1]>(&text).expect("JSON"), [odd]);
        let laid_out = file(&[odd]).expect("JSON");
        assert_eq!(laid_out.lines().count(), 3);
        assert_eq!(serde_json::from_str::<[String; 1]>(&laid_out).expect("JSON"), [odd]);
    }
}
