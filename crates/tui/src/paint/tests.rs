//! Tests that a terminal shows the target after processing the painter's slices.

use proptest::prelude::*;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Modifier};

use super::cell::CellContent;
use super::target_screen::buffer_cell_contents;
use super::terminal_color::TerminalColor;
use super::*;

mod previews;

/// A painter and the terminal it draws on.
struct TestTerminal {
    painter: Painter,
    terminal: vt100::Parser,
    sent: usize,
}

impl TestTerminal {
    fn new(columns: u16, rows: u16, depth: ColorDepth) -> Self {
        Self::repeating(columns, rows, depth, false)
    }

    fn repeating(columns: u16, rows: u16, depth: ColorDepth, can_repeat: bool) -> Self {
        let side = |length| std::num::NonZero::new(length).expect("not zero");
        let terminal = vt100::Parser::new(side(rows), side(columns), 0);
        Self { painter: Painter::new(depth).with_repeat_support(can_repeat), terminal, sent: 0 }
    }

    /// Sends one slice. Returns false if there was nothing to send.
    fn slice(&mut self, max_bytes: usize) -> bool {
        let bytes = self.painter.next_slice(max_bytes);
        // A single cell may need a cursor move, a pen with all modifiers, and a symbol.
        assert!(bytes.len() <= max_bytes.max(96), "{} bytes sent, limit {max_bytes}", bytes.len());
        self.terminal.process(&bytes);
        self.sent += bytes.len();
        !bytes.is_empty()
    }

    /// Sends all remaining bytes and returns their number.
    fn finish(&mut self, max_bytes: usize) -> usize {
        let before = self.sent;
        while self.slice(max_bytes) {}
        self.sent - before
    }

    /// The largest channel difference between the screen and a buffer. Panics if anything but preview colors
    /// differs.
    fn difference(&self, wanted: &Buffer, depth: ColorDepth) -> u32 {
        let mut largest = 0;
        let contents = buffer_cell_contents(wanted, depth);
        for (i, look) in contents.iter().enumerate() {
            let (x, y) = (i as u16 % wanted.area.width, i as u16 / wanted.area.width);
            let cell = self.terminal.screen().cell(y, x).expect("a cell");
            match (look, cell_content(cell)) {
                (CellContent::Mosaic(a), CellContent::Mosaic(b)) => {
                    for (a, b, _) in a.color_overlaps_with(b) {
                        largest =
                            largest.max(distance(a, b).unwrap_or_else(|| panic!("{x},{y}: {a:?} {b:?}")));
                    }
                }
                (a, b) => assert_eq!(a, &b, "{x},{y}"),
            }
        }
        largest
    }
}

/// The largest channel difference. `None` if the colors cannot be compared.
fn distance(a: TerminalColor, b: TerminalColor) -> Option<u32> {
    if a == b {
        return Some(0);
    }
    let (a, b) = (a.to_rgb()?, b.to_rgb()?);
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b))).max()
}

/// The content of a terminal cell. The vt100 crate supports only some modifiers.
fn cell_content(cell: &vt100::Cell) -> CellContent {
    if cell.is_wide_continuation() {
        return CellContent::Covered;
    }
    let mut as_buffer = ratatui::buffer::Cell::default();
    let color = |color| match color {
        vt100::Color::Default => Color::Reset,
        vt100::Color::Idx(index) => Color::Indexed(index),
        vt100::Color::Rgb(r, g, b) => Color::Rgb(r, g, b),
    };
    as_buffer.set_symbol(if cell.has_contents() { cell.contents() } else { " " });
    as_buffer.set_fg(color(cell.fgcolor())).set_bg(color(cell.bgcolor()));
    for (modifier, is_on) in [
        (Modifier::BOLD, cell.bold()),
        (Modifier::DIM, cell.dim()),
        (Modifier::ITALIC, cell.italic()),
        (Modifier::UNDERLINED, cell.underline()),
        (Modifier::REVERSED, cell.inverse()),
    ] {
        as_buffer.modifier.set(modifier, is_on);
    }
    CellContent::from_cell(&as_buffer, ColorDepth::TrueColor)
}

const COLUMNS: u16 = 24;
const ROWS: u16 = 8;
const PICTURE: Rect = Rect { x: 3, y: 1, width: 17, height: 6 };

/// A cell's symbol, colors and modifiers.
#[derive(Clone, Debug)]
struct CellStyle {
    symbol: &'static str,
    fg: Color,
    bg: Color,
    modifier: Modifier,
}

