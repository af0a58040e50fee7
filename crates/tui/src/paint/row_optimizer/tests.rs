use proptest::prelude::*;

use super::*;
use crate::mosaic::TwoPartBlockPattern;
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
        RateDistortionParameters::EXACT,
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
    let found = plan_row(&targets, start(RED, BLACK), RateDistortionParameters::EXACT);
    let columns: Vec<usize> = found.ops.iter().map(|op| op.column).collect();
    assert_eq!((columns, found.bytes), (vec![0, 8], 3 + 4 + 3));
    // A one-cell gap is redrawn, because this takes no more bytes than moving the cursor and is more
    // accurate.
    let found =
        plan_row(&[targets[0], targets[1], targets[8]], start(RED, BLACK), RateDistortionParameters::EXACT);
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
        let found = plan_row(&targets, start(BLACK, BLACK), RateDistortionParameters::MOVING);
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
        let model = if is_exact { RateDistortionParameters::EXACT } else { RateDistortionParameters::MOVING };
        let found = plan_row(&targets, start(TerminalColor::DefaultForeground, TerminalColor::DefaultBackground), model);
        let mut screen: Vec<Option<TwoPartColorCell>> = targets.iter().map(|target| target.shown).collect();
        for op in &found.ops {
            prop_assert!(targets[op.column].wanted.is_some(), "not part of the preview");
            prop_assert!(op.glyph.can_represent_color_pair(op.mosaic.pair));
            screen[op.column] = Some(op.mosaic);
        }
        for (shown, target) in screen.iter().zip(&targets) {
            let Some(wanted) = target.wanted else { continue };
            let shown = shown.expect("unknown cells should be drawn");
            for (shown, wanted, part) in shown.color_overlaps_with(wanted) {
                let error = model.squared_color_error(shown, wanted);
                if is_exact {
                    prop_assert!(error <= 3.0, "a channel differs by more than 1");
                } else {
                    // Larger errors in a single channel should be avoided at any cost.
                    prop_assert!(part * error <= RateDistortionParameters::MOVING.byte * 120.0);
                }
            }
        }
    }
}
