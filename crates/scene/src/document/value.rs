//! Converts TOML values to numbers and describes them.

use super::super::sanitize::escape_and_truncate;
pub(super) use super::super::toml::{TomlValue, Value};
use super::context::{FileContext, Issue};
use super::limits::Limits;

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

/// Reads a number within limits. Error messages call the number `name` and its type `expected`.
pub(super) fn number_within(
    context: &FileContext<'_>,
    name: &str,
    value: Value<'_>,
    limits: Limits,
    expected: &str,
) -> Option<f64> {
    let Some(number) = to_number(value) else {
        report_wrong_type(context, name, value, expected);
        return None;
    };
    let violation = limits.violation(number);
    if let Some(words) = &violation {
        let label = format!("found {}", describe_value(context, value));
        context.report(Issue::error(value.span(), format!("`{name}` {words}")).with_label(label));
    }
    violation.is_none().then_some(number)
}

/// Reports a value of the wrong type.
pub(super) fn report_wrong_type(context: &FileContext<'_>, name: &str, value: Value<'_>, expected: &str) {
    let label = format!("found {}", describe_value(context, value));
    let issue = Issue::error(value.span(), format!("`{name}` must be {expected}")).with_label(label);
    // Explain that textures are not allowed here. Otherwise, users would look for a typo.
    let is_texture = matches!(value.decode(), TomlValue::Table(table) if table.get("texture").is_some());
    context.report(match is_texture && !expected.contains("texture") {
        true => issue.with_help(format!("`{name}` cannot be a texture")),
        false => issue,
    });
}
