//! Reads a table's key as the expected type. Every method returns `None` if the key is absent or invalid.
//! If the key is invalid, the method also reports an error.

mod color;
mod file;
mod number;

use std::ops::{Range, RangeInclusive};

use super::super::nearest::foreign_or_nearest_name;
use super::super::sanitize::escape_and_truncate;
use super::context::{FileContext, Issue};
use super::limits::Limits;
use super::names::DefinedNames;
use super::table::{TableReader, TableTitle};
use super::value::{
    TomlValue, Value, describe_value, number_within, parse_integer_in_radix, report_wrong_type,
};
use crate::choice::Choice;
use crate::math::limits::{SHORTEST, is_nonzero_but_too_short, robust_length};
use crate::math::{DVec3, Vec2};

/// A table's key, which may be absent.
pub(super) struct KeyInTable<'a> {
    pub(super) context: &'a FileContext<'a>,
    pub(super) name: &'static str,
    pub(super) value: Option<Value<'a>>,
    key_span: Option<Range<usize>>,
}

impl<'a> KeyInTable<'a> {
    pub(super) fn new(
        context: &'a FileContext<'a>,
        name: &'static str,
        key_span: Option<Range<usize>>,
        value: Option<Value<'a>>,
    ) -> Self {
        Self { context, name, value, key_span }
    }

    /// Whether the file has the key.
    pub(super) fn is_present(&self) -> bool {
        self.value.is_some()
    }

    /// The span of the key.
    pub(super) fn key_span(&self) -> Option<Range<usize>> {
        self.key_span.clone()
    }

    /// The span of the value.
    pub(super) fn value_span(&self) -> Option<Range<usize>> {
        self.value.map(|value| value.span())
    }

    /// Reads a number, which may be an integer.
    pub(super) fn number(&self, limits: Limits) -> Option<f64> {
        number_within(self.context, self.name, self.value?, limits, "a number")
    }

    /// Reads a number in single precision.
    pub(super) fn number_f32(&self, limits: Limits) -> Option<f32> {
        self.number(limits).map(|number| number as f32)
    }

    /// Reads an integer. `N` must be able to represent all of `range`.
    pub(super) fn integer<N: TryFrom<i128>>(&self, range: RangeInclusive<i128>) -> Option<N> {
        let value = self.value?;
        let TomlValue::Integer { digits, radix } = value.decode() else {
            report_wrong_type(self.context, self.name, value, "a whole number");
            return None;
        };
        let number = parse_integer_in_radix(digits, radix).filter(|number| range.contains(number));
        if number.is_none() {
            let (name, low, high) = (self.name, range.start(), range.end());
            let message = format!("`{name}` must be a whole number between {low} and {high}");
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
        report_wrong_type(self.context, self.name, value, "true or false");
        None
    }

    /// Reads a string. `expected` describes the string in error messages.
    pub(super) fn string(&self, expected: &str) -> Option<&'a str> {
        self.string_described_by(|| expected.to_owned())
    }

