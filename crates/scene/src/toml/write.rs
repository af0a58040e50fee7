//! Writes documents that were built in memory as concise TOML: short numbers, bare keys, comments.

use super::tree::{Document, Entries, KeyValue, TableId, TomlValue, Value};

/// A comment in a built document.
#[derive(Clone, Debug)]
pub(super) struct Comment {
    /// The table to which the comment belongs.
    pub(super) table: TableId,
    /// Whether the comment is below the table's header instead of above it.
    pub(super) is_below_header: bool,
    pub(super) text: String,
}

/// Formats a document with its comments, which must be in order. Writes the tables in the order in which they
/// were added.
pub(super) fn format_document(document: &Document<'_>, comments: &[Comment]) -> String {
    let mut tables = Vec::new();
    collect_tables("", document.root(), &mut tables);
    tables.sort_by_key(|(_, entries)| entries.table_id());
    let (mut text, mut comments) = (String::new(), comments.iter().peekable());
    for (header, entries) in tables {
        let mut is_first = true;
        while let Some(comment) =
            comments.next_if(|one| !one.is_below_header && one.table <= entries.table_id())
        {
            if std::mem::take(&mut is_first) {
                start_paragraph(&mut text);
            }
            write_comment(&mut text, &comment.text);
        }
        start_paragraph(&mut text);
        text.push_str(&header);
        text.push('\n');
        while let Some(comment) = comments.next_if(|one| one.table == entries.table_id()) {
            write_comment(&mut text, &comment.text);
        }
        for KeyValue { key, value, .. } in entries.iter().filter(|entry| !has_header(entry.value)) {
            text.push_str(&format!("{} = {}\n", quote_key_part(key), format_value(value)));
        }
    }
    text
}

/// Collects all tables with headers below `entries`, whose dotted key is `path`.
fn collect_tables<'d>(path: &str, entries: Entries<'d>, tables: &mut Vec<(String, Entries<'d>)>) {
    for KeyValue { key, value, .. } in entries.iter().filter(|entry| has_header(entry.value)) {
        let dot = if path.is_empty() { "" } else { "." };
        let path = format!("{path}{dot}{}", quote_key_part(key));
        if let Some(inner) = value.as_table() {
            if !inner.is_implicit() {
                tables.push((format!("[{path}]"), inner));
            }
            collect_tables(&path, inner, tables);
        }
        let elements = value.as_array().into_iter().flat_map(|array| array.iter());
        tables.extend(elements.filter_map(|one| Some((format!("[[{path}]]"), one.as_table()?))));
    }
}

/// Whether a value is a table or a list of tables that has a header instead of a key.
fn has_header(value: Value<'_>) -> bool {
    let is_table = |value: Value<'_>| value.as_table().is_some_and(|inner| !inner.is_inline());
    is_table(value) || value.as_array().and_then(|array| array.iter().next()).is_some_and(is_table)
}

/// Adds an empty line unless the text is empty.
fn start_paragraph(text: &mut String) {
    if !text.is_empty() {
        text.push('\n');
    }
}

/// Adds a comment, wrapped to several lines if necessary.
fn write_comment(text: &mut String, comment: &str) {
    const WIDTH: usize = 110;
    let mut length = 1;
    text.push('#');
    for word in comment.split_whitespace() {
        if length + 1 + word.len() > WIDTH {
            text.push_str("\n#");
            length = 1;
        }
        // A control character would end the comment.
        text.extend(std::iter::once(' ').chain(word.chars().filter(|c| !c.is_control())));
        length += 1 + word.len();
    }
    text.push('\n');
}

/// Formats a value.
pub(crate) fn format_value(value: Value<'_>) -> String {
    match value.decode() {
        TomlValue::String(text) => quote_toml_string(text),
        TomlValue::Number(number) => format_number(number.to_f64().unwrap_or_default()),
        TomlValue::Boolean(flag) => flag.to_string(),
        TomlValue::Datetime => value.source_text().to_owned(),
        TomlValue::Array(array) => {
            // Separate the rows of a matrix with two spaces.
            let separator = |index: usize| match (index, array.len()) {
                (0, _) => "",
                (_, 16) if index.is_multiple_of(4) => ",  ",
                (_, _) => ", ",
            };
            let elements = array.iter().enumerate();
            let list: String = elements
                .map(|(index, element)| format!("{}{}", separator(index), format_value(element)))
                .collect();
            format!("[{list}]")
        }
        TomlValue::Table(entries) => {
            let pair =
                |one: KeyValue<'_>| format!("{} = {}", quote_key_part(one.key), format_value(one.value));
            format!("{{ {} }}", entries.iter().map(pair).collect::<Vec<_>>().join(", "))
        }
    }
}

/// Formats a number with the fewest digits.
fn format_number(number: f64) -> String {
    match number.abs() {
        0.0 => "0".to_owned(),
        magnitude if magnitude.is_nan() => "nan".to_owned(),
        magnitude if (1e-5..1e15).contains(&magnitude) => number.to_string(),
        _ => format!("{number:e}"),
    }
}

/// Formats a TOML basic string.
pub fn quote_toml_string(text: &str) -> String {
    let mut quoted = String::from('"');
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            control if control.is_control() => quoted.push_str(&format!("\\U{:08x}", u32::from(control))),
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

/// Formats one part of a dotted key, in quotes if it is not a bare key.
pub(crate) fn quote_key_part(name: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if !name.is_empty() && name.chars().all(is_bare) { name.to_owned() } else { quote_toml_string(name) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_formatted_concisely() {
        for (number, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (-2.5, "-2.5"),
            (500_000.125, "500000.125"),
            (1e-7, "1e-7"),
            (3e20, "3e20"),
            (f64::INFINITY, "inf"),
            (-f64::NAN, "nan"),
        ] {
            assert_eq!(format_number(number), text);
        }
        assert_eq!((quote_key_part("a-b_1"), quote_key_part("a b")), ("a-b_1".into(), "\"a b\"".into()));
    }

    #[test]
    fn comments_are_wrapped_and_sanitized() {
        let mut text = String::new();
        write_comment(&mut text, &format!("a\n[camera]\u{7} {}", "word ".repeat(40)));
        assert!(
            text.lines().count() > 1 && text.lines().all(|line| line.starts_with("# ") && line.len() <= 112),
            "{text}"
        );
    }
}
