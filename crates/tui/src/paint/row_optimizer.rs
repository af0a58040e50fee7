//! Finds the cheapest byte sequence that draws a row of the preview.
//!
//! Each cell is either kept or drawn with one of four glyphs, changing neither, one or both of the pen's
//! colors. The cost depends on the pen and the cursor position, so the search keeps the best path for each of
//! a few pens (Viterbi algorithm with beam search) and traces the path back from the cheapest end.

use super::candidates::{PartColorCandidates, candidate_colors_for_run_start};
use super::cell::{ForegroundParts, TwoPartColorCell};
use super::cost_model::RateDistortion;
use super::terminal_color::{ColorLayer, TerminalColor, decimal_digit_count};
use crate::mosaic::{PLACES, TwoPartBlockPattern};

/// Number of paths kept per cell.
const BEAM_WIDTH: usize = 5;
/// Upper bound on the bytes needed to reach any pen and cursor position from any other. A path that costs
/// this much more than the best path cannot win.
const MAX_BYTES: f32 = 46.0;

/// A cell in the row, with its target and its current content.
#[derive(Clone, Copy, Debug)]
pub(super) struct WantedAndShownCell {
    /// Target content, or `None` if the cell is not part of the preview.
    pub(super) wanted: Option<TwoPartColorCell>,
    /// Content on the screen, or `None` if unknown, in which case the cell must be drawn.
    pub(super) shown: Option<TwoPartColorCell>,
}

/// State of the pen and cursor at the start of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowStart {
    pub(super) fg: TerminalColor,
    pub(super) bg: TerminalColor,
    /// Whether the cursor is at the first cell.
    pub(super) is_at_start: bool,
}

/// An operation that draws one cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CellDrawOp {
    /// Column relative to the first target cell.
    pub(super) column: usize,
    pub(super) glyph: ForegroundParts,
    pub(super) mosaic: TwoPartColorCell,
}

/// A path through the row up to some cell.
#[derive(Clone, Copy, Debug)]
struct RowPrefixPlan {
    fg: TerminalColor,
    bg: TerminalColor,
    /// Both colors of the pen, packed into one key.
    pen: u64,
    gap: CursorDistance,
    bytes: u32,
    /// Weighted sum of bytes and errors.
    cost: f32,
    /// Index of the path to the previous cell.
    parent: usize,
    /// The glyph drawn in the cell, or `None` if the cell was kept.
    glyph: Option<ForegroundParts>,
}

/// Packs two colors into one key.
fn color_pair_key(fg: TerminalColor, bg: TerminalColor) -> u64 {
    u64::from(fg.unique_number()) << 32 | u64::from(bg.unique_number())
}

/// Distance between the cursor and the next cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CursorDistance {
    /// The cursor is in another row.
    Far,
    Cells(u8),
}

impl CursorDistance {
    fn move_byte_count(self) -> u32 {
        match self {
            Self::Far => 8,
            Self::Cells(0) => 0,
            Self::Cells(1) => 3,
            Self::Cells(count) => 3 + decimal_digit_count(count),
        }
    }

    fn plus_one_cell(self) -> Self {
        match self {
            Self::Far => Self::Far,
            Self::Cells(count) => Self::Cells(count.saturating_add(1)),
        }
    }
}

/// A row's drawing operations.
#[derive(Clone, Debug)]
pub(super) struct PlannedRow {
    pub(super) ops: Vec<CellDrawOp>,
    pub(super) bytes: u32,
}

/// Finds the cheapest path through a row of cells.
pub(super) fn plan_row(targets: &[WantedAndShownCell], start: RowStart, model: RateDistortion) -> PlannedRow {
    let gap = if start.is_at_start { CursorDistance::Cells(0) } else { CursorDistance::Far };
    let RowStart { fg, bg, .. } = start;
    let first = RowPrefixPlan {
        fg,
        bg,
        pen: color_pair_key(fg, bg),
        gap,
        bytes: 0,
        cost: 0.0,
        parent: 0,
        glyph: None,
    };
    let mut paths = vec![vec![first]];
    let wanted: Vec<_> = targets.iter().map(|target| target.wanted).collect();
    for (column, target) in targets.iter().enumerate() {
        let last = &paths[column];
        paths.push(extend_plans(last, *target, &wanted[column..], model));
    }
    trace_back_cheapest_plan(&paths, &wanted)
}

