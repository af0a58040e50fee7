//! Tests byte counts for whole previews and edits, and text drawn over previews.

use super::*;

/// A window with a preview and a row of text below it.
fn preview_window(columns: u16, rows: u16, pixel: impl Fn(u16, u16) -> [u8; 3]) -> (Buffer, Rect) {
    let picture = Rect::new(1, 0, columns, rows);
    let mut buffer = Buffer::empty(Rect::new(0, 0, columns + 6, rows + 1));
    buffer.set_string(0, rows, "words", ratatui::style::Style::new());
    let color = |x, y| {
        let [r, g, b] = pixel(x, y);
        Color::Rgb(r, g, b)
    };
    for y in 0..rows {
        for x in 0..columns {
            buffer[(x + 1, y)].set_symbol("▀").set_fg(color(x, 2 * y)).set_bg(color(x, 2 * y + 1));
        }
    }
    (buffer, picture)
}

/// A hash of the position and seed.
fn noise(x: u16, y: u16, seed: u32) -> u8 {
    let mut hash = u32::from(x).wrapping_mul(0x9E37_79B1)
        ^ u32::from(y).wrapping_mul(0x85EB_CA77)
        ^ seed.wrapping_mul(0xC2B2_AE3D);
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D);
    hash = (hash ^ (hash >> 12)).wrapping_mul(0x297A_2D39);
    (hash ^ (hash >> 15)) as u8
}

/// A smooth image with noise of ±`grain` code values.
fn noisy_pixel(x: u16, y: u16, seed: u32, grain: i32) -> [u8; 3] {
    let smooth = [40 + i32::from(x) * 2, 90 + i32::from(y), 200 - i32::from(x + y)];
    let mut seed = seed;
    smooth.map(|channel| {
        seed += 1;
        let step = i32::from(noise(x, y, seed)) % (2 * grain + 1) - grain;
        u8::try_from((channel + step).clamp(0, 255)).expect("a byte")
    })
}

const SIDE: (u16, u16) = (60, 24);
const CELLS: usize = SIDE.0 as usize * SIDE.1 as usize;

fn showing(buffer: &Buffer, picture: Rect, fidelity: PreviewFidelity) -> TestTerminal {
    let mut test = TestTerminal::new(buffer.area.width, buffer.area.height, ColorDepth::TrueColor);
    test.painter.set_target(buffer, picture, fidelity);
    test.finish(4096);
    test
}

#[test]
fn first_preview_fits_in_12_bytes_per_cell() {
    for (grain, most) in [(0, 16), (5, 30), (20, 120), (60, 255), (255, 255)] {
        let (buffer, picture) = preview_window(SIDE.0, SIDE.1, |x, y| noisy_pixel(x, y, 1, grain));
        let test = showing(&buffer, picture, PreviewFidelity::First);
        // Allow for clearing the screen and drawing the text.
        let others = 40;
        assert!(test.sent <= 12 * CELLS + others, "grain {grain}: {} bytes per cell", test.sent / CELLS);
        let largest = test.difference(&buffer, ColorDepth::TrueColor);
        assert!(largest <= most, "grain {grain}: difference {largest}");
    }
}

#[test]
fn noise_below_threshold_causes_no_output() {
    let (buffer, picture) = preview_window(SIDE.0, SIDE.1, |x, y| noisy_pixel(x, y, 1, 0));
    let mut test = showing(&buffer, picture, PreviewFidelity::Still);
    for seed in 2..6 {
        let (noisy, _) = preview_window(SIDE.0, SIDE.1, |x, y| noisy_pixel(x, y, seed, 2));
        test.painter.set_target(&noisy, picture, PreviewFidelity::Moving);
        assert_eq!(test.finish(4096), 0);
    }
    test.painter.set_target(&buffer, picture, PreviewFidelity::Still);
    assert_eq!(test.finish(4096), 0, "the cells should still be exact");
}

/// The cells changed by the edit.
const CHANGED: Rect = Rect { x: 21, y: 6, width: 12, height: 6 };

fn edited(x: u16, y: u16, seed: u32, grain: i32, is_edited: bool) -> [u8; 3] {
    let [r, g, b] = noisy_pixel(x, y, seed, grain);
    if is_edited && CHANGED.contains((x + 1, y / 2).into()) { [b, g / 2, r] } else { [r, g, b] }
}