fn color() -> impl Strategy<Value = Color> {
    prop_oneof![
        Just(Color::Reset),
        Just(Color::Red),
        Just(Color::White),
        (0..=255_u8).prop_map(Color::Indexed),
        any::<[u8; 3]>().prop_map(|[r, g, b]| Color::Rgb(r, g, b)),
        // A few similar colors.
        (0..3_u8, 0..3_u8).prop_map(|(r, g)| Color::Rgb(98 + r, 8 + g, 250)),
    ]
}

fn ink() -> impl Strategy<Value = CellStyle> {
    let symbol = prop_oneof![
        4 => Just("▀"),
        2 => Just(" "),
        1 => proptest::sample::select(vec!["▄", "█", "▚", "🬟", "░", "▒", "▓", "a", "B", "…", "━", "日", "한", "e\u{301}", "", "\t"]),
    ];
    let modifier = prop_oneof![
        5 => Just(Modifier::empty()),
        1 => proptest::sample::select(vec![
            Modifier::BOLD,
            Modifier::DIM,
            Modifier::UNDERLINED | Modifier::ITALIC,
            Modifier::REVERSED | Modifier::BOLD,
        ]),
    ];
    (symbol, color(), color(), modifier).prop_map(|(symbol, fg, bg, modifier)| CellStyle {
        symbol,
        fg,
        bg,
        modifier,
    })
}

fn buffer() -> impl Strategy<Value = Buffer> {
    let cells = usize::from(COLUMNS) * usize::from(ROWS);
    // Use few distinct cells so that neighbors are often equal.
    (proptest::collection::vec(ink(), 1..12), proptest::collection::vec(any::<u8>(), cells)).prop_map(
        |(inks, choice)| {
            let mut buffer = Buffer::empty(Rect::new(0, 0, COLUMNS, ROWS));
            for (cell, choice) in buffer.content.iter_mut().zip(choice) {
                let ink = &inks[usize::from(choice) % inks.len()];
                cell.set_symbol(ink.symbol).set_fg(ink.fg).set_bg(ink.bg);
                cell.modifier = ink.modifier;
            }
            buffer
        },
    )
}

fn depth() -> impl Strategy<Value = ColorDepth> {
    proptest::sample::select(vec![
        ColorDepth::TrueColor,
        ColorDepth::Indexed256,
        ColorDepth::Ansi16,
        ColorDepth::None,
    ])
}

fn fidelity() -> impl Strategy<Value = PreviewFidelity> {
    proptest::sample::select(vec![PreviewFidelity::First, PreviewFidelity::Moving, PreviewFidelity::Still])
}

/// A step of a painter test.
#[derive(Clone, Debug)]
enum PainterStep {
    Aim(Buffer, PreviewFidelity),
    Slice(usize),
    Forget,
    /// Another program writes to the screen, and the painter discards its model of the screen.
    Litter,
}

fn step() -> impl Strategy<Value = PainterStep> {
    prop_oneof![
        3 => (buffer(), fidelity()).prop_map(|(buffer, fidelity)| PainterStep::Aim(buffer, fidelity)),
        4 => (0..600_usize).prop_map(PainterStep::Slice),
        1 => Just(PainterStep::Forget),
        1 => Just(PainterStep::Litter),
    ]
}

proptest! {
    #[test]
    fn final_preview_is_exact_after_any_history(
        steps in proptest::collection::vec(step(), 0..12),
        last in buffer(),
        max_bytes in 1..400_usize,
        depth in depth(),
        can_repeat in any::<bool>(),
    ) {
        let mut test = TestTerminal::repeating(COLUMNS, ROWS, depth, can_repeat);
        for step in steps {
            match step {
                PainterStep::Aim(buffer, fidelity) => test.painter.set_target(&buffer, PICTURE, fidelity),
                PainterStep::Slice(max_bytes) => {
                    test.slice(max_bytes);
                }
                PainterStep::Forget => test.painter.invalidate(),
                PainterStep::Litter => {
                    test.terminal.process(b"\x1b[7;31;44mshell$ \x1b[5;5Hx\n\n\n\n\n\n\n");
                    test.painter.invalidate();
                }
            }
        }
        test.painter.set_target(&last, PICTURE, PreviewFidelity::Still);
        test.finish(max_bytes);
        let largest = test.difference(&last, depth);
        prop_assert!(largest <= 1, "{largest}");
        test.painter.set_target(&last, PICTURE, PreviewFidelity::Still);
        prop_assert_eq!(test.finish(max_bytes), 0, "an up-to-date screen should need no bytes");
    }

    #[test]
    fn text_is_exact_at_every_fidelity(buffers in proptest::collection::vec((buffer(), fidelity()), 1..5), depth in depth()) {
        let mut test = TestTerminal::new(COLUMNS, ROWS, depth);
        for (buffer, fidelity) in buffers {
            test.painter.set_target(&buffer, Rect::ZERO, fidelity);
            test.finish(100);
            prop_assert_eq!(test.difference(&buffer, depth), 0);
        }
    }
}

