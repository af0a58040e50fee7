//! A TOML parser with a compact tree that references the text.
//!
//! [`parse`] reads a document line by line. [`plain`] handles simple lines, which make up most of large scenes. All others are
//! split by [`expression`], parsed by `toml_parser` and converted to values by [`events`]. [`assembly`] inserts keys and values
//! into the tables of a [`tree`]. This module does not know about scenes. It recovers from errors.
//!
//! ## Why not the tree of the `toml` crate
//!
//! `toml::de::DeTable::parse_recoverable` (1.2) also has spans and error recovery. Measured alternately on the same machine, on
//! a scene of a million spheres (77 MB of text):
//!
//! | | this tree | `DeTable` |
//! | --- | --- | --- |
//! | processor time, user + system | 0.21 + 0.18 s | 1.5 + 1.4 s or more |
//! | memory of the tree | 192 MB | 985 MB |
//! | peak memory, without the text | 192 MB | 2.67 GB |
//! | errors in `tests/broken` | | the same messages and spans, but no span for dotted keys that are too deep |
//!
//! The `toml` crate remains the reference in tests: both use the grammar of `toml_parser` and report its errors. Scenes of that
//! size are in use, and the crate's tree would take more memory than the rendered spheres.

mod assembly;
mod brackets;
mod error;
mod events;
mod expression;
mod plain;
mod set;
mod tree;

use assembly::Assembly;
use expression::Expressions;

pub(super) use brackets::{Bracket, brackets, last_open};
pub(super) use error::SyntaxError;
pub(super) use set::{KeyError, KeyErrorKind, Layout};
pub(super) use tree::{Document, Elements, Entries, KeyValue, TomlValue, Value};

/// Deepest nesting of arrays and tables, and most parts of a dotted key.
const MAX_DEPTH: u32 = 80;

/// The byte order mark that may precede a text.
const MARK: &str = "\u{feff}";

/// Whether a text consists of one dotted key with its value.
pub(super) fn is_key_value(text: &str) -> bool {
    let (document, errors) = parse(text);
    errors.is_empty() && document.only_value(tree::Document::ROOT).is_some_and(|(keys, _)| keys.len() >= 2)
}

/// Sets the key at byte `at` of `source` to the value given there. `source` starts with the text of the document.
///
/// # Errors
/// The part of the key that does not exist.
pub(super) fn set<'s>(
    document: Document<'s>,
    source: &'s str,
    at: usize,
    layout: Layout,
) -> (Document<'s>, Result<(), KeyError>) {
    let (mut assembly, detached) = Assembly::detached(document.with_source(source));
    Expressions::default().read(source, at, &mut assembly);
    let (mut document, _) = assembly.finish();
    let placed = match document.only_value(detached) {
        Some((keys, value)) => document.put_at(&keys, value, layout),
        None => Ok(()),
    };
    (document, placed)
}

/// Parses a text of less than 4 GiB. Returns its tree and first errors: syntax errors followed by errors of keys and values,
/// both in text order.
pub(super) fn parse(source: &str) -> (Document<'_>, Vec<SyntaxError>) {
    let mut assembly = Assembly::new(source);
    let mut expressions = Expressions::default();
    let mut at = if source.starts_with(MARK) { MARK.len() } else { 0 };
    while at < source.len() {
        let plain = if assembly.is_in_header() { None } else { plain::read(source, at, &mut assembly) };
        at = plain.unwrap_or_else(|| expressions.read(source, at, &mut assembly));
    }
    assembly.finish()
}

#[cfg(test)]
mod tests;
