//! A TOML parser with a compact tree that references the text.
//!
//! [`parse`] reads a document line by line. [`plain`] handles simple lines, the majority in large scenes. For
//! all other lines, [`expression`] splits the text, `toml_parser` parses it, and [`events`] converts it to
//! values. [`assembly`] inserts keys and values into the tables of a [`tree`]. This module is independent of
//! scenes and recovers from errors. [`build`] builds the same tree in memory, and [`mod@write`] formats it.
//!
//! ## Why not use the `toml` crate's tree
//!
//! `toml::de::DeTable::parse_recoverable` (1.2) also supports spans and error recovery. Interleaved
//! measurements on the same machine, for a scene with a million spheres (77 MB of text):
//!
//! | | this tree | `DeTable` |
//! | --- | --- | --- |
//! | processor time, user + system | 0.21 + 0.18 s | 1.5 + 1.4 s or more |
//! | memory of the tree | 192 MB | 985 MB |
//! | peak memory, without the text | 192 MB | 2.67 GB |
//! | errors in `tests/broken` | | the same messages and spans, but no span for dotted keys that are too deep |
//!
//! Tests still use the `toml` crate as the reference: both parsers use the `toml_parser` grammar and report
//! its errors. Users have scenes of this size, and the crate's tree would take more memory than the rendered
//! spheres.

mod assembly;
mod brackets;
mod build;
mod error;
mod events;
mod expression;
mod plain;
mod set;
mod tree;
mod write;

use assembly::DocumentBuilder;
use expression::TomlExpressionParser;

pub use build::{InMemoryFile, SceneDocumentBuilder, SceneDocumentValue};
pub use write::quote_toml_string;

pub(super) use brackets::{BracketToken, find_all_array_brackets, innermost_bracket_open_at_end};
pub(super) use error::SyntaxError;
pub(super) use set::{KeyError, KeyErrorKind, TableKindPredicates};
pub(super) use tree::{Document, Elements, Entries, KeyValue, Number, TableId, TomlValue, Value};
pub(super) use write::{format_value, quote_key_part};

/// Maximum nesting depth of arrays and tables, and maximum number of parts in a dotted key.
const MAX_DEPTH: u32 = 80;

/// The byte order mark that may precede the text.
const MARK: &str = "\u{feff}";

/// Whether `text` is exactly one dotted key and its value.
pub(super) fn is_one_dotted_key_assignment(text: &str) -> bool {
    let (document, errors) = parse(text);
    errors.is_empty()
        && document.sole_assignment_in_table(tree::Document::ROOT).is_some_and(|(keys, _)| keys.len() >= 2)
}

/// Parses a value that is read often. Its memory is never freed.
pub(super) fn parse_leaked_constant(text: &str) -> Option<Value<'static>> {
    let (mut document, _) = parse(format!("constant = {text}").leak());
    document.decode_numbers();
    let document: &Document<'_> = Box::leak(Box::new(document));
    document.root().get("constant").map(|found| found.value)
}

/// Applies a `KEY = VALUE` assignment to the document. The assignment is at byte `at` of `source`, and
/// `source` starts with the document's text.
///
/// # Errors
/// Returns the part of the key that cannot be resolved.
pub(super) fn apply_assignment<'s>(
    document: Document<'s>,
    source: &'s str,
    at: usize,
    layout: TableKindPredicates,
) -> (Document<'s>, Result<(), KeyError>) {
    let (mut assembly, detached) =
        DocumentBuilder::from_document_with_new_table(document.with_extended_source(source));
    TomlExpressionParser::default().read(source, at, &mut assembly);
    let (mut document, _) = assembly.finish();
    let placed = match document.sole_assignment_in_table(detached) {
        Some((keys, value)) => document.set_at_path(&keys, value, layout),
        None => Ok(()),
    };
    (document, placed)
}

/// Parses a text of less than 4 GiB. Returns the tree and the first errors: syntax errors, followed by errors
/// in keys and values, both in text order.
pub(super) fn parse(source: &str) -> (Document<'_>, Vec<SyntaxError>) {
    let mut assembly = DocumentBuilder::new(source);
    let mut expressions = TomlExpressionParser::default();
    let mut at = if source.starts_with(MARK) { MARK.len() } else { 0 };
    while at < source.len() {
        let plain = if assembly.has_unclosed_header() {
            None
        } else {
            plain::read_plain_line(source, at, &mut assembly)
        };
        at = plain.unwrap_or_else(|| expressions.read(source, at, &mut assembly));
    }
    assembly.finish()
}

#[cfg(test)]
mod tests;