#[test]
fn resize_redraws_the_screen() {
    let mut test = TestTerminal::new(COLUMNS, ROWS, ColorDepth::TrueColor);
    for (columns, rows) in [(COLUMNS, ROWS), (10, 3), (24, 6), (1, 1)] {
        let area = Rect::new(0, 0, columns, rows);
        let mut buffer = Buffer::empty(area);
        buffer.set_string(0, 0, "words", ratatui::style::Style::new());
        test.painter.set_target(&buffer, area, PreviewFidelity::Still);
        test.finish(1000);
        assert_eq!(test.difference(&buffer, ColorDepth::TrueColor), 0);
    }
}

#[test]
fn text_is_drawn_first_then_middle_rows() {
    let area = Rect::new(0, 0, 30, 9);
    let mut buffer = Buffer::empty(area);
    let picture = Rect::new(2, 1, 20, 7);
    for y in picture.top()..picture.bottom() {
        for x in picture.left()..picture.right() {
            buffer[(x, y)]
                .set_symbol("▀")
                .set_fg(Color::Rgb(x as u8 * 9, 200, 9))
                .set_bg(Color::Rgb(9, y as u8, 80));
        }
    }
    buffer.set_string(0, 8, "words", ratatui::style::Style::new());
    buffer.set_string(5, 3, "over_it", ratatui::style::Style::reset());
    let mut test = TestTerminal::new(30, 9, ColorDepth::TrueColor);
    test.painter.set_target(&buffer, picture, PreviewFidelity::Still);
    test.slice(100);
    let row =
        |test: &TestTerminal, y: u16| test.terminal.screen().rows(0, 30).nth(usize::from(y)).expect("a row");
    assert_eq!((row(&test, 8), row(&test, 3)), ("words".to_owned(), "     over_it".to_owned()));
    let mut order = Vec::new();
    while test.slice(100) {
        let is_drawn = |y: &u16| row(&test, *y).ends_with('▀');
        let new: Vec<u16> = (1..8).filter(is_drawn).filter(|y| !order.contains(y)).collect();
        order.extend(new);
    }
    assert_eq!(order, [4, 5, 3, 6, 2, 7, 1]);
}

#[test]
fn painter_without_target_sends_nothing() {
    let mut painter = Painter::new(ColorDepth::TrueColor);
    assert_eq!(painter.next_slice(1000), b"");
    painter.invalidate();
    assert_eq!(painter.next_slice(1000), b"");
}

#[test]
fn character_preview_is_drawn_after_text() {
    let picture = Rect::new(0, 0, 20, 5);
    let mut buffer = Buffer::empty(Rect::new(0, 0, 20, 6));
    for y in 0..5 {
        buffer.set_string(0, y, "  ..::--==++**##%%@@", ratatui::style::Style::new());
    }
    buffer.set_string(0, 5, "words", ratatui::style::Style::new());
    let mut test = TestTerminal::new(20, 6, ColorDepth::None);
    test.painter.set_target(&buffer, picture, PreviewFidelity::Moving);
    let mut order = Vec::new();
    while test.slice(24) {
        let rows: Vec<String> = test.terminal.screen().rows(0, 20).collect();
        let full = |y: &usize| rows[*y].ends_with('@') || rows[*y] == "words";
        let new: Vec<usize> = (0..6).filter(full).filter(|y| !order.contains(y)).collect();
        order.extend(new);
    }
    assert_eq!(order, [5, 2, 3, 1, 4, 0]);
    assert_eq!(test.difference(&buffer, ColorDepth::None), 0);
    assert!(test.sent < 160, "{} bytes sent for 105 characters", test.sent);
}

