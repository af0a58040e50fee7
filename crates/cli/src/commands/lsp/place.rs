//! Determines what can be completed at the cursor. Works line by line, because incomplete text may have
//! syntax errors.

use crate::scene::keys::find_table;
use crate::scene::keys::key::{KeyInfo, TableInfo, TableSyntax, TableTypeInfo};
use crate::scene::split_dotted_key;

/// The kind of text to complete at the cursor.
#[derive(Debug)]
pub(super) enum CursorContext {
    /// A header, or a line where a header can start.
    Header,
    /// A key of a table. `given` contains the table's other keys, and `is_assigned` is true if `=` follows.
    Key { of: CursorTable, given: Vec<String>, is_assigned: bool },
    /// The value of a key.
    Value { of: CursorTable, key: String, is_quoted: bool },
    /// A key in the inline table that is the value of the key `outer`.
    InnerKey { of: CursorTable, outer: String, given: Vec<String> },
    /// The value of a key in such an inline table.
    InnerValue { of: CursorTable, outer: String, key: String, is_quoted: bool },
}

/// The table at the cursor and its type.
#[derive(Clone, Copy, Debug)]
pub(super) struct CursorTable {
    pub(super) info: &'static TableInfo,
    pub(super) kind: Option<&'static TableTypeInfo>,
}

impl CursorTable {
    /// The keys allowed in the table.
    pub(super) fn allowed_keys(&self) -> Vec<&'static KeyInfo> {
        self.info.keys_for_type(self.kind).collect()
    }

    pub(super) fn find_allowed_key(&self, name: &str) -> Option<&'static KeyInfo> {
        self.info.keys_for_type(self.kind).find(|key| key.name == name)
    }
}

/// Returns the context at a byte offset, or `None` in comments, arrays and unknown tables.
pub(super) fn cursor_context(text: &str, offset: usize) -> Option<CursorContext> {
    let before = text.get(..offset)?;
    let line = &before[before.rfind('\n').map_or(0, |at| at + 1)..];
    let trimmed = line.trim_start();
    let around = EnclosingTable::from_offset(text, offset);
    if LineEndState::from_line(line).is_comment || around.is_in_array {
        return None;
    }
    if trimmed.starts_with('[') && !trimmed.contains(']') {
        return Some(CursorContext::Header);
    }
    let Some((header, body)) = around.table else {
        return (!trimmed.contains('=')).then_some(CursorContext::Header);
    };
    let after = text[offset..].split('\n').next().unwrap_or_default();
    let parts: Vec<&str> = split_dotted_key(header).into_iter().map(str::trim).collect();
    let mut info = find_table(parts[0])?;
    if let Some(inner) = parts.get(2) {
        info = info.find_inner_table(inner)?;
    } else if parts.len() == 1 && info.form == TableSyntax::Named {
        // `[materials]` followed by `wall = { … }`.
        let (_, braces) = line.split_once('{')?;
        let items = format!("{braces}{after}").replace(',', "\n");
        return context_in_table(info, &items, braces, after, true);
    }
    context_in_table(info, body, line, after, false)
}

/// Returns the context in a table. `body` contains the lines of a table or the items of an inline table.
/// `typed` is the text before the cursor, and `after` the text after it. Returns `None` in arrays and after
/// complete values.
fn context_in_table(
    info: &'static TableInfo,
    body: &str,
    typed: &str,
    after: &str,
    is_inline: bool,
) -> Option<CursorContext> {
    let of = CursorTable { info, kind: table_type_from_type_key(info, body) };
    let (opened, closed) = (typed.matches('{').count(), typed.matches('}').count());
    if opened > closed {
        return Some(context_in_inline_table(of, typed.rsplit_once('{').unwrap_or_default()));
    }
    let current = if is_inline { text_after_last_top_level_comma(typed) } else { typed };
    let Some((key, value)) = current.split_once('=') else {
        let is_assigned =
            after.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_').trim_start().starts_with('=');
        return Some(CursorContext::Key { of, given: other_keys_present(body, current.trim()), is_assigned });
    };
    let is_whole = !is_in_quotes(value) && value.contains(['"', '\'']);
    let is_open = !(is_whole || value.contains('['));
    is_open.then(|| CursorContext::Value { of, key: key.trim().to_owned(), is_quoted: is_in_quotes(value) })
}

