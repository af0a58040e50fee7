//! Context of all readers of one file: its text, its place, and the list of its mistakes.

use std::cell::{Cell, OnceCell, RefCell};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::super::diagnostic::{Diagnostic, Severity};
use super::super::report::LineIndex;
use super::super::source::Source;

/// A file that is being read.
pub(super) struct Context<'a> {
    source: Source,
    path: &'a Path,
    lines: OnceCell<LineIndex>,
    issues: RefCell<Vec<Issue>>,
    /// Number of errors and of warnings.
    counts: Cell<[usize; 2]>,
    searches: Cell<Searches>,
}

/// Number of searches for a name among many, and of comparisons.
#[derive(Clone, Copy, Default)]
struct Searches {
    count: usize,
    comparisons: usize,
}

/// A diagnostic before it has its file.
pub(super) struct Issue {
    severity: Severity,
    span: Range<usize>,
    message: String,
    label: String,
    help: Option<String>,
    cause: Cause,
}

/// Cause of an issue: it decides whether the issue is worth showing beside errors of syntax.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Cause {
    /// The TOML is broken.
    Syntax,
    /// The value at the place.
    Value,
    /// A value elsewhere, or one that is missing: perhaps it stands in a broken line.
    Absence,
}

impl Issue {
    /// The scene cannot be rendered because of what is at `span`.
    pub(super) fn error(span: Range<usize>, message: impl Into<String>) -> Self {
        let message = message.into();
        Self {
            severity: Severity::Error,
            span,
            message,
            label: String::new(),
            help: None,
            cause: Cause::Value,
        }
    }

    /// A likely mistake at `span`.
    pub(super) fn warning(span: Range<usize>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, cause: Cause::Absence, ..Self::error(span, message) }
    }

    /// A few words under the underline.
    pub(super) fn label(self, label: impl Into<String>) -> Self {
        Self { label: label.into(), ..self }
    }

    /// The way out.
    pub(super) fn help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }

    /// The way out, if there is one to offer.
    pub(super) fn maybe_help(self, help: Option<String>) -> Self {
        Self { help, ..self }
    }

    /// This is about something that is not there.
    pub(super) fn absence(self) -> Self {
        Self { cause: Cause::Absence, ..self }
    }

    /// This is about the TOML itself.
    pub(super) fn syntax(self) -> Self {
        Self { cause: Cause::Syntax, ..self }
    }
}

impl<'a> Context<'a> {
    pub(super) fn new(source: Source, path: &'a Path) -> Self {
        let (lines, issues, counts, searches) = Default::default();
        Self { source, path, lines, issues, counts, searches }
    }

    /// Adds to the list.
    pub(super) fn report(&self, issue: Issue) {
        self.report_with(|| issue);
    }

    /// Adds an issue to the list; if the list has enough errors, or enough warnings, only counts it.
    pub(super) fn report_with(&self, make: impl FnOnce() -> Issue) {
        let issue = make();
        let mut counts = self.counts.get();
        let count = &mut counts[usize::from(issue.severity == Severity::Warning)];
        *count += 1;
        if *count <= MOST_COLLECTED {
            self.issues.borrow_mut().push(issue);
        }
        self.counts.set(counts);
    }

    pub(super) fn has_errors(&self) -> bool {
        self.issues.borrow().iter().any(|issue| issue.severity == Severity::Error)
    }

    /// The text of the file.
    pub(super) fn file(&self) -> &str {
        self.source.text()
    }

    /// The text at a place; empty where the place is not in the text.
    pub(super) fn text(&self, span: &Range<usize>) -> &str {
        self.source.all().get(span.clone()).unwrap_or_default()
    }

