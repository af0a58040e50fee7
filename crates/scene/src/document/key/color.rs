//! Reads colors and textures.

use std::ops::Range;

use super::super::super::description::{ColorSource, EmissionSource};
use super::super::super::keys::colors::{color_names, hex_digits_after_hash, parse_hex_or_named_srgb8};
use super::super::super::nearest::nearest_name;
use super::super::context::Issue;
use super::super::limits::Limits;
use super::super::names::DefinedNames;
use super::super::value::{TomlValue, Value};
use super::KeyInTable;
use crate::math::color::srgb8_color_to_linear;
use crate::math::{DVec3, Vec3};

const COLOR: &str = "a color: [r, g, b], a number, \"#rrggbb\" or a name";
/// Integers of at least this value are assumed to be components in 0–255, because no reflectance is this
/// large.
const MIN_BYTE: u8 = 10;
const COLOR_PAIR: &str = "an array of two colors";
const COLOR_OR_TEXTURE: &str =
    "a color, [r, g, b], a number, \"#rrggbb\" or a name, or { texture = \"name\" }";
const EMISSION: &str =
    "a color, [r, g, b], a number, \"#rrggbb\" or a name, or { texture = \"name\", scale = 1.0 }";

impl KeyInTable<'_> {
    /// Reads a color and converts it to linear.
    pub(in super::super) fn color(&self) -> Option<Vec3> {
        self.color_f64().map(DVec3::as_vec3)
    }

    /// Reads a color in double precision, because `f32` would round some values to 0 or 1.
    pub(in super::super) fn color_f64(&self) -> Option<DVec3> {
        self.read_color_described_as(COLOR)
    }

    /// Reads an array of two colors and converts them to linear.
    pub(in super::super) fn color_pair(&self) -> Option<[Vec3; 2]> {
        let value = self.value?;
        let Some(array) = value.as_array().filter(|array| array.len() == 2) else {
            self.report_wrong_type(value, COLOR_PAIR);
            return None;
        };
        let color = |element: Value<'_>| {
            let spans = self.spans.clone().map(|[key, _]| [key, element.span()]);
            KeyInTable { context: self.context, info: self.info, value: Some(element), spans }.color()
        };
        let mut colors = array.iter().map(color);
        // Read both, to report all errors.
        let (first, second) = (colors.next()?, colors.next()?);
        Some([first?, second?])
    }

    /// Reads a color or a texture.
    pub(in super::super) fn color_or_texture(&self, textures: &DefinedNames) -> Option<ColorSource> {
        if self.is_table() {
            return self.referenced_texture_index(textures).map(ColorSource::Texture);
        }
        self.reject_bare_texture_name(textures, COLOR_OR_TEXTURE)?;
        self.read_color_described_as(COLOR_OR_TEXTURE).map(|color| ColorSource::Constant(color.as_vec3()))
    }

    /// Reads the texture in `{ texture = "name" }`.
    fn referenced_texture_index(&self, textures: &DefinedNames) -> Option<usize> {
        let table = self.inline_table()?;
        let texture = table.key("texture").index_by_name(textures);
        table.report_unknown_and_missing_keys();
        texture
    }

    /// Reads emitted radiance: a non-negative color, or a texture with a scale factor.
    pub(in super::super) fn emission_source(&self, textures: &DefinedNames) -> Option<EmissionSource> {
        if self.is_table() {
            let table = self.inline_table()?;
            let texture = table.key("texture").index_by_name(textures);
            let scale = table.key("scale").color();
            table.report_unknown_and_missing_keys();
            return Some(EmissionSource { texture: Some(texture?), ..EmissionSource::from_constant(scale?) });
        }
        self.reject_bare_texture_name(textures, EMISSION)?;
        self.read_color_described_as(EMISSION).map(|color| EmissionSource::from_constant(color.as_vec3()))
    }

    /// Returns `None` and reports an error if the value is a bare texture name.
    fn reject_bare_texture_name(&self, textures: &DefinedNames, expected: &str) -> Option<()> {
        if let Some(text) = self.value?.as_str()
            && parse_hex_or_named_srgb8(text).is_none()
            && textures.find_and_mark_used(text).is_some()
        {
            let issue = Issue::error(self.value_span()?, format!("`{}` must be {expected}", self.info.name))
                .with_label("found the name of a texture")
                .with_help(format!("write {{ texture = {} }}", self.context.span_text(&self.value_span()?)));
            self.context.report(issue);
            return None;
        }
        Some(())
    }

    /// Reads a color. Error messages call the value's type `expected`.
    fn read_color_described_as(&self, expected: &str) -> Option<DVec3> {
        let value = self.value?;
        if let Some(Limits::Between(..)) = self.info.kind.limits()
            && self
                .report_byte_color(|span| Issue::error(span, format!("`{}` must be {COLOR}", self.info.name)))
        {
            return None;
        }
        match value.decode() {
            TomlValue::String(text) => return self.parse_hex_or_named_color(text).map(Vec3::as_dvec3),
            TomlValue::Number(_) => return self.number_from_value(value, expected).map(DVec3::splat),
            TomlValue::Boolean(_) | TomlValue::Datetime | TomlValue::Array(_) | TomlValue::Table(_) => {}
        }
        if value.as_array().is_some_and(|array| array.len() == 3) {
            let rgb: [f64; 3] = self.numbers("three numbers, [r, g, b]")?;
            return Some(DVec3::from_array(rgb));
        }
        self.report_wrong_type(value, expected);
        None
    }

    /// If the value looks like a color with components from 0 to 255, reports `issue` at the value's span and
    /// suggests the equivalent `#rrggbb`. Returns whether it does.
    pub(in super::super) fn report_byte_color(&self, issue: impl FnOnce(Range<usize>) -> Issue) -> bool {
        let (Some(span), Some(color)) = (self.value_span(), self.byte_color_to_hex()) else { return false };
        let help = format!("write \"{color}\"; linear components range from 0 to 1");
        self.context.report(issue(span).with_label("this looks like 0–255").with_help(help));
        true
    }

    /// Converts one or three integers up to 255 to `#rrggbb`, if any of them is too large for a linear
    /// component.
    fn byte_color_to_hex(&self) -> Option<String> {
        let byte = |value: Value<'_>| u8::try_from(value.as_number()?.to_integer()?).ok();
        let value = self.value?;
        let bytes: Vec<u8> = match value.as_array() {
            Some(array) => array.iter().map(byte).collect::<Option<_>>()?,
            None => vec![byte(value)?; 3],
        };
        let is_meant = bytes.len() == 3 && bytes.iter().any(|byte| *byte >= MIN_BYTE);
        is_meant.then(|| bytes.iter().fold("#".to_owned(), |text, byte| format!("{text}{byte:02x}")))
    }

    /// Converts `#rrggbb` or a case-insensitive color name from sRGB to linear.
    fn parse_hex_or_named_color(&self, text: &str) -> Option<Vec3> {
        if let Some(bytes) = parse_hex_or_named_srgb8(text) {
            return Some(srgb8_color_to_linear(bytes));
        }
        let issue = Issue::error(self.value_span()?, format!("`{}` must be {COLOR}", self.info.name));
        let small = text.to_ascii_lowercase();
        let issue = match (normalize_hex_color(text), nearest_name(&small, color_names())) {
            (Some(long), _) => issue
                .with_label("not of the form #rrggbb")
                .with_help(format!("write all six digits: \"{long}\"")),
            (None, _) if text.starts_with('#') => issue
                .with_label("not of the form #rrggbb")
                .with_help("write six hexadecimal digits after the #, such as \"#ffcc00\""),
            (None, Some(near)) => issue.with_label(format!("did you mean \"{near}\"?")),
            (None, None) => issue.with_label("unknown color name").with_help("use a CSS color name"),
        };
        self.context.report(issue);
        None
    }
}

/// Converts `#rgb` and `rrggbb` to `#rrggbb`.
fn normalize_hex_color(text: &str) -> Option<String> {
    match hex_digits_after_hash(text) {
        Some(digits) if digits.len() == 3 => {
            Some(digits.chars().fold("#".to_owned(), |long, digit| format!("{long}{digit}{digit}")))
        }
        Some(_) => None,
        None => hex_digits_after_hash(&format!("#{text}"))
            .filter(|digits| digits.len() == 6)
            .map(|d| format!("#{d}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_and_bare_hex_colors_are_completed() {
        assert_eq!(normalize_hex_color("#f80").as_deref(), Some("#ff8800"));
        assert_eq!(normalize_hex_color("ff8000").as_deref(), Some("#ff8000"));
        assert_eq!(normalize_hex_color("red"), None);
    }
}
