//! A TOML table that keeps track of which keys have been read.

use std::cell::RefCell;
use std::fmt;
use std::ops::{Range, RangeInclusive};

use super::super::keys::find_table as table_info;
use super::super::keys::key::ValueKind;
use super::super::nearest::{foreign_or_nearest_name, nearest_name};
use super::super::sanitize::escape_and_truncate;
use super::super::toml::{Entries, KeyValue};
use super::context::{FileContext, Issue};
use super::key::KeyInTable;
use super::limits::Limits;
use super::value::{TomlValue, Value, describe_value};

/// How messages refer to a table.
#[derive(Clone, Copy, Debug)]
pub(super) enum TableTitle<'a> {
    /// The root table of the file.
    Root,
    /// A single table, such as `[render]`.
    Table(&'static str),
    /// A table in a list, such as `[[sphere]]`.
    List(&'static str),
    /// A named table, such as `[materials.wall]`.
    Named(&'static str, &'a str),
    /// An inline table, identified by its key.
    Key(&'static str),
}

impl fmt::Display for TableTitle<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Root => Ok(()),
            Self::Table(name) => write!(f, "[{name}]"),
            Self::List(name) => write!(f, "[[{name}]]"),
            Self::Named(group, name) => write!(f, "[{group}.{}]", escape_and_truncate(name, 40)),
            Self::Key(name) => write!(f, "`{name}`"),
        }
    }
}

/// A table in the file. Read its keys, then call [`TableReader::report_unknown_and_missing_keys`].
pub(super) struct TableReader<'a> {
    pub(super) context: &'a FileContext<'a>,
    /// Byte range of the header or the braces.
    pub(super) span: Range<usize>,
    title: TableTitle<'a>,
    entries: Entries<'a>,
    known: RefCell<Vec<&'static str>>,
    unavailable: RefCell<Vec<&'static str>>,
    missing: RefCell<Vec<(&'static str, &'static str)>>,
}

impl<'a> TableReader<'a> {
    fn new(
        context: &'a FileContext<'a>,
        entries: Entries<'a>,
        span: Range<usize>,
        title: TableTitle<'a>,
    ) -> Self {
        let (known, unavailable, missing) = Default::default();
        Self { context, span, title, entries, known, unavailable, missing }
    }

    /// Creates a reader for the file's root table.
    pub(super) fn root(context: &'a FileContext<'a>, entries: Entries<'a>) -> Self {
        Self::new(context, entries, 0..0, TableTitle::Root)
    }

    /// Reads a value as a table. Reports an error for any other type.
    pub(super) fn from_value(
        context: &'a FileContext<'a>,
        value: Value<'a>,
        title: TableTitle<'a>,
    ) -> Option<Self> {
        match value.decode() {
            TomlValue::Table(entries) => Some(Self::new(context, entries, value.span(), title)),
            other => {
                let mut issue = Issue::error(value.span(), format!("{title} must be a table"));
                if is_array_of_tables(&other) {
                    issue =
                        issue.with_label("found an array of tables").with_help(format!("write {title} once"));
                } else {
                    issue = issue.with_label(format!("found {}", describe_value(context, value)));
                }
                context.report(issue);
                None
            }
        }
    }

    /// Reads an optional key.
    pub(super) fn optional_key(&self, name: &'static str) -> KeyInTable<'a> {
        let mut known = self.known.borrow_mut();
        if !known.contains(&name) {
            known.push(name);
        }
        let entry = self.entries.get(name);
        KeyInTable::new(
            self.context,
            name,
            entry.as_ref().map(|one| one.span.clone()),
            entry.map(|one| one.value),
        )
    }

    /// Returns the range defined for the key `name`, which has the form `KEY` or `TYPE.KEY`.
    pub(super) fn key_limits(&self, name: &str) -> Limits {
        match self.expected_value_kind(name) {
            Some(
                ValueKind::Number(limits)
                | ValueKind::Color(limits)
                | ValueKind::ColorOrTexture(limits)
                | ValueKind::Emission(limits)
                | ValueKind::NumberOrTexture(limits)
                | ValueKind::Numbers(_, _, limits)
                | ValueKind::Scale(limits),
            ) => limits,
            Some(
                ValueKind::Whole(..)
                | ValueKind::Flag
                | ValueKind::Words(_)
                | ValueKind::Text
                | ValueKind::File(_)
                | ValueKind::Texture
                | ValueKind::Heights
                | ValueKind::Material,
            )
            | None => Limits::Any,
        }
    }

    /// Returns the range defined for an integer key.
    pub(super) fn integer_key_range(&self, name: &str) -> RangeInclusive<i128> {
        match self.expected_value_kind(name) {
            Some(ValueKind::Whole(least, most)) => least.into()..=most.into(),
            Some(_) | None => 0..=u32::MAX.into(),
        }
    }

    /// Returns the type defined for a key. A test checks that the definitions match the keys that are read.
    fn expected_value_kind(&self, name: &str) -> Option<ValueKind> {
        let info = match self.title {
            TableTitle::Table(table) | TableTitle::List(table) | TableTitle::Named(table, _) => {
                table_info(table)?
            }
            TableTitle::Root | TableTitle::Key(_) => return None,
        };
        let (kind, name) = match name.split_once('.') {
            Some((kind, name)) => (info.find_type_or_default(Some(kind)), name),
            None => (None, name),
        };
        info.keys_for_type(kind).find(|key| key.name == name).map(|key| key.kind)
    }

    /// Reads a required key. `example` is a valid value to show in the help text.
    pub(super) fn required_key(&self, name: &'static str, example: &'static str) -> KeyInTable<'a> {
        let key = self.optional_key(name);
        if !key.is_present() {
            self.missing.borrow_mut().push((name, example));
        }
        key
    }

