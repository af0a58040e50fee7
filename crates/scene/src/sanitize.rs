//! Makes text from files safe to display: replaces control characters, invisible characters and bidirectional
//! overrides.

use std::borrow::Cow;

use crate::system::text::is_terminal_safe_char;

/// Replaces control and invisible characters with visible characters: control pictures such as `␛` for ESC
/// and `␊` for a line feed, four spaces for a tab, and escapes such as `\u{202e}` for C1 controls,
/// directional marks and zero-width characters. The result is a single line.
pub fn escape_invisible_chars(text: &str) -> Cow<'_, str> {
    if text.chars().all(is_terminal_safe_char) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '\t' => shown.push_str("    "),
            '\u{7f}' => shown.push('␡'),
            '\0'..='\u{1f}' => shown.extend(char::from_u32(0x2400 + u32::from(c))),
            c if is_terminal_safe_char(c) => shown.push(c),
            c => shown.extend(c.escape_unicode()),
        }
    }
    Cow::Owned(shown)
}

/// Makes text safe to display with [`escape_invisible_chars`] and truncates it to `limit` characters.
/// Truncated text ends with `…`.
pub fn escape_and_truncate(text: &str, limit: usize) -> String {
    let shown = escape_invisible_chars(text);
    if shown.chars().count() <= limit {
        return shown.into_owned();
    }
    shown.chars().take(limit.saturating_sub(1)).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_text_is_not_copied() {
        assert!(matches!(escape_invisible_chars("Bäume, 木, 🌳"), Cow::Borrowed(_)));
    }

    #[test]
    fn control_characters_become_visible() {
        assert_eq!(escape_invisible_chars("\u{1b}]52;c;x\u{7}"), "␛]52;c;x␇");
        assert_eq!(escape_invisible_chars("a\r\nb\tc\u{7f}\0"), "a␍␊b    c␡␀");
        assert_eq!(
            escape_invisible_chars("\u{9b}31m\u{202e}gpj.exe\u{2066}"),
            "\\u{9b}31m\\u{202e}gpj.exe\\u{2066}"
        );
        assert_eq!(escape_invisible_chars("\u{feff}a\u{200b}"), "\\u{feff}a\\u{200b}");
    }

    #[test]
    fn limit_counts_visible_characters() {
        assert_eq!(escape_and_truncate("äöü", 3), "äöü");
        assert_eq!(escape_and_truncate("äöüß", 3), "äö…");
        assert_eq!(escape_and_truncate("a\tbc", 4), "a  …");
    }
}
