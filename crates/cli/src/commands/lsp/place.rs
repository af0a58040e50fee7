//! The place of the cursor in a text that may be broken just there: found by lines, as a person reads them.

use crate::scene::keys::key::{KeyInfo, TableInfo, TypeInfo};
use crate::scene::keys::table;

/// A place where something may be typed.
#[derive(Debug)]
pub(super) enum Place {
    /// A header, or a line on which one may begin.
    Header,
    /// A key of a table; those that the table has already, and whether its `=` is there.
    Key { of: Section, given: Vec<String>, is_assigned: bool },
    /// The value of a key.
    Value { of: Section, key: String, is_quoted: bool },
    /// A key in the braces of a value.
    InnerKey { given: Vec<String> },
    /// The value of a key in the braces of a value.
    InnerValue { key: String, is_quoted: bool },
}

/// A table with its type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Section {
    pub(super) info: &'static TableInfo,
    pub(super) kind: Option<&'static TypeInfo>,
}

impl Section {
    /// Its keys.
    pub(super) fn keys(&self) -> Vec<&'static KeyInfo> {
        self.info.keys_of(self.kind).collect()
    }

    pub(super) fn key(&self, name: &str) -> Option<&'static KeyInfo> {
        self.info.keys_of(self.kind).find(|key| key.name == name)
    }
}

/// The place of a byte. `None` in comments, in arrays, and in tables that scenes do not have.
pub(super) fn place(text: &str, offset: usize) -> Option<Place> {
    let before = text.get(..offset)?;
    let line = &before[before.rfind('\n').map_or(0, |at| at + 1)..];
    let trimmed = line.trim_start();
    let around = Around::of(text, offset);
    if Scan::of(line).is_comment || around.is_in_array {
        return None;
    }
    if trimmed.starts_with('[') && !trimmed.contains(']') {
        return Some(Place::Header);
    }
    let Some((header, body)) = around.table else {
        return (!trimmed.contains('=')).then_some(Place::Header);
    };
    let after = text[offset..].split('\n').next().unwrap_or_default();
    let mut parts = header.split('.');
    let info = table(parts.next().unwrap_or_default().trim())?;
    if parts.next().is_none() && info.form == crate::scene::keys::key::Form::Named {
        // `[materials]` and then `wall = { … }`.
        let (_, braces) = line.split_once('{')?;
        let items = format!("{braces}{after}").replace(',', "\n");
        return in_table(info, &items, (braces, after), true);
    }
    in_table(info, body, (line, after), false)
}

/// The place in a table whose lines, or items in braces, are `body`; the texts are those before and behind the cursor. `None` in
/// arrays, and behind values that are whole.
fn in_table(
    info: &'static TableInfo,
    body: &str,
    (typed, after): (&str, &str),
    is_inline: bool,
) -> Option<Place> {
    let of = Section { info, kind: kind(info, body) };
    let (opened, closed) = (typed.matches('{').count(), typed.matches('}').count());
    if opened > closed {
        return Some(inner(typed.rsplit('{').next().unwrap_or_default()));
    }
    let current = if is_inline { last_item(typed) } else { typed };
    let Some((key, value)) = current.split_once('=') else {
        let is_assigned =
            after.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_').trim_start().starts_with('=');
        return Some(Place::Key { of, given: given(body, current.trim()), is_assigned });
    };
    let is_whole = !is_in_quotes(value) && value.contains(['"', '\'']);
    let is_open = !(is_whole || value.contains('['));
    is_open.then(|| Place::Value { of, key: key.trim().to_owned(), is_quoted: is_in_quotes(value) })
}

fn inner(typed: &str) -> Place {
    let current = last_item(typed);
    match current.split_once('=') {
        Some((key, value)) => {
            Place::InnerValue { key: key.trim().to_owned(), is_quoted: is_in_quotes(value) }
        }
        None => Place::InnerKey { given: given(&typed.replace(',', "\n"), current.trim()) },
    }
}

/// The typed part of the last item; commas within brackets end none.
fn last_item(typed: &str) -> &str {
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
    Scan::of(value).quote.is_some()
}

/// State at the end of a line: open string, comment, open brackets.
#[derive(Clone, Copy, Debug, Default)]
struct Scan {
    /// The quote of a string that is open.
    quote: Option<char>,
    is_comment: bool,
    /// Opened brackets, less the closed ones.
    brackets: i32,
}