    /// Looks for a name in what may be a long list. Each search costs as much as the list is long, so that only the
    /// first few dozen of a file are made: a file with more wrong names has one mistake many times.
    pub(super) fn search<T>(&self, comparisons: usize, look: impl FnOnce() -> Option<T>) -> Option<T> {
        let Searches { count, comparisons: before } = self.searches.get();
        if count >= MOST_SEARCHES || before >= MOST_COMPARISONS {
            return None;
        }
        self.searches.set(Searches { count: count + 1, comparisons: before + comparisons });
        look()
    }

    /// Number of names compared.
    #[cfg(test)]
    pub(super) fn comparisons(&self) -> usize {
        self.searches.get().comparisons
    }

    /// The line of a byte of the text, from 1.
    pub(super) fn line(&self, offset: usize) -> usize {
        self.lines().line(offset)
    }

    /// The text of a line, counted from 1.
    pub(super) fn line_text(&self, line: usize) -> Option<&str> {
        let text = self.source.all();
        text.get(self.lines().span(line.checked_sub(1)?, text)?)
    }

    fn lines(&self) -> &LineIndex {
        self.lines.get_or_init(|| LineIndex::new(self.source.all()))
    }

    /// A path in the scene, seen from the scene's folder.
    pub(super) fn resolve(&self, file: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// All issues, in the order of the file. If the TOML is broken, leaves out issues that may only follow from that: those in
    /// the lines named, and missing values.
    pub(super) fn finish(self, broken_lines: &[Range<usize>]) -> Vec<Diagnostic> {
        let mut issues = self.issues.take();
        if !broken_lines.is_empty() {
            issues.retain(|issue| match issue.cause {
                Cause::Syntax => true,
                Cause::Absence => false,
                // What stands for a value that broken TOML hides is at no place.
                Cause::Value if issue.span == (0..0) => false,
                Cause::Value => {
                    let line = self.line(issue.span.start);
                    let before = broken_lines.partition_point(|lines| lines.start <= line);
                    !before.checked_sub(1).is_some_and(|last| broken_lines[last].contains(&line))
                }
            });
        }
        // Warnings never hide an error: what is left out of a long list are the last warnings, then the last errors.
        let place = |issue: &Issue| (issue.span.start, issue.severity == Severity::Warning);
        issues.sort_by_key(|issue| (issue.severity == Severity::Warning, issue.span.start));
        let collected = |severity| issues.iter().filter(|issue| issue.severity == severity).count();
        let [errors, warnings] = [Severity::Error, Severity::Warning].map(collected);
        let uncollected = self.counts.get().map(|count| count.saturating_sub(MOST_COLLECTED));
        let unshown_errors = errors.saturating_sub(MOST_ISSUES) + uncollected[0];
        let unshown = (errors + warnings).saturating_sub(MOST_ISSUES) + uncollected[0] + uncollected[1];
        issues.truncate(MOST_ISSUES);
        issues.sort_by_key(place);
        if unshown > 0 {
            let message = format!("and {unshown} more like these");
            let end = self.source.text().len();
            let make = if unshown_errors > 0 { Issue::error } else { Issue::warning };
            issues.push(make(end..end, message));
        }
        let (path, source) = (self.path, self.source);
        issues.into_iter().map(|issue| issue.into_diagnostic(path, &source)).collect()
    }
}

/// Nobody reads on from here.
const MOST_ISSUES: usize = 500;

/// Searches for the nearest of many names that are made for one file.
const MOST_SEARCHES: usize = 48;

/// No search begins after this many names were compared.
const MOST_COMPARISONS: usize = 200_000;

/// Enough errors, and enough warnings, to find the first of them in the order of the file, in all files but monstrous ones.
const MOST_COLLECTED: usize = 10_000;

impl Issue {
    fn into_diagnostic(self, path: &Path, source: &Source) -> Diagnostic {
        let label = if self.label.is_empty() { String::new() } else { format!("; {}", self.label) };
        let (path, place) = source.place(path, self.span, self.label);
        let (severity, mut message, help) = (self.severity, self.message, self.help);
        if place.is_none() {
            message += &label;
        }
        Diagnostic { severity, message, path, place, help }
    }
}
