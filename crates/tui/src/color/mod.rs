//! Terminal colors and their use in approximating sRGB colors.

mod bayer;
mod color_mapper;
mod oklab;
mod palette;
mod palette_dither;
mod recipes;

use ratatui::style::Color;

pub(super) use self::bayer::dither_to_6_bits_per_channel;
pub(super) use self::color_mapper::ColorMapper;
pub(super) use self::oklab::linear_to_oklab;
pub use self::palette::xterm_rgb;
pub(super) use self::palette::{
    AnsiColors, XTERM, assumed_ansi_colors, fixed_palette_color, nearest_256_color_index,
};
pub(super) use self::palette_dither::PaletteDither;
use super::terminals::TerminalBrand;
use crate::choice;

choice! {
    /// Which colors to use.
    pub enum ColorDepthChoice {
        /// As many colors as the terminal supports.
        Auto = "auto",
        /// 24-bit color.
        TrueColor = "truecolor",
        /// The 256-color palette: xterm's 6×6×6 cube and grays.
        Indexed256 = "256",
        /// xterm's 16-color palette.
        Ansi16 = "16",
        /// No colors.
        None = "none",
    }
}

/// Color depth of the output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorDepth {
    /// 24-bit color.
    TrueColor,
    /// xterm's 6×6×6 cube and grays.
    Indexed256,
    /// xterm's 16 colors.
    Ansi16,
    /// No colors.
    None,
}

/// Resolves the user's choice, consulting environment variables for `Auto`.
pub(super) fn resolve_color_depth(
    choice: ColorDepthChoice,
    variable: impl Fn(&str) -> Option<String>,
) -> ColorDepth {
    match choice {
        ColorDepthChoice::TrueColor => ColorDepth::TrueColor,
        ColorDepthChoice::Indexed256 => ColorDepth::Indexed256,
        ColorDepthChoice::Ansi16 => ColorDepth::Ansi16,
        ColorDepthChoice::None => ColorDepth::None,
        ColorDepthChoice::Auto => detect_color_depth(variable),
    }
}

/// Detects the color depth from `NO_COLOR` (no-color.org), `COLORTERM`, `TERM` and `TERM_PROGRAM`, in this
/// order. SSH often forwards only `TERM`.
fn detect_color_depth(variable: impl Fn(&str) -> Option<String>) -> ColorDepth {
    let get = |name: &str| variable(name).unwrap_or_default();
    let term = get("TERM");
    if !get("NO_COLOR").is_empty() || is_terminal_without_colors(&term) {
        return ColorDepth::None;
    }
    // GNU screen passes on the outer terminal's COLORTERM but does not support 24-bit color itself.
    let in_screen = term.starts_with("screen") && get("TMUX").is_empty();
    let says_true = matches!(get("COLORTERM").as_str(), "truecolor" | "24bit");
    if in_screen {
        ColorDepth::Indexed256
    } else if says_true || is_known_true_color_terminal(&term, &get("TERM_PROGRAM")) {
        ColorDepth::TrueColor
    } else if ["256color", "tmux", "screen", "xterm", "rxvt"].iter().any(|name| term.contains(name)) {
        ColorDepth::Indexed256
    } else {
        ColorDepth::Ansi16
    }
}

fn is_terminal_without_colors(term: &str) -> bool {
    term == "dumb" || term.starts_with("vt1") || term.starts_with("vt2") || term.ends_with("-mono")
}

fn is_known_true_color_terminal(term: &str, program: &str) -> bool {
    const TERMS: [&str; 8] = ["kitty", "alacritty", "foot", "wezterm", "ghostty", "contour", "iterm2", "rio"];
    // Inside tmux, TERM_PROGRAM is `tmux`, so the outer terminal's name does not affect the result.
    term.ends_with("-direct")
        || TERMS.iter().any(|name| term.contains(name))
        || TerminalBrand::from_program(program).is_some_and(TerminalBrand::supports_true_color_and_rep)
}

/// Whether `COLORFGBG` (set by rxvt and some other terminals) indicates a light background.
pub(super) fn colorfgbg_indicates_light_background(variable: impl Fn(&str) -> Option<String>) -> bool {
    let last = variable("COLORFGBG").and_then(|colors| colors.rsplit(';').next()?.parse::<u8>().ok());
    last.is_some_and(|index| index == 7 || (9..16).contains(&index))
}

/// The 16 ANSI colors in palette order.
const ANSI_COLORS: [Color; 16] = [
    Color::Black,
    Color::Red,
    Color::Green,
    Color::Yellow,
    Color::Blue,
    Color::Magenta,
    Color::Cyan,
    Color::Gray,
    Color::DarkGray,
    Color::LightRed,
    Color::LightGreen,
    Color::LightYellow,
    Color::LightBlue,
    Color::LightMagenta,
    Color::LightCyan,
    Color::White,
];

#[cfg(test)]
mod tests {
    use super::*;

    fn auto(pairs: &[(&str, &str)]) -> ColorDepth {
        resolve_color_depth(ColorDepthChoice::Auto, |name| {
            pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn color_depth_follows_the_environment() {
        assert_eq!(auto(&[("TERM", "xterm-256color")]), ColorDepth::Indexed256);
        assert_eq!(auto(&[("TERM", "xterm-256color"), ("COLORTERM", "truecolor")]), ColorDepth::TrueColor);
        assert_eq!(auto(&[("TERM", "xterm-kitty")]), ColorDepth::TrueColor);
        assert_eq!(auto(&[("TERM", "xterm-direct")]), ColorDepth::TrueColor);
        assert_eq!(auto(&[("TERM", "dumb"), ("COLORTERM", "truecolor")]), ColorDepth::None);
        assert_eq!(auto(&[("TERM", "linux")]), ColorDepth::Ansi16);
        assert_eq!(auto(&[]), ColorDepth::Ansi16);
        assert_eq!(auto(&[("TERM", "screen-256color"), ("COLORTERM", "truecolor")]), ColorDepth::Indexed256);
        let tmux = [("TERM", "screen-256color"), ("COLORTERM", "truecolor"), ("TMUX", "/tmp/tmux")];
        assert_eq!(auto(&tmux), ColorDepth::TrueColor);
        assert_eq!(auto(&[("TERM", "tmux-256color")]), ColorDepth::Indexed256);
    }

    #[test]
    fn background_is_dark_by_default() {
        let light =
            |colors: Option<&str>| colorfgbg_indicates_light_background(|_| colors.map(str::to_owned));
        assert!(light(Some("0;15")) && light(Some("0;default;7")));
        assert!(!light(Some("15;0")) && !light(Some("15;8")) && !light(Some("15;default")) && !light(None));
    }

    #[test]
    fn no_color_is_honored_unless_overridden() {
        assert_eq!(auto(&[("NO_COLOR", "1"), ("COLORTERM", "truecolor")]), ColorDepth::None);
        assert_eq!(auto(&[("NO_COLOR", ""), ("COLORTERM", "truecolor")]), ColorDepth::TrueColor);
        assert_eq!(
            resolve_color_depth(ColorDepthChoice::Ansi16, |_| Some("1".to_owned())),
            ColorDepth::Ansi16
        );
    }
}
