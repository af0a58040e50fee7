//! Colours, and colours or textures.

use super::super::super::description::ColorSource;
use super::super::context::Issue;
use super::super::limits::Limits;
use super::super::names::Names;
use super::super::value::{Item, wrong_type};
use super::Key;
use crate::math::Vec3;
use crate::math::color::srgb8_to_linear;

const COLOR: &str = "a colour: [r, g, b] or \"#rrggbb\"";
const COLOR_OR_TEXTURE: &str = "a colour, [r, g, b] or \"#rrggbb\", or { texture = \"name\" }";

impl Key<'_> {
    /// A colour ≥ 0, decoded to linear.
    pub(in super::super) fn color(&self) -> Option<Vec3> {
        self.color_of(Limits::AtLeast(0.0), COLOR)
    }

    /// A colour of components in [0, 1]: a part of the light.
    pub(in super::super) fn fraction(&self) -> Option<Vec3> {
        self.color_of(Limits::Between(0.0, 1.0), COLOR)
    }

    /// A colour ≥ 0 or a texture.
    pub(in super::super) fn color_or_texture(&self, textures: &Names) -> Option<ColorSource> {
        match self.value?.item() {
            Item::Table(_) => {
                let table = self.inline_table()?;
                let texture = table.required("texture", "\"name\"").name_in(textures);
                table.finish();
                texture.map(ColorSource::Texture)
            }
            Item::String(text) if textures.find(text).is_some() => {
                let issue = Issue::error(self.span()?, format!("`{}` must be {COLOR_OR_TEXTURE}", self.name))
                    .label("found the name of a texture")
                    .help(format!("write {{ texture = {} }}", self.context.text(&self.span()?)));
                self.context.report(issue);
                None
            }
            _ => self.color_of(Limits::AtLeast(0.0), COLOR_OR_TEXTURE).map(ColorSource::Constant),
        }
    }

    fn color_of(&self, limits: Limits, expected: &str) -> Option<Vec3> {
        let value = self.value?;
        match value.item() {
            Item::String(text) => self.hexadecimal(text),
            Item::Array(array) if array.len() == 3 => {
                let rgb: [f64; 3] = self.numbers(limits, "three numbers, [r, g, b]")?;
                Some(Vec3::from_array(rgb.map(|component| component as f32)))
            }
            _ => {
                wrong_type(self.context, self.name, value, expected);
                None
            }
        }
    }

    fn hexadecimal(&self, text: &str) -> Option<Vec3> {
        let color = rgb_bytes(text).map(srgb8_to_linear);
        if color.is_none() {
            let help = match long_form(text) {
                Some(long) => format!("write all six digits: \"{long}\""),
                None => "six hexadecimal digits after a #, such as \"#ffcc00\"".to_owned(),
            };
            let issue = Issue::error(self.span()?, format!("`{}` must be {COLOR}", self.name));
            self.context.report(issue.label("this is not #rrggbb").help(help));
        }
        color
    }
}

/// The bytes of `#rrggbb`.
fn rgb_bytes(text: &str) -> Option<[u8; 3]> {
    let digits = hex_digits(text).filter(|digits| digits.len() == 6)?;
    let number = u32::from_str_radix(digits, 16).ok()?;
    let [_, red, green, blue] = number.to_be_bytes();
    Some([red, green, blue])
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

fn hex_digits(text: &str) -> Option<&str> {
    text.strip_prefix('#').filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_six_digits_are_a_colour() {
        assert_eq!(rgb_bytes("#ff8000"), Some([255, 128, 0]));
        assert_eq!(rgb_bytes("#FF80aa"), Some([255, 128, 170]));
        for wrong in ["", "#", "ff8000", "#ff800", "#ff80000", "#gg8000", "#+f8000", "#ä1234"] {
            assert_eq!(rgb_bytes(wrong), None, "{wrong}");
        }
        assert_eq!(long_form("#f80").as_deref(), Some("#ff8800"));
        assert_eq!(long_form("ff8000").as_deref(), Some("#ff8000"));
        assert_eq!(long_form("red"), None);
    }
}
