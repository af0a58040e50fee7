//! TOML values as numbers, and in words.

use toml::Spanned;
use toml::de::{DeInteger, DeValue};

use super::super::sanitize::shortened;
use super::context::{Context, Issue};
use super::limits::Limits;

/// A value with its place.
pub(super) type Value<'a> = &'a Spanned<DeValue<'a>>;

/// A value in a few words, to be read after `found`.
pub(super) fn found(context: &Context<'_>, value: Value<'_>) -> String {
    const LONGEST: usize = 32;
    let written = || shortened(context.text(&value.span()), LONGEST);
    match value.get_ref() {
        DeValue::String(_) => format!("the string {}", written()),
        DeValue::Integer(_) | DeValue::Float(_) => written(),
        DeValue::Boolean(_) => written(),
        DeValue::Datetime(_) => format!("the date {}", written()),
        DeValue::Array(array) => match array.len() {
            0 => "an empty array".to_owned(),
            1 => "an array of 1 value".to_owned(),
            count => format!("an array of {count} values"),
        },
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// An integer or a float; the largest double where it is larger. None: something else.
pub(super) fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        // Rounding to the nearest double is what writing the number as a float would do.
        DeValue::Integer(integer) => Some(whole(integer).map_or(f64::MAX, |number| number as f64)),
        DeValue::Float(float) => {
            let number: f64 = float.as_str().parse().ok()?;
            let is_digits = number.is_infinite() && !float.as_str().contains("inf");
            Some(if is_digits { f64::MAX } else { number })
        }
        _ => None,
    }
}

/// An integer; none where it is beyond all uses.
pub(super) fn whole(integer: &DeInteger<'_>) -> Option<i128> {
    i128::from_str_radix(integer.as_str(), integer.radix()).ok()
}

/// A number within limits. `name` is what messages call it, `expected` what it must be.
pub(super) fn limited(
    context: &Context<'_>,
    name: &str,
    value: Value<'_>,
    limits: Limits,
    expected: &str,
) -> Option<f64> {
    let Some(number) = number(value.get_ref()) else {
        wrong_type(context, name, value, expected);
        return None;
    };
    let violation = limits.violation(number);
    if let Some(words) = &violation {
        let label = format!("found {}", found(context, value));
        context.report(Issue::error(value.span(), format!("`{name}` {words}")).label(label));
    }
    violation.is_none().then_some(number)
}

/// Reports that a value is not of the kind that is expected.
pub(super) fn wrong_type(context: &Context<'_>, name: &str, value: Value<'_>, expected: &str) {
    let label = format!("found {}", found(context, value));
    context.report(Issue::error(value.span(), format!("`{name}` must be {expected}")).label(label));
}
