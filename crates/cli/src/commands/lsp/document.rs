//! An open document. LSP positions are lines and UTF-16 code units.

use std::ops::Range;
use std::path::PathBuf;

use lsp_types::{Position, Range as Span};

use crate::scene::outline::{OutlineTable, document_outline};

/// A document opened by the client.
#[derive(Clone, Debug)]
pub(super) struct OpenDocument {
    pub(super) path: PathBuf,
    pub(super) version: i32,
    pub(super) text: String,
    /// The tables in the text.
    pub(super) tables: Vec<OutlineTable>,
    /// Byte offsets of the line starts.
    lines: Vec<usize>,
}

impl OpenDocument {
    pub(super) fn new(path: PathBuf, version: i32, text: String) -> Self {
        let starts = text.match_indices('\n').map(|(at, _)| at + 1);
        let lines = std::iter::once(0).chain(starts).collect();
        Self { path, version, tables: document_outline(&text), lines, text }
    }

    /// Returns the byte offset of a position, clamped to the end of its line.
    pub(super) fn offset(&self, position: Position) -> usize {
        let line = usize::try_from(position.line).unwrap_or(usize::MAX);
        let Some(&start) = self.lines.get(line) else { return self.text.len() };
        let text = self.text[start..].split('\n').next().unwrap_or_default();
        let mut units = position.character;
        for (at, character) in text.char_indices() {
            if units == 0 {
                return start + at;
            }
            units = units.saturating_sub(character.len_utf16() as u32);
        }
        start + text.len()
    }

    /// Returns the LSP position for a byte offset.
    pub(super) fn position(&self, offset: usize) -> Position {
        let offset = offset.min(self.text.len());
        let line = self.lines.partition_point(|start| *start <= offset) - 1;
        let before = self.text.get(self.lines[line]..offset).unwrap_or_default();
        let units = before.encode_utf16().count();
        Position::new(line as u32, units as u32)
    }

    pub(super) fn to_lsp_range(&self, range: &Range<usize>) -> Span {
        Span::new(self.position(range.start), self.position(range.end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_utf_16_code_units() {
        let document = OpenDocument::new(PathBuf::new(), 0, "a = 1\n# ä𝄞x\n\n".to_owned());
        for (offset, line, character) in
            [(0, 0, 0), (5, 0, 5), (6, 1, 0), (10, 1, 3), (14, 1, 5), (15, 1, 6), (16, 2, 0)]
        {
            assert_eq!(document.position(offset), Position::new(line, character), "{offset}");
            assert_eq!(document.offset(Position::new(line, character)), offset);
        }
        assert_eq!(document.offset(Position::new(0, 99)), 5);
        assert_eq!(document.offset(Position::new(99, 0)), document.text.len());
    }
}
