//! Text for cells: styles that do without colour, amounts in words.

use std::time::Duration;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier, Style};
use unicode_width::UnicodeWidthStr;

pub(super) use crate::pipeline::words::seconds;
use crate::tui::color::ColorDepth;

/// What a piece of text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tone {
    Plain,
    Faint,
    Strong,
    Good,
    Warning,
    Error,
}

impl Tone {
    /// Its style; without colours, modifiers alone.
    pub(super) fn style(self, depth: ColorDepth) -> Style {
        let (color, modifier) = match self {
            Self::Plain => (Color::Reset, Modifier::empty()),
            Self::Faint => (Color::Reset, Modifier::DIM),
            Self::Strong => (Color::Reset, Modifier::BOLD),
            Self::Good => (Color::Green, Modifier::empty()),
            Self::Warning => (Color::Yellow, Modifier::empty()),
            Self::Error => (Color::Red, Modifier::BOLD),
        };
        let color = if depth == ColorDepth::None { Color::Reset } else { color };
        Style::new().fg(color).bg(Color::Reset).add_modifier(modifier)
    }
}

/// Writes pieces from the left into the first row of the area; what does not fit is cut. Returns the columns
/// used.
pub(super) fn put(buffer: &mut Buffer, area: Rect, pieces: &[(&str, Tone)], depth: ColorDepth) -> u16 {
    let area = area.intersection(buffer.area);
    if area.is_empty() {
        return 0;
    }
    let mut x = area.x;
    for (text, tone) in pieces {
        let room = usize::from(area.right() - x);
        x = buffer.set_stringn(x, area.y, text, room, tone.style(depth)).0;
    }
    x - area.x
}

/// Writes a text so that it ends at the right edge of the first row, if it fits.
pub(super) fn put_right(buffer: &mut Buffer, area: Rect, text: &str, tone: Tone, depth: ColorDepth) -> u16 {
    let width = columns(text);
    if width > area.width {
        return 0;
    }
    put(buffer, Rect { x: area.right() - width, width, ..area }, &[(text, tone)], depth)
}

/// Columns that a text takes.
pub(super) fn columns(text: &str) -> u16 {
    u16::try_from(text.width()).unwrap_or(u16::MAX)
}

/// A row of the area, counted from its top; empty below its end.
pub(super) fn row(area: Rect, index: u16) -> Rect {
    if index < area.height { Rect { y: area.y + index, height: 1, ..area } } else { Rect::ZERO }
}

/// A duration in a few characters.
pub(super) fn duration(time: Duration) -> String {
    seconds(time.as_secs_f64())
}

/// A size of a file.
pub(super) fn bytes(bytes: u64) -> String {
    match bytes {
        0..1000 => format!("{bytes} B"),
        1000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}

/// A bar of this many columns, filled as far as `fraction` says.
pub(super) fn gauge(fraction: f64, columns: usize, ascii: bool) -> String {
    let (full, empty) = if ascii { ("#", "-") } else { ("█", "░") };
    let filled = ((fraction.clamp(0.0, 1.0) * columns as f64).floor() as usize).min(columns);
    full.repeat(filled) + &empty.repeat(columns - filled)
}

/// Whole percent; 100 only when everything is done.
pub(super) fn percent(fraction: f64) -> u32 {
    (fraction.clamp(0.0, 1.0) * 100.0).floor() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_is_full_only_at_the_end() {
        assert_eq!(gauge(0.999, 4, false), "███░");
        assert_eq!(gauge(1.0, 4, false), "████");
        assert_eq!(gauge(f64::NAN, 2, true), "--");
        assert_eq!((percent(0.999), percent(1.0)), (99, 100));
    }
}
