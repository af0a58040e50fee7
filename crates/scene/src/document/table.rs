//! A TOML table that keeps track of which keys have been read.

use std::cell::RefCell;
use std::fmt;
use std::ops::Range;

use super::super::description::Channel;
use super::super::keys::key::{
    COLOR, DefaultValue, KeyInfo, TableInfo, TableSyntax, TableTypeInfo, ValueKind, choice_values, keys,
    parsed_default,
};
use super::super::nearest::{nearest_name, translated_or_nearest_name};
use super::super::sanitize::escape_and_truncate;
use super::super::toml::{Entries, KeyValue, TableId};
use super::context::{FileContext, Issue};
use super::key::KeyInTable;
use super::value::{TomlValue, Value, describe_value};
use crate::choice::Choice;

/// A table's definition, and how messages refer to it.
#[derive(Clone, Copy, Debug)]
pub(super) enum TableTitle<'a> {
    /// The root table of the file.
    Root,
    /// A single table such as `[render]`, a table in a list such as `[[sphere]]`, or the group of all named
    /// tables.
    Table(&'static TableInfo),
    /// A named table, such as `[materials.wall]`.
    Named(&'static TableInfo, &'a str),
    /// A table in a list of a named table, such as `[[groups.chair.box]]`.
    Inner(&'static TableInfo, &'a str, &'static TableInfo),
    /// An inline table, identified by its key, and its allowed keys.
    Key(&'static str, &'static [KeyInfo]),
}

impl TableTitle<'_> {
    /// Returns the title of the tables in a list of this table.
    fn list_element_title(self, info: &'static TableInfo) -> Self {
        match self {
            Self::Named(group, name) => Self::Inner(group, name, info),
            Self::Root | Self::Table(_) | Self::Inner(..) | Self::Key(..) => Self::Table(info),
        }
    }

    fn table_info(self) -> Option<&'static TableInfo> {
        match self {
            Self::Table(info) | Self::Named(info, _) | Self::Inner(.., info) => Some(info),
            Self::Root | Self::Key(..) => None,
        }
    }

    fn known_keys(self) -> &'static [KeyInfo] {
        match self {
            Self::Root => &[],
            Self::Table(info) | Self::Named(info, _) | Self::Inner(.., info) => info.keys,
            Self::Key(_, keys) => keys,
        }
    }
}

/// Keys of an inline table that refers to a texture. Not every value allows all of them.
pub(super) const TEXTURE_REFERENCE: &[KeyInfo] = keys! {
    /// The texture.
    texture: ValueKind::Texture, DefaultValue::Required("\"name\"");
    /// The channel for a number.
    channel: ValueKind::Words(choice_values::<Channel>), DefaultValue::Absent;
    /// A factor on emitted radiance.
    scale: COLOR, DefaultValue::Is("[1, 1, 1]");
};

impl fmt::Display for TableTitle<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Root => Ok(()),
            Self::Table(info) => match info.form {
                TableSyntax::List => write!(f, "[[{}]]", info.name),
                TableSyntax::Single | TableSyntax::Named => write!(f, "[{}]", info.name),
            },
            Self::Named(group, name) => write!(f, "[{}.{}]", group.name, escape_and_truncate(name, 40)),
            Self::Inner(group, name, info) => {
                write!(f, "[[{}.{}.{}]]", group.name, escape_and_truncate(name, 40), info.name)
            }
            Self::Key(name, _) => write!(f, "`{name}`"),
        }
    }
}