/// Returns the context in an inline table, from the text before and after its opening brace.
fn context_in_inline_table(of: CursorTable, (before, typed): (&str, &str)) -> CursorContext {
    let outer = before.trim_end().trim_end_matches('=').trim_end();
    let outer =
        outer.rsplit(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap_or_default().to_owned();
    let current = text_after_last_top_level_comma(typed);
    match current.split_once('=') {
        Some((key, value)) => {
            let (key, is_quoted) = (key.trim().to_owned(), is_in_quotes(value));
            CursorContext::InnerValue { of, outer, key, is_quoted }
        }
        None => {
            let given = other_keys_present(&typed.replace(',', "\n"), current.trim());
            CursorContext::InnerKey { of, outer, given }
        }
    }
}

/// Returns the last item in a comma-separated list. Ignores commas within brackets.
fn text_after_last_top_level_comma(typed: &str) -> &str {
    let mut depth = 0_i32;
    let mut start = 0;
    for (at, character) in typed.char_indices() {
        match character {
            '[' | '{' => depth += 1,
            ']' | '}' => depth -= 1,
            ',' if depth <= 0 => start = at + 1,
            _ => {}
        }
    }
    &typed[start..]
}

fn is_in_quotes(value: &str) -> bool {
    LineEndState::from_line(value).quote.is_some()
}

/// State at the end of a line: whether a string, a comment or brackets are open.
#[derive(Clone, Copy, Debug, Default)]
struct LineEndState {
    /// The opening quote, if a string is open.
    quote: Option<char>,
    is_comment: bool,
    /// Number of opening brackets minus closing brackets.
    brackets: i32,
}

impl LineEndState {
    fn from_line(line: &str) -> Self {
        let mut scan = Self::default();
        let mut is_escaped = false;
        for character in line.chars() {
            match (scan.quote, character) {
                (Some('"'), '\\') if !is_escaped => {
                    is_escaped = true;
                    continue;
                }
                (Some(quote), _) if character == quote && !is_escaped => scan.quote = None,
                (Some(_), _) => {}
                (None, '"' | '\'') => scan.quote = Some(character),
                (None, '#') => return Self { is_comment: true, ..scan },
                (None, '[') => scan.brackets += 1,
                (None, ']') => scan.brackets -= 1,
                (None, _) => {}
            }
            is_escaped = false;
        }
        scan
    }
}

/// The table that contains a byte offset, and a flag that is set if the offset is in an array.
#[derive(Debug, Default)]
struct EnclosingTable<'t> {
    /// The last header before the offset, without its brackets, and the lines of its table, or `None` before
    /// the first header.
    table: Option<(&'t str, &'t str)>,
    /// Whether the line continues an array.
    is_in_array: bool,
}

impl<'t> EnclosingTable<'t> {
    fn from_offset(text: &'t str, offset: usize) -> Self {
        let (mut around, mut header) = (Self::default(), None);
        let (mut at, mut open) = (0, 0);
        for line in text.split_inclusive('\n') {
            // A key or a header ends an unclosed array.
            if starts_with_assignment(line) || header_name(line).is_some() {
                open = 0;
            }
            let (start, end) = (at, at + line.len());
            let is_here = start <= offset && (offset < end || end == text.len() && !line.ends_with('\n'));
            around.is_in_array |= is_here && open > 0;
            match header_name(line).filter(|_| open == 0 && !is_here) {
                // Stop at the next table.
                Some(_) if offset < start => break,
                Some(name) => header = Some((name, end)),
                None => open = (open + LineEndState::from_line(line).brackets).max(0),
            }
            at = end;
        }
        // Text that ends with a newline has an empty last line.
        around.is_in_array |= offset == text.len() && (text.is_empty() || text.ends_with('\n')) && open > 0;
        around.table = header.map(|(name, end)| (name, &text[end..at]));
        around
    }
}

/// Whether a line starts with a key and `=`.
fn starts_with_assignment(line: &str) -> bool {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    let rest = line.trim_start().trim_start_matches(is_bare);
    rest.trim_start().starts_with('=')
}

/// Returns the name in a table header, or `None` for other lines, such as `[1, 0],` in an array.
fn header_name(line: &str) -> Option<&str> {
    let (name, rest) = line.trim_start().strip_prefix('[')?.trim_start_matches('[').split_once(']')?;
    let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.' | '"' | '\'' | ' ');
    let rest = rest.trim_start_matches(']').trim();
    let is_name =
        name.trim_start().starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_part);
    (is_name && (rest.is_empty() || rest.starts_with('#'))).then(|| name.trim())
}