#[test]
fn unedited_cells_are_not_redrawn() {
    let picture_of =
        |seed, grain, is_edited| preview_window(SIDE.0, SIDE.1, |x, y| edited(x, y, seed, grain, is_edited));
    let (first, picture) = picture_of(1, 40, false);
    let mut test = showing(&first, picture, PreviewFidelity::First);
    test.painter.set_target(&picture_of(9, 0, false).0, picture, PreviewFidelity::Still);
    test.finish(4096);
    let before: Vec<CellContent> = on_screen(&test, picture);

    // The same noise at one sample, followed by decreasing amounts of different noise.
    let mut sent = 0;
    for (seed, grain, fidelity) in [
        (1, 40, PreviewFidelity::First),
        (2, 8, PreviewFidelity::Moving),
        (3, 4, PreviewFidelity::Moving),
        (9, 0, PreviewFidelity::Still),
    ] {
        let (buffer, _) = picture_of(seed, grain, true);
        test.painter.set_target(&buffer, picture, fidelity);
        sent += test.finish(4096);
        for (i, (old, new)) in before.iter().zip(on_screen(&test, picture)).enumerate() {
            let (x, y) = (i as u16 % picture.width + picture.x, i as u16 / picture.width + picture.y);
            assert!(CHANGED.contains((x, y).into()) || *old == new, "{x},{y} at {fidelity:?}");
        }
    }
    assert_eq!(test.difference(&picture_of(9, 0, true).0, ColorDepth::TrueColor).max(1), 1);
    let cells = usize::from(CHANGED.width * CHANGED.height);
    assert!(sent <= 100 * cells, "{} bytes per cell", sent / cells);

    // Undo the edit while its result is on the screen.
    test.painter.set_target(&first, picture, PreviewFidelity::First);
    test.finish(4096);
    for (i, (old, new)) in before.iter().zip(on_screen(&test, picture)).enumerate() {
        let (x, y) = (i as u16 % picture.width + picture.x, i as u16 / picture.width + picture.y);
        assert!(CHANGED.contains((x, y).into()) || *old == new, "{x},{y} after undoing the edit");
    }
    let changed_back = on_screen(&test, CHANGED);
    test.painter.set_target(&picture_of(9, 0, true).0, picture, PreviewFidelity::Still);
    test.finish(4096);
    assert_ne!(changed_back, on_screen(&test, CHANGED), "the edit should be undone on the screen");
}

fn on_screen(test: &TestTerminal, area: Rect) -> Vec<CellContent> {
    let places = (area.top()..area.bottom()).flat_map(|y| (area.left()..area.right()).map(move |x| (x, y)));
    places.map(|(x, y)| cell_content(test.terminal.screen().cell(y, x).expect("a cell"))).collect()
}

#[test]
fn all_rows_are_drawn_despite_frequent_targets() {
    let picture_of = |seed| preview_window(SIDE.0, SIDE.1, |x, y| noisy_pixel(x, y, seed, 60));
    let mut test = TestTerminal::new(SIDE.0 + 6, SIDE.1 + 1, ColorDepth::TrueColor);
    for seed in 0..16 {
        let (buffer, picture) = picture_of(seed);
        test.painter.set_target(
            &buffer,
            picture,
            if seed == 0 { PreviewFidelity::First } else { PreviewFidelity::Moving },
        );
        // Enough bytes for about three rows at this noise level.
        test.slice(3 * 40 * usize::from(SIDE.0));
    }
    let contents = on_screen(&test, Rect::new(1, 0, SIDE.0, SIDE.1));
    let blank = contents.iter().filter(|look| **look == CellContent::BLANK).count();
    assert_eq!(blank, 0, "some cells were never drawn");
}

#[test]
fn changing_text_does_not_delay_the_preview() {
    let (mut buffer, picture) = preview_window(SIDE.0, SIDE.1, |x, y| noisy_pixel(x, y, 1, 5));
    let whole = showing(&buffer, picture, PreviewFidelity::First).sent;
    let mut test = TestTerminal::new(SIDE.0 + 6, SIDE.1 + 1, ColorDepth::TrueColor);
    for step in 0..40 {
        buffer.set_string(0, SIDE.1, format!("{step:02}"), ratatui::style::Style::new());
        test.painter.set_target(&buffer, picture, PreviewFidelity::First);
        test.slice(whole / 20);
    }
    test.finish(4096);
    assert!(test.sent < whole + 40 * 80, "{} bytes instead of {whole}", test.sent);
    let contents = on_screen(&test, picture);
    assert!(!contents.contains(&CellContent::BLANK), "some cells were never drawn");
}

#[test]
fn preview_is_restored_when_text_disappears() {
    let (buffer, picture) = preview_window(SIDE.0, SIDE.1, |x, y| noisy_pixel(x, y, 1, 5));
    let mut test = showing(&buffer, picture, PreviewFidelity::Still);
    let mut covered = buffer.clone();
    covered.set_string(8, 4, "日本 x", ratatui::style::Style::reset());
    for wanted in [&covered, &buffer] {
        test.painter.set_target(wanted, picture, PreviewFidelity::Still);
        assert!(test.finish(4096) < 400);
        assert!(test.difference(wanted, ColorDepth::TrueColor) <= 1);
    }
}