#[test]
fn long_blanks_are_erased() {
    let area = Rect::new(0, 0, 60, 1);
    let mut full = Buffer::empty(area);
    full.set_string(0, 0, "x".repeat(60), ratatui::style::Style::new());
    let mut test = TestTerminal::new(60, 1, ColorDepth::TrueColor);
    for (text, most) in [("x".repeat(20), 12), (format!("{}{}x", "x".repeat(20), " ".repeat(39)), 16)] {
        test.painter.set_target(&full, Rect::ZERO, PreviewFidelity::Still);
        test.finish(100);
        let mut buffer = Buffer::empty(area);
        buffer.set_string(0, 0, &text, ratatui::style::Style::new());
        test.painter.set_target(&buffer, Rect::ZERO, PreviewFidelity::Still);
        let sent = test.finish(100);
        assert!(sent <= most, "{sent} bytes for {text:?}");
        assert_eq!(test.difference(&buffer, ColorDepth::TrueColor), 0);
    }
}

/// A buffer with text around a preview in which each cell has different colors.
fn with_words() -> Buffer {
    let mut buffer = Buffer::empty(Rect::new(0, 0, COLUMNS, ROWS));
    for place in PICTURE.positions() {
        let color = |seed: u16| Color::Rgb((place.x * 9 + seed) as u8, (place.y * 30) as u8, seed as u8);
        buffer[place].set_symbol("▀").set_fg(color(3)).set_bg(color(90));
    }
    buffer.set_string(0, 0, "now there", ratatui::style::Style::new());
    buffer.set_string(0, 7, "later", ratatui::style::Style::new());
    buffer
}

#[test]
fn delayed_text_is_drawn_after_the_preview() {
    let buffer = with_words();
    let later = Rect { x: 0, y: 7, width: COLUMNS, height: 1 };
    for extras in
        [LinksAndDelayedText { later, ..LinksAndDelayedText::default() }, LinksAndDelayedText::default()]
    {
        let mut test = TestTerminal::new(COLUMNS, ROWS, ColorDepth::TrueColor);
        test.painter.set_target_with_links(&buffer, PICTURE, PreviewFidelity::Still, &extras);
        let mut cells_before = None;
        while test.slice(60) {
            let text = test.terminal.screen().contents();
            let is_drawn = |place: &ratatui::layout::Position| {
                let cell = test.terminal.screen().cell(place.y, place.x).expect("a cell");
                cell.bgcolor() != vt100::Color::Default || cell.fgcolor() != vt100::Color::Default
            };
            if text.contains("later") && cells_before.is_none() {
                cells_before = Some(PICTURE.positions().filter(is_drawn).count() as u32);
            }
        }
        assert_eq!(test.difference(&buffer, ColorDepth::TrueColor), 0);
        let expected = if extras.later.is_empty() { 0 } else { PICTURE.area() };
        assert_eq!(cells_before, Some(expected), "{extras:?}");
    }
}

#[test]
fn hyperlink_covers_only_its_cells() {
    let buffer = with_words();
    let link = |address: &str| LinksAndDelayedText {
        links: vec![Hyperlink {
            cells: Rect { x: 4, y: 0, width: 5, height: 1 },
            address: address.to_owned(),
        }],
        ..LinksAndDelayedText::default()
    };
    let mut painter = Painter::new(ColorDepth::TrueColor);
    let mut sent = |extras: &LinksAndDelayedText| {
        painter.set_target_with_links(&buffer, PICTURE, PreviewFidelity::Still, extras);
        let mut bytes = Vec::new();
        loop {
            let slice = painter.next_slice(100);
            if slice.is_empty() {
                return String::from_utf8(bytes).expect("UTF-8");
            }
            bytes.extend(slice);
        }
    };
    let first = sent(&link("file:///a"));
    let rest = first.split("now \u{1b}]8;;file:///a\u{1b}\\there").nth(1).expect("a hyperlink");
    let (before, _) = rest.split_once("\u{1b}]8;;\u{1b}\\").expect("its end");
    assert!(
        before.chars().all(|c| c.is_ascii_digit() || "\u{1b}[;H".contains(c)),
        "expected only a cursor move: {before:?}"
    );
    assert_eq!(first.matches("file:").count(), 1);
    assert_eq!(sent(&link("file:///a")), "", "unchanged content needs no bytes");
    let other = sent(&link("file:///b"));
    assert!(
        other.contains("file:///b\u{1b}\\") && other.contains("there") && !other.contains("now"),
        "{other:?}"
    );
    let none = sent(&LinksAndDelayedText::default());
    assert!(none.contains("there") && !none.contains("file:"), "{none:?}");
}
