//! The cheapest way through a row of the picture.
//!
//! A cell can be left as it is or be drawn: by one of four glyphs, with the pen as it is or with one or both of its
//! colors changed. What that costs depends on the pen and on where the cursor was left, so that the best way
//! to a cell is kept for each of a few pens (the Viterbi algorithm as a beam search), and the cheapest end is traced back.

use super::candidates::{CandidateColors, candidates};
use super::cell::{Glyph, Mosaic};
use super::cost_model::CostModel;
use super::terminal_color::{ColorLayer, TerminalColor, digits};
use crate::mosaic::{PLACES, Tile};

/// Ways that are kept from cell to cell.
const BEAM: usize = 5;
/// Bytes after which any pen is any other one anywhere: what is this much worse than the best never wins.
const MOST_BYTES: f32 = 46.0;

/// A cell of the row.
#[derive(Clone, Copy, Debug)]
pub(super) struct TargetCell {
    /// None: the cell is not of the picture.
    pub(super) wanted: Option<Mosaic>,
    /// None: nothing that could stay.
    pub(super) shown: Option<Mosaic>,
}

/// Pen and cursor at the beginning of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct RowStart {
    pub(super) fg: TerminalColor,
    pub(super) bg: TerminalColor,
    /// Whether the cursor is at the first cell.
    pub(super) is_there: bool,
}

/// One cell drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct DrawOp {
    /// Counted from the first target.
    pub(super) column: usize,
    pub(super) glyph: Glyph,
    pub(super) mosaic: Mosaic,
}

/// A way through the row up to a cell.
#[derive(Clone, Copy, Debug)]
struct DrawPath {
    fg: TerminalColor,
    bg: TerminalColor,
    /// Both colors as one number.
    pen: u64,
    gap: CursorGap,
    bytes: u32,
    /// Bytes and errors.
    cost: f32,
    /// Index among the ways to the cell before.
    parent: usize,
    /// None: the cell was left.
    glyph: Option<Glyph>,
}

/// Two colors as one number.
fn pen(fg: TerminalColor, bg: TerminalColor) -> u64 {
    u64::from(fg.number()) << 32 | u64::from(bg.number())
}

/// Cells between the cursor and the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CursorGap {
    /// The cursor is in another row.
    Far,
    Cells(u8),
}

impl CursorGap {
    fn bytes(self) -> u32 {
        match self {
            Self::Far => 8,
            Self::Cells(0) => 0,
            Self::Cells(1) => 3,
            Self::Cells(count) => 3 + digits(count),
        }
    }

    fn wider(self) -> Self {
        match self {
            Self::Far => Self::Far,
            Self::Cells(count) => Self::Cells(count.saturating_add(1)),
        }
    }
}

/// Strokes of a row.
#[derive(Clone, Debug)]
pub(super) struct PlannedRow {
    pub(super) dabs: Vec<DrawOp>,
    pub(super) bytes: u32,
}

/// The way through the row at the least cost.
pub(super) fn row(targets: &[TargetCell], start: RowStart, model: CostModel) -> PlannedRow {
    let gap = if start.is_there { CursorGap::Cells(0) } else { CursorGap::Far };
    let RowStart { fg, bg, .. } = start;
    let first = DrawPath { fg, bg, pen: pen(fg, bg), gap, bytes: 0, cost: 0.0, parent: 0, glyph: None };
    let mut ways = vec![vec![first]];
    let wanted: Vec<_> = targets.iter().map(|target| target.wanted).collect();
    for (column, target) in targets.iter().enumerate() {
        let last = &ways[column];
        ways.push(step(last, *target, &wanted[column..], model));
    }
    trace(&ways, &wanted)
}

/// The ways on to the next cell.
fn step(last: &[DrawPath], target: TargetCell, wanted: &[Option<Mosaic>], model: CostModel) -> Vec<DrawPath> {
    let mut beam = Beam { ways: Vec::with_capacity(BEAM), limit: MOST_BYTES * model.byte };
    let leave = match (target.wanted, target.shown) {
        (None, _) => 0.0,
        (Some(wanted), Some(shown)) => {
            shown.against(wanted).map(|(shown, wanted, part)| part * model.error(shown, wanted)).sum()
        }
        (Some(_), None) => f32::INFINITY,
    };
    if leave.is_finite() {
        for (parent, way) in last.iter().enumerate() {
            beam.add(DrawPath { gap: way.gap.wider(), cost: way.cost + leave, parent, glyph: None, ..*way });
        }
    }
    let Some(mosaic) = target.wanted else { return beam.ways };
    // What is near enough is not worth a new color, but may be drawn again instead of jumped over.
    let changes = if leave <= model.byte { CandidateColors::default() } else { candidates(wanted, model) };
    let changes = ColorChanges::new(&changes, mosaic, model);
    for (parent, way) in last.iter().enumerate() {
        changes.turn_one(parent, way, &mut beam);
    }
    // Where both colors are set, nothing is left of the pen: the cheapest way goes on.
    let base = |way: &DrawPath| way.cost + way.gap.bytes() as f32 * model.byte;
    if let Some((parent, way)) = last.iter().enumerate().min_by(|(_, a), (_, b)| base(a).total_cmp(&base(b)))
    {
        changes.turn_both(parent, way, &mut beam);
    }
    beam.ways
}

