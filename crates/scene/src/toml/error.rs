//! Syntax errors of the TOML itself.

use std::ops::Range;

use toml_parser::{Expected, ParseError};

/// An error of the syntax, or of keys that contradict each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in super::super) struct SyntaxError {
    /// Bytes of the text.
    pub(in super::super) span: Range<usize>,
    /// In a few words.
    pub(in super::super) what: String,
    /// Expected tokens: a list, or `nothing`.
    pub(in super::super) expected: Option<String>,
}

impl SyntaxError {
    /// An error of a part of the text that begins at byte `base`.
    pub(super) fn new(error: &ParseError, base: usize) -> Self {
        let span = error.unexpected().map_or(0..0, |span| base + span.start()..base + span.end());
        Self { span, what: error.description().to_owned(), expected: error.expected().map(list) }
    }

    /// An error of one's own.
    pub(super) fn at(span: Range<usize>, what: impl Into<String>) -> Self {
        Self { span, what: what.into(), expected: None }
    }
}

fn list(expected: &[Expected]) -> String {
    if expected.is_empty() {
        return "nothing".to_owned();
    }
    expected.iter().map(one).collect::<Vec<_>>().join(", ")
}

fn one(expected: &Expected) -> String {
    match expected {
        Expected::Literal("\n") => "newline".to_owned(),
        Expected::Literal("`") => "'`'".to_owned(),
        Expected::Literal(text) if text.chars().all(|c| c.is_ascii_control()) => {
            format!("`{}`", text.escape_debug())
        }
        Expected::Literal(text) => format!("`{text}`"),
        Expected::Description(text) => (*text).to_owned(),
        // The list of `toml_parser` may grow.
        _ => "something else".to_owned(),
    }
}

/// The first errors of a kind; nobody reads on after those.
#[derive(Debug, Default)]
pub(super) struct Errors(Vec<SyntaxError>);

impl Errors {
    /// Enough to find the first of them in the order of the text, in all files but monstrous ones.
    const MOST: usize = 2_000;

    pub(super) fn push_with(&mut self, make: impl FnOnce() -> SyntaxError) {
        if self.0.len() < Self::MOST {
            self.0.push(make());
        }
    }

    /// These, then those.
    pub(super) fn then(mut self, others: Self) -> Vec<SyntaxError> {
        self.0.extend(others.0);
        self.0.truncate(Self::MOST);
        self.0
    }
}
