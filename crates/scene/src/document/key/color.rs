//! Colours, and colours or textures.

use std::ops::Range;

use super::super::super::description::{ColorSource, EmissionSource};
use super::super::super::keys::{color_bytes, color_names, hex_digits};
use super::super::super::nearest::nearest;
use super::super::context::Issue;
use super::super::limits::Limits;
use super::super::names::Names;
use super::super::value::{Item, Value, limited, whole, wrong_type};
use super::Key;
use crate::math::color::srgb8_to_linear;
use crate::math::{DVec3, Vec3};

const COLOR: &str = "a colour: [r, g, b], a number, \"#rrggbb\" or a name";
/// Nobody means a surface by such a number that reflects as many times what falls on it.
const LEAST_BYTE: u8 = 10;
const COLOR_OR_TEXTURE: &str =
    "a colour, [r, g, b], a number, \"#rrggbb\" or a name, or { texture = \"name\" }";
const EMISSION: &str =
    "a colour, [r, g, b], a number, \"#rrggbb\" or a name, or { texture = \"name\", scale = 1.0 }";

impl Key<'_> {
    /// A colour ≥ 0, decoded to linear.
    pub(in super::super) fn color(&self) -> Option<Vec3> {
        self.exact_color(Limits::AtLeast(0.0)).map(DVec3::as_vec3)
    }

    /// A colour as it is written: a part so small or so near to 1 that `f32` does not tell it from that.
    pub(in super::super) fn exact_color(&self, limits: Limits) -> Option<DVec3> {
        self.color_of(limits, COLOR)
    }

    /// A colour or a texture.
    pub(in super::super) fn color_or_texture(&self, textures: &Names, limits: Limits) -> Option<ColorSource> {
        if self.is_table() {
            return self.texture(textures).map(ColorSource::Texture);
        }
        self.is_no_texture(textures, COLOR_OR_TEXTURE)?;
        self.color_of(limits, COLOR_OR_TEXTURE).map(|color| ColorSource::Constant(color.as_vec3()))
    }

    /// The texture of `{ texture = "name" }`.
    fn texture(&self, textures: &Names) -> Option<usize> {
        let table = self.inline_table()?;
        let texture = table.required("texture", "\"name\"").name_in(textures);
        table.finish();
        texture
    }

    /// Radiance: a colour ≥ 0, or a texture and what that is multiplied by.
    pub(in super::super) fn emission(&self, textures: &Names) -> Option<EmissionSource> {
        if self.is_table() {
            let table = self.inline_table()?;
            let texture = table.required("texture", "\"name\"").name_in(textures);
            let scale = table.optional("scale");
            let scale = if scale.is_given() { scale.color() } else { Some(Vec3::ONE) };
            table.finish();
            return Some(EmissionSource { texture: Some(texture?), ..EmissionSource::constant(scale?) });
        }
        self.is_no_texture(textures, EMISSION)?;
        self.color_of(Limits::AtLeast(0.0), EMISSION).map(|color| EmissionSource::constant(color.as_vec3()))
    }

    /// None, and an error, where a value is the bare name of a texture.
    fn is_no_texture(&self, textures: &Names, expected: &str) -> Option<()> {
        if let Item::String(text) = self.value?.item()
            && color_bytes(text).is_none()
            && textures.find(text).is_some()
        {
            let issue = Issue::error(self.span()?, format!("`{}` must be {expected}", self.name))
                .label("found the name of a texture")
                .help(format!("write {{ texture = {} }}", self.context.text(&self.span()?)));
            self.context.report(issue);
            return None;
        }
        Some(())
    }

    fn color_of(&self, limits: Limits, expected: &str) -> Option<DVec3> {
        let value = self.value?;
        if let Limits::Between(..) = limits
            && self.is_of_bytes(|span| Issue::error(span, format!("`{}` must be {COLOR}", self.name)))
        {
            return None;
        }
        match value.item() {
            Item::String(text) => return self.written_color(text).map(Vec3::as_dvec3),
            Item::Integer { .. } | Item::Float(_) => {
                return limited(self.context, self.name, value, limits, expected).map(DVec3::splat);
            }
            Item::Boolean(_) | Item::Datetime | Item::Array(_) | Item::Table(_) => {}
        }
        if value.array().is_some_and(|array| array.len() == 3) {
            let rgb: [f64; 3] = self.numbers(limits, "three numbers, [r, g, b]")?;
            return Some(DVec3::from_array(rgb));
        }
        wrong_type(self.context, self.name, value, expected);
        None
    }

    /// Whether its value is numbers from 0 to 255 in place of parts of the light; then reports this issue of its place, with
    /// the text that is meant.
    pub(in super::super) fn is_of_bytes(&self, issue: impl FnOnce(Range<usize>) -> Issue) -> bool {
        let (Some(span), Some(color)) = (self.span(), self.of_bytes()) else { return false };
        let help = format!("write \"{color}\"; parts of the light go from 0 to 1");
        self.context.report(issue(span).label("this looks like 0–255").help(help));
        true
    }

    /// The text `#rrggbb` for one or three whole numbers up to 255 of which one is too large for a part of the light.
    fn of_bytes(&self) -> Option<String> {
        let byte = |value: Value<'_>| match value.item() {
            Item::Integer { digits, radix } => u8::try_from(whole(digits, radix)?).ok(),
            Item::String(_)
            | Item::Float(_)
            | Item::Boolean(_)
            | Item::Datetime
            | Item::Array(_)
            | Item::Table(_) => None,
        };
        let value = self.value?;
        let bytes: Vec<u8> = match value.array() {
            Some(array) => array.iter().map(byte).collect::<Option<_>>()?,
            None => vec![byte(value)?; 3],
        };
        let is_meant = bytes.len() == 3 && bytes.iter().any(|byte| *byte >= LEAST_BYTE);
        is_meant.then(|| bytes.iter().fold("#".to_owned(), |text, byte| format!("{text}{byte:02x}")))
    }

    /// `#rrggbb`, or a name in any case, decoded from sRGB.
    fn written_color(&self, text: &str) -> Option<Vec3> {
        if let Some(bytes) = color_bytes(text) {
            return Some(srgb8_to_linear(bytes));
        }
        let issue = Issue::error(self.span()?, format!("`{}` must be {COLOR}", self.name));
        let small = text.to_ascii_lowercase();
        let issue = match (long_form(text), nearest(&small, color_names())) {
            (Some(long), _) => {
                issue.label("this is not #rrggbb").help(format!("write all six digits: \"{long}\""))
            }
            (None, _) if text.starts_with('#') => issue
                .label("this is not #rrggbb")
                .help("six hexadecimal digits after a #, such as \"#ffcc00\""),
            (None, Some(near)) => issue.label(format!("did you mean \"{near}\"?")),
            (None, None) => issue.label("there is no colour of this name").help("the names are those of CSS"),
        };
        self.context.report(issue);
        None
    }
}

/// `#rrggbb` for `#rgb` and for `rrggbb`.
fn long_form(text: &str) -> Option<String> {
    match hex_digits(text) {
        Some(digits) if digits.len() == 3 => {
            Some(digits.chars().fold("#".to_owned(), |long, digit| format!("{long}{digit}{digit}")))
        }
        Some(_) => None,
        None => hex_digits(&format!("#{text}")).filter(|digits| digits.len() == 6).map(|d| format!("#{d}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_and_bare_digits_lead_to_the_long_form() {
        assert_eq!(long_form("#f80").as_deref(), Some("#ff8800"));
        assert_eq!(long_form("ff8000").as_deref(), Some("#ff8000"));
        assert_eq!(long_form("red"), None);
    }
}