/// The best ways so far.
struct Beam {
    ways: Vec<DrawPath>,
    /// Ways that cost this much more than the best are not kept.
    limit: f32,
}

impl Beam {
    fn add(&mut self, way: DrawPath) {
        let is_same = |other: &DrawPath| other.pen == way.pen && other.gap == way.gap;
        if let Some(other) = self.ways.iter_mut().find(|other| is_same(other)) {
            if way.cost < other.cost {
                *other = way;
            }
        } else if self.ways.len() < BEAM {
            self.ways.push(way);
        } else if let Some(worst) = self.ways.iter_mut().max_by(|a, b| a.cost.total_cmp(&b.cost))
            && way.cost < worst.cost
        {
            *worst = way;
        }
    }

    /// The cost from which on a way is not worth a look.
    fn bound(&self) -> f32 {
        let (mut best, mut worst) = (f32::INFINITY, 0.0_f32);
        for way in &self.ways {
            (best, worst) = (best.min(way.cost), worst.max(way.cost));
        }
        if self.ways.len() < BEAM { best + self.limit } else { worst.min(best + self.limit) }
    }
}

/// A color that may be set at a cell, with what follows.
#[derive(Clone, Copy)]
struct ColorChange {
    shade: TerminalColor,
    /// Bytes of the SGR parameters.
    bytes: u32,
    /// In the first and the second part.
    errors: [f32; 2],
}

/// Changes that may be drawn at a cell.
struct ColorChanges {
    mosaic: Mosaic,
    model: CostModel,
    all: Vec<ColorChange>,
    /// Number of changes of the first part; those of the second part follow.
    first: usize,
    second: usize,
}

impl ColorChanges {
    fn new(candidates: &CandidateColors, mosaic: Mosaic, model: CostModel) -> Self {
        let CandidateColors { first, second, both } = candidates;
        let mut changes =
            Self { mosaic, model, all: Vec::new(), first: first.len(), second: first.len() + second.len() };
        let change = |shade: &TerminalColor| ColorChange {
            shade: *shade,
            bytes: shade.length(),
            errors: changes.errors(*shade),
        };
        changes.all = first.iter().chain(second).chain(both).map(change).collect();
        changes
    }

    /// The errors of a color in both parts, each as large as it is.
    fn errors(&self, shade: TerminalColor) -> [f32; 2] {
        let sizes = self.mosaic.tile.sizes();
        std::array::from_fn(|part| {
            let share = 2.0 * sizes[part] as f32 / PLACES as f32;
            share * self.model.error(shade, self.mosaic.pair[part])
        })
    }

    /// The ways to draw the cell at the end of a way to it, with the pen as it is or with one other color. A color for
    /// one part is shown in that one.
    fn turn_one(&self, parent: usize, way: &DrawPath, beam: &mut Beam) {
        let mut ends = PathEnd::new(self, parent, way, beam);
        if !ends.is_near() {
            return;
        }
        let (fg_errors, bg_errors) = (self.errors(way.fg), self.errors(way.bg));
        let pen = PenErrors { fg: way.fg, fg_errors, bg: way.bg, bg_errors };
        for glyph in Glyph::ALL {
            ends.add(pen, 0, glyph);
        }
        for (index, change) in self.all.iter().enumerate() {
            let bytes = change.bytes + 3;
            let (as_fg, as_bg) = match index {
                _ if index < self.first => (Glyph::First, Glyph::Second),
                _ if index < self.second => (Glyph::Second, Glyph::First),
                _ => (Glyph::Full, Glyph::Blank),
            };
            if change.shade.fits(ColorLayer::Foreground) {
                ends.add(pen.with_fg(change), bytes, as_fg);
            }
            if change.shade.fits(ColorLayer::Background) {
                ends.add(pen.with_bg(change), bytes, as_bg);
            }
        }
    }

    /// The same with both colors.
    fn turn_both(&self, parent: usize, way: &DrawPath, beam: &mut Beam) {
        let mut ends = PathEnd::new(self, parent, way, beam);
        for first in &self.all[..self.first] {
            for second in &self.all[self.first..self.second] {
                let bytes = first.bytes + second.bytes + 4;
                for (fg, bg, glyph) in [(first, second, Glyph::First), (second, first, Glyph::Second)] {
                    if fg.shade.fits(ColorLayer::Foreground) && bg.shade.fits(ColorLayer::Background) {
                        ends.add(PenErrors::of(fg, bg), bytes, glyph);
                    }
                }
            }
        }
    }
}

