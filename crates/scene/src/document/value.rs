//! Converts TOML values to numbers, describes them and parses defaults.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use super::super::sanitize::escape_and_truncate;
use super::super::toml;
pub(super) use super::super::toml::{TomlValue, Value};
use super::context::FileContext;

/// Describes a value for use in messages, as in `found the string "a"`.
pub(super) fn describe_value(context: &FileContext<'_>, value: Value<'_>) -> String {
    const LONGEST: usize = 32;
    let written = || escape_and_truncate(context.span_text(&value.span()), LONGEST);
    match value.decode() {
        TomlValue::String(_) => format!("the string {}", written()),
        TomlValue::Integer { .. } | TomlValue::Float(_) | TomlValue::Boolean(_) => written(),
        TomlValue::Datetime => format!("the date {}", written()),
        TomlValue::Array(array) => match array.len() {
            0 => "an empty array".to_owned(),
            1 => "an array of 1 value".to_owned(),
            count => format!("an array of {count} values"),
        },
        TomlValue::Table(_) => "a table".to_owned(),
    }
}

/// Converts an integer or a float to a double, clamping it to the range of doubles. Returns `None` for other
/// values.
pub(super) fn to_number(value: Value<'_>) -> Option<f64> {
    match value.decode() {
        // Round to the nearest double, as if the number were written as a float.
        TomlValue::Integer { digits, radix } => {
            Some(parse_integer_in_radix(digits, radix).map_or(f64::MAX, |number| number as f64))
        }
        TomlValue::Float(text) => {
            let number: f64 = text.parse().ok()?;
            let is_digits = number.is_infinite() && !text.contains("inf");
            Some(if is_digits { f64::MAX } else { number })
        }
        TomlValue::String(_)
        | TomlValue::Boolean(_)
        | TomlValue::Datetime
        | TomlValue::Array(_)
        | TomlValue::Table(_) => None,
    }
}

/// Parses an integer, or returns `None` if it overflows.
pub(super) fn parse_integer_in_radix(digits: &str, radix: u32) -> Option<i128> {
    i128::from_str_radix(digits, radix).ok()
}

/// Parses the text of a default. Each text is parsed once and never freed, so that defaults can be read like
/// values in a file.
pub(super) fn default_value(text: &'static str) -> Option<Value<'static>> {
    static PARSED: Mutex<BTreeMap<&str, Option<Value<'static>>>> = Mutex::new(BTreeMap::new());
    let mut parsed = PARSED.lock().unwrap_or_else(PoisonError::into_inner);
    *parsed.entry(text).or_insert_with(|| {
        let document = Box::leak(Box::new(toml::parse(format!("default = {text}").leak()).0));
        document.root().get("default").map(|found| found.value)
    })
}
