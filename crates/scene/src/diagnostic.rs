//! Errors and warnings as values: a message, the place in a file, what to do about it.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Severity of a diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The scene cannot be rendered.
    Error,
    /// It can, but this is probably not meant.
    Warning,
}

/// A mistake in a scene, or in a file that it names.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Error or warning.
    pub severity: Severity,
    /// The mistake, in one line, starting with a small letter.
    pub message: String,
    /// The file with the mistake; empty for the call itself.
    pub path: PathBuf,
    /// The place in that file, if it has one.
    pub place: Option<Place>,
    /// Expected values, or the way out.
    pub help: Option<String>,
}

impl Diagnostic {
    /// An error in the file at `path`.
    pub(crate) fn error(
        path: &Path,
        message: String,
        help: Option<String>,
        place: Option<Place>,
    ) -> Box<Self> {
        Box::new(Self { severity: Severity::Error, message, path: path.to_owned(), place, help })
    }
}

/// A place in a text.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The whole text.
    pub source: Arc<str>,
    /// The bytes that are meant.
    pub span: Range<usize>,
    /// A few words under the underline; may be empty.
    pub label: String,
}
