//! TOML values as numbers, and in words.

use super::super::sanitize::shortened;
pub(super) use super::super::toml::{Item, Value};
use super::context::{Context, Issue};
use super::limits::Limits;

/// A value in a few words, to be read after `found`.
pub(super) fn found(context: &Context<'_>, value: Value<'_>) -> String {
    const LONGEST: usize = 32;
    let written = || shortened(context.text(&value.span()), LONGEST);
    match value.item() {
        Item::String(_) => format!("the string {}", written()),
        Item::Integer { .. } | Item::Float(_) | Item::Boolean(_) => written(),
        Item::Datetime => format!("the date {}", written()),
        Item::Array(array) => match array.len() {
            0 => "an empty array".to_owned(),
            1 => "an array of 1 value".to_owned(),
            count => format!("an array of {count} values"),
        },
        Item::Table(_) => "a table".to_owned(),
    }
}

/// An integer or a float; the largest double if it is larger. `None` for other values.
pub(super) fn number(value: Value<'_>) -> Option<f64> {
    match value.item() {
        // Rounding to the nearest double is what writing the number as a float would do.
        Item::Integer { digits, radix } => {
            Some(whole(digits, radix).map_or(f64::MAX, |number| number as f64))
        }
        Item::Float(text) => {
            let number: f64 = text.parse().ok()?;
            let is_digits = number.is_infinite() && !text.contains("inf");
            Some(if is_digits { f64::MAX } else { number })
        }
        Item::String(_) | Item::Boolean(_) | Item::Datetime | Item::Array(_) | Item::Table(_) => None,
    }
}

/// An integer by its digits. `None` if it is beyond all uses.
pub(super) fn whole(digits: &str, radix: u32) -> Option<i128> {
    i128::from_str_radix(digits, radix).ok()
}

/// A number within limits. `name` is what messages call it, `expected` what it must be.
pub(super) fn limited(
    context: &Context<'_>,
    name: &str,
    value: Value<'_>,
    limits: Limits,
    expected: &str,
) -> Option<f64> {
    let Some(number) = number(value) else {
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
    let issue = Issue::error(value.span(), format!("`{name}` must be {expected}")).label(label);
    // Whoever wrote a texture wants to know whether it is spelled wrongly or not possible.
    let is_texture = matches!(value.item(), Item::Table(table) if table.get("texture").is_some());
    context.report(match is_texture && !expected.contains("texture") {
        true => issue.help(format!("`{name}` is the same everywhere: it takes no texture")),
        false => issue,
    });
}
