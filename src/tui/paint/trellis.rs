//! The cheapest way through a row of the picture.
//!
//! A cell can be left as it is or be drawn: by one of four glyphs, with the pen as it is or with one or both of its
//! colours changed. What that costs depends on the pen and on where the cursor was left, so that the best way
//! to a cell is kept for each of a few pens (a beam search of Viterbi's trellis), and the cheapest end is traced back.

use super::candidates::{Candidates, candidates};
use super::look::Glyph;
use super::shade::{Layer, Shade, digits};
use super::taste::Taste;

/// Ways that are kept from cell to cell.
const BEAM: usize = 5;
/// Bytes after which any pen is any other one anywhere: what is this much worse than the best never wins.
const MOST_BYTES: f32 = 46.0;

/// A cell of the row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    /// None: the cell is not of the picture.
    pub(super) wanted: Option<[Shade; 2]>,
    /// None: nothing that could stay.
    pub(super) shown: Option<[Shade; 2]>,
}

/// Where a row begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub(super) fg: Shade,
    pub(super) bg: Shade,
    /// Whether the cursor is at the first cell.
    pub(super) is_there: bool,
}

/// One cell drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dab {
    /// Counted from the first target.
    pub(super) column: usize,
    pub(super) glyph: Glyph,
    pub(super) halves: [Shade; 2],
}

/// A way through the row up to a cell.
#[derive(Clone, Copy, Debug)]
struct Way {
    fg: Shade,
    bg: Shade,
    /// Both colours as one number.
    pen: u64,
    gap: Gap,
    bytes: u32,
    /// Bytes and errors.
    cost: f32,
    /// Of the ways to the cell before.
    parent: usize,
    /// None: the cell was left.
    glyph: Option<Glyph>,
}

/// Two colours as one number.
fn pen(fg: Shade, bg: Shade) -> u64 {
    u64::from(fg.number()) << 32 | u64::from(bg.number())
}

/// Cells between the cursor and the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Gap {
    /// The cursor is in another row.
    Far,
    Cells(u8),
}

impl Gap {
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

/// What is drawn in a row.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) dabs: Vec<Dab>,
    pub(super) bytes: u32,
}

/// What leads through the row at the least cost.
pub(super) fn row(targets: &[Target], start: Start, taste: Taste) -> Row {
    let gap = if start.is_there { Gap::Cells(0) } else { Gap::Far };
    let Start { fg, bg, .. } = start;
    let first = Way { fg, bg, pen: pen(fg, bg), gap, bytes: 0, cost: 0.0, parent: 0, glyph: None };
    let mut ways = vec![vec![first]];
    let wanted: Vec<_> = targets.iter().map(|target| target.wanted).collect();
    for (column, target) in targets.iter().enumerate() {
        let last = &ways[column];
        ways.push(step(last, *target, &wanted[column..], taste));
    }
    trace(&ways)
}

/// The ways on to the next cell.
fn step(last: &[Way], target: Target, wanted: &[Option<[Shade; 2]>], taste: Taste) -> Vec<Way> {
    let mut beam = Beam { ways: Vec::with_capacity(BEAM), limit: MOST_BYTES * taste.byte };
    let leave = match (target.wanted, target.shown) {
        (None, _) => 0.0,
        (Some(wanted), Some(shown)) => taste.error(shown[0], wanted[0]) + taste.error(shown[1], wanted[1]),
        (Some(_), None) => f32::INFINITY,
    };
    if leave.is_finite() {
        for (parent, way) in last.iter().enumerate() {
            beam.add(Way { gap: way.gap.wider(), cost: way.cost + leave, parent, glyph: None, ..*way });
        }
    }
    let Some(halves) = target.wanted else { return beam.ways };
    // What is near enough is not worth a new colour, but may be drawn again instead of jumped over.
    let changes = if leave <= taste.byte { Candidates::default() } else { candidates(wanted, taste) };
    let changes = Changes::new(&changes, halves, taste);
    for (parent, way) in last.iter().enumerate() {
        changes.turn_one(parent, way, &mut beam);
    }
    // Where both colours are set, nothing is left of the pen: the cheapest way goes on.
    let base = |way: &Way| way.cost + way.gap.bytes() as f32 * taste.byte;
    if let Some((parent, way)) = last.iter().enumerate().min_by(|(_, a), (_, b)| base(a).total_cmp(&base(b)))
    {
        changes.turn_both(parent, way, &mut beam);
    }
    beam.ways
}

/// The best ways so far.
struct Beam {
    ways: Vec<Way>,
    /// Ways that cost this much more than the best are not kept.
    limit: f32,
}

