//! Parts of the screen that need separate handling: file names and delayed cells.

use std::path::PathBuf;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{TextRole, put_text, text_columns};
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::State;

/// File names to link, and cells to draw after the preview.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct FileLinksAndDelayedText {
    /// File names and the cells that contain them.
    pub(crate) files: Vec<(Rect, PathBuf)>,
    /// Cells to draw after the preview on a slow connection.
    pub(crate) later: Rect,
}

impl FileLinksAndDelayedText {
    /// Writes a line and records which cells contain file names. Returns the number of columns used.
    pub(super) fn put_line_with_links(
        &mut self,
        state: &State,
        area: Rect,
        line: &[(String, TextRole)],
        buffer: &mut Buffer,
    ) -> u16 {
        let mut x = area.x;
        for (text, tone) in line {
            let end = x.saturating_add(text_columns(text)).min(area.right());
            let cells = Rect { x, width: end.saturating_sub(x), ..area };
            let is_shown_path = |path: &&PathBuf| escape_invisible_chars(&path.to_string_lossy()) == *text;
            let written = state.saving.written.iter().map(|written| &written.path);
            let path = (*tone == TextRole::File).then(|| written.clone().find(is_shown_path)).flatten();
            self.files.extend(path.map(|path| (Rect { height: 1, ..cells }, path.clone())));
            x = end;
        }
        let pieces: Vec<(&str, TextRole)> = line.iter().map(|(text, tone)| (text.as_str(), *tone)).collect();
        put_text(buffer, area, &pieces, state.display.depth)
    }
}