    /// Reads a string. `expected` returns the description of the string for error messages.
    fn string_described_by(&self, expected: impl FnOnce() -> String) -> Option<&'a str> {
        let value = self.value?;
        if let TomlValue::String(text) = value.decode() {
            return Some(text);
        }
        report_wrong_type(self.context, self.name, value, &expected());
        None
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
        let issue = Issue::error(self.value_span()?, format!("`{}` must not be a number", self.name));
        self.context.report(
            issue.with_help("use a name with a letter, because shapes can also be referenced by number"),
        );
        None
    }

    /// Whether the value is a table.
    pub(super) fn is_table(&self) -> bool {
        self.value.is_some_and(|value| matches!(value.decode(), TomlValue::Table(_)))
    }

    /// Reads a choice by its name.
    pub(super) fn choice<C: Choice>(&self) -> Option<C> {
        let list = || {
            let list = C::ALL.iter().map(|one| format!("\"{}\"", one.name())).collect::<Vec<_>>().join(", ");
            if C::ALL.len() == 1 { list } else { format!("one of {list}") }
        };
        let text = self.string_described_by(list)?;
        if let Some(meant) = C::named(text) {
            return Some(meant);
        }
        let (span, name, shown, list) =
            (self.value_span()?, self.name, escape_and_truncate(text, 32), list());
        let mut issue = if C::UNAVAILABLE.contains(&text) {
            let message = format!("{name} \"{shown}\" is not available in this version; use {list}");
            Issue::error(span, message)
        } else {
            Issue::error(span, format!("`{name}` cannot be \"{shown}\""))
                .with_help(format!("expected {list}"))
        };
        let names: Vec<&str> = C::ALL.iter().map(|one| one.name()).collect();
        if let Some(near) = foreign_or_nearest_name(text, &names) {
            issue = issue.with_label(format!("did you mean \"{near}\"?"));
        }
        self.context.report(issue);
        None
    }

    /// Reads three numbers as a vector.
    pub(super) fn vector(&self, limits: Limits) -> Option<DVec3> {
        self.numbers(limits, "three numbers, [x, y, z]").map(DVec3::from_array)
    }

    /// Reads three numbers as a vector. Returns `default` if the key is absent.
    pub(super) fn vector_or(&self, limits: Limits, default: DVec3) -> Option<DVec3> {
        if self.is_present() { self.vector(limits) } else { Some(default) }
    }

    /// Checks that a vector is long enough to compute with, and reports an error if not. For vectors of
    /// length 0, the caller reports a more specific error.
    pub(super) fn check_vector_zero_or_long_enough(&self, vector: DVec3) -> bool {
        let length = robust_length(vector);
        let Some(span) = self.value_span().filter(|_| is_nonzero_but_too_short(length)) else { return true };
        let issue = Issue::error(span, format!("`{}` must be more than {SHORTEST:e} long", self.name));
        self.context.report(issue.with_label(format!("its length is {length:e}")));
        false
    }

    /// Checks that the points at the keys `self` and `other` are far enough apart to compute with, and
    /// reports an error if not. For equal points, the caller reports a more specific error.
    pub(super) fn check_points_equal_or_far_apart(&self, from: DVec3, other: &Self, to: DVec3) -> bool {
        let distance = robust_length(to - from);
        let span = other.value_span().or(self.value_span());
        let Some(span) = span.filter(|_| is_nonzero_but_too_short(distance)) else { return true };
        let (first, second) = (self.name, other.name);
        let message = format!("`{first}` and `{second}` must be more than {SHORTEST:e} apart");
        self.context.report(Issue::error(span, message).with_label(format!("they are {distance:e} apart")));
        false
    }

    /// Reads a pair of numbers.
    pub(super) fn pair(&self, limits: Limits) -> Option<Vec2> {
        self.numbers(limits, "two numbers, [u, v]").map(|[u, v]: [f64; 2]| Vec2::new(u as f32, v as f32))
    }

    /// Reads an array of `N` numbers. Reports every invalid number.
    pub(super) fn numbers<const N: usize>(&self, limits: Limits, expected: &str) -> Option<[f64; N]> {
        let value = self.value?;
        let Some(array) = value.as_array().filter(|array| array.len() == N) else {
            report_wrong_type(self.context, self.name, value, expected);
            return None;
        };
        let mut numbers = [Some(0.0); N];
        for (number, one) in numbers.iter_mut().zip(array.iter()) {
            *number = number_within(self.context, self.name, one, limits, expected);
        }
        let is_whole = numbers.iter().all(Option::is_some);
        is_whole.then(|| numbers.map(Option::unwrap_or_default))
    }

    /// Reads scale factors: one number for all three axes, or three numbers.
    pub(super) fn scale_factors(&self, limits: Limits) -> Option<DVec3> {
        if matches!(self.value?.decode(), TomlValue::Integer { .. } | TomlValue::Float(_)) {
            return self.number(limits).map(DVec3::splat);
        }
        self.numbers(limits, "a number, or three numbers [x, y, z]").map(DVec3::from_array)
    }

    /// Reads a name and returns the name's index in `names`.
    pub(super) fn index_by_name(&self, names: &DefinedNames) -> Option<usize> {
        self.resolve_name_or_report(
            names,
            self.string_described_by(|| format!("the name of a {}", names.kind))?,
        )
    }

    /// Looks up the name `text`, which is the key's value. Reports an error if it is undefined.
    fn resolve_name_or_report(&self, names: &DefinedNames, text: &str) -> Option<usize> {
        let index = names.find_and_mark_used(text);
        if index.is_none() {
            let message = format!("there is no {} \"{}\"", names.kind, escape_and_truncate(text, 40));
            let issue = Issue::error(self.value_span()?, message).with_missing_value_cause();
            self.context.report(names.add_name_suggestions(self.context, issue, text));
        }
        index
    }

    /// Reads an inline table: `{ … }`.
    pub(super) fn inline_table(&self) -> Option<TableReader<'a>> {
        TableReader::from_value(self.context, self.value?, TableTitle::Key(self.name))
    }
}
