//! Conversion of cells to lines of text, for output without cursor movement.

use ratatui::buffer::{Buffer, Cell};
use ratatui::style::Color;

use super::pen::Pen;
use super::terminal_color::{ColorLayer, TerminalColor};

/// Converts a buffer's rows to lines without trailing blanks. Each line starts and ends with the terminal's
/// default colors. If `is_colored` is false, the output contains no escape sequences.
pub fn buffer_to_ansi_text(buffer: &Buffer, is_colored: bool) -> String {
    let mut bytes = Vec::new();
    for row in buffer.content.chunks(usize::from(buffer.area.width.max(1))) {
        let length = row.iter().rposition(is_visible_cell).map_or(0, |last| last + 1);
        let mut pen = Pen::RESET;
        for cell in &row[..length] {
            if is_colored {
                pen.switch_to(&pen_of_cell(cell).exact_requirements(), &mut bytes);
            }
            bytes.extend_from_slice(cell.symbol().as_bytes());
        }
        pen.switch_to(&Pen::RESET.exact_requirements(), &mut bytes);
        bytes.push(b'\n');
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn is_visible_cell(cell: &Cell) -> bool {
    cell.symbol() != " " || cell.bg != Color::Reset
}

fn pen_of_cell(cell: &Cell) -> Pen {
    Pen {
        fg: TerminalColor::from_ratatui(cell.fg, ColorLayer::Foreground),
        bg: TerminalColor::from_ratatui(cell.bg, ColorLayer::Background),
        modifier: cell.modifier,
        link: 0,
    }
}

#[cfg(test)]
mod tests {
    use ratatui::layout::Rect;
    use ratatui::style::Style;

    use super::*;

    #[test]
    fn lines_end_with_default_colors() {
        let mut buffer = Buffer::empty(Rect::new(0, 0, 6, 3));
        buffer.set_string(0, 0, "ab", Style::new().fg(Color::Red));
        buffer.set_string(2, 2, "▀", Style::new().fg(Color::Rgb(1, 2, 3)).bg(Color::Indexed(9)));
        let colored = "\u{1b}[31mab\u{1b}[0m\n\n  \u{1b}[38;2;1;2;3;101m▀\u{1b}[0m\n";
        assert_eq!(buffer_to_ansi_text(&buffer, true), colored);
        assert_eq!(buffer_to_ansi_text(&buffer, false), "ab\n\n  ▀\n");
    }
}