impl Beam {
    fn add(&mut self, way: Way) {
        let is_same = |other: &Way| other.pen == way.pen && other.gap == way.gap;
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

/// A colour that may be set at a cell, with what follows.
#[derive(Clone, Copy)]
struct Change {
    shade: Shade,
    /// Of the parameters of SGR.
    bytes: u32,
    /// In the upper and the lower half.
    errors: [f32; 2],
}

/// What may be drawn at a cell.
struct Changes {
    halves: [Shade; 2],
    taste: Taste,
    all: Vec<Change>,
    /// So many of them are for the upper half, and up to here for the lower one.
    upper: usize,
    lower: usize,
}

impl Changes {
    fn new(candidates: &Candidates, halves: [Shade; 2], taste: Taste) -> Self {
        let change = |shade: &Shade| Change {
            shade: *shade,
            bytes: shade.length(),
            errors: halves.map(|half| taste.error(*shade, half)),
        };
        let Candidates { upper, lower, both } = candidates;
        let all = upper.iter().chain(lower).chain(both).map(change).collect();
        Self { halves, taste, all, upper: upper.len(), lower: upper.len() + lower.len() }
    }

    /// The ways to draw the cell at the end of a way to it, with the pen as it is or with one other colour. A colour for
    /// one half is shown in that one.
    fn turn_one(&self, parent: usize, way: &Way, beam: &mut Beam) {
        let mut ends = End::new(self, parent, way, beam);
        if !ends.is_near() {
            return;
        }
        let errors = |shade| self.halves.map(|half| self.taste.error(shade, half));
        let pen = Ends { fg: way.fg, fg_errors: errors(way.fg), bg: way.bg, bg_errors: errors(way.bg) };
        for glyph in Glyph::ALL {
            ends.add(pen, 0, glyph);
        }
        for (index, change) in self.all.iter().enumerate() {
            let bytes = change.bytes + 3;
            let (as_fg, as_bg) = match index {
                _ if index < self.upper => (Glyph::Upper, Glyph::Lower),
                _ if index < self.lower => (Glyph::Lower, Glyph::Upper),
                _ => (Glyph::Full, Glyph::Blank),
            };
            if change.shade.fits(Layer::Foreground) {
                ends.add(pen.with_fg(change), bytes, as_fg);
            }
            if change.shade.fits(Layer::Background) {
                ends.add(pen.with_bg(change), bytes, as_bg);
            }
        }
    }

    /// The same with both colours.
    fn turn_both(&self, parent: usize, way: &Way, beam: &mut Beam) {
        let mut ends = End::new(self, parent, way, beam);
        for upper in &self.all[..self.upper] {
            for lower in &self.all[self.upper..self.lower] {
                let bytes = upper.bytes + lower.bytes + 4;
                for (fg, bg, glyph) in [(upper, lower, Glyph::Upper), (lower, upper, Glyph::Lower)] {
                    if fg.shade.fits(Layer::Foreground) && bg.shade.fits(Layer::Background) {
                        ends.add(Ends::of(fg, bg), bytes, glyph);
                    }
                }
            }
        }
    }
}

/// Ways on from the end of one.
struct End<'a> {
    parent: usize,
    /// With those that lead to the cell.
    bytes: u32,
    /// Of the cells before.
    error: f32,
    /// The price of a byte.
    byte: f32,
    beam: &'a mut Beam,
    /// Of the beam.
    bound: f32,
}

impl<'a> End<'a> {
    fn new(changes: &Changes, parent: usize, way: &Way, beam: &'a mut Beam) -> Self {
        let byte = changes.taste.byte;
        let error = way.cost - way.bytes as f32 * byte;
        let bound = beam.bound();
        Self { parent, bytes: way.bytes + way.gap.bytes(), error, byte, beam, bound }
    }

    /// Whether anything that is drawn here can be worth a look.
    fn is_near(&self) -> bool {
        (self.bytes + 1) as f32 * self.byte + self.error < self.bound
    }

    fn add(&mut self, ends: Ends, sgr: u32, glyph: Glyph) {
        let bytes = self.bytes + sgr + glyph.symbol().len() as u32;
        let cost = bytes as f32 * self.byte + self.error + ends.error(glyph);
        if cost < self.bound {
            let Ends { fg, bg, .. } = ends;
            let parent = self.parent;
            let (pen, gap, glyph) = (pen(fg, bg), Gap::Cells(0), Some(glyph));
            self.beam.add(Way { fg, bg, pen, gap, bytes, cost, parent, glyph });
            self.bound = self.beam.bound();
        }
    }
}

/// A pen, and the errors of its colours in the halves of a cell.
#[derive(Clone, Copy)]
struct Ends {
    fg: Shade,
    fg_errors: [f32; 2],
    bg: Shade,
    bg_errors: [f32; 2],
}

impl Ends {
    fn of(fg: &Change, bg: &Change) -> Self {
        Self { fg: fg.shade, fg_errors: fg.errors, bg: bg.shade, bg_errors: bg.errors }
    }

    fn with_fg(self, change: &Change) -> Self {
        Self { fg: change.shade, fg_errors: change.errors, ..self }
    }

    fn with_bg(self, change: &Change) -> Self {
        Self { bg: change.shade, bg_errors: change.errors, ..self }
    }

