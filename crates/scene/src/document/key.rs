//! Reads a table's key as the expected type. Every method takes the range and the default from the key's
//! definition. If the key is absent, the method returns the default, or `None` if there is no default. If
//! the value is invalid, it reports an error and returns `None`.

mod color;
mod file;
mod number;
mod vector;

use std::ops::Range;

use super::super::keys::key::{KeyInfo, ValueKind};
use super::super::nearest::translated_or_nearest_name;
use super::super::sanitize::escape_and_truncate;
use super::super::toml::{KeyValue, Number};
use super::context::{FileContext, Issue};
use super::limits::Limits;
use super::names::DefinedNames;
use super::table::{TEXTURE_REFERENCE, TableReader, TableTitle};
use super::value::{TomlValue, Value, describe_value};
use crate::choice::Choice;

/// A table's key, which may be absent.
pub(super) struct KeyInTable<'a> {
    pub(super) context: &'a FileContext<'a>,
    /// The key's definition.
    pub(super) info: &'static KeyInfo,
    /// The value in the file. If the key is absent, the default, if any.
    value: Option<Value<'a>>,
    /// The spans of the key and the value, if the file has the key.
    spans: Option<[Range<usize>; 2]>,
}

impl<'a> KeyInTable<'a> {
    pub(super) fn new(
        context: &'a FileContext<'a>,
        info: &'static KeyInfo,
        entry: Option<KeyValue<'a>>,
    ) -> Self {
        let Some(KeyValue { key: _, span, value }) = entry else {
            return Self { context, info, value: (info.default_value)(), spans: None };
        };
        Self { context, info, value: Some(value), spans: Some([span, value.span()]) }
    }

    /// Whether the file has the key.
    pub(super) fn is_present(&self) -> bool {
        self.spans.is_some()
    }

    /// The span of the key.
    pub(super) fn key_span(&self) -> Option<Range<usize>> {
        self.spans.clone().map(|[key, _]| key)
    }

    /// The span of the value.
    pub(super) fn value_span(&self) -> Option<Range<usize>> {
        self.spans.clone().map(|[_, value]| value)
    }

    /// Returns the result of `read`. If the value is invalid, returns the default, so that the reader can
    /// continue and find more errors.
    pub(super) fn read_or_default<T>(&self, read: impl Fn(&Self) -> Option<T>) -> T {
        read(self).unwrap_or_else(|| self.default(read))
    }

    /// Reads the default, even if the file has the key.
    pub(super) fn default<T>(&self, read: impl Fn(&Self) -> Option<T>) -> T {
        read(&Self::new(self.context, self.info, None)).expect("a test reads every default")
    }

    /// Reads a number, which may be an integer.
    pub(super) fn number(&self) -> Option<f64> {
        self.number_from_value(self.value?, "a number")
    }

    /// Reads a number in single precision.
    pub(super) fn number_f32(&self) -> Option<f32> {
        self.number().map(|number| number as f32)
    }

    /// Reads a number, which may be part of the key's value. Error messages call the value's type `expected`.
    fn number_from_value(&self, value: Value<'_>, expected: &str) -> Option<f64> {
        let Some(number) = value.as_number().and_then(Number::to_f64) else {
            self.report_wrong_type(value, expected);
            return None;
        };
        let violation = self.info.kind.limits().unwrap_or(Limits::Any).violation(number);
        if let Some(words) = &violation {
            let label = format!("found {}", describe_value(self.context, value));
            let issue = Issue::error(value.span(), format!("`{}` {words}", self.info.name));
            self.context.report(issue.with_label(label));
        }
        violation.is_none().then_some(number)
    }

    /// Reports a value of the wrong type.
    fn report_wrong_type(&self, value: Value<'_>, expected: &str) {
        let name = self.info.name;
        let label = format!("found {}", describe_value(self.context, value));
        let issue = Issue::error(value.span(), format!("`{name}` must be {expected}")).with_label(label);
        // Explain that textures are not allowed here. Otherwise, users would look for a typo.
        let is_texture = value.as_table().is_some_and(|table| table.get("texture").is_some());
        self.context.report(match is_texture && !expected.contains("texture") {
            true => issue.with_help(format!("`{name}` cannot be a texture")),
            false => issue,
        });
    }

    /// Reads an integer. `N` must be able to represent the whole range.
    pub(super) fn integer<N: TryFrom<i128>>(&self) -> Option<N> {
        let (value, ValueKind::Whole(low, high)) = (self.value?, self.info.kind) else { return None };
        let Some(written) = value.as_number().filter(|number| number.is_integer()) else {
            self.report_wrong_type(value, "a whole number");
            return None;
        };
        let range = i128::from(low)..=i128::from(high);
        let number = written.to_integer().filter(|number| range.contains(number));
        if number.is_none() {
            let message = format!("`{}` must be a whole number between {low} and {high}", self.info.name);
            let label = format!("found {}", describe_value(self.context, value));
            self.context.report(Issue::error(value.span(), message).with_label(label));
        }
        number.and_then(|number| number.try_into().ok())
    }