/// Extends the paths by one cell.
fn extend_plans(
    last: &[RowPrefixPlan],
    target: WantedAndShownCell,
    wanted: &[Option<TwoPartColorCell>],
    model: RateDistortion,
) -> Vec<RowPrefixPlan> {
    let mut beam = SearchBeam { paths: Vec::with_capacity(BEAM_WIDTH), limit: MAX_BYTES * model.byte };
    let leave = match (target.wanted, target.shown) {
        (None, _) => 0.0,
        (Some(wanted), Some(shown)) => shown
            .overlapping_color_pairs(wanted)
            .map(|(shown, wanted, part)| part * model.squared_color_error(shown, wanted))
            .sum(),
        (Some(_), None) => f32::INFINITY,
    };
    if leave.is_finite() {
        for (parent, path) in last.iter().enumerate() {
            beam.add(RowPrefixPlan {
                gap: path.gap.plus_one_cell(),
                cost: path.cost + leave,
                parent,
                glyph: None,
                ..*path
            });
        }
    }
    let Some(mosaic) = target.wanted else { return beam.paths };
    // A cell that is close enough to its target is not worth a color change, but redrawing it may be cheaper
    // than skipping it.
    let changes = if leave <= model.byte {
        PartColorCandidates::default()
    } else {
        candidate_colors_for_run_start(wanted, model)
    };
    let changes = ColorChangesToTry::new(&changes, mosaic, model);
    for (parent, path) in last.iter().enumerate() {
        changes.try_single_changes(parent, path, &mut beam);
    }
    // If both colors are set, the previous pen does not matter, so extend only the cheapest path.
    let base = |path: &RowPrefixPlan| path.cost + path.gap.move_byte_count() as f32 * model.byte;
    if let Some((parent, path)) = last.iter().enumerate().min_by(|(_, a), (_, b)| base(a).total_cmp(&base(b)))
    {
        changes.try_paired_changes(parent, path, &mut beam);
    }
    beam.paths
}

/// The best paths found so far for a cell.
struct SearchBeam {
    paths: Vec<RowPrefixPlan>,
    /// Paths that cost more than the best path by at least this amount are dropped.
    limit: f32,
}

impl SearchBeam {
    fn add(&mut self, path: RowPrefixPlan) {
        let is_same = |other: &RowPrefixPlan| other.pen == path.pen && other.gap == path.gap;
        if let Some(other) = self.paths.iter_mut().find(|other| is_same(other)) {
            if path.cost < other.cost {
                *other = path;
            }
        } else if self.paths.len() < BEAM_WIDTH {
            self.paths.push(path);
        } else if let Some(worst) = self.paths.iter_mut().max_by(|a, b| a.cost.total_cmp(&b.cost))
            && path.cost < worst.cost
        {
            *worst = path;
        }
    }

    /// Returns the cost above which a path cannot enter the beam.
    fn pruning_cost_threshold(&self) -> f32 {
        let (mut best, mut worst) = (f32::INFINITY, 0.0_f32);
        for path in &self.paths {
            (best, worst) = (best.min(path.cost), worst.max(path.cost));
        }
        if self.paths.len() < BEAM_WIDTH { best + self.limit } else { worst.min(best + self.limit) }
    }
}

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
struct ColorChangesToTry {
    mosaic: TwoPartColorCell,
    model: RateDistortion,
    all: Vec<ColorChange>,
    /// End index of the colors for the first part. Colors for the second part follow, up to `second`.
    first: usize,
    second: usize,
}

