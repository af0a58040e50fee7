//! A TOML table that knows which of its keys were asked for.

use std::cell::RefCell;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::super::nearest::nearest;
use super::super::sanitize::shortened;
use super::context::{Context, Issue};
use super::key::Key;
use super::value::found;

/// A table of the file. Ask for its keys, then [`Table::finish`] it.
pub(super) struct Table<'a> {
    pub(super) context: &'a Context<'a>,
    /// Its header, or its braces.
    pub(super) span: Range<usize>,
    /// As it is called in messages: `[render]`, `[[sphere]]`, `[materials.wall]`.
    pub(super) title: String,
    entries: &'a DeTable<'a>,
    known: RefCell<Vec<&'static str>>,
    unavailable: RefCell<Vec<&'static str>>,
    missing: RefCell<Vec<(&'static str, &'static str)>>,
}

impl<'a> Table<'a> {
    fn new(context: &'a Context<'a>, entries: &'a DeTable<'a>, span: Range<usize>, title: String) -> Self {
        let (known, unavailable, missing) = Default::default();
        Self { context, span, title, entries, known, unavailable, missing }
    }

    /// The file itself.
    pub(super) fn root(context: &'a Context<'a>, entries: &'a DeTable<'a>) -> Self {
        Self::new(context, entries, 0..0, String::new())
    }

    /// A value as a table; an error where it is something else.
    pub(super) fn of(
        context: &'a Context<'a>,
        value: &'a Spanned<DeValue<'a>>,
        title: String,
    ) -> Option<Self> {
        match value.get_ref() {
            DeValue::Table(entries) => Some(Self::new(context, entries, value.span(), title)),
            other => {
                let mut issue = Issue::error(value.span(), format!("{title} must be a table"));
                if is_array_of_tables(other) {
                    issue = issue.label("found an array of tables").help(format!("write {title} once"));
                } else {
                    issue = issue.label(format!("found {}", found(context, value)));
                }
                context.report(issue);
                None
            }
        }
    }

    /// A key that may be absent.
    pub(super) fn optional(&self, name: &'static str) -> Key<'a> {
        let mut known = self.known.borrow_mut();
        if !known.contains(&name) {
            known.push(name);
        }
        let entry = self.entries.get_key_value(name);
        Key::new(self.context, name, entry.map(|(key, _)| key.span()), entry.map(|(_, value)| value))
    }

    /// A key that must be there; `example` is what may stand after its `=`.
    pub(super) fn required(&self, name: &'static str, example: &'static str) -> Key<'a> {
        let key = self.optional(name);
        if !key.is_given() {
            self.missing.borrow_mut().push((name, example));
        }
        key
    }

    /// A key or table that other versions have: an error if it is used.
    pub(super) fn unavailable(&self, name: &'static str, message: &str, help: Option<&str>) {
        let key = self.optional(name);
        self.unavailable.borrow_mut().push(name);
        if let Some(span) = key.key_span() {
            self.context.report(Issue::error(span, message).maybe_help(help.map(str::to_owned)));
        }
    }

    /// The table of this name in the file, `[name]`.
    pub(super) fn table(&self, name: &'static str) -> Option<Self> {
        let value = self.optional(name).value?;
        Self::of(self.context, value, format!("[{name}]"))
    }

    /// The tables `[name.…]` with their names and the places of those, in the order of the file.
    pub(super) fn named_tables(&self, name: &'static str) -> Vec<(String, Range<usize>, Option<Self>)> {
        let Some(group) = self.table(name) else { return Vec::new() };
        let mut entries: Vec<_> = group.entries.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let read =
            |key: &str, value| Self::of(self.context, value, format!("[{name}.{}]", shortened(key, 40)));
        let entry = |(key, value): (&'a Spanned<_>, _)| {
            let text: &std::borrow::Cow<'_, str> = key.get_ref();
            (text.to_string(), key.span(), read(text, value))
        };
        entries.into_iter().map(entry).collect()
    }

    /// The tables `[[name]]` of the file.
    pub(super) fn tables(&self, name: &'static str) -> Vec<Self> {
        let key = self.optional(name);
        let Some(value) = key.value else { return Vec::new() };
        let title = || format!("[[{name}]]");
        if let DeValue::Array(array) = value.get_ref() {
            return array.iter().filter_map(|one| Self::of(self.context, one, title())).collect();
        }
        let issue =
            Issue::error(key.key_span().unwrap_or_default(), format!("`{name}` must be a list of tables"))
                .label(format!("found {}", found(self.context, value)))
                .help(format!("write [[{name}]] with double brackets"));
        self.context.report(issue);
        Vec::new()
    }

    /// Reports the keys that nobody asked for, and those that should be there. Of a misspelled required key
    /// only the spelling is reported.
    pub(super) fn finish(&self) {
        let known = self.known.borrow();
        let unknown = self.entries.iter().filter(|(key, _)| !known.contains(&key.get_ref().as_ref()));
        let mut meant = Vec::new();
        for (key, value) in unknown {
            self.context.report_with(|| {
                let near = nearest(key.get_ref(), known.iter().copied());
                meant.extend(near);
                self.unknown(key.get_ref(), key.span(), value.get_ref(), near)
            });
        }
        for (name, example) in self.missing.borrow().iter().filter(|(name, _)| !meant.contains(name)) {
            let issue = Issue::error(self.span.clone(), format!("{} needs `{name}`", self.title))
                .label(format!("`{name}` is missing"))
                .help(format!("add a line such as `{name} = {example}`"));
            self.context.report(issue.absence());
        }
    }

    fn unknown(&self, key: &str, span: Range<usize>, value: &DeValue<'_>, near: Option<&str>) -> Issue {
        let shown = shortened(key, 40);
        let table = |value: &DeValue<'_>| matches!(value, DeValue::Table(_)) || is_array_of_tables(value);
        let message = match () {
            () if !self.title.is_empty() => format!("unknown key `{shown}` in {}", self.title),
            () if table(value) => format!("unknown table `{shown}`"),
            () => format!("unknown key `{shown}` outside of any table"),
        };
        let mut issue = Issue::error(span, message);
        if let Some(near) = near {
            issue = issue.label(format!("did you mean `{near}`?"));
        }
        issue.help(format!("expected one of {}", self.known_list()))
    }

    fn known_list(&self) -> String {
        let (known, unavailable) = (self.known.borrow(), self.unavailable.borrow());
        let names = known.iter().filter(|name| !unavailable.contains(name));
        names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
    }
}

fn is_array_of_tables(value: &DeValue<'_>) -> bool {
    let DeValue::Array(array) = value else { return false };
    array.iter().next().is_some_and(|first| first.get_ref().is_table())
}
