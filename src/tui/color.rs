//! How many colours the terminal has, and the nearest of them.

use std::sync::LazyLock;

use ratatui::style::Color;

use crate::choice;
use crate::math::Vec3;
use crate::math::color::srgb8_to_linear;

choice! {
    /// Which colours are used.
    pub enum ColorChoice {
        /// What the terminal can show.
        Auto = "auto",
        /// 24 bits.
        TrueColor = "truecolor",
        /// The palette of 256: the 6×6×6 cube and the greys of xterm.
        Indexed256 = "256",
        /// The palette of 16 of xterm.
        Ansi16 = "16",
        /// None.
        None = "none",
    }
}

/// What the terminal gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorDepth {
    /// 24 bits.
    TrueColor,
    /// The 6×6×6 cube and the greys of xterm.
    Indexed256,
    /// The 16 colours of xterm.
    Ansi16,
    /// None at all.
    None,
}

/// The depth for a choice, in an environment.
pub(super) fn depth(choice: ColorChoice, variable: impl Fn(&str) -> Option<String>) -> ColorDepth {
    match choice {
        ColorChoice::TrueColor => ColorDepth::TrueColor,
        ColorChoice::Indexed256 => ColorDepth::Indexed256,
        ColorChoice::Ansi16 => ColorDepth::Ansi16,
        ColorChoice::None => ColorDepth::None,
        ColorChoice::Auto => detected(variable),
    }
}

/// `NO_COLOR` first (no-color.org), then `COLORTERM`, then the names in `TERM` and `TERM_PROGRAM`: SSH often
/// forwards `TERM` only.
fn detected(variable: impl Fn(&str) -> Option<String>) -> ColorDepth {
    let get = |name: &str| variable(name).unwrap_or_default();
    let term = get("TERM");
    if !get("NO_COLOR").is_empty() || has_no_colors(&term) {
        return ColorDepth::None;
    }
    // GNU screen passes COLORTERM of the terminal around it on and does not know 24 bits itself.
    let in_screen = term.starts_with("screen") && get("TMUX").is_empty();
    let says_true = matches!(get("COLORTERM").as_str(), "truecolor" | "24bit");
    if in_screen {
        ColorDepth::Indexed256
    } else if says_true || is_true_color(&term, &get("TERM_PROGRAM")) {
        ColorDepth::TrueColor
    } else if ["256color", "tmux", "screen", "xterm", "rxvt"].iter().any(|name| term.contains(name)) {
        ColorDepth::Indexed256
    } else {
        ColorDepth::Ansi16
    }
}

fn has_no_colors(term: &str) -> bool {
    term == "dumb" || term.starts_with("vt1") || term.starts_with("vt2") || term.ends_with("-mono")
}

fn is_true_color(term: &str, program: &str) -> bool {
    const TERMS: [&str; 8] = ["kitty", "alacritty", "foot", "wezterm", "ghostty", "contour", "iterm2", "rio"];
    const PROGRAMS: [&str; 4] = ["iTerm.app", "WezTerm", "ghostty", "vscode"];
    // Inside tmux TERM_PROGRAM is `tmux`, so that what the outer terminal can do does not leak in.
    term.ends_with("-direct") || TERMS.iter().any(|name| term.contains(name)) || PROGRAMS.contains(&program)
}

/// The levels of a channel in the 6×6×6 cube.
pub(super) const CUBE_LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];

/// The 16 colours as xterm draws them by default; people change them.
const ANSI: [([u8; 3], Color); 16] = [
    ([0, 0, 0], Color::Black),
    ([205, 0, 0], Color::Red),
    ([0, 205, 0], Color::Green),
    ([205, 205, 0], Color::Yellow),
    ([0, 0, 238], Color::Blue),
    ([205, 0, 205], Color::Magenta),
    ([0, 205, 205], Color::Cyan),
    ([229, 229, 229], Color::Gray),
    ([127, 127, 127], Color::DarkGray),
    ([255, 0, 0], Color::LightRed),
    ([0, 255, 0], Color::LightGreen),
    ([255, 255, 0], Color::LightYellow),
    ([92, 92, 255], Color::LightBlue),
    ([255, 0, 255], Color::LightMagenta),
    ([0, 255, 255], Color::LightCyan),
    ([255, 255, 255], Color::White),
];