    /// Reads `true` or `false`.
    pub(super) fn boolean(&self) -> Option<bool> {
        let value = self.value?;
        if let TomlValue::Boolean(flag) = value.decode() {
            return Some(flag);
        }
        self.report_wrong_type(value, "true or false");
        None
    }

    /// Reads a string. `expected` describes the string in error messages.
    pub(super) fn string(&self, expected: &str) -> Option<&'a str> {
        self.read_string_described_by(|| expected.to_owned())
    }

    /// Reads a string. `expected` returns the description of the string for error messages.
    fn read_string_described_by(&self, expected: impl FnOnce() -> String) -> Option<&'a str> {
        let value = self.value?;
        let text = value.as_str();
        if text.is_none() {
            self.report_wrong_type(value, &expected());
        }
        text
    }

    /// Reads the name of a shape, if any. Reports names that look like numbers.
    pub(super) fn optional_shape_name(&self) -> Option<Option<Box<str>>> {
        if !self.is_present() {
            return Some(None);
        }
        let text = self.string("the name of this shape")?;
        if text.bytes().any(|byte| !byte.is_ascii_digit()) {
            return Some(Some(text.into()));
        }
        let issue = Issue::error(self.value_span()?, format!("`{}` must not be a number", self.info.name));
        self.context.report(
            issue.with_help("use a name with a letter, because shapes can also be referenced by number"),
        );
        None
    }

    /// Whether the value is a table.
    pub(super) fn is_table(&self) -> bool {
        self.value.is_some_and(|value| value.as_table().is_some())
    }

    /// Reads a choice by its name.
    pub(super) fn choice<C: Choice>(&self) -> Option<C> {
        let list = || {
            let list = C::ALL.iter().map(|one| format!("\"{}\"", one.name())).collect::<Vec<_>>().join(", ");
            if C::ALL.len() == 1 { list } else { format!("one of {list}") }
        };
        let text = self.read_string_described_by(list)?;
        if let Some(meant) = C::named(text) {
            return Some(meant);
        }
        let (span, name, shown, list) =
            (self.value_span()?, self.info.name, escape_and_truncate(text, 32), list());
        let mut issue = if C::UNAVAILABLE.contains(&text) {
            let message = format!("{name} \"{shown}\" is not available in this version; use {list}");
            Issue::error(span, message)
        } else {
            Issue::error(span, format!("`{name}` cannot be \"{shown}\""))
                .with_help(format!("expected {list}"))
        };
        let names: Vec<&str> = C::ALL.iter().map(|one| one.name()).collect();
        if let Some(near) = translated_or_nearest_name(text, &names) {
            issue = issue.with_label(format!("did you mean \"{near}\"?"));
        }
        self.context.report(issue);
        None
    }

    /// Reads an array of `N` numbers. Reports every invalid number.
    pub(super) fn numbers<const N: usize>(&self, expected: &str) -> Option<[f64; N]> {
        let value = self.value?;
        let Some(array) = value.as_array().filter(|array| array.len() == N) else {
            self.report_wrong_type(value, expected);
            return None;
        };
        let mut numbers = [Some(0.0); N];
        for (number, one) in numbers.iter_mut().zip(array.iter()) {
            *number = self.number_from_value(one, expected);
        }
        let is_whole = numbers.iter().all(Option::is_some);
        is_whole.then(|| numbers.map(Option::unwrap_or_default))
    }

    /// Reads a name and returns the name's index in `names`.
    pub(super) fn index_by_name(&self, names: &DefinedNames) -> Option<usize> {
        let text = self.read_string_described_by(|| format!("the name of a {}", names.kind))?;
        self.resolve_name_or_report(names, text, self.value_span())
    }

    /// Reads an array of two names and returns their indices in `names`.
    pub(super) fn index_pair_by_names(&self, names: &DefinedNames) -> Option<[usize; 2]> {
        let value = self.value?;
        let texts = value.as_array().filter(|array| array.len() == 2).and_then(|array| {
            let mut texts = array.iter().map(|name| Some((name.as_str()?, name.span())));
            Some([texts.next()??, texts.next()??])
        });
        let Some(texts) = texts else {
            self.report_wrong_type(value, &format!("an array with the names of two {}s", names.kind));
            return None;
        };
        let [first, second] = texts.map(|(text, span)| self.resolve_name_or_report(names, text, Some(span)));
        Some([first?, second?])
    }

    /// Looks up the name `text` at `span`. Reports an error if it is undefined.
    fn resolve_name_or_report(
        &self,
        names: &DefinedNames,
        text: &str,
        span: Option<Range<usize>>,
    ) -> Option<usize> {
        let index = names.find_and_mark_used(text);
        if index.is_none() {
            let message = format!("there is no {} \"{}\"", names.kind, escape_and_truncate(text, 40));
            let issue = Issue::error(span?, message).with_missing_value_cause();
            self.context.report(names.add_name_suggestions(self.context, issue, text));
        }
        index
    }

    /// Reads an inline table: `{ … }`.
    pub(super) fn inline_table(&self) -> Option<TableReader<'a>> {
        let keys = if let ValueKind::InlineTable(keys) = self.info.kind { keys } else { TEXTURE_REFERENCE };
        TableReader::from_value(self.context, self.value?, TableTitle::Key(self.info.name, keys))
    }
}
