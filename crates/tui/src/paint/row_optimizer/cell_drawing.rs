//! Extends paths by drawing one cell: with the current pen, or after changing one or both of its colors.

use super::super::candidates::PartColorCandidates;
use super::super::cell::{ForegroundParts, TwoPartColorCell};
use super::super::cost_model::RateDistortionParameters;
use super::super::terminal_color::{ColorLayer, TerminalColor};
use super::beam::{CursorDistance, RowPrefixPlan, SearchBeam, color_pair_key};
use crate::mosaic::{PLACES, TwoPartBlockPattern};

/// A color that may be set before drawing a cell, and its cost.
#[derive(Clone, Copy)]
struct ColorChange {
    shade: TerminalColor,
    /// Number of bytes in the SGR parameters.
    bytes: u32,
    /// Area-weighted errors in the first and second parts.
    errors: [f32; 2],
}

/// Color changes to try for a cell.
pub(super) struct ColorChangesToTry {
    mosaic: TwoPartColorCell,
    model: RateDistortionParameters,
    all: Vec<ColorChange>,
    /// End index of the colors for the first part. Colors for the second part follow, up to `second`.
    first: usize,
    second: usize,
}

impl ColorChangesToTry {
    pub(super) fn new(
        candidates: &PartColorCandidates,
        mosaic: TwoPartColorCell,
        model: RateDistortionParameters,
    ) -> Self {
        let PartColorCandidates { first, second, both } = candidates;
        let mut changes =
            Self { mosaic, model, all: Vec::new(), first: first.len(), second: first.len() + second.len() };
        let change = |shade: &TerminalColor| ColorChange {
            shade: *shade,
            bytes: shade.sgr_length(),
            errors: changes.color_error_per_part(*shade),
        };
        changes.all = first.iter().chain(second).chain(both).map(change).collect();
        changes
    }

    /// Returns the area-weighted error that a color causes in each part.
    fn color_error_per_part(&self, shade: TerminalColor) -> [f32; 2] {
        let sizes = self.mosaic.tile.part_sizes();
        std::array::from_fn(|part| {
            let share = 2.0 * sizes[part] as f32 / PLACES as f32;
            share * self.model.squared_color_error(shade, self.mosaic.pair[part])
        })
    }

    /// Extends a path by drawing with the current pen or after changing one of its colors. A color chosen for
    /// one part is used only there.
    pub(super) fn try_single_changes(&self, parent: usize, path: &RowPrefixPlan, beam: &mut SearchBeam) {
        let mut ends = OneCellPlanExtender::new(self, parent, path, beam);
        if !ends.can_enter_beam() {
            return;
        }
        let (fg_errors, bg_errors) = (self.color_error_per_part(path.fg), self.color_error_per_part(path.bg));
        let pen = PenWithErrors { fg: path.fg, fg_errors, bg: path.bg, bg_errors };
        for glyph in ForegroundParts::ALL {
            ends.try_glyph(pen, 0, glyph);
        }
        for (index, change) in self.all.iter().enumerate() {
            let bytes = change.bytes + 3;
            let (as_fg, as_bg) = match index {
                _ if index < self.first => (ForegroundParts::First, ForegroundParts::Second),
                _ if index < self.second => (ForegroundParts::Second, ForegroundParts::First),
                _ => (ForegroundParts::Full, ForegroundParts::Blank),
            };
            if change.shade.is_allowed_in_layer(ColorLayer::Foreground) {
                ends.try_glyph(pen.with_fg(change), bytes, as_fg);
            }
            if change.shade.is_allowed_in_layer(ColorLayer::Background) {
                ends.try_glyph(pen.with_bg(change), bytes, as_bg);
            }
        }
    }

