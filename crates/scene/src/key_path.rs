//! Dotted keys as in `--set`: `materials."copper ball".roughness`.

use unicode_width::UnicodeWidthStr;

use super::sanitize::{escape_and_truncate, escape_invisible_chars};

/// Splits a dotted key into its parts, which keep their quotes. Ignores dots inside quotes.
pub fn split_dotted_key(key: &str) -> Vec<&str> {
    let mut rest = key;
    let mut parts = Vec::new();
    while let Some(end) = find_unquoted(rest, '.') {
        parts.push(&rest[..end]);
        rest = &rest[end + 1..];
    }
    parts.push(rest);
    parts
}

/// Splits a text at the first space outside quotes, into a dotted key and the text after it.
pub fn split_at_unquoted_space(text: &str) -> Option<(&str, &str)> {
    find_unquoted(text, ' ').map(|end| (&text[..end], &text[end + 1..]))
}

/// Shortens a dotted key to at most `columns` columns. Drops leading tables first, and truncates the last
/// part only if it does not fit.
pub fn shortened_key(key: &str, columns: usize) -> String {
    let key = escape_invisible_chars(key);
    if key.width() <= columns {
        return key.into_owned();
    }
    let parts = split_dotted_key(&key);
    let last = parts.len() - 1;
    // Do not start with an index, because it is meaningless without the list's name.
    let begins_with_number = |skipped: &usize| parts[*skipped].parse::<u64>().is_ok();
    let tails =
        (1..=last).filter(|skipped| !begins_with_number(skipped)).map(|skipped| parts[skipped..].join("."));
    let fitting = tails.map(|tail| format!("…{tail}")).find(|tail| tail.width() <= columns);
    fitting.unwrap_or_else(|| escape_and_truncate(parts[last], columns))
}

/// Returns the byte index of the first `end` outside quotes.
fn find_unquoted(text: &str, end: char) -> Option<usize> {
    let (mut is_quoted, mut is_escaped) = (false, false);
    for (at, c) in text.char_indices() {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' if is_quoted => is_escaped = true,
            '"' => is_quoted = !is_quoted,
            c if c == end && !is_quoted => return Some(at),
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quoted_parts_keep_dots_and_spaces() {
        let key = r#"materials."copper \" ball v1.2".roughness"#;
        assert_eq!(split_dotted_key(key), ["materials", r#""copper \" ball v1.2""#, "roughness"]);
        assert_eq!(split_dotted_key("light.1.direction"), ["light", "1", "direction"]);
        assert_eq!(split_dotted_key("camera"), ["camera"]);
        assert_eq!(split_at_unquoted_space(&format!("{key} 0.1 → 0.4")), Some((key, "0.1 → 0.4")));
        assert_eq!(split_at_unquoted_space("camera"), None);
    }

    #[test]
    fn leading_tables_are_dropped_first() {
        let key = r#"materials."copper ball".roughness"#;
        for (columns, shown) in [
            (40, key),
            (33, key),
            (24, r#"…"copper ball".roughness"#),
            (23, "…roughness"),
            (20, "…roughness"),
            (10, "…roughness"),
            (9, "roughness"),
            (5, "roug…"),
        ] {
            assert_eq!(shortened_key(key, columns), shown, "{columns}");
        }
        assert_eq!(shortened_key("light.1.direction", 16), "…direction", "must not start with an index");
    }
}