/// A table in the file. Read its keys, then call [`TableReader::report_unknown_and_missing_keys`].
pub(super) struct TableReader<'a> {
    pub(super) context: &'a FileContext<'a>,
    /// Byte range of the header or the braces.
    pub(super) span: Range<usize>,
    title: TableTitle<'a>,
    /// Definitions of the keys of the table's type and of the keys of all types.
    keys: [&'static [KeyInfo]; 2],
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
        Self { context, span, title, keys: [&[], title.known_keys()], entries, known, unavailable, missing }
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

    /// The table's ID, which orders tables as in the text.
    pub(super) fn table_id(&self) -> TableId {
        self.entries.table_id()
    }

    /// Finds the entry called `name`, which then counts as known.
    pub(super) fn entry(&self, name: &'static str) -> Option<KeyValue<'a>> {
        let mut known = self.known.borrow_mut();
        if !known.contains(&name) {
            known.push(name);
        }
        self.entries.get(name)
    }

    /// Finds a key by its name. If it is required and absent,
    /// [`Self::report_unknown_and_missing_keys`] reports it.
    pub(super) fn key(&self, name: &str) -> KeyInTable<'a> {
        let mut all = self.keys.into_iter().flatten();
        let info = all.find(|key| key.name == name).expect("readers use only defined keys, as tests check");
        let key = KeyInTable::new(self.context, info, self.entry(info.name));
        if let DefaultValue::Required(example) = info.default {
            self.record_if_missing(&key, example);
        }
        key
    }

    /// Finds a key that is required because no alternative key is present.
    pub(super) fn key_required_without_alternative(&self, name: &str) -> KeyInTable<'a> {
        let key = self.key(name);
        if let DefaultValue::Alternative(example) = key.info.default {
            self.record_if_missing(&key, example);
        }
        key
    }

    fn record_if_missing(&self, key: &KeyInTable<'a>, example: &'static str) {
        let mut missing = self.missing.borrow_mut();
        let line = (key.info.name, example);
        if !key.is_present() && !missing.contains(&line) {
            missing.push(line);
        }
    }

    /// Reads the key `type`. Afterwards, [`Self::key`] also finds the keys of this type. The first type is the
    /// default.
    pub(super) fn read_type<C: Choice>(&mut self) -> Option<C> {
        const TYPE: &KeyInfo = &keys! {
            /// The type.
            type: ValueKind::Text, DefaultValue::Absent;
        }[0];
        let key = KeyInTable::new(self.context, TYPE, self.entry(TYPE.name));
        let kind = if key.is_present() { key.choice()? } else { *C::ALL.first()? };
        let info = self.title.table_info()?.find_type_or_default(Some(kind.name()))?;
        self.keys[0] = info.keys;
        Some(kind)
    }

    /// Reports an error if the table contains the key `name`, which is not allowed here.
    pub(super) fn reject_key(&self, name: &'static str, message: &str, help: Option<&str>) {
        self.unavailable.borrow_mut().push(name);
        if let Some(entry) = self.entry(name) {
            self.context
                .report(Issue::error(entry.span, message).with_optional_help(help.map(str::to_owned)));
        }
    }

    /// Reads a single table, if present.
    pub(super) fn table(&self, info: &'static TableInfo) -> Option<Self> {
        Self::from_value(self.context, self.entry(info.name)?.value, TableTitle::Table(info))
    }

    /// Reads a single table, or an empty table if it is absent.
    pub(super) fn table_or_empty(&self, info: &'static TableInfo) -> Option<Self> {
        let value = match self.entry(info.name) {
            Some(entry) => entry.value,
            None => parsed_default!(DefaultValue::Is("{}"))()?,
        };
        Self::from_value(self.context, value, TableTitle::Table(info))
    }

    /// Reads named tables in file order, with their names and the names' spans.
    pub(super) fn named_tables(&self, info: &'static TableInfo) -> Vec<(String, Range<usize>, Option<Self>)> {
        let Some(group) = self.table(info) else { return Vec::new() };
        let mut entries: Vec<_> = group.entries.iter().collect();
        entries.sort_by_key(|entry| entry.span.start);
        let read = |key, value| Self::from_value(self.context, value, TableTitle::Named(info, key));
        entries.into_iter().map(|one| (one.key.to_owned(), one.span, read(one.key, one.value))).collect()
    }

    /// Reads a list of tables.
    pub(super) fn tables(&self, info: &'static TableInfo) -> impl Iterator<Item = Self> + use<'a> {
        let (context, name, title) = (self.context, info.name, self.title.list_element_title(info));
        let list = self.entry(name).and_then(|entry| {
            if let Some(array) = entry.value.as_array() {
                return Some(array);
            }
            let issue = Issue::error(entry.span, format!("`{name}` must be a list of tables"))
                .with_label(format!("found {}", describe_value(context, entry.value)))
                .with_help(format!("write {title} with double brackets"));
            context.report(issue);
            None
        });
        let values = list.into_iter().flat_map(|list| list.iter());
        values.filter_map(move |value| Self::from_value(context, value, title))
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
        translated_or_nearest_name(key, &others).or_else(|| nearest_name(key, known.iter().copied()))
    }

    /// Whether the file contains a table whose name is probably a misspelling of `name`.
    pub(super) fn has_misspelled_table(&self, name: &'static str) -> bool {
        let is_table = |value: Value<'_>| value.as_table().is_some();
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
            | TableTitle::Named(..)
            | TableTitle::Inner(..)
            | TableTitle::Key(..)) => {
                format!("unknown key `{shown}` in {title}")
            }
        };
        let mut issue = Issue::error(span, message);
        if let Some(near) = near {
            issue = issue.with_label(format!("did you mean `{near}`?"));
        }
        let expected = format!("expected one of {}", self.format_known_keys());
        let others = self.types_with_key(key);
        issue.with_help(match others.is_empty() {
            true => expected,
            false => format!("`{shown}` is for type {}; {expected}", others.join(" or ")),
        })
    }

    /// Returns the other types of the table that have the key `name`, in quotes.
    fn types_with_key(&self, name: &str) -> Vec<String> {
        let types = self.title.table_info().map_or(&[][..], |info| info.types);
        let has_key = |kind: &&TableTypeInfo| kind.keys.iter().any(|key| key.name == name);
        types.iter().filter(has_key).map(|kind| format!("\"{}\"", kind.name)).collect()
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
