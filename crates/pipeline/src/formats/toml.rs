//! Writer for concise TOML with short numbers, bare keys and no default values.

use crate::math::{DVec3, Vec2};
use crate::scene::quote_toml_string;

/// TOML text under construction.
#[derive(Debug, Default)]
pub(super) struct TomlWriter(String);

impl TomlWriter {
    /// Adds a comment, wrapped to several lines if necessary.
    pub(super) fn comment(&mut self, text: &str) {
        const WIDTH: usize = 110;
        let mut line = String::from("#");
        for word in text.split_whitespace() {
            if line.len() + 1 + word.len() > WIDTH {
                self.line(&line);
                line = String::from("#");
            }
            // A control character would end the comment.
            line.extend(std::iter::once(' ').chain(word.chars().filter(|c| !c.is_control())));
        }
        self.line(&line);
    }

    /// Adds an empty line and a table header, such as `[camera]`.
    pub(super) fn table(&mut self, header: &str) {
        if !self.0.is_empty() && !self.0.ends_with("\n\n") {
            self.0.push('\n');
        }
        self.line(header);
    }

    /// Adds an empty line and a comment.
    pub(super) fn section_comment(&mut self, text: &str) {
        if !self.0.is_empty() && !self.0.ends_with("\n\n") {
            self.0.push('\n');
        }
        self.comment(text);
    }

    /// Adds a key with a value in TOML syntax.
    pub(super) fn key_value(&mut self, key: &str, value: impl AsRef<str>) {
        self.line(&format!("{key} = {}", value.as_ref()));
    }

    fn line(&mut self, line: &str) {
        self.0.push_str(line);
        self.0.push('\n');
    }

    pub(super) fn finish(self) -> String {
        self.0
    }
}

/// Formats a number with 32-bit float precision. Values of 10,000 and above keep all digits.
pub(super) fn format_number(value: f64) -> String {
    const FAR: f64 = 1e4;
    let magnitude = value.abs();
    let text = if magnitude >= 1e15 || magnitude > 0.0 && magnitude < 1e-5 {
        format!("{:e}", value as f32)
    } else if magnitude >= FAR {
        format!("{value}")
    } else {
        format!("{}", value as f32)
    };
    if text == "-0" { "0".to_owned() } else { text }
}

/// Formats a point with all digits, since a small model may be far from the origin.
pub(super) fn format_exact_vector(value: DVec3) -> String {
    let exact = |value: f64| match value.abs() {
        0.0 => "0".to_owned(),
        magnitude if !(1e-5..1e15).contains(&magnitude) => format!("{value:e}"),
        _ => format!("{value}"),
    };
    format!("[{}]", value.to_array().map(exact).join(", "))
}

/// Rounds to `digits` significant digits.
pub(super) fn round_significant(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let unit = libm::pow(10.0, f64::from(digits - 1) - libm::floor(libm::log10(value.abs())));
    (value * unit).round() / unit
}

/// Formats an array.
pub(super) fn format_list(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|value| format_number(*value)).collect::<Vec<_>>().join(", "))
}

/// Formats a point or a direction.
pub(super) fn format_vector(value: DVec3) -> String {
    format_list(&value.to_array())
}

/// Formats a pair of numbers.
pub(super) fn format_pair(value: Vec2) -> String {
    format_list(&[f64::from(value.x), f64::from(value.y)])
}

/// Formats a color. Grays become a single number.
pub(super) fn format_color(value: DVec3) -> String {
    let [red, green, blue] = value.to_array();
    if red == green && green == blue { format_number(red) } else { format_vector(value) }
}

/// Formats a name as a key, quoted only if TOML requires it.
pub(super) fn format_key(name: &str) -> String {
    let is_bare =
        !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte));
    if is_bare { name.to_owned() } else { quote_toml_string(name) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_formatted_concisely() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (f64::from(0.3_f32), "0.3"),
            (-2.5, "-2.5"),
            (500_000.125, "500000.125"),
            (1e-7, "1e-7"),
            (3e20, "3e20"),
        ] {
            assert_eq!(format_number(value), text);
        }
        assert_eq!(
            (round_significant(1234.56, 3), round_significant(-0.012345, 2), round_significant(0.0, 2)),
            (1230.0, -0.012, 0.0)
        );
        assert_eq!(
            (format_color(DVec3::ONE), format_key("a-b_1"), format_key("a b")),
            ("1".into(), "a-b_1".into(), "\"a b\"".into())
        );
    }

    #[test]
    fn comments_are_wrapped_and_sanitized() {
        let mut toml = TomlWriter::default();
        toml.comment(&format!("a\n[camera]\u{7} {}", "word ".repeat(40)));
        let text = toml.finish();
        assert!(
            text.lines().count() > 1 && text.lines().all(|line| line.starts_with("# ") && line.len() <= 112),
            "{text}"
        );
    }
}
