//! Color strings: CSS color names and `#rrggbb`.

use csscolorparser::NAMED_COLORS;

/// Lowercase color names from CSS Color Module Level 4, section 6.1.
pub fn color_names() -> impl Iterator<Item = &'static str> {
    NAMED_COLORS.keys().map(|name| name.as_str())
}

/// Parses a color string (`#rrggbb` or a case-insensitive name) into sRGB bytes.
pub fn parse_hex_or_named_srgb8(text: &str) -> Option<[u8; 3]> {
    parse_six_digit_hex_color(text).or_else(|| named_color(text))
}

/// Parses `#rrggbb`.
fn parse_six_digit_hex_color(text: &str) -> Option<[u8; 3]> {
    let digits = hex_digits_after_hash(text).filter(|digits| digits.len() == 6)?;
    let number = u32::from_str_radix(digits, 16).ok()?;
    let [_, red, green, blue] = number.to_be_bytes();
    Some([red, green, blue])
}

/// Returns the hexadecimal digits after a `#`.
pub(crate) fn hex_digits_after_hash(text: &str) -> Option<&str> {
    text.strip_prefix('#').filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()))
}

fn named_color(name: &str) -> Option<[u8; 3]> {
    let found = NAMED_COLORS.entries().find(|(known, _)| known.as_str().eq_ignore_ascii_case(name));
    found.map(|(_, bytes)| *bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn color_names_are_case_insensitive() {
        assert_eq!(parse_hex_or_named_srgb8("rebeccapurple"), Some([0x66, 0x33, 0x99]));
        assert_eq!(parse_hex_or_named_srgb8("DarkSlateGrey"), parse_hex_or_named_srgb8("darkslategray"));
        assert_eq!(color_names().count(), 148);
        for wrong in ["", "transparent", "fff", "bad", "rgb(0,0,0)", "red "] {
            assert_eq!(parse_hex_or_named_srgb8(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn hex_colors_need_six_digits() {
        assert_eq!(parse_hex_or_named_srgb8("#ff8000"), Some([255, 128, 0]));
        assert_eq!(parse_hex_or_named_srgb8("#FF80aa"), Some([255, 128, 170]));
        for wrong in ["", "#", "ff8000", "#ff800", "#ff80000", "#gg8000", "#+f8000", "#ä1234"] {
            assert_eq!(parse_hex_or_named_srgb8(wrong), None, "{wrong}");
        }
    }
}
