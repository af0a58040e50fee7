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

/// An error or warning about a scene or a file referenced by a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Whether this is an error or a warning.
    pub severity: Severity,
    /// One-line message, starting with a lowercase letter.
    pub message: String,
    /// Path of the file. Empty for the command line.
    pub path: PathBuf,
    /// The span in the file, if known.
    pub place: Option<SourceSpan>,
    /// Help text that lists the expected values or explains how to fix the problem.
    pub help: Option<String>,
}

impl Diagnostic {
    /// Creates a diagnostic about an entire file.
    pub fn about_file(path: &Path, severity: Severity, message: String) -> Self {
        Self { severity, message, path: path.to_owned(), place: None, help: None }
    }

    /// Creates an error in the file at `path`.
    pub(crate) fn error_in_file(
        path: &Path,
        message: String,
        help: Option<String>,
        place: Option<SourceSpan>,
    ) -> Box<Self> {
        Box::new(Self { severity: Severity::Error, message, path: path.to_owned(), place, help })
    }
}

/// A labeled span in a source text.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceSpan {
    /// The whole source text.
    pub source: Arc<str>,
    /// Byte range in [`Self::source`].
    pub span: Range<usize>,
    /// Text next to the underline. May be empty.
    pub label: String,
}
