//! Names defined in the file, and whether they are used.

use std::cell::Cell;
use std::collections::HashMap;
use std::ops::Range;

use super::super::nearest::nearest_name;
use super::super::sanitize::escape_and_truncate;
use super::context::{FileContext, Issue};

/// The names of all textures, materials or groups in a file.
pub(super) struct DefinedNames {
    /// `texture`, `material` or `group`.
    pub(super) kind: &'static str,
    entries: Vec<DefinedName>,
    indices: HashMap<String, usize>,
}

/// A defined name.
struct DefinedName {
    name: String,
    span: Range<usize>,
    used: Cell<bool>,
}

impl DefinedNames {
    pub(super) fn new(kind: &'static str, names: impl Iterator<Item = (String, Range<usize>)>) -> Self {
        let entries: Vec<DefinedName> =
            names.map(|(name, span)| DefinedName { name, span, used: Cell::new(false) }).collect();
        let indices = entries.iter().enumerate().map(|(index, entry)| (entry.name.clone(), index)).collect();
        Self { kind, entries, indices }
    }

    /// Returns a name, or an empty string if the index is out of range.
    pub(super) fn name(&self, index: usize) -> &str {
        self.entries.get(index).map_or("", |entry| &entry.name)
    }

    /// Returns a name's span, or the start of the file if the index is out of range.
    pub(super) fn span(&self, index: usize) -> Range<usize> {
        self.entries.get(index).map_or(0..0, |entry| entry.span.clone())
    }

    /// Looks up a name and marks it as used.
    pub(super) fn find_and_mark_used(&self, name: &str) -> Option<usize> {
        let index = *self.indices.get(name)?;
        self.entries[index].used.set(true);
        Some(index)
    }

    /// Adds the known names and the most similar name to an issue about an unknown name.
    pub(super) fn add_name_suggestions(&self, context: &FileContext<'_>, issue: Issue, name: &str) -> Issue {
        const MAX_LISTED: usize = 12;
        let kind = self.kind;
        let known = || self.entries.iter().map(|entry| entry.name.as_str());
        let quoted = |name: &str| format!("\"{}\"", escape_and_truncate(name, 40));
        let list = known().take(MAX_LISTED).map(quoted).collect::<Vec<_>>().join(", ");
        let help = match self.entries.len() {
            0 => format!("the scene has no {kind}s; define one with [{kind}s.NAME]"),
            count if count > MAX_LISTED => format!("there are {list} and {} more", count - MAX_LISTED),
            1 => format!("there is {list}"),
            _ => format!("there are {list}"),
        };
        let issue = issue.with_help(help);
        match context.run_limited_name_search(self.entries.len(), || nearest_name(name, known())) {
            Some(near) => issue.with_label(format!("did you mean {}?", quoted(near))),
            None => issue,
        }
    }

    /// Warns about every unused name. Must only be called for scenes without errors.
    pub(super) fn warn_about_unused(&self, context: &FileContext<'_>) {
        for entry in self.entries.iter().filter(|entry| !entry.used.get()) {
            let message =
                format!("the {} \"{}\" is not used", self.kind, escape_and_truncate(&entry.name, 40));
            context.report(Issue::warning(entry.span.clone(), message));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::super::source::SceneText;
    use super::*;

    /// Returns the number of comparisons when `count` unknown names are looked up among `count` defined
    /// names.
    fn comparisons(count: usize) -> usize {
        let context = FileContext::new(SceneText::from_file_text("".into()), Path::new("scene.toml"));
        let names = DefinedNames::new("material", (0..count).map(|number| (format!("name{number}"), 0..0)));
        for number in 0..count {
            names.add_name_suggestions(&context, Issue::error(0..0, "wrong"), &format!("nome{number}"));
        }
        context.compared_name_count()
    }

    #[test]
    fn name_suggestions_take_linear_time() {
        assert_eq!(comparisons(10), 100);
        for count in [1_000, 10_000, 50_000] {
            assert!(comparisons(count) <= 250_000, "{count} names: {}", comparisons(count));
        }
    }
}
