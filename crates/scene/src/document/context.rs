//! Context shared by all readers of a file: its source text, its path, and the issues found so far.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::super::diagnostic::{Diagnostic, Severity};
use super::super::report::LineIndex;
use super::super::source::SceneText;
use super::super::toml::InMemoryFile;

/// A file that is being read.
pub(super) struct FileContext<'a> {
    source: SceneText,
    path: &'a Path,
    lines: OnceCell<LineIndex>,
    issues: RefCell<Vec<Issue>>,
    /// Number of errors and number of warnings.
    counts: Cell<[usize; 2]>,
    searches: Cell<NameSearchCounts>,
    /// Files that exist only in memory.
    generated: Arc<BTreeMap<String, InMemoryFile>>,
}

/// Number of searches for similar names, and number of names compared in them.
#[derive(Clone, Copy, Default)]
struct NameSearchCounts {
    count: usize,
    comparisons: usize,
}

/// A diagnostic without its file.
pub(super) struct Issue {
    severity: Severity,
    span: Range<usize>,
    message: String,
    label: String,
    help: Option<String>,
    cause: IssueCause,
}

/// Cause of an issue. If there are syntax errors, it determines whether the issue is reported.
#[derive(Clone, Copy, PartialEq, Eq)]
enum IssueCause {
    /// A TOML syntax error.
    Syntax,
    /// The value at the issue's span.
    Value,
    /// A missing value, or a value elsewhere in the file. A syntax error on another line may be to blame.
    Absence,
}

impl Issue {
    /// Creates an error at `span`.
    pub(super) fn error(span: Range<usize>, message: impl Into<String>) -> Self {
        let message = message.into();
        Self {
            severity: Severity::Error,
            span,
            message,
            label: String::new(),
            help: None,
            cause: IssueCause::Value,
        }
    }

    /// Creates a warning about a likely mistake at `span`.
    pub(super) fn warning(span: Range<usize>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, cause: IssueCause::Absence, ..Self::error(span, message) }
    }

    /// Sets the text next to the underline.
    pub(super) fn with_label(self, label: impl Into<String>) -> Self {
        Self { label: label.into(), ..self }
    }

    /// Sets the help text.
    pub(super) fn with_help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }

    /// Sets the help text, if any.
    pub(super) fn with_optional_help(self, help: Option<String>) -> Self {
        Self { help, ..self }
    }

    /// Marks the issue as caused by a missing value.
    pub(super) fn with_missing_value_cause(self) -> Self {
        Self { cause: IssueCause::Absence, ..self }
    }

    /// Marks the issue as a syntax error.
    pub(super) fn marked_as_syntax_error(self) -> Self {
        Self { cause: IssueCause::Syntax, ..self }
    }
}

impl<'a> FileContext<'a> {
    pub(super) fn new(source: SceneText, path: &'a Path) -> Self {
        let (lines, issues, counts, searches, generated) = Default::default();
        Self { source, path, lines, issues, counts, searches, generated }
    }

    /// Sets the files that exist only in memory.
    pub(super) fn with_in_memory_files(self, generated: Arc<BTreeMap<String, InMemoryFile>>) -> Self {
        Self { generated, ..self }
    }

    /// Whether a file exists only in memory.
    pub(super) fn is_in_memory_file(&self, name: &str) -> bool {
        self.generated.contains_key(name)
    }

    /// Whether a span is in a `--set` value rather than in the file.
    pub(super) fn is_span_in_set_arg(&self, span: &Range<usize>) -> bool {
        self.source.is_span_in_set_arg(span)
    }

    /// Adds an issue to the list.
    pub(super) fn report(&self, issue: Issue) {
        self.build_and_report_issue(|| issue);
    }

    /// Adds an issue to the list, or only counts the issue if the list is full.
    pub(super) fn build_and_report_issue(&self, make: impl FnOnce() -> Issue) {
        let issue = make();
        let mut counts = self.counts.get();
        let count = &mut counts[usize::from(issue.severity == Severity::Warning)];
        *count += 1;
        if *count <= MAX_COLLECTED {
            self.issues.borrow_mut().push(issue);
        }
        self.counts.set(counts);
    }

    pub(super) fn has_errors(&self) -> bool {
        self.issues.borrow().iter().any(|issue| issue.severity == Severity::Error)
    }

    /// The file's text.
    pub(super) fn text_without_set_args(&self) -> &str {
        self.source.text_without_set_args()
    }

    /// Returns the text at `span`, or an empty string if `span` is out of range.
    pub(super) fn span_text(&self, span: &Range<usize>) -> &str {
        self.source.full_text().get(span.clone()).unwrap_or_default()
    }

    /// Source text of a value. `None` if the value has no source text, or is from a foreign file, where the
    /// text need not match the value.
    pub(super) fn value_text(&self, span: &Range<usize>) -> Option<&str> {
        Some(self.span_text(span))
            .filter(|text| !text.is_empty() && !self.source.is_span_in_foreign_format(span))
    }