/// The terminal's colour for a pixel at column `x`, row `y` of the preview. The 16 colours are dithered by an
/// ordered 4×4 pattern, which leaves exact ones as they are.
pub(super) fn pixel(rgb: [u8; 3], depth: ColorDepth, x: usize, y: usize) -> Color {
    match depth {
        ColorDepth::TrueColor => Color::Rgb(rgb[0], rgb[1], rgb[2]),
        ColorDepth::Indexed256 => Color::Indexed(nearest_256(rgb)),
        ColorDepth::Ansi16 => dithered_16(rgb, x, y),
        ColorDepth::None => Color::Reset,
    }
}

/// The nearer of the nearest colour of the cube (16 to 231) and the nearest grey (232 to 255).
pub(super) fn nearest_256(rgb: [u8; 3]) -> u8 {
    let steps = rgb.map(nearest_level);
    let cube = steps.map(|step| CUBE_LEVELS[step]);
    let mean = rgb.iter().map(|&channel| u32::from(channel)).sum::<u32>() / 3;
    let grey_step = (mean.saturating_sub(8) + 5).min(235) / 10;
    let grey_step = u8::try_from(grey_step.min(23)).unwrap_or(23);
    let grey = [8 + 10 * grey_step; 3];
    if difference(rgb, grey) < difference(rgb, cube) {
        232 + grey_step
    } else {
        let index = 36 * steps[0] + 6 * steps[1] + steps[2];
        16 + u8::try_from(index).unwrap_or(215)
    }
}

fn nearest_level(channel: u8) -> usize {
    match channel {
        0..48 => 0,
        48..115 => 1,
        _ => (usize::from(channel) - 35) / 40,
    }
}

/// A weighted distance in sRGB that follows the eye well at the cost of a few products ("redmean",
/// compuphase.com/cmetric.htm), squared.
fn difference(a: [u8; 3], b: [u8; 3]) -> i32 {
    let [dr, dg, db] = std::array::from_fn(|i| i32::from(a[i]) - i32::from(b[i]));
    let mean_red = (i32::from(a[0]) + i32::from(b[0])) / 2;
    (((512 + mean_red) * dr * dr) >> 8) + 4 * dg * dg + (((767 - mean_red) * db * db) >> 8)
}

/// Ordered dither: of the two candidates around the colour (the nearest, and the nearest to its reflection in
/// that one), the second is taken for as many places of the pattern as the colour lies towards it.
fn dithered_16(rgb: [u8; 3], x: usize, y: usize) -> Color {
    const BAYER: [[f32; 4]; 4] =
        [[0.0, 8.0, 2.0, 10.0], [12.0, 4.0, 14.0, 6.0], [3.0, 11.0, 1.0, 9.0], [15.0, 7.0, 13.0, 5.0]];
    let threshold = (BAYER[y % 4][x % 4] + 0.5) / 16.0;
    let color = oklab(rgb);
    let first = nearest_16(color);
    let beyond = color + (color - ANSI_OKLAB[first]);
    let second = nearest_16(beyond);
    let span = ANSI_OKLAB[second] - ANSI_OKLAB[first];
    let length = span.length_squared();
    let share = if length > 0.0 { (color - ANSI_OKLAB[first]).dot(span) / length } else { 0.0 };
    ANSI[if share > threshold { second } else { first }].1
}

