//! Text in cells: styles that also work without color, and quantity formatting.

use std::time::Duration;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use unicode_width::{UnicodeWidthChar, UnicodeWidthStr};

use crate::color::ColorDepth;
pub(super) use crate::pipeline::words::format_seconds;

/// Role of a piece of text. Each role's color is one of the 16 ANSI colors, so it matches the terminal's
/// theme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TextRole {
    Plain,
    /// Text that is less important.
    Faint,
    /// Text that is new or important.
    Strong,
    Working,
    Good,
    Warning,
    Error,
    /// Name of a written file, shown as a hyperlink if the terminal supports them.
    File,
    /// The selected line in a list.
    Chosen,
}

impl TextRole {
    /// Returns the style for text with this role. Without color support, only modifiers are used.
    pub(super) fn style(self, depth: ColorDepth) -> Style {
        let (color, modifier) = match self {
            Self::Plain | Self::File => (Color::Reset, Modifier::empty()),
            Self::Faint => (Color::Reset, Modifier::DIM),
            Self::Strong => (Color::Reset, Modifier::BOLD),
            // Plain blue is hard to read on black in many palettes.
            Self::Working => (Color::LightBlue, Modifier::empty()),
            Self::Good => (Color::Green, Modifier::empty()),
            Self::Warning => (Color::Yellow, Modifier::empty()),
            Self::Error => (Color::Red, Modifier::BOLD),
            Self::Chosen => (Color::Reset, Modifier::BOLD.union(Modifier::REVERSED)),
        };
        let color = if depth == ColorDepth::None { Color::Reset } else { color };
        Style::new().fg(color).bg(Color::Reset).add_modifier(modifier)
    }

    /// Returns a style for a solid block of color with black or white text that is readable in any theme.
    /// Without color support, the text is reversed.
    pub(super) fn block_style(self, depth: ColorDepth) -> Style {
        let (fg, bg) = match self {
            _ if depth == ColorDepth::None => (Color::Reset, Color::Reset),
            Self::Working => (Color::White, Color::Blue),
            Self::Good => (Color::Black, Color::Green),
            Self::Warning => (Color::Black, Color::Yellow),
            Self::Error => (Color::White, Color::Red),
            Self::Plain | Self::Faint | Self::Strong | Self::File | Self::Chosen => {
                (Color::Reset, Color::Reset)
            }
        };
        // xterm and some other terminals draw bold black as gray, using the bright half of the palette.
        let reversed = Modifier::REVERSED.union(Modifier::BOLD);
        let modifier = if bg == Color::Reset { reversed } else { Modifier::empty() };
        Style::new().fg(fg).bg(bg).add_modifier(modifier)
    }
}

/// Writes text into the first row of an area, truncated with an ellipsis if necessary. Returns the number of
/// columns used.
pub(super) fn put_text(
    buffer: &mut Buffer,
    area: Rect,
    pieces: &[(&str, TextRole)],
    depth: ColorDepth,
) -> u16 {
    let area = area.intersection(buffer.area);
    if area.is_empty() {
        return 0;
    }
    let length: usize = pieces.iter().map(|(text, _)| text.width()).sum();
    let is_cut = length > usize::from(area.width);
    let end = area.right() - u16::from(is_cut);
    let mut x = area.x;
    for (text, tone) in pieces {
        let style = tone.style(depth);
        x = buffer.set_stringn(x, area.y, text, usize::from(end - x), style).0;
        if is_cut && x + 1 >= end && text_columns(text) > 0 {
            // A wide character may leave one column unused.
            buffer.set_stringn(x, area.y, "…", 1, style);
        }
    }
    if is_cut { area.width } else { x - area.x }
}

/// Writes text at the right edge of the first row, if it fits. Returns the number of columns used.
pub(super) fn put_text_right(
    buffer: &mut Buffer,
    area: Rect,
    text: &str,
    tone: TextRole,
    depth: ColorDepth,
) -> u16 {
    let width = text_columns(text);
    if width > area.width {
        return 0;
    }
    put_text(buffer, Rect { x: area.right() - width, width, ..area }, &[(text, tone)], depth)
}

/// Width of a string in columns.
pub(crate) fn text_columns(text: &str) -> u16 {
    u16::try_from(text.width()).unwrap_or(u16::MAX)
}

/// Returns a row of an area, counting from the top, or an empty area if `index` is out of range.
pub(super) fn nth_row(area: Rect, index: u16) -> Rect {
    if index < area.height { Rect { y: area.y + index, height: 1, ..area } } else { Rect::ZERO }
}

