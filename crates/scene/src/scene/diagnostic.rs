//! Errors and warnings as values: a message, the place in a file, what to do about it.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The scene cannot be rendered.
    Error,
    /// It can, but this is probably not meant.
    Warning,
}

/// One thing that is wrong with a scene or with a file that it names.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// Error or warning.
    pub severity: Severity,
    /// What is wrong, in one line, starting with a small letter.
    pub message: String,
    /// The file it is about; empty where it is about the call.
    pub path: PathBuf,
    /// The place in that file, if it has one.
    pub place: Option<Place>,
    /// What was expected, or the way out.
    pub help: Option<String>,
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