    /// Reports an error if the table contains the key `name`, which is not allowed here.
    pub(super) fn reject_key(&self, name: &'static str, message: &str, help: Option<&str>) {
        let key = self.optional_key(name);
        self.unavailable.borrow_mut().push(name);
        if let Some(span) = key.key_span() {
            self.context.report(Issue::error(span, message).with_optional_help(help.map(str::to_owned)));
        }
    }

    /// Reads the `[name]` table, if present.
    pub(super) fn table(&self, name: &'static str) -> Option<Self> {
        let value = self.optional_key(name).value?;
        Self::from_value(self.context, value, TableTitle::Table(name))
    }

    /// Reads the `[name.NAME]` tables in file order, with their names and the names' spans.
    pub(super) fn named_tables(&self, name: &'static str) -> Vec<(String, Range<usize>, Option<Self>)> {
        let Some(group) = self.table(name) else { return Vec::new() };
        let mut entries: Vec<_> = group.entries.iter().collect();
        entries.sort_by_key(|entry| entry.span.start);
        let read = |key, value| Self::from_value(self.context, value, TableTitle::Named(name, key));
        entries.into_iter().map(|one| (one.key.to_owned(), one.span, read(one.key, one.value))).collect()
    }

    /// Reads the `[[name]]` tables.
    pub(super) fn tables(&self, name: &'static str) -> impl Iterator<Item = Self> + use<'a> {
        let context = self.context;
        let key = self.optional_key(name);
        let list = key.value.and_then(|value| {
            if let Some(array) = value.as_array() {
                return Some(array);
            }
            let span = key.key_span().unwrap_or_default();
            let issue = Issue::error(span, format!("`{name}` must be a list of tables"))
                .with_label(format!("found {}", describe_value(context, value)))
                .with_help(format!("write [[{name}]] with double brackets"));
            context.report(issue);
            None
        });
        let values = list.into_iter().flat_map(|list| list.iter());
        values.filter_map(move |value| Self::from_value(context, value, TableTitle::List(name)))
    }

    /// Reports unknown and missing keys. A misspelled required key is reported only once.
    pub(super) fn report_unknown_and_missing_keys(&self) {
        let known = self.known.borrow();
        let mut meant = Vec::new();
        for KeyValue { key, span, value } in self.entries.iter().filter(|one| !known.contains(&one.key)) {
            self.context.build_and_report_issue(|| {
                let near = self.guess_intended_key(key, &known);
                meant.extend(near);
                self.unknown_key_issue(key, span, &value.decode(), near)
            });
        }
        for (name, example) in self.missing.borrow().iter().filter(|(name, _)| !meant.contains(name)) {
            let issue = Issue::error(self.span.clone(), format!("{} needs `{name}`", self.title))
                .with_label(format!("`{name}` is missing"))
                .with_help(format!("add a line, such as `{name} = {example}`"));
            self.context.report(issue.with_missing_value_cause());
        }
    }

    /// Guesses which key the user meant by an unknown key. Prefers keys that are absent from the table.
    fn guess_intended_key(&self, key: &str, known: &[&'static str]) -> Option<&'static str> {
        let absent = |name: &&&'static str| self.entries.get(name).is_none();
        let unavailable = self.unavailable.borrow();
        let is_other = |name: &&&'static str| absent(name) && !unavailable.contains(name);
        let others: Vec<&'static str> = known.iter().filter(is_other).copied().collect();
        foreign_or_nearest_name(key, &others).or_else(|| nearest_name(key, known.iter().copied()))
    }

    /// Whether the file contains a table whose name is probably a misspelling of `name`.
    pub(super) fn has_misspelled_table(&self, name: &'static str) -> bool {
        let is_table = |value: Value<'_>| matches!(value.decode(), TomlValue::Table(_));
        let mut others = self.entries.iter().filter(|one| one.key != name && is_table(one.value));
        others.any(|one| nearest_name(one.key, [name]).is_some())
    }

    fn unknown_key_issue(
        &self,
        key: &str,
        span: Range<usize>,
        value: &TomlValue<'_>,
        near: Option<&str>,
    ) -> Issue {
        let shown = escape_and_truncate(key, 40);
        let message = match self.title {
            TableTitle::Root if matches!(value, TomlValue::Table(_)) || is_array_of_tables(value) => {
                format!("unknown table `{shown}`")
            }
            TableTitle::Root => format!("unknown key `{shown}` outside of any table"),
            title @ (TableTitle::Table(_)
            | TableTitle::List(_)
            | TableTitle::Named(..)
            | TableTitle::Key(_)) => {
                format!("unknown key `{shown}` in {title}")
            }
        };
        let mut issue = Issue::error(span, message);
        if let Some(near) = near {
            issue = issue.with_label(format!("did you mean `{near}`?"));
        }
        issue.with_help(format!("expected one of {}", self.format_known_keys()))
    }

    fn format_known_keys(&self) -> String {
        let (known, unavailable) = (self.known.borrow(), self.unavailable.borrow());
        let names = known.iter().filter(|name| !unavailable.contains(name));
        names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
    }
}

fn is_array_of_tables(value: &TomlValue<'_>) -> bool {
    matches!(value, TomlValue::Array(array) if array.starts_with_table())
}
