//! Colours by name.

use csscolorparser::NAMED_COLORS;

/// The names of colours, in small letters (CSS Color Module Level 4, 6.1).
pub fn color_names() -> impl Iterator<Item = &'static str> {
    NAMED_COLORS.keys().map(|name| name.as_str())
}

/// The sRGB bytes of a colour by its name, in any case.
pub fn color_bytes(name: &str) -> Option<[u8; 3]> {
    let found = NAMED_COLORS.entries().find(|(known, _)| known.as_str().eq_ignore_ascii_case(name));
    found.map(|(_, bytes)| *bytes)
}