impl Scan {
    fn of(line: &str) -> Self {
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

/// Surroundings of a byte of a text: its table, and whether it is in an array.
#[derive(Debug, Default)]
struct Around<'t> {
    /// The header above, without its brackets, and the lines of its table. `None` above the first header.
    table: Option<(&'t str, &'t str)>,
    /// Whether the line goes on with an array that begins above it.
    is_in_array: bool,
}

impl<'t> Around<'t> {
    fn of(text: &'t str, offset: usize) -> Self {
        let (mut around, mut header) = (Self::default(), None);
        let (mut at, mut open) = (0, 0);
        for line in text.split_inclusive('\n') {
            // A line that cannot be a part of an array ends one that nobody has closed.
            if is_key(line) || header_name(line).is_some() {
                open = 0;
            }
            let (start, end) = (at, at + line.len());
            let is_here = start <= offset && (offset < end || end == text.len() && !line.ends_with('\n'));
            around.is_in_array |= is_here && open > 0;
            match header_name(line).filter(|_| open == 0 && !is_here) {
                // The next table begins.
                Some(_) if offset < start => break,
                Some(name) => header = Some((name, end)),
                None => open = (open + Scan::of(line).brackets).max(0),
            }
            at = end;
        }
        // A text that ends with a line end has one more line.
        around.is_in_array |= offset == text.len() && (text.is_empty() || text.ends_with('\n')) && open > 0;
        around.table = header.map(|(name, end)| (name, &text[end..at]));
        around
    }
}

/// Whether a line begins with a key and its `=`.
fn is_key(line: &str) -> bool {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    let rest = line.trim_start().trim_start_matches(is_bare);
    rest.trim_start().starts_with('=')
}

/// The name in the brackets of a header. `None` for a line that is none, such as `[1, 0],` in an array.
fn header_name(line: &str) -> Option<&str> {
    let (name, rest) = line.trim_start().strip_prefix('[')?.trim_start_matches('[').split_once(']')?;
    let is_part = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.' | '"' | '\'' | ' ');
    let rest = rest.trim_start_matches(']').trim();
    let is_name =
        name.trim_start().starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(is_part);
    (is_name && (rest.is_empty() || rest.starts_with('#'))).then(|| name.trim())
}

/// The type of a table by its `type`, or the default.
fn kind(info: &'static TableInfo, body: &str) -> Option<&'static TypeInfo> {
    let named = body.split(['\n', ',', '{', '}']).find_map(|item| {
        let (key, value) = item.split_once('=')?;
        (key.trim() == "type").then(|| in_quotes(value)).flatten()
    });
    info.type_of(named).or_else(|| info.type_of(None))
}

/// The text of the first string of a value.
fn in_quotes(value: &str) -> Option<&str> {
    let (_, rest) = value.split_once(['"', '\''])?;
    Some(rest.split(['"', '\'']).next().unwrap_or(rest))
}

/// Keys that lines have, but for the one that is typed.
fn given(body: &str, typed: &str) -> Vec<String> {
    let keys = body.lines().filter_map(|line| line.split_once('=')).map(|(key, _)| key.trim().to_owned());
    keys.filter(|key| key != typed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The place of `|` in a text.
    fn at(text: &str) -> Option<Place> {
        let offset = text.find('|').expect("a cursor");
        place(&text.replace('|', ""), offset)
    }

    #[test]
    fn a_place_is_known_in_texts_that_are_being_typed() {
        assert!(matches!(at("|"), Some(Place::Header)));
        assert!(matches!(at("[ren|"), Some(Place::Header)));
        assert!(at("# [ren|").is_none() && at("[render]\nwidth = 3 # so|").is_none());
        let Some(Place::Key { of, given, .. }) =
            at("[render]\nwidth = 3\nhe|\nseed = 1\n\n[camera]\nup = [0, 1, 0]\n")
        else {
            panic!()
        };
        assert_eq!((of.info.name, given), ("render", vec!["width".to_owned(), "seed".to_owned()]));
        let Some(Place::Value { of, key, is_quoted }) = at("[[light]]\ntype = \"spot\"\nfalloff = \"|\n")
        else {
            panic!()
        };
        assert_eq!((of.kind.map(|kind| kind.name), key.as_str(), is_quoted), (Some("spot"), "falloff", true));
        assert!(at("[nonsense]\na|").is_none());
    }

    #[test]
    fn braces_hold_tables_and_textures() {
        for text in [
            "[materials]\nwall = { type = \"metal\", color = 0.5, ro| }",
            "[materials]\nwall = { ro|, type = 'metal', color = 0.5 }",
        ] {
            let Some(Place::Key { of, mut given, .. }) = at(text) else { panic!("{text}") };
            given.sort();
            assert_eq!(
                (of.kind.map(|kind| kind.name), given),
                (Some("metal"), vec!["color".to_owned(), "type".to_owned()])
            );
        }
        let Some(Place::InnerValue { key, is_quoted }) = at("[materials.a]\ndiffuse = { texture = \"|\" }")
        else {
            panic!()
        };
        assert_eq!((key.as_str(), is_quoted), ("texture", true));
        assert!(matches!(at("[materials]\na = { diffuse = { |"), Some(Place::InnerKey { .. })));
        let Some(Place::Value { key, .. }) = at("[materials]\na = { diffuse = [1, 2, 3], emission = |")
        else {
            panic!()
        };
        assert_eq!(key, "emission");
    }

    #[test]
    fn comments_hide_neither_types_nor_headers() {
        let kind = |text: &str| match at(text) {
            Some(Place::Key { of, .. }) => (of.info.name, of.kind.map(|kind| kind.name)),
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
    fn nothing_is_typed_in_arrays_and_behind_values() {
        assert!(at("[materials.a]\ndiffuse = [1, |").is_none());
        assert!(at("[render]\nintegrator = \"path\" |").is_none());
        let is_assigned = |text: &str| matches!(at(text), Some(Place::Key { is_assigned: true, .. }));
        assert!(is_assigned("[[sphere]]\nrad| = 0.5") && is_assigned("[[sphere]]\nra|dius = 0.5"));
        assert!(!is_assigned("[[sphere]]\nrad|"));
    }

    #[test]
    fn arrays_over_lines_have_no_keys_and_are_no_headers() {
        let Some(Place::Key { of, given, .. }) =
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
        // An array that is not closed ends with the next key or header.
        for text in ["[camera]\nup = [0, 1\nfov = 40\nap|", "[render]\nbackground = [0, 1\n[camera]\nap|"] {
            assert!(matches!(at(text), Some(Place::Key { of, .. }) if of.info.name == "camera"), "{text}");
        }
    }
}
