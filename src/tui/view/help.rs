//! The overlay of keys, made from the table of keys.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::widgets::{Block, Clear, Widget};

use super::text::{Tone, columns, put, row};
use crate::tui::keymap::KEYMAP;
use crate::tui::state::State;

const TITLE: &str = " keys ";
/// What else is on the screen.
const NOTES: &[(&str, &str)] =
    &[("31 kB 150 ms", "bytes of the last picture, and the terminal's time to answer")];

/// In the middle of the screen.
pub(super) fn draw(state: &State, buffer: &mut Buffer) {
    let keys = || KEYMAP.iter().filter(|it| !it.help.is_empty());
    let entries = || keys().map(|it| (it.label, it.help)).chain(NOTES.iter().copied());
    let labels = entries().map(|(label, _)| columns(label)).max().unwrap_or(0);
    let helps = entries().map(|(_, help)| columns(help)).max().unwrap_or(0);
    let lines = u16::try_from(entries().count()).unwrap_or(u16::MAX);
    let area = centred(buffer.area, labels + helps + 6, lines.saturating_add(2));
    Clear.render(area, buffer);
    let block = Block::bordered().title(TITLE).border_style(Tone::Plain.style(state.depth));
    let inner = if area.height > 3 && area.width > 3 { block.inner(area) } else { area };
    if inner != area {
        block.render(area, buffer);
    }
    let hidden = lines.saturating_sub(inner.height);
    for (index, (label, help)) in (0..inner.height).zip(entries()) {
        let line = row(inner, index);
        if hidden > 0 && index + 1 == inner.height {
            put(
                buffer,
                line,
                &[(&format!(" … {} more: enlarge the window", hidden + 1), Tone::Faint)],
                state.depth,
            );
            break;
        }
        let label = format!(" {label:<width$}  ", width = usize::from(labels));
        put(buffer, line, &[(&label, Tone::Strong), (help, Tone::Plain)], state.depth);
    }
}

fn centred(area: Rect, width: u16, height: u16) -> Rect {
    let (width, height) = (width.min(area.width), height.min(area.height));
    Rect { x: area.x + (area.width - width) / 2, y: area.y + (area.height - height) / 2, width, height }
}