/// Ways on from the end of one.
struct PathEnd<'a> {
    parent: usize,
    /// With those that lead to the cell.
    bytes: u32,
    /// Error of the cells before.
    error: f32,
    /// The price of a byte.
    byte: f32,
    tile: Tile,
    beam: &'a mut Beam,
    /// Bound of the beam.
    bound: f32,
}

impl<'a> PathEnd<'a> {
    fn new(changes: &ColorChanges, parent: usize, way: &DrawPath, beam: &'a mut Beam) -> Self {
        let byte = changes.model.byte;
        let error = way.cost - way.bytes as f32 * byte;
        let bound = beam.bound();
        let tile = changes.mosaic.tile;
        Self { parent, bytes: way.bytes + way.gap.bytes(), error, byte, tile, beam, bound }
    }

    /// Whether anything that is drawn here can be worth a look.
    fn is_near(&self) -> bool {
        (self.bytes + 1) as f32 * self.byte + self.error < self.bound
    }

    fn add(&mut self, ends: PenErrors, sgr: u32, glyph: Glyph) {
        // Turned round, half of each is another pattern by the same character.
        if glyph == Glyph::Second && self.tile == Tile::MEDIUM {
            return;
        }
        let bytes = self.bytes + sgr + glyph.symbol(self.tile).len_utf8() as u32;
        let cost = bytes as f32 * self.byte + self.error + ends.error(glyph);
        if cost < self.bound {
            let PenErrors { fg, bg, .. } = ends;
            let parent = self.parent;
            let (pen, gap, glyph) = (pen(fg, bg), CursorGap::Cells(0), Some(glyph));
            self.beam.add(DrawPath { fg, bg, pen, gap, bytes, cost, parent, glyph });
            self.bound = self.beam.bound();
        }
    }
}

/// A pen, and the errors of its colors in the parts of a cell.
#[derive(Clone, Copy)]
struct PenErrors {
    fg: TerminalColor,
    fg_errors: [f32; 2],
    bg: TerminalColor,
    bg_errors: [f32; 2],
}

impl PenErrors {
    fn of(fg: &ColorChange, bg: &ColorChange) -> Self {
        Self { fg: fg.shade, fg_errors: fg.errors, bg: bg.shade, bg_errors: bg.errors }
    }

    fn with_fg(self, change: &ColorChange) -> Self {
        Self { fg: change.shade, fg_errors: change.errors, ..self }
    }

    fn with_bg(self, change: &ColorChange) -> Self {
        Self { bg: change.shade, bg_errors: change.errors, ..self }
    }

    fn error(&self, glyph: Glyph) -> f32 {
        let of = |part: usize| match glyph.layers()[part] {
            ColorLayer::Foreground => self.fg_errors[part],
            ColorLayer::Background => self.bg_errors[part],
        };
        of(0) + of(1)
    }
}

