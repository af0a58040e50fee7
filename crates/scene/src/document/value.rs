//! Describes TOML values in messages.

use super::super::sanitize::escape_and_truncate;
use super::super::toml::format_value;
pub(super) use super::super::toml::{TomlValue, Value};
use super::context::FileContext;

/// Describes a value for use in messages, as in `found the string "a"`. Quotes the source text, or formats
/// the value if it has no source text or is from a foreign file.
pub(super) fn describe_value(context: &FileContext<'_>, value: Value<'_>) -> String {
    const MAX_LENGTH: usize = 32;
    let written = || match context.value_text(&value.span()) {
        None => escape_and_truncate(&format_value(value), MAX_LENGTH),
        Some(text) => escape_and_truncate(text, MAX_LENGTH),
    };
    match value.decode() {
        TomlValue::String(_) => format!("the string {}", written()),
        TomlValue::Number(_) | TomlValue::Boolean(_) => written(),
        TomlValue::Datetime => format!("the date {}", written()),
        TomlValue::Array(array) => match array.len() {
            0 => "an empty array".to_owned(),
            1 => "an array of 1 value".to_owned(),
            count => format!("an array of {count} values"),
        },
        TomlValue::Table(_) => "a table".to_owned(),
    }
}
