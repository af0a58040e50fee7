//! The text files of a foreign scene.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::diagnostic::{Diagnostic, Severity, SourceSpan};

/// The texts of a foreign scene's files, concatenated. Byte offsets into the concatenation identify places in
/// all files.
#[derive(Clone, Debug, Default)]
pub struct SourceFiles {
    all: String,
    files: Vec<SourceFile>,
}

/// A file in [`SourceFiles`].
#[derive(Clone, Debug)]
pub(crate) struct SourceFile {
    /// Path of the file.
    pub(crate) path: PathBuf,
    /// Text of the file.
    pub(crate) text: Arc<str>,
    /// Offset of the text in the concatenation.
    start: usize,
}

impl SourceFile {
    /// Converts a span in the concatenation to a span in this file. Returns `None` if it is elsewhere.
    pub(crate) fn local_span(&self, span: &Range<usize>) -> Option<Range<usize>> {
        let end = self.start + self.text.len();
        (self.start <= span.start && span.end <= end).then(|| span.start - self.start..span.end - self.start)
    }
}

impl SourceFiles {
    /// Adds a file and returns the offset of its text.
    pub fn add(&mut self, path: &Path, text: Arc<str>) -> usize {
        // A newline separates the files.
        if !self.files.is_empty() {
            self.all.push('\n');
        }
        let start = self.all.len();
        self.all.push_str(&text);
        self.files.push(SourceFile { path: path.to_owned(), text, start });
        start
    }

    /// Length of all texts in bytes.
    pub fn total_bytes(&self) -> usize {
        self.all.len()
    }

    /// The text of all files.
    pub fn text(&self) -> &str {
        &self.all
    }

    /// Creates a diagnostic at a span of the concatenation. An empty path is used if no file contains it.
    pub fn diagnostic(
        &self,
        severity: Severity,
        span: Range<usize>,
        message: impl Into<String>,
        label: impl Into<String>,
        help: Option<String>,
    ) -> Diagnostic {
        let found = self.files.iter().find_map(|file| Some((file, file.local_span(&span)?)));
        let path = found.as_ref().map_or_else(
            || self.files.first().map_or_else(PathBuf::new, |first| first.path.clone()),
            |(file, _)| file.path.clone(),
        );
        let place = found
            .filter(|(file, local)| file.text.get(local.clone()).is_some())
            .map(|(file, span)| SourceSpan { source: Arc::clone(&file.text), span, label: label.into() });
        Diagnostic { severity, message: message.into(), path, place, help }
    }

    /// Returns the path of the file that contains a span.
    pub fn path_of_span(&self, span: &Range<usize>) -> Option<&Path> {
        self.files.iter().find(|file| file.local_span(span).is_some()).map(|file| file.path.as_path())
    }

    pub(crate) fn into_parts(self) -> (Arc<str>, Arc<[SourceFile]>) {
        (self.all.into(), self.files.into())
    }
}

/// Returns the 1-based number of the line that contains a byte offset.
pub(crate) fn line_number_at(text: &str, offset: usize) -> usize {
    text.get(..offset).unwrap_or_default().bytes().filter(|byte| *byte == b'\n').count() + 1
}