/// The cheapest way back from the last cell.
fn trace(ways: &[Vec<DrawPath>], wanted: &[Option<Mosaic>]) -> PlannedRow {
    let last = ways.last().into_iter().flatten().enumerate();
    let best = last.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let (mut index, bytes) = best.map_or((0, 0), |(index, way)| (index, way.bytes));
    let mut dabs = Vec::new();
    for (column, ways) in ways.iter().enumerate().skip(1).rev() {
        let Some(way) = ways.get(index) else { break };
        if let (Some(glyph), Some(mosaic)) = (way.glyph, wanted[column - 1]) {
            let pair = glyph.layers().map(|layer| match layer {
                ColorLayer::Foreground => way.fg,
                ColorLayer::Background => way.bg,
            });
            dabs.push(DrawOp { column: column - 1, glyph, mosaic: Mosaic::new(mosaic.tile, pair) });
        }
        index = way.parent;
    }
    dabs.reverse();
    PlannedRow { dabs, bytes }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::mosaic::of_symbol;

    const BLACK: TerminalColor = TerminalColor::Rgb([0, 0, 0]);
    const RED: TerminalColor = TerminalColor::Rgb([200, 0, 0]);

    fn wanted(halves: &[[TerminalColor; 2]]) -> Vec<TargetCell> {
        halves
            .iter()
            .map(|halves| TargetCell {
                wanted: Some(Mosaic::halves(*halves)),
                shown: Some(Mosaic::plain(TerminalColor::Ground)),
            })
            .collect()
    }

    fn start(fg: TerminalColor, bg: TerminalColor) -> RowStart {
        RowStart { fg, bg, is_there: true }
    }

    #[test]
    fn the_pen_is_turned_once_and_blanks_are_preferred() {
        let found = row(
            &wanted(&[[RED, RED], [RED, RED], [BLACK, RED]]),
            start(BLACK, TerminalColor::Ground),
            CostModel::EXACT,
        );
        let glyphs: Vec<Glyph> = found.dabs.iter().map(|dab| dab.glyph).collect();
        assert_eq!(glyphs, [Glyph::Blank, Glyph::Blank, Glyph::First]);
        // ESC [ 48;2;200;0;0 m and the glyphs.
        assert_eq!(found.bytes, 3 + 12 + 1 + 1 + 3);
    }

    #[test]
    fn what_is_shown_is_left_and_jumped_over() {
        let mut targets = wanted(&[[RED, BLACK]; 9]);
        for target in &mut targets[1..8] {
            target.shown = Some(Mosaic::halves([RED, TerminalColor::Rgb([1, 1, 1])]));
        }
        let found = row(&targets, start(RED, BLACK), CostModel::EXACT);
        let columns: Vec<usize> = found.dabs.iter().map(|dab| dab.column).collect();
        assert_eq!((columns, found.bytes), (vec![0, 8], 3 + 4 + 3));
        // A gap of one cell is drawn again, which is no longer than a jump and leaves it nearer to what is wanted.
        let found = row(&[targets[0], targets[1], targets[8]], start(RED, BLACK), CostModel::EXACT);
        assert_eq!((found.dabs.len(), found.bytes), (3, 9));
    }

    #[test]
    fn colors_that_only_one_layer_has_are_shown_by_it() {
        for halves in [
            [RED, TerminalColor::Ground],
            [TerminalColor::Ground, RED],
            [TerminalColor::Ink, TerminalColor::Ground],
            [TerminalColor::Ink; 2],
        ] {
            let targets = [TargetCell { wanted: Some(Mosaic::halves(halves)), shown: None }];
            let found = row(&targets, start(BLACK, BLACK), CostModel::MOVING);
            assert_eq!(found.dabs.first().map(|dab| dab.mosaic.pair), Some(halves));
        }
    }

    fn shade() -> impl Strategy<Value = TerminalColor> {
        prop_oneof![
            4 => (0..4_u8, 0..4_u8).prop_map(|(r, g)| TerminalColor::Rgb([98 + r, 8 + g, 250])),
            2 => any::<[u8; 3]>().prop_map(TerminalColor::Rgb),
            1 => any::<u8>().prop_map(TerminalColor::Palette),
            1 => Just(TerminalColor::Ground),
        ]
    }

    fn mosaic() -> impl Strategy<Value = Mosaic> {
        let tile = prop_oneof![
            3 => Just(Tile::HALVES),
            1 => proptest::sample::select(vec!['▌', '▚', '░', '▒', '🬟', '\u{1CD10}'])
                .prop_map(|symbol| of_symbol(symbol).expect("a tile").0),
        ];
        (tile, [shade(), shade()]).prop_map(|(tile, pair)| {
            // As it is read from a character: its first part is in the foreground.
            let is_cell = tile != Tile::MEDIUM || pair[0] != TerminalColor::Ground;
            Mosaic::new(if is_cell { tile } else { Tile::HALVES }, pair)
        })
    }

    proptest! {
        #[test]
        fn every_cell_comes_near_enough(
            cells in proptest::collection::vec(
                (proptest::option::weighted(0.9, mosaic()), proptest::option::of(mosaic())),
                1..40,
            ),
            is_exact in any::<bool>(),
        ) {
            let targets: Vec<TargetCell> = cells.iter().map(|(wanted, shown)| TargetCell { wanted: *wanted, shown: *shown }).collect();
            let model = if is_exact { CostModel::EXACT } else { CostModel::MOVING };
            let found = row(&targets, start(TerminalColor::Ink, TerminalColor::Ground), model);
            let mut screen: Vec<Option<Mosaic>> = targets.iter().map(|target| target.shown).collect();
            for dab in &found.dabs {
                prop_assert!(targets[dab.column].wanted.is_some(), "a cell of another's");
                prop_assert!(dab.glyph.shows(dab.mosaic.pair));
                screen[dab.column] = Some(dab.mosaic);
            }
            for (shown, target) in screen.iter().zip(&targets) {
                let Some(wanted) = target.wanted else { continue };
                let shown = shown.expect("a cell that was unknown is drawn");
                for (shown, wanted, part) in shown.against(wanted) {
                    // More than that in one channel is worth any bytes.
                    let most = if is_exact { 3.0 } else { CostModel::MOVING.byte * 120.0 };
                    prop_assert!(part * model.error(shown, wanted) <= most);
                }
            }
        }
    }
}