impl ColorChangesToTry {
    fn new(candidates: &PartColorCandidates, mosaic: TwoPartColorCell, model: RateDistortion) -> Self {
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
    fn try_single_changes(&self, parent: usize, path: &RowPrefixPlan, beam: &mut SearchBeam) {
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
    fn try_paired_changes(&self, parent: usize, path: &RowPrefixPlan, beam: &mut SearchBeam) {
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

/// Traces the cheapest path back from the last cell.
fn trace_back_cheapest_plan(paths: &[Vec<RowPrefixPlan>], wanted: &[Option<TwoPartColorCell>]) -> PlannedRow {
    let last = paths.last().into_iter().flatten().enumerate();
    let best = last.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let (mut index, bytes) = best.map_or((0, 0), |(index, path)| (index, path.bytes));
    let mut ops = Vec::new();
    for (column, paths) in paths.iter().enumerate().skip(1).rev() {
        let Some(path) = paths.get(index) else { break };
        if let (Some(glyph), Some(mosaic)) = (path.glyph, wanted[column - 1]) {
            let pair = glyph.part_layers().map(|layer| match layer {
                ColorLayer::Foreground => path.fg,
                ColorLayer::Background => path.bg,
            });
            ops.push(CellDrawOp {
                column: column - 1,
                glyph,
                mosaic: TwoPartColorCell::new(mosaic.tile, pair),
            });
        }
        index = path.parent;
    }
    ops.reverse();
    PlannedRow { ops, bytes }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mosaic::pattern_and_inversion_for_symbol;

    const BLACK: TerminalColor = TerminalColor::Rgb([0, 0, 0]);
    const RED: TerminalColor = TerminalColor::Rgb([200, 0, 0]);

    fn wanted(halves: &[[TerminalColor; 2]]) -> Vec<WantedAndShownCell> {
        halves
            .iter()
            .map(|halves| WantedAndShownCell {
                wanted: Some(TwoPartColorCell::from_halves(*halves)),
                shown: Some(TwoPartColorCell::uniform(TerminalColor::DefaultBackground)),
            })
            .collect()
    }

    fn start(fg: TerminalColor, bg: TerminalColor) -> RowStart {
        RowStart { fg, bg, is_at_start: true }
    }

    #[test]
    fn pen_changes_once_and_blanks_are_preferred() {
        let found = plan_row(
            &wanted(&[[RED, RED], [RED, RED], [BLACK, RED]]),
            start(BLACK, TerminalColor::DefaultBackground),
            RateDistortion::EXACT,
        );
        let glyphs: Vec<ForegroundParts> = found.ops.iter().map(|op| op.glyph).collect();
        assert_eq!(glyphs, [ForegroundParts::Blank, ForegroundParts::Blank, ForegroundParts::First]);
        // ESC [ 48;2;200;0;0 m, followed by the glyphs.
        assert_eq!(found.bytes, 3 + 12 + 1 + 1 + 3);
    }

    #[test]
    fn unchanged_cells_are_skipped() {
        let mut targets = wanted(&[[RED, BLACK]; 9]);
        for target in &mut targets[1..8] {
            target.shown = Some(TwoPartColorCell::from_halves([RED, TerminalColor::Rgb([1, 1, 1])]));
        }
        let found = plan_row(&targets, start(RED, BLACK), RateDistortion::EXACT);
        let columns: Vec<usize> = found.ops.iter().map(|op| op.column).collect();
        assert_eq!((columns, found.bytes), (vec![0, 8], 3 + 4 + 3));
        // A one-cell gap is redrawn, because this takes no more bytes than moving the cursor and is more
        // accurate.
        let found = plan_row(&[targets[0], targets[1], targets[8]], start(RED, BLACK), RateDistortion::EXACT);
        assert_eq!((found.ops.len(), found.bytes), (3, 9));
    }

    #[test]
    fn default_colors_are_drawn_in_their_layers() {
        for halves in [
            [RED, TerminalColor::DefaultBackground],
            [TerminalColor::DefaultBackground, RED],
            [TerminalColor::DefaultForeground, TerminalColor::DefaultBackground],
            [TerminalColor::DefaultForeground; 2],
        ] {
            let targets =
                [WantedAndShownCell { wanted: Some(TwoPartColorCell::from_halves(halves)), shown: None }];
            let found = plan_row(&targets, start(BLACK, BLACK), RateDistortion::MOVING);
            assert_eq!(found.ops.first().map(|op| op.mosaic.pair), Some(halves));
        }
    }

    fn shade() -> impl Strategy<Value = TerminalColor> {
        prop_oneof![
            4 => (0..4_u8, 0..4_u8).prop_map(|(r, g)| TerminalColor::Rgb([98 + r, 8 + g, 250])),
            2 => any::<[u8; 3]>().prop_map(TerminalColor::Rgb),
            1 => any::<u8>().prop_map(TerminalColor::Palette),
            1 => Just(TerminalColor::DefaultBackground),
        ]
    }

    fn mosaic() -> impl Strategy<Value = TwoPartColorCell> {
        let tile = prop_oneof![
            3 => Just(TwoPartBlockPattern::HALVES),
            1 => proptest::sample::select(vec!['▌', '▚', '░', '▒', '🬟', '\u{1CD10}'])
                .prop_map(|symbol| pattern_and_inversion_for_symbol(symbol).expect("a tile").0),
        ];
        (tile, [shade(), shade()]).prop_map(|(tile, pair)| {
            // A medium shade draws its first part in the foreground color, never in the default background.
            let is_cell = tile != TwoPartBlockPattern::MEDIUM || pair[0] != TerminalColor::DefaultBackground;
            TwoPartColorCell::new(if is_cell { tile } else { TwoPartBlockPattern::HALVES }, pair)
        })
    }

    proptest! {
        #[test]
        fn every_cell_is_close_to_its_target(
            cells in proptest::collection::vec(
                (proptest::option::weighted(0.9, mosaic()), proptest::option::of(mosaic())),
                1..40,
            ),
            is_exact in any::<bool>(),
        ) {
            let targets: Vec<WantedAndShownCell> = cells.iter().map(|(wanted, shown)| WantedAndShownCell { wanted: *wanted, shown: *shown }).collect();
            let model = if is_exact { RateDistortion::EXACT } else { RateDistortion::MOVING };
            let found = plan_row(&targets, start(TerminalColor::DefaultForeground, TerminalColor::DefaultBackground), model);
            let mut screen: Vec<Option<TwoPartColorCell>> = targets.iter().map(|target| target.shown).collect();
            for op in &found.ops {
                prop_assert!(targets[op.column].wanted.is_some(), "not part of the preview");
                prop_assert!(op.glyph.can_show_colors(op.mosaic.pair));
                screen[op.column] = Some(op.mosaic);
            }
            for (shown, target) in screen.iter().zip(&targets) {
                let Some(wanted) = target.wanted else { continue };
                let shown = shown.expect("unknown cells should be drawn");
                for (shown, wanted, part) in shown.overlapping_color_pairs(wanted) {
                    let error = model.squared_color_error(shown, wanted);
                    if is_exact {
                        prop_assert!(error <= 3.0, "a channel differs by more than 1");
                    } else {
                        // Larger errors in a single channel should be avoided at any cost.
                        prop_assert!(part * error <= RateDistortion::MOVING.byte * 120.0);
                    }
                }
            }
        }
    }
}
