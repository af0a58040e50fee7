//! Whole pictures: the bytes that they and their edits take, and words over them.

use super::*;

/// A picture by its pixels, in a window with a row of words below.
fn pictured(columns: u16, rows: u16, pixel: impl Fn(u16, u16) -> [u8; 3]) -> (Buffer, Rect) {
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

/// Numbers without an order, the same for the same place and seed.
fn noise(x: u16, y: u16, seed: u32) -> u8 {
    let mut hash = u32::from(x).wrapping_mul(0x9E37_79B1)
        ^ u32::from(y).wrapping_mul(0x85EB_CA77)
        ^ seed.wrapping_mul(0xC2B2_AE3D);
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D);
    hash = (hash ^ (hash >> 12)).wrapping_mul(0x297A_2D39);
    (hash ^ (hash >> 15)) as u8
}

/// A smooth picture with noise of this many steps to each side.
fn grainy(x: u16, y: u16, seed: u32, grain: i32) -> [u8; 3] {
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

fn showing(buffer: &Buffer, picture: Rect, fidelity: Fidelity) -> TestTerminal {
    let mut ui = TestTerminal::new(buffer.area.width, buffer.area.height, ColorDepth::TrueColor);
    ui.painter.aim(buffer, picture, fidelity);
    ui.finish(4096);
    ui
}

#[test]
fn a_first_picture_takes_12_bytes_a_cell_whatever_it_shows() {
    for (grain, most) in [(0, 16), (5, 30), (20, 120), (60, 255), (255, 255)] {
        let (buffer, picture) = pictured(SIDE.0, SIDE.1, |x, y| grainy(x, y, 1, grain));
        let ui = showing(&buffer, picture, Fidelity::First);
        // Clearing the screen and the words.
        let others = 40;
        assert!(ui.sent <= 12 * CELLS + others, "grain {grain}: {} bytes a cell", ui.sent / CELLS);
        let largest = ui.difference(&buffer, ColorDepth::TrueColor);
        assert!(largest <= most, "grain {grain}: off by {largest}");
    }
}

#[test]
fn noise_under_the_threshold_is_not_sent() {
    let (buffer, picture) = pictured(SIDE.0, SIDE.1, |x, y| grainy(x, y, 1, 0));
    let mut ui = showing(&buffer, picture, Fidelity::Still);
    for seed in 2..6 {
        let (noisy, _) = pictured(SIDE.0, SIDE.1, |x, y| grainy(x, y, seed, 2));
        ui.painter.aim(&noisy, picture, Fidelity::Moving);
        assert_eq!(ui.finish(4096), 0);
    }
    ui.painter.aim(&buffer, picture, Fidelity::Still);
    assert_eq!(ui.finish(4096), 0, "nothing is to be put right");
}

/// Inside this rectangle of cells the scene of a test changes.
const CHANGED: Rect = Rect { x: 21, y: 6, width: 12, height: 6 };

fn edited(x: u16, y: u16, seed: u32, grain: i32, is_edited: bool) -> [u8; 3] {
    let [r, g, b] = grainy(x, y, seed, grain);
    if is_edited && CHANGED.contains((x + 1, y / 2).into()) { [b, g / 2, r] } else { [r, g, b] }
}

#[test]
fn an_edit_sends_nothing_of_what_it_did_not_change() {
    let picture_of =
        |seed, grain, is_edited| pictured(SIDE.0, SIDE.1, |x, y| edited(x, y, seed, grain, is_edited));
    let (first, picture) = picture_of(1, 40, false);
    let mut ui = showing(&first, picture, Fidelity::First);
    ui.painter.aim(&picture_of(9, 0, false).0, picture, Fidelity::Still);
    ui.finish(4096);
    let before: Vec<CellContent> = on_screen(&ui, picture);

    // The same noise at one sample, then less and less of others.
    let mut sent = 0;
    for (seed, grain, fidelity) in [
        (1, 40, Fidelity::First),
        (2, 8, Fidelity::Moving),
        (3, 4, Fidelity::Moving),
        (9, 0, Fidelity::Still),
    ] {
        let (buffer, _) = picture_of(seed, grain, true);
        ui.painter.aim(&buffer, picture, fidelity);
        sent += ui.finish(4096);
        for (i, (old, new)) in before.iter().zip(on_screen(&ui, picture)).enumerate() {
            let (x, y) = (i as u16 % picture.width + picture.x, i as u16 / picture.width + picture.y);
            assert!(CHANGED.contains((x, y).into()) || *old == new, "{x},{y} at {fidelity:?}");
        }
    }
    assert_eq!(ui.difference(&picture_of(9, 0, true).0, ColorDepth::TrueColor).max(1), 1);
    let cells = usize::from(CHANGED.width * CHANGED.height);
    assert!(sent <= 100 * cells, "{} bytes a cell", sent / cells);

    // And back again, where the screen shows the edit.
    ui.painter.aim(&first, picture, Fidelity::First);
    ui.finish(4096);
    for (i, (old, new)) in before.iter().zip(on_screen(&ui, picture)).enumerate() {
        let (x, y) = (i as u16 % picture.width + picture.x, i as u16 / picture.width + picture.y);
        assert!(CHANGED.contains((x, y).into()) || *old == new, "{x},{y} on the way back");
    }
    let changed_back = on_screen(&ui, CHANGED);
    ui.painter.aim(&picture_of(9, 0, true).0, picture, Fidelity::Still);
    ui.finish(4096);
    assert_ne!(changed_back, on_screen(&ui, CHANGED), "the edit was taken back on the screen");
}

fn on_screen(ui: &TestTerminal, area: Rect) -> Vec<CellContent> {
    let places = (area.top()..area.bottom()).flat_map(|y| (area.left()..area.right()).map(move |x| (x, y)));
    places.map(|(x, y)| shown(ui.terminal.screen().cell(y, x).expect("a cell"))).collect()
}

#[test]
fn aims_that_come_faster_than_they_are_drawn_lead_to_the_edge() {
    let picture_of = |seed| pictured(SIDE.0, SIDE.1, |x, y| grainy(x, y, seed, 60));
    let mut ui = TestTerminal::new(SIDE.0 + 6, SIDE.1 + 1, ColorDepth::TrueColor);
    for seed in 0..16 {
        let (buffer, picture) = picture_of(seed);
        ui.painter.aim(&buffer, picture, if seed == 0 { Fidelity::First } else { Fidelity::Moving });
        // About three rows of such noise.
        ui.slice(3 * 40 * usize::from(SIDE.0));
    }
    let looks = on_screen(&ui, Rect::new(1, 0, SIDE.0, SIDE.1));
    let blank = looks.iter().filter(|look| **look == CellContent::BLANK).count();
    assert_eq!(blank, 0, "cells that were never drawn");
}

#[test]
fn words_that_change_during_a_picture_do_not_hold_it_up() {
    let (mut buffer, picture) = pictured(SIDE.0, SIDE.1, |x, y| grainy(x, y, 1, 5));
    let whole = showing(&buffer, picture, Fidelity::First).sent;
    let mut ui = TestTerminal::new(SIDE.0 + 6, SIDE.1 + 1, ColorDepth::TrueColor);
    for step in 0..40 {
        buffer.set_string(0, SIDE.1, format!("{step:02}"), ratatui::style::Style::new());
        ui.painter.aim(&buffer, picture, Fidelity::First);
        ui.slice(whole / 20);
    }
    ui.finish(4096);
    assert!(ui.sent < whole + 40 * 80, "{} bytes in place of {whole}", ui.sent);
    let looks = on_screen(&ui, picture);
    assert!(!looks.contains(&CellContent::BLANK), "cells that were never drawn");
}

#[test]
fn a_picture_under_words_comes_back_when_they_go() {
    let (buffer, picture) = pictured(SIDE.0, SIDE.1, |x, y| grainy(x, y, 1, 5));
    let mut ui = showing(&buffer, picture, Fidelity::Still);
    let mut covered = buffer.clone();
    covered.set_string(8, 4, "日本 x", ratatui::style::Style::reset());
    for wanted in [&covered, &buffer] {
        ui.painter.aim(wanted, picture, Fidelity::Still);
        assert!(ui.finish(4096) < 400);
        assert!(ui.difference(wanted, ColorDepth::TrueColor) <= 1);
    }
}