    /// Extends a path by changing both colors of the pen.
    pub(super) fn try_paired_changes(&self, parent: usize, path: &RowPrefixPlan, beam: &mut SearchBeam) {
        let mut ends = OneCellPlanExtender::new(self, parent, path, beam);
        for first in &self.all[..self.first] {
            for second in &self.all[self.first..self.second] {
                let bytes = first.bytes + second.bytes + 4;
                for (fg, bg, glyph) in
                    [(first, second, ForegroundParts::First), (second, first, ForegroundParts::Second)]
                {
                    if fg.shade.is_allowed_in_layer(ColorLayer::Foreground)
                        && bg.shade.is_allowed_in_layer(ColorLayer::Background)
                    {
                        ends.try_glyph(PenWithErrors::from_changes(fg, bg), bytes, glyph);
                    }
                }
            }
        }
    }
}

/// Extends one path by drawing the next cell.
struct OneCellPlanExtender<'a> {
    parent: usize,
    /// Number of bytes so far, including those that move the cursor to the cell.
    bytes: u32,
    /// Total error of all cells before this one.
    error: f32,
    /// Cost per byte of output.
    byte: f32,
    tile: TwoPartBlockPattern,
    beam: &'a mut SearchBeam,
    /// Current cost bound of the beam.
    bound: f32,
}

impl<'a> OneCellPlanExtender<'a> {
    fn new(
        changes: &ColorChangesToTry,
        parent: usize,
        path: &RowPrefixPlan,
        beam: &'a mut SearchBeam,
    ) -> Self {
        let byte = changes.model.byte;
        let error = path.cost - path.bytes as f32 * byte;
        let bound = beam.pruning_cost_threshold();
        let tile = changes.mosaic.tile;
        Self { parent, bytes: path.bytes + path.gap.move_byte_count(), error, byte, tile, beam, bound }
    }

    /// Whether any glyph drawn here could be cheap enough to enter the beam.
    fn can_enter_beam(&self) -> bool {
        (self.bytes + 1) as f32 * self.byte + self.error < self.bound
    }

    fn try_glyph(&mut self, ends: PenWithErrors, sgr: u32, glyph: ForegroundParts) {
        // Inverting the medium shade yields a different pattern but the same character.
        if glyph == ForegroundParts::Second && self.tile == TwoPartBlockPattern::MEDIUM {
            return;
        }
        let bytes = self.bytes + sgr + glyph.symbol_for_pattern(self.tile).len_utf8() as u32;
        let cost = bytes as f32 * self.byte + self.error + ends.error(glyph);
        if cost < self.bound {
            let PenWithErrors { fg, bg, .. } = ends;
            let parent = self.parent;
            let (pen, gap, glyph) = (color_pair_key(fg, bg), CursorDistance::Cells(0), Some(glyph));
            self.beam.add(RowPrefixPlan { fg, bg, pen, gap, bytes, cost, parent, glyph });
            self.bound = self.beam.pruning_cost_threshold();
        }
    }
}

/// A pen and the errors of its colors in both parts of a cell.
#[derive(Clone, Copy)]
struct PenWithErrors {
    fg: TerminalColor,
    fg_errors: [f32; 2],
    bg: TerminalColor,
    bg_errors: [f32; 2],
}

impl PenWithErrors {
    fn from_changes(fg: &ColorChange, bg: &ColorChange) -> Self {
        Self { fg: fg.shade, fg_errors: fg.errors, bg: bg.shade, bg_errors: bg.errors }
    }

    fn with_fg(self, change: &ColorChange) -> Self {
        Self { fg: change.shade, fg_errors: change.errors, ..self }
    }

    fn with_bg(self, change: &ColorChange) -> Self {
        Self { bg: change.shade, bg_errors: change.errors, ..self }
    }

    fn error(&self, glyph: ForegroundParts) -> f32 {
        let of = |part: usize| match glyph.part_layers()[part] {
            ColorLayer::Foreground => self.fg_errors[part],
            ColorLayer::Background => self.bg_errors[part],
        };
        of(0) + of(1)
    }
}
