//! Terminal palettes: the 16 ANSI colors, plus xterm's color cube and grays.

use ratatui::style::Color;

/// Channel levels of the 6×6×6 cube.
pub(crate) const CUBE_LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];

/// First palette index whose color is the same on all terminals (the start of the cube).
pub(crate) const FIRST_FIXED: u8 = 16;
/// First gray in the 256-color palette.
pub(crate) const FIRST_GRAY: u8 = 232;

/// The 16 ANSI colors in sRGB.
pub(crate) type AnsiColors = [[u8; 3]; 16];

/// xterm's default ANSI colors, which users often change.
pub(crate) const XTERM: AnsiColors = [
    [0, 0, 0],
    [205, 0, 0],
    [0, 205, 0],
    [205, 205, 0],
    [0, 0, 238],
    [205, 0, 205],
    [0, 205, 205],
    [229, 229, 229],
    [127, 127, 127],
    [255, 0, 0],
    [0, 255, 0],
    [255, 255, 0],
    [92, 92, 255],
    [255, 0, 255],
    [0, 255, 255],
    [255, 255, 255],
];

/// The ANSI colors of the Linux console (VGA).
const VGA: AnsiColors = [
    [0, 0, 0],
    [170, 0, 0],
    [0, 170, 0],
    [170, 85, 0],
    [0, 0, 170],
    [170, 0, 170],
    [0, 170, 170],
    [170, 170, 170],
    [85, 85, 85],
    [255, 85, 85],
    [85, 255, 85],
    [255, 255, 85],
    [85, 85, 255],
    [255, 85, 255],
    [85, 255, 255],
    [255, 255, 255],
];

/// ANSI colors assumed for a terminal that has not reported its own.
pub(crate) fn assumed_ansi_colors(term: &str) -> &'static AnsiColors {
    if term.starts_with("linux") { &VGA } else { &XTERM }
}

/// The sRGB value of a palette color, or `None` for the first 16, which the user can change.
pub(crate) fn fixed_palette_color(index: u8) -> Option<[u8; 3]> {
    match index {
        0..FIRST_FIXED => None,
        FIRST_FIXED..FIRST_GRAY => {
            let i = usize::from(index - FIRST_FIXED);
            Some([i / 36, i / 6 % 6, i % 6].map(|step| CUBE_LEVELS[step]))
        }
        FIRST_GRAY.. => Some([8 + 10 * (index - FIRST_GRAY); 3]),
    }
}

/// The sRGB value of a terminal color in xterm's default palette, or `None` for the default foreground and
/// background.
pub fn xterm_rgb(color: Color) -> Option<[u8; 3]> {
    let ansi = match color {
        Color::Reset => return None,
        Color::Rgb(r, g, b) => return Some([r, g, b]),
        Color::Indexed(index) => {
            return fixed_palette_color(index).or_else(|| XTERM.get(usize::from(index)).copied());
        }
        Color::Black => 0,
        Color::Red => 1,
        Color::Green => 2,
        Color::Yellow => 3,
        Color::Blue => 4,
        Color::Magenta => 5,
        Color::Cyan => 6,
        Color::Gray => 7,
        Color::DarkGray => 8,
        Color::LightRed => 9,
        Color::LightGreen => 10,
        Color::LightYellow => 11,
        Color::LightBlue => 12,
        Color::LightMagenta => 13,
        Color::LightCyan => 14,
        Color::White => 15,
    };
    Some(XTERM[ansi])
}

/// Index of the nearest palette color in the cube (16 to 231) or the grays (232 to 255).
pub(crate) fn nearest_256_color_index(rgb: [u8; 3]) -> u8 {
    let steps = rgb.map(nearest_cube_level_index);
    let cube = steps.map(|step| CUBE_LEVELS[step]);
    let mean = rgb.iter().map(|&channel| u32::from(channel)).sum::<u32>() / 3;
    let gray_step = (mean.saturating_sub(8) + 5).min(235) / 10;
    let gray_step = u8::try_from(gray_step.min(23)).unwrap_or(23);
    let gray = [8 + 10 * gray_step; 3];
    if redmean_distance_squared(rgb, gray) < redmean_distance_squared(rgb, cube) {
        FIRST_GRAY + gray_step
    } else {
        let index = 36 * steps[0] + 6 * steps[1] + steps[2];
        FIRST_FIXED + u8::try_from(index).unwrap_or(215)
    }
}

fn nearest_cube_level_index(channel: u8) -> usize {
    match channel {
        0..48 => 0,
        48..115 => 1,
        _ => (usize::from(channel) - 35) / 40,
    }
}

/// Squared "redmean" distance in sRGB (compuphase.com/cmetric.htm), a cheap perceptual approximation.
fn redmean_distance_squared(a: [u8; 3], b: [u8; 3]) -> i32 {
    let [dr, dg, db] = std::array::from_fn(|i| i32::from(a[i]) - i32::from(b[i]));
    let mean_red = (i32::from(a[0]) + i32::from(b[0])) / 2;
    (((512 + mean_red) * dr * dr) >> 8) + 4 * dg * dg + (((767 - mean_red) * db * db) >> 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_256_color_indices() {
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
            assert_eq!(nearest_256_color_index(rgb), index, "{rgb:?}");
            assert!(
                fixed_palette_color(index)
                    .is_some_and(|fixed_color| redmean_distance_squared(fixed_color, rgb) <= 36),
                "{rgb:?}"
            );
        }
        assert_eq!(fixed_palette_color(15), None);
        let shown = [Color::Indexed(9), Color::LightRed, Color::Indexed(67), Color::Reset].map(xterm_rgb);
        assert_eq!(shown, [Some([255, 0, 0]), Some([255, 0, 0]), Some([95, 135, 175]), None]);
    }

    #[test]
    fn nearest_palette_color_is_close_to_optimal() {
        let palette: Vec<[u8; 3]> = (FIRST_FIXED..=255).filter_map(fixed_palette_color).collect();
        assert_eq!(palette.len(), 240);
        for i in 0..4096_u32 {
            let rgb = [0, 8, 16].map(|shift| (i.wrapping_mul(2_654_435_761) >> shift) as u8);
            let got = redmean_distance_squared(
                rgb,
                fixed_palette_color(nearest_256_color_index(rgb)).expect("a fixed color"),
            );
            let best =
                palette.iter().map(|&other| redmean_distance_squared(rgb, other)).min().expect("240 colors");
            assert!(f64::from(got).sqrt() <= f64::from(best).sqrt() + 12.0, "{rgb:?}: {got} {best}");
        }
    }
}