    /// Calls `look` to search a list for a similar name, unless the file's search limit has been reached. The
    /// limit exists because the cost of a search is linear in the length of the list, and files with many
    /// wrong names usually repeat the same mistake.
    pub(super) fn run_limited_name_search<T>(
        &self,
        comparisons: usize,
        look: impl FnOnce() -> Option<T>,
    ) -> Option<T> {
        let NameSearchCounts { count, comparisons: before } = self.searches.get();
        if count >= MAX_SEARCHES || before >= MAX_COMPARISONS {
            return None;
        }
        self.searches.set(NameSearchCounts { count: count + 1, comparisons: before + comparisons });
        look()
    }

    /// Number of names compared.
    #[cfg(test)]
    pub(super) fn compared_name_count(&self) -> usize {
        self.searches.get().comparisons
    }

    /// The 1-based line number of a byte offset.
    pub(super) fn line_number_at_offset(&self, offset: usize) -> usize {
        self.cached_line_start_index().line_number(offset)
    }

    /// The text of a line, given its 1-based number.
    pub(super) fn line_text_by_number(&self, line: usize) -> Option<&str> {
        let text = self.source.full_text();
        text.get(self.cached_line_start_index().line_span(line.checked_sub(1)?, text)?)
    }

    fn cached_line_start_index(&self) -> &LineIndex {
        self.lines.get_or_init(|| LineIndex::new(self.source.full_text()))
    }

    /// Resolves a path relative to the scene's folder.
    pub(super) fn resolve_path(&self, file: &str) -> PathBuf {
        // The scene generated for a model refers to the model file, whose name may not be valid UTF-8.
        let is_own_name = |name: &OsStr| name.to_str().is_none() && name.to_string_lossy() == file;
        if self.path.file_name().is_some_and(is_own_name) {
            return self.path.to_owned();
        }
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// Returns all issues in file order. If there are syntax errors, omits issues that they may have caused:
    /// issues in `broken_lines` and missing values.
    pub(super) fn into_diagnostics(self, broken_lines: &[Range<usize>]) -> Vec<Diagnostic> {
        let mut issues = self.issues.take();
        if !broken_lines.is_empty() {
            issues.retain(|issue| match issue.cause {
                IssueCause::Syntax => true,
                IssueCause::Absence => false,
                // Placeholders for values with syntax errors have no span.
                IssueCause::Value if issue.span == (0..0) => false,
                IssueCause::Value => {
                    let line = self.line_number_at_offset(issue.span.start);
                    let before = broken_lines.partition_point(|lines| lines.start <= line);
                    !before.checked_sub(1).is_some_and(|last| broken_lines[last].contains(&line))
                }
            });
        }
        // Errors take precedence over warnings: drop the last warnings first, then the last errors.
        let place = |issue: &Issue| (issue.span.start, issue.severity == Severity::Warning);
        issues.sort_by_key(|issue| (issue.severity == Severity::Warning, issue.span.start));
        let collected = |severity| issues.iter().filter(|issue| issue.severity == severity).count();
        let [errors, warnings] = [Severity::Error, Severity::Warning].map(collected);
        let uncollected = self.counts.get().map(|count| count.saturating_sub(MAX_COLLECTED));
        let unshown_errors = errors.saturating_sub(MAX_ISSUES) + uncollected[0];
        let unshown = (errors + warnings).saturating_sub(MAX_ISSUES) + uncollected[0] + uncollected[1];
        issues.truncate(MAX_ISSUES);
        issues.sort_by_key(place);
        if unshown > 0 {
            let message = format!("and {unshown} {MORE_LIKE_THESE}");
            let end = self.source.text_without_set_args().len();
            let make = if unshown_errors > 0 { Issue::error } else { Issue::warning };
            issues.push(make(end..end, message));
        }
        let (path, source) = (self.path, self.source);
        issues.into_iter().map(|issue| issue.into_diagnostic(path, &source)).collect()
    }
}

/// End of the message that reports how many issues are not listed.
pub const MORE_LIKE_THESE: &str = "more like these";

/// Maximum number of issues listed.
const MAX_ISSUES: usize = 500;

/// Maximum number of searches for similar names per file.
const MAX_SEARCHES: usize = 48;

/// Maximum number of name comparisons per file, checked before each search.
const MAX_COMPARISONS: usize = 200_000;

/// Maximum number of errors to collect, and separately of warnings. It is large enough to include the first
/// issues in file order, except in absurdly broken files.
const MAX_COLLECTED: usize = 10_000;

impl Issue {
    fn into_diagnostic(self, path: &Path, source: &SceneText) -> Diagnostic {
        let label = if self.label.is_empty() { String::new() } else { format!("; {}", self.label) };
        let (path, place) = source.resolve_span(path, self.span, self.label);
        let (severity, mut message, help) = (self.severity, self.message, self.help);
        if place.is_none() {
            message += &label;
        }
        Diagnostic { severity, message, path, place, help }
    }
}