    fn error(&self, glyph: Glyph) -> f32 {
        let of = |half: usize| match glyph.layers()[half] {
            Layer::Foreground => self.fg_errors[half],
            Layer::Background => self.bg_errors[half],
        };
        of(0) + of(1)
    }
}

/// The cheapest way back from the last cell.
fn trace(ways: &[Vec<Way>]) -> Row {
    let last = ways.last().into_iter().flatten().enumerate();
    let best = last.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let (mut index, bytes) = best.map_or((0, 0), |(index, way)| (index, way.bytes));
    let mut dabs = Vec::new();
    for (column, ways) in ways.iter().enumerate().skip(1).rev() {
        let Some(way) = ways.get(index) else { break };
        if let Some(glyph) = way.glyph {
            let halves = glyph.layers().map(|layer| match layer {
                Layer::Foreground => way.fg,
                Layer::Background => way.bg,
            });
            dabs.push(Dab { column: column - 1, glyph, halves });
        }
        index = way.parent;
    }
    dabs.reverse();
    Row { dabs, bytes }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const BLACK: Shade = Shade::Rgb([0, 0, 0]);
    const RED: Shade = Shade::Rgb([200, 0, 0]);

    fn wanted(halves: &[[Shade; 2]]) -> Vec<Target> {
        halves
            .iter()
            .map(|halves| Target { wanted: Some(*halves), shown: Some([Shade::Ground; 2]) })
            .collect()
    }

    fn start(fg: Shade, bg: Shade) -> Start {
        Start { fg, bg, is_there: true }
    }

    #[test]
    fn the_pen_is_turned_once_and_blanks_are_preferred() {
        let found =
            row(&wanted(&[[RED, RED], [RED, RED], [BLACK, RED]]), start(BLACK, Shade::Ground), Taste::EXACT);
        let glyphs: Vec<Glyph> = found.dabs.iter().map(|dab| dab.glyph).collect();
        assert_eq!(glyphs, [Glyph::Blank, Glyph::Blank, Glyph::Upper]);
        // ESC [ 48;2;200;0;0 m and the glyphs.
        assert_eq!(found.bytes, 3 + 12 + 1 + 1 + 3);
    }

    #[test]
    fn what_is_shown_is_left_and_jumped_over() {
        let mut targets = wanted(&[[RED, BLACK]; 9]);
        for target in &mut targets[1..8] {
            target.shown = Some([RED, Shade::Rgb([1, 1, 1])]);
        }
        let found = row(&targets, start(RED, BLACK), Taste::EXACT);
        let columns: Vec<usize> = found.dabs.iter().map(|dab| dab.column).collect();
        assert_eq!((columns, found.bytes), (vec![0, 8], 3 + 4 + 3));
        // A gap of one cell is drawn again, which is no longer than a jump and leaves it nearer to what is wanted.
        let found = row(&[targets[0], targets[1], targets[8]], start(RED, BLACK), Taste::EXACT);
        assert_eq!((found.dabs.len(), found.bytes), (3, 9));
    }

    #[test]
    fn colours_that_only_one_layer_has_are_shown_by_it() {
        for halves in
            [[RED, Shade::Ground], [Shade::Ground, RED], [Shade::Ink, Shade::Ground], [Shade::Ink; 2]]
        {
            let targets = [Target { wanted: Some(halves), shown: None }];
            let found = row(&targets, start(BLACK, BLACK), Taste::MOVING);
            assert_eq!(found.dabs.first().map(|dab| dab.halves), Some(halves));
        }
    }

    fn shade() -> impl Strategy<Value = Shade> {
        prop_oneof![
            4 => (0..4_u8, 0..4_u8).prop_map(|(r, g)| Shade::Rgb([98 + r, 8 + g, 250])),
            2 => any::<[u8; 3]>().prop_map(Shade::Rgb),
            1 => any::<u8>().prop_map(Shade::Palette),
            1 => Just(Shade::Ground),
        ]
    }

    proptest! {
        #[test]
        fn every_cell_comes_near_enough(
            cells in proptest::collection::vec(
                (proptest::option::weighted(0.9, [shade(), shade()]), proptest::option::of([shade(), shade()])),
                1..40,
            ),
            is_exact in any::<bool>(),
        ) {
            let targets: Vec<Target> = cells.iter().map(|(wanted, shown)| Target { wanted: *wanted, shown: *shown }).collect();
            let taste = if is_exact { Taste::EXACT } else { Taste::MOVING };
            let found = row(&targets, start(Shade::Ink, Shade::Ground), taste);
            let mut screen: Vec<Option<[Shade; 2]>> = targets.iter().map(|target| target.shown).collect();
            for dab in &found.dabs {
                prop_assert!(targets[dab.column].wanted.is_some(), "a cell of another's");
                prop_assert!(dab.glyph.shows(dab.halves));
                screen[dab.column] = Some(dab.halves);
            }
            for (shown, target) in screen.iter().zip(&targets) {
                let Some(wanted) = target.wanted else { continue };
                let shown = shown.expect("a cell that was unknown is drawn");
                for (shown, wanted) in shown.iter().zip(wanted) {
                    // More than that in one channel is worth any bytes.
                    let most = if is_exact { 3.0 } else { Taste::MOVING.byte * 120.0 };
                    prop_assert!(taste.error(*shown, wanted) <= most);
                }
            }
        }
    }
}
