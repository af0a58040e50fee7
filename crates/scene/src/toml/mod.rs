//! TOML text as a compact tree that points into the text.
//!
//! [`parse`] reads a document line by line. [`plain`] reads the simplest lines, of which large scenes consist; every
//! other expression is cut out by [`expression`], read by the events of `toml_parser` and made into values by
//! [`events`]. [`assembly`] puts the keys and values into tables by the rules of TOML, [`tree`] holds them. Nothing here
//! knows what a scene is. Documents with errors are read as far as they can be understood.
//!
//! ## Why the tree is not that of the crate `toml`
//!
//! `toml::de::DeTable::parse_recoverable` (1.2) has spans and recovery too. Both were measured on a scene of a million spheres,
//! 77 MB of text, on the same machine in turns:
//!
//! | | this tree | `DeTable` |
//! | --- | --- | --- |
//! | processor time, user + system | 0.21 + 0.18 s | 1.5 + 1.4 s or more |
//! | memory of the tree | 192 MB | 985 MB |
//! | most memory at once, beside the text | 192 MB | 2.67 GB |
//! | errors in `tests/broken` | | the same messages and places, but no place where dotted keys are too deep |
//!
//! The library stays the reference of tests: both have the grammar of `toml_parser`, and therefore its errors. Scenes of that
//! size are in use, and the library's tree would take more memory than the spheres that are rendered.

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
pub(super) use set::{Layout, NoPlace, Why};
pub(super) use tree::{Document, Elements, Entries, Item, KeyValue, Value};

/// Arrays and tables may lie in each other this deep, and dotted keys have at most this many parts.
const DEEPEST: u32 = 80;

/// A byte order mark, which may begin a text and does not belong to it.
const MARK: &str = "\u{feff}";

/// Whether a text is one value with a key that leads into a table, and nothing else.
pub(super) fn is_key_value(text: &str) -> bool {
    let (document, errors) = parse(text);
    errors.is_empty() && document.only_value(tree::Document::ROOT).is_some_and(|(keys, _)| keys.len() >= 2)
}

/// Puts what stands at byte `at`, a key and its value, in place of the value that the document has for that key. `source`
/// begins with the text of the document.
///
/// # Errors
/// The part of the key that leads nowhere.
pub(super) fn set<'s>(
    document: Document<'s>,
    source: &'s str,
    at: usize,
    layout: Layout,
) -> (Document<'s>, Result<(), NoPlace>) {
    let (mut assembly, apart) = Assembly::apart(document.within(source));
    Expressions::default().read(source, at, &mut assembly);
    let (mut document, _) = assembly.finish();
    let placed = match document.only_value(apart) {
        Some((keys, value)) => document.put_at(&keys, value, layout),
        None => Ok(()),
    };
    (document, placed)
}

/// The tree of a text of less than 4 GiB, and its first errors: those of the syntax, then those of keys and values,
/// each in the order of the text.
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