/// The part of a row to the right of the used columns.
pub(super) fn remaining_row_area(area: Rect, used: u16) -> Rect {
    let used = used.min(area.width);
    Rect { x: area.x + used, width: area.width - used, ..area }
}

/// Truncates text to fit, adding an ellipsis.
pub(crate) fn truncated_text(text: &str, room: u16) -> String {
    if text_columns(text) <= room {
        return text.to_owned();
    }
    let mut short = String::new();
    let mut width = 1;
    for character in text.chars() {
        width += character.width().unwrap_or(0);
        if width > usize::from(room) {
            break;
        }
        short.push(character);
    }
    if room == 0 { short } else { format!("{}…", short.trim_end()) }
}

/// Wraps text into lines, breaking between words if possible.
pub fn wrap_text(text: &str, width: usize) -> Vec<String> {
    let width = width.max(1);
    let (mut lines, mut line, mut length) = (Vec::new(), String::new(), 0);
    for word in text.split_inclusive(' ') {
        let of_word = word.trim_end().width();
        if length > 0 && length + of_word > width {
            lines.push(std::mem::take(&mut line));
            length = 0;
        }
        for character in word.chars() {
            let wide = character.width().unwrap_or(0);
            if length + wide > width && character != ' ' {
                lines.push(std::mem::take(&mut line));
                length = 0;
            }
            line.push(character);
            length += wide;
        }
    }
    lines.push(line);
    lines.into_iter().map(|line| line.trim_end().to_owned()).collect()
}

/// Formats a duration in a few characters.
pub(crate) fn format_duration(time: Duration) -> String {
    format_seconds(time.as_secs_f64())
}

/// Formats a running time. Always shows tenths of a second up to a minute, so that the format does not keep
/// changing.
pub(super) fn format_running_time_with_tenths(time: Duration) -> String {
    if time.as_secs() < 60 { format!("{:.1} s", time.as_secs_f64()) } else { format_duration(time) }
}

