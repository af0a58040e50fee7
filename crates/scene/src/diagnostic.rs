//! Errors and warnings: a message, a source span and a help text.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Severity of a diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The scene cannot be rendered.
    Error,
    /// The scene can be rendered, but probably contains a mistake.
    Warning,
}

/// An error or warning about a scene or a file that it references.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Error or warning.
    pub severity: Severity,
    /// One line, starting in lower case.
    pub message: String,
    /// The file; empty for the command line.
    pub path: PathBuf,
    /// The span in that file, if known.
    pub place: Option<SourceSpan>,
    /// Expected values, or how to fix the problem.
    pub help: Option<String>,
}

impl Diagnostic {
    /// Creates an error in the file at `path`.
    pub(crate) fn error(
        path: &Path,
        message: String,
        help: Option<String>,
        place: Option<SourceSpan>,
    ) -> Box<Self> {
        Box::new(Self { severity: Severity::Error, message, path: path.to_owned(), place, help })
    }
}

/// A labeled span of a text.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceSpan {
    /// The whole text.
    pub source: Arc<str>,
    /// Byte range in [`Self::source`].
    pub span: Range<usize>,
    /// Label of the underline; may be empty.
    pub label: String,
}