/// Returns the table's type: the value of its key `type`, or the default type.
fn table_type_from_type_key(info: &'static TableInfo, body: &str) -> Option<&'static TableTypeInfo> {
    let named = body.split(['\n', ',', '{', '}']).find_map(|item| {
        let (key, value) = item.split_once('=')?;
        (key.trim() == "type").then(|| first_string(value)).flatten()
    });
    info.find_type_or_default(named).or_else(|| info.find_type_or_default(None))
}

/// Contents of the first string in a value.
fn first_string(value: &str) -> Option<&str> {
    let (_, rest) = value.split_once(['"', '\''])?;
    Some(rest.split(['"', '\'']).next().unwrap_or(rest))
}

/// Returns the keys in `body`, except the key being typed.
fn other_keys_present(body: &str, typed: &str) -> Vec<String> {
    let keys = body.lines().filter_map(|line| line.split_once('=')).map(|(key, _)| key.trim().to_owned());
    keys.filter(|key| key != typed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the context at the `|` in the text.
    fn at(text: &str) -> Option<CursorContext> {
        let offset = text.find('|').expect("a cursor");
        cursor_context(&text.replace('|', ""), offset)
    }

    #[test]
    fn incomplete_text_has_a_context() {
        assert!(matches!(at("|"), Some(CursorContext::Header)));
        assert!(matches!(at("[ren|"), Some(CursorContext::Header)));
        assert!(at("# [ren|").is_none() && at("[render]\nwidth = 3 # so|").is_none());
        let Some(CursorContext::Key { of, given, .. }) =
            at("[render]\nwidth = 3\nhe|\nseed = 1\n\n[camera]\nup = [0, 1, 0]\n")
        else {
            panic!()
        };
        assert_eq!((of.info.name, given), ("render", vec!["width".to_owned(), "seed".to_owned()]));
        let Some(CursorContext::Value { of, key, is_quoted }) =
            at("[[light]]\ntype = \"spot\"\nfalloff = \"|\n")
        else {
            panic!()
        };
        assert_eq!((of.kind.map(|kind| kind.name), key.as_str(), is_quoted), (Some("spot"), "falloff", true));
        assert!(at("[nonsense]\na|").is_none());
        let table = |text: &str| match at(text) {
            Some(CursorContext::Key { of, .. }) => Some(of.info.name),
            _ => None,
        };
        assert_eq!(table("[[groups.\"a.b\".box]]\nce|"), Some("box"));
        assert_eq!(table("[materials.\"a.b\"]\nro|"), Some("materials"));
        assert_eq!(table("[[groups.a.light]]\nin|"), None);
    }

    #[test]
    fn inline_tables_have_a_context() {
        for text in [
            "[materials]\nwall = { type = \"metal\", color = 0.5, ro| }",
            "[materials]\nwall = { ro|, type = 'metal', color = 0.5 }",
        ] {
            let Some(CursorContext::Key { of, mut given, .. }) = at(text) else { panic!("{text}") };
            given.sort();
            assert_eq!(
                (of.kind.map(|kind| kind.name), given),
                (Some("metal"), vec!["color".to_owned(), "type".to_owned()])
            );
        }
        let Some(CursorContext::InnerValue { key, is_quoted, .. }) =
            at("[materials.a]\ndiffuse = { texture = \"|\" }")
        else {
            panic!()
        };
        assert_eq!((key.as_str(), is_quoted), ("texture", true));
        assert!(matches!(at("[materials]\na = { diffuse = { |"), Some(CursorContext::InnerKey { .. })));
        let Some(CursorContext::InnerKey { of, outer, given }) =
            at("[environment]\nsky = { sun = [0, 1, 0], tur|")
        else {
            panic!()
        };
        assert_eq!((of.info.name, outer.as_str(), given), ("environment", "sky", vec!["sun".to_owned()]));
        let Some(CursorContext::Value { key, .. }) =
            at("[materials]\na = { diffuse = [1, 2, 3], emission = |")
        else {
            panic!()
        };
        assert_eq!(key, "emission");
    }

    #[test]
    fn comments_are_ignored() {
        let kind = |text: &str| match at(text) {
            Some(CursorContext::Key { of, .. }) => (of.info.name, of.kind.map(|kind| kind.name)),
            _ => panic!("{text}"),
        };
        assert_eq!(
            kind("[materials.a]\ntype = \"metal\"   # \"phong\", gold\nro|"),
            ("materials", Some("metal"))
        );
        assert_eq!(kind("[materials.a] # x = 1, 2\ntype = 'glass'\nro|"), ("materials", Some("glass")));
        assert_eq!(kind("[camera]\nup = [0, 1, 0]\n[render] # a = b\nwi|").0, "render");
    }

    #[test]
    fn arrays_and_complete_values_have_no_context() {
        assert!(at("[materials.a]\ndiffuse = [1, |").is_none());
        assert!(at("[render]\nintegrator = \"path\" |").is_none());
        let is_assigned = |text: &str| matches!(at(text), Some(CursorContext::Key { is_assigned: true, .. }));
        assert!(is_assigned("[[sphere]]\nrad| = 0.5") && is_assigned("[[sphere]]\nra|dius = 0.5"));
        assert!(!is_assigned("[[sphere]]\nrad|"));
    }

    #[test]
    fn multiline_arrays_are_skipped() {
        let Some(CursorContext::Key { of, given, .. }) =
            at("[[mesh]]\nmatrix = [\n[1, 0],\n]\nsmo|\nmaterial = [\n[2],\n]\nscale = 1\n[camera]\nfov = 4")
        else {
            panic!()
        };
        assert_eq!(of.info.name, "mesh");
        assert_eq!(given, ["matrix", "material", "scale"]);
        for text in [
            "[[mesh]]\nmatrix = [\n1, 0,\n|",
            "[[mesh]]\nmatrix = [\n  1, 0, |\n]\nsmooth = true",
            "[[mesh]]\nmatrix = [ # ]\n|",
            "[[mesh]]\nmatrix = [\n[1, 0],\n[|",
        ] {
            assert!(at(text).is_none(), "{text}");
        }
        // An unclosed array ends at the next key or header.
        for text in ["[camera]\nup = [0, 1\nfov = 40\nap|", "[render]\nbackground = [0, 1\n[camera]\nap|"] {
            assert!(
                matches!(at(text), Some(CursorContext::Key { of, .. }) if of.info.name == "camera"),
                "{text}"
            );
        }
    }
}
