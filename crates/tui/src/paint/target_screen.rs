//! The target content for the painter.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::cell::{CellContent, TwoPartColorCell};
use super::fidelity::PreviewFidelity;
use crate::color::ColorDepth;

/// The cells to be shown on the screen.
#[derive(Debug)]
pub(super) struct TargetScreen {
    pub(super) columns: u16,
    pub(super) rows: u16,
    contents: Vec<CellContent>,
    pub(super) picture: Rect,
    /// Cells whose text is drawn after the preview.
    pub(super) later: Rect,
    pub(super) fidelity: PreviewFidelity,
    depth: ColorDepth,
}

/// Regions of the screen, in drawing order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TextOrPreviewRegion {
    Text,
    Preview,
    /// Text drawn after the preview.
    DelayedText,
}

impl TargetScreen {
    /// A target screen without cells.
    pub(super) fn empty(depth: ColorDepth) -> Self {
        Self::new(&Buffer::empty(Rect::ZERO), Rect::ZERO, PreviewFidelity::Still, depth)
    }

    pub(super) fn new(buffer: &Buffer, picture: Rect, fidelity: PreviewFidelity, depth: ColorDepth) -> Self {
        let (columns, rows) = (buffer.area.width, buffer.area.height);
        let picture = picture.intersection(Rect::new(0, 0, columns, rows));
        Self {
            columns,
            rows,
            contents: buffer_cell_contents(buffer, depth),
            picture,
            later: Rect::ZERO,
            fidelity,
            depth,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.contents.is_empty()
    }

    pub(super) fn row(&self, y: u16) -> &[CellContent] {
        let columns = usize::from(self.columns);
        &self.contents[usize::from(y) * columns..][..columns]
    }

    /// Whether a row drawn for this target would also satisfy `other`.
    pub(super) fn row_also_satisfies_other(&self, other: &Self, y: u16) -> bool {
        let is_as_near = self.fidelity == other.fidelity
            || (matches!(self.fidelity, PreviewFidelity::Still | PreviewFidelity::Following)
                && other.fidelity == PreviewFidelity::Moving);
        let columns = usize::from(self.picture.left())..usize::from(self.picture.right());
        is_as_near
            && (self.columns, self.picture) == (other.columns, other.picture)
            && self.row(y).get(columns.clone()) == other.row(y).get(columns)
    }

    /// The mosaic of a preview cell. `None` for text cells, which may cover the preview.
    pub(super) fn preview_cell(&self, x: u16, y: u16) -> Option<TwoPartColorCell> {
        match self.row(y)[usize::from(x)] {
            CellContent::Mosaic(mosaic) if self.picture.contains((x, y).into()) => Some(mosaic),
            CellContent::Mosaic(_) | CellContent::Text(_) | CellContent::Covered | CellContent::Unknown => {
                None
            }
        }
    }

    /// Sets the cells whose text is drawn after the preview. Blank cells are not delayed.
    pub(super) fn with_delayed_text_area(self, later: Rect) -> Self {
        Self { later, ..self }
    }

    /// Makes the text in these cells a hyperlink.
    pub(super) fn link_cells(&mut self, cells: Rect, number: u16) {
        let cells = cells.intersection(Rect::new(0, 0, self.columns, self.rows));
        for place in cells.positions() {
            let index = usize::from(place.y) * usize::from(self.columns) + usize::from(place.x);
            if let CellContent::Text(text) = &mut self.contents[index] {
                text.pen.link = number;
            }
        }
    }

    /// The region that a cell belongs to.
    pub(super) fn region_at(&self, x: u16, y: u16) -> TextOrPreviewRegion {
        match () {
            () if self.is_preview_cell(x, y) => TextOrPreviewRegion::Preview,
            () if !self.later.contains((x, y).into()) => TextOrPreviewRegion::Text,
            () if self.row(y)[usize::from(x)] == CellContent::BLANK => TextOrPreviewRegion::Text,
            () => TextOrPreviewRegion::DelayedText,
        }
    }

    /// Whether a cell belongs to the preview. Preview cells are mosaics or, without colors, ramp characters.
    pub(super) fn is_preview_cell(&self, x: u16, y: u16) -> bool {
        let is_tone = |symbol: &str| matches!(symbol.as_bytes(), [byte] if byte.is_ascii_punctuation());
        self.picture.contains((x, y).into())
            && match &self.row(y)[usize::from(x)] {
                CellContent::Mosaic(_) => true,
                CellContent::Text(text) => self.depth == ColorDepth::None && is_tone(&text.symbol),
                CellContent::Covered | CellContent::Unknown => false,
            }
    }

    /// Whether the preview is drawn using characters.
    pub(super) fn uses_ascii_ramp(&self) -> bool {
        self.depth == ColorDepth::None
    }

    /// The rows of the preview, from the middle outward.
    pub(super) fn preview_rows_center_outward(&self) -> impl Iterator<Item = u16> + use<> {
        let (top, bottom) = (self.picture.top(), self.picture.bottom());
        let middle = top + (bottom - top) / 2;
        (0..=bottom - top).flat_map(move |away| {
            let below = middle.checked_add(away).filter(|y| *y < bottom);
            let above = middle.checked_sub(away).filter(|y| away > 0 && *y >= top);
            [below, above].into_iter().flatten()
        })
    }
}

/// Contents of a buffer's cells.
pub(super) fn buffer_cell_contents(buffer: &Buffer, depth: ColorDepth) -> Vec<CellContent> {
    let columns = usize::from(buffer.area.width.max(1));
    let mut contents: Vec<CellContent> =
        buffer.content.iter().map(|cell| CellContent::from_cell(cell, depth)).collect();
    for row in contents.chunks_mut(columns) {
        let mut x = 0;
        while x < row.len() {
            let end = x + usize::from(row[x].columns());
            if end > row.len() {
                row[x] = CellContent::BLANK;
            } else {
                row[x + 1..end].fill(CellContent::Covered);
            }
            x = end;
        }
    }
    contents
}
