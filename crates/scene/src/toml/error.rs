//! TOML syntax errors, and a list of limited length that collects them.

use std::ops::Range;

use toml_parser::{Expected, ParseError};

/// A TOML syntax error, or a duplicate or conflicting key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct SyntaxError {
    /// Byte range in the text.
    pub(crate) span: Range<usize>,
    /// Short description of the error.
    pub(crate) what: String,
    /// The expected tokens, as a list or as `nothing`.
    pub(crate) expected: Option<String>,
}

impl SyntaxError {
    /// Converts a parser error in the part of the text that starts at byte `base`.
    pub(super) fn from_parse_error(error: &ParseError, base: usize) -> Self {
        let span = error.unexpected().map_or(0..0, |span| base + span.start()..base + span.end());
        Self {
            span,
            what: error.description().to_owned(),
            expected: error.expected().map(format_expected_list),
        }
    }

    /// Creates an error that is not from the parser.
    pub(super) fn at(span: Range<usize>, what: impl Into<String>) -> Self {
        Self { span, what: what.into(), expected: None }
    }
}

fn format_expected_list(expected: &[Expected]) -> String {
    if expected.is_empty() {
        return "nothing".to_owned();
    }
    expected.iter().map(format_expected).collect::<Vec<_>>().join(", ")
}

fn format_expected(expected: &Expected) -> String {
    match expected {
        Expected::Literal("\n") => "newline".to_owned(),
        Expected::Literal("`") => "'`'".to_owned(),
        Expected::Literal(text) if text.chars().all(|c| c.is_ascii_control()) => {
            format!("`{}`", text.escape_debug())
        }
        Expected::Literal(text) => format!("`{text}`"),
        Expected::Description(text) => (*text).to_owned(),
        // The enum is non-exhaustive.
        _ => "something else".to_owned(),
    }
}

/// A list of errors with a limited length.
#[derive(Debug, Default)]
pub(super) struct BoundedErrors(Vec<SyntaxError>);

impl BoundedErrors {
    /// Maximum length, large enough to include the first errors in text order, except in absurdly broken
    /// files.
    const CAPACITY: usize = 2_000;

    pub(super) fn push_with(&mut self, make: impl FnOnce() -> SyntaxError) {
        if self.0.len() < Self::CAPACITY {
            self.0.push(make());
        }
    }

    /// Concatenates two lists, up to the maximum length.
    pub(super) fn concatenate(mut self, others: Self) -> Vec<SyntaxError> {
        self.0.extend(others.0);
        self.0.truncate(Self::CAPACITY);
        self.0
    }
}