/// Formats a file size.
pub(super) fn format_bytes(bytes: u64) -> String {
    match bytes {
        0..1000 => format!("{bytes} B"),
        1000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

/// Formats an estimated time with one or two digits: `about 9 s`.
pub(super) fn format_approximate_time(seconds: f64) -> String {
    match seconds {
        x if x < 1.0 => "under 1 s".to_owned(),
        x if x < 99.5 => format!("about {x:.0} s"),
        x if x < 99.5 * 60.0 => format!("about {:.0} min", x / 60.0),
        x if x <= 24.0 * 3600.0 => format!("about {:.0} h", x / 3600.0),
        _ => "over a day".to_owned(),
    }
}

/// Formats the difference between a stage's time and its previous time. Uses the same unit as the time unless
/// the difference is far larger. Returns an empty string if the difference is insignificant.
pub(super) fn format_time_difference(seconds: f64, before: Option<f64>) -> String {
    /// Relative variation in time between runs of identical work.
    const NOISE: f64 = 0.05;
    let Some(before) = before else { return String::new() };
    let change = seconds - before;
    let (in_units, unit) = if seconds < 0.999_5 { (change * 1e3, "ms") } else { (change, "s") };
    let amount = match in_units.abs() {
        x if x >= 9.95 => format!("{x:.0}"),
        x => format!("{x:.1}"),
    };
    let amount = amount.strip_prefix('0').unwrap_or(&amount);
    if change.abs() <= NOISE * before || amount == ".0" || !change.is_finite() {
        return String::new();
    }
    let sign = if change < 0.0 { "−" } else { "+" };
    let is_far_more = seconds < 0.999_5 && change.abs() >= 0.999_5;
    if is_far_more {
        format!("{sign}{}", self::format_seconds(change.abs()))
    } else {
        format!("{sign}{amount} {unit}")
    }
}

/// Returns the filled and empty parts of a thin progress bar that is `columns` wide.
pub(super) fn progress_bar_parts(fraction: f64, columns: u16, ascii: bool) -> (String, String) {
    let (full, empty) = if ascii { ("#", "-") } else { ("━", "─") };
    let columns = usize::from(columns);
    let filled_squares = ((fraction.clamp(0.0, 1.0) * columns as f64).floor() as usize).min(columns);
    (full.repeat(filled_squares), empty.repeat(columns - filled_squares))
}

/// Percentage, rounded down so that 100 appears only at the end.
pub(crate) fn floor_percent(fraction: f64) -> u32 {
    (fraction.clamp(0.0, 1.0) * 100.0).floor() as u32
}

/// Formats a fraction as a percentage with one or two digits: `2.1 %`, `1 %`.
pub(super) fn format_two_digit_percent(part: f64) -> String {
    let percent = part * 100.0;
    let digits = if percent > 0.0 { (1 - percent.log10().floor() as i32).clamp(0, 6) } else { 0 };
    let text = format!("{percent:.0$}", digits as usize);
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} %")
}

/// Formats a number with about three significant digits.
pub(super) fn format_number_to_three_digits(x: f32) -> String {
    let digits = match x.abs() {
        x if x >= 100.0 => 0,
        x if x >= 10.0 => 1,
        x if x >= 1.0 => 2,
        x if x >= 1e-3 || x == 0.0 => 4,
        _ => return format!("{x:.1e}"),
    };
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Formats a count with its noun, such as `1 error` or `2 errors`.
pub(crate) fn format_count_with_noun(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// xterm draws bold black as gray.
    #[test]
    fn text_on_color_blocks_is_not_bold() {
        for tone in [TextRole::Working, TextRole::Good, TextRole::Warning, TextRole::Error] {
            let style = tone.block_style(ColorDepth::TrueColor);
            assert!(!style.add_modifier.contains(Modifier::BOLD), "{tone:?}");
            assert!(tone.block_style(ColorDepth::None).add_modifier.contains(Modifier::REVERSED), "{tone:?}");
        }
    }

    #[test]
    fn percentages_have_two_digits() {
        let shares = [0.021, 0.01, 0.000_43, 0.5, 1.7, 0.0, 0.0996].map(format_two_digit_percent);
        assert_eq!(shares, ["2.1 %", "1 %", "0.043 %", "50 %", "170 %", "0 %", "10 %"]);
    }

    #[test]
    fn bar_is_full_only_at_the_end() {
        let bar = |fraction, ascii| {
            let (filled_squares, rest) = progress_bar_parts(fraction, 4, ascii);
            filled_squares + &rest
        };
        assert_eq!(bar(0.999, false), "━━━─");
        assert_eq!(bar(1.0, false), "━━━━");
        assert_eq!(bar(f64::NAN, true), "----");
        assert_eq!((floor_percent(0.999), floor_percent(1.0)), (99, 100));
    }

    #[test]
    fn time_differences_use_the_unit_of_the_time() {
        for (seconds, before, words) in [
            (1.12, Some(1.42), "−.3 s"),
            (1.12, Some(1.10), ""),
            (0.023, Some(0.019), "+4.0 ms"),
            (0.5, Some(1.5), "−1.00 s"),
            (0.985, Some(4.635), "−3.65 s"),
            (0.02, Some(200.0), "−3 min 20 s"),
            (0.9, Some(0.1), "+800 ms"),
            (12.0, Some(1.0), "+11 s"),
            (2.0, Some(1.96), ""),
            (0.000_02, Some(0.000_01), ""),
            (1.0, None, ""),
        ] {
            assert_eq!(format_time_difference(seconds, before), words, "{seconds} {before:?}");
        }
    }

    #[test]
    fn estimated_times_have_two_digits() {
        let times = [0.3, 1.0, 9.46, 14.2, 99.4, 100.0, 754.0, 5970.0, 90_000.0].map(format_approximate_time);
        let words = [
            "under 1 s",
            "about 1 s",
            "about 9 s",
            "about 14 s",
            "about 99 s",
            "about 2 min",
            "about 13 min",
            "about 2 h",
            "over a day",
        ];
        assert_eq!(times, words);
    }

    #[test]
    fn truncated_text_ends_with_an_ellipsis() {
        for (text, room, shown) in [
            ("abcdef", 6, "abcdef"),
            ("abcdef", 5, "abcd…"),
            ("日本語", 5, "日本…"),
            ("日本語", 4, "日…"),
            ("ab", 1, "…"),
        ] {
            assert_eq!(truncated_text(text, room), shown);
            for split in text.char_indices().map(|(at, _)| at) {
                let area = Rect::new(0, 0, room, 1);
                let mut buffer = Buffer::empty(area);
                let (first, second) = text.split_at(split);
                put_text(
                    &mut buffer,
                    area,
                    &[(first, TextRole::Plain), (second, TextRole::Faint)],
                    ColorDepth::None,
                );
                let seen: String = buffer.content.iter().map(|cell| cell.symbol()).collect();
                // The cell after a wide character is blank in the buffer.
                assert_eq!(seen.replace(' ', ""), shown, "{text} {room} {split}");
            }
        }
    }
}