fn nearest_16(color: Vec3) -> usize {
    let distance = |index: &usize| ANSI_OKLAB[*index].distance_squared(color);
    (0..ANSI.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
}

static ANSI_OKLAB: LazyLock<[Vec3; 16]> = LazyLock::new(|| ANSI.map(|(rgb, _)| oklab(rgb)));

/// Oklab of an sRGB colour (Björn Ottosson, "A perceptual color space for image processing", 2020).
fn oklab(rgb: [u8; 3]) -> Vec3 {
    let linear = srgb8_to_linear(rgb);
    let cone = |r, g, b| Vec3::new(r, g, b).dot(linear).cbrt();
    let lms = Vec3::new(
        cone(0.412_221_46, 0.536_332_55, 0.051_445_995),
        cone(0.211_903_5, 0.680_699_5, 0.107_396_96),
        cone(0.088_302_46, 0.281_718_85, 0.629_978_7),
    );
    Vec3::new(
        Vec3::new(0.210_454_26, 0.793_617_8, -0.004_072_047).dot(lms),
        Vec3::new(1.977_998_5, -2.428_592_2, 0.450_593_7).dot(lms),
        Vec3::new(0.025_904_037, 0.782_771_77, -0.808_675_77).dot(lms),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn auto(pairs: &[(&str, &str)]) -> ColorDepth {
        depth(ColorChoice::Auto, |name| {
            pairs.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn the_environment_decides() {
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
    fn no_color_counts_unless_empty_and_the_option_beats_it() {
        assert_eq!(auto(&[("NO_COLOR", "1"), ("COLORTERM", "truecolor")]), ColorDepth::None);
        assert_eq!(auto(&[("NO_COLOR", ""), ("COLORTERM", "truecolor")]), ColorDepth::TrueColor);
        assert_eq!(depth(ColorChoice::Ansi16, |_| Some("1".to_owned())), ColorDepth::Ansi16);
    }

    #[test]
    fn known_indices_of_256() {
        for (rgb, index) in [
            ([0, 0, 0], 16),
            ([255, 255, 255], 231),
            ([255, 0, 0], 196),
            ([0, 255, 0], 46),
            ([0, 0, 255], 21),
            ([95, 135, 175], 67),
            ([8, 8, 8], 232),
            ([238, 238, 238], 255),
            ([118, 118, 118], 243),
        ] {
            assert_eq!(pixel(rgb, ColorDepth::Indexed256, 0, 0), Color::Indexed(index), "{rgb:?}");
        }
    }

    #[test]
    fn no_other_index_of_256_is_much_nearer() {
        let palette: Vec<[u8; 3]> = (0..216_usize)
            .map(|i| [CUBE_LEVELS[i / 36], CUBE_LEVELS[i / 6 % 6], CUBE_LEVELS[i % 6]])
            .chain((0..24_u8).map(|i| [8 + 10 * i; 3]))
            .collect();
        for i in 0..4096_u32 {
            let rgb = [0, 8, 16].map(|shift| (i.wrapping_mul(2_654_435_761) >> shift) as u8);
            let got = difference(rgb, palette[usize::from(nearest_256(rgb)) - 16]);
            let best = palette.iter().map(|&other| difference(rgb, other)).min().expect("240 colours");
            assert!(f64::from(got).sqrt() <= f64::from(best).sqrt() + 12.0, "{rgb:?}: {got} {best}");
        }
    }

    #[test]
    fn exact_colours_of_16_stay_at_every_place_of_the_pattern() {
        for (rgb, color) in ANSI {
            for place in 0..16 {
                assert_eq!(pixel(rgb, ColorDepth::Ansi16, place % 4, place / 4), color, "{rgb:?}");
            }
        }
    }

    #[test]
    fn a_colour_between_two_of_16_shows_both() {
        let seen: Vec<Color> =
            (0..16).map(|place| pixel([60, 60, 60], ColorDepth::Ansi16, place % 4, place / 4)).collect();
        assert!(seen.contains(&Color::Black) && seen.contains(&Color::DarkGray), "{seen:?}");
        let light = pixel([250, 250, 250], ColorDepth::Ansi16, 0, 3);
        assert!(matches!(light, Color::White | Color::Gray), "{light:?}");
    }

    #[test]
    fn oklab_of_white_is_lightness_one_without_hue() {
        assert!(oklab([255, 255, 255]).distance(Vec3::new(1.0, 0.0, 0.0)) < 1e-3);
    }
}
