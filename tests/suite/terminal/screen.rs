//! The screen in windows of all sizes: preview only, the help, the view list, quitting.

use glimt::tui::messages;

use super::pty::{Colors, SCENE, Terminal, shows};
use crate::test_dir::{PROGRAM, TestDir, assert_mentions};

const TAB: &str = "\t";
const ESCAPE: &str = "\x1b";
const PAGE_DOWN: &str = "\x1b[6~";

/// The text of the last row.
fn last_line(screen: &vt100::Screen) -> String {
    let rows = usize::from(screen.size().0.get());
    screen.contents().lines().nth(rows - 1).unwrap_or_default().trim_end().to_owned()
}

/// Waits until the text for this size appears. Returns the number of red cells when it no longer changes.
fn resized(terminal: &mut Terminal, columns: u16, rows: u16) -> usize {
    terminal.resize(columns, rows);
    terminal.wait("the line of keys", |screen| last_line(screen).ends_with("? help"));
    terminal.settled(|screen| Colors::of(screen).red)
}

#[test]
fn tab_shows_only_the_preview() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let beside = terminal.settled(|screen| Colors::of(screen).red);
    terminal.press(TAB);
    terminal.wait_for("tab back");
    let alone = terminal.settled(|screen| Colors::of(screen).red);
    assert!(alone > beside, "{alone} {beside}");
    let last = terminal.look(last_line);
    assert!(last.contains("✓ done") && last.ends_with("tab back"), "{last}");
    terminal.press("e");
    terminal
        .wait("a message on the only line", |screen| last_line(screen).contains(messages::NO_DIAGNOSTICS));
    terminal.press(TAB);
    terminal.wait("the keys", |screen| last_line(screen).ends_with("? help"));
    assert_eq!(terminal.settled(|screen| Colors::of(screen).red), beside);
}

#[test]
fn help_scrolls_in_small_windows() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    resized(&mut terminal, 60, 12);
    terminal.press("?");
    terminal.wait_for_message(messages::HELP_TOGGLE);
    terminal.wait_for("j k scroll");
    for (forth, back) in [("j", "k"), ("\x1b[B", "\x1b[A"), (PAGE_DOWN, "\x1b[5~")] {
        terminal.press(forth);
        terminal.wait("more lines", |screen| !screen.contents().contains(messages::HELP_TOGGLE));
        terminal.press(back);
        terminal.wait_for_message(messages::HELP_TOGGLE);
    }
    terminal.press(&PAGE_DOWN.repeat(9));
    terminal.wait_for_message(messages::HELP_STAGE_TIME);
    terminal.press(ESCAPE);
    terminal.wait("no help", |screen| !shows(screen, messages::HELP_STAGE_TIME));
}

#[test]
fn digits_choose_from_the_view_list() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("v");
    terminal.wait_for("▸2 normal");
    terminal.wait_for_render(2);
    terminal.press("6");
    terminal.wait_for("▸6 albedo");
    terminal.wait_for_render(3);
    terminal.press(ESCAPE);
    terminal.wait("no list", |screen| !screen.contents().contains("barycentric"));
    terminal.press("V");
    terminal.wait_for("▸5 uv");
    // The list closes after a timeout.
    terminal.wait("no list", |screen| !screen.contents().contains("barycentric"));
    terminal.wait_for("v uv");
}

#[test]
fn small_windows_show_preview_errors_and_keys() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    for (columns, rows) in [(40, 12), (30, 8)] {
        folder.write("scene.toml", SCENE);
        terminal.wait_for("done");
        let red = resized(&mut terminal, columns, rows);
        assert!(red > 20, "{red} at {columns}×{rows}\n{}", terminal.text());
        terminal.wait_for("s soft");
        folder.write("scene.toml", SCENE.replace("samples = 4", "samples = \"four\""));
        terminal.wait_for("broken");
        terminal.wait_for("scene.toml:4:11");
        terminal.press("?");
        terminal.wait_for(&messages::HELP_TOGGLE[..12]);
        terminal.press("?");
        terminal.press(ESCAPE);
        // Right after resizing, a slow machine may have shown the stretched preview, so the count may differ.
        terminal.wait("the image", |screen| Colors::of(screen).red > 20);
    }
}

#[test]
fn every_state_has_a_symbol_and_a_word() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml"], &[("NO_COLOR", "1")]);
    terminal.wait_for("✓ done");
    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 10000000"));
    terminal.wait_for("● rendering");
    terminal.wait_for("ETA");
    terminal.press(" ");
    terminal.wait_for("‖ paused");
    terminal.press("v");
    terminal.wait_for("▸2 normal");
    folder.write("scene.toml", "[render");
    terminal.wait_for("✗ broken");
    terminal.wait_for("error");
}

#[test]
fn last_of_many_resizes_wins() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let red = terminal.settled(|screen| Colors::of(screen).red);
    terminal.press("v");
    terminal.press("1");
    for step in 0..60_u16 {
        terminal.resize(10 + step * 37 % 190, 2 + step * 23 % 58);
        if step % 10 == 0 {
            terminal.press(TAB);
        }
    }
    terminal.press(ESCAPE);
    terminal.resize(80, 24);
    terminal.wait("the last line", |screen| last_line(screen).ends_with("? help"));
    terminal.wait("the image", |screen| Colors::of(screen).red == red);
    // Wait, because a `q` sent right after an escape character would be read as Alt-q.
    terminal.settled(vt100::Screen::contents);
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

#[test]
fn quit_leaves_one_line() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("q");
    assert_eq!(terminal.code(), 0);
    assert_mentions(&terminal.last_lines(), &["scene.png", "64×48", "4 samples"]);
    terminal.end();
}

#[test]
fn terminal_with_256_colors_gets_no_others() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml"], &[("COLORTERM", "")]);
    terminal.wait_for_render(1);
    let is_of_palette = |color| matches!(color, vt100::Color::Default | vt100::Color::Idx(_));
    let fixed = |screen: &vt100::Screen| {
        let colors = super::pty::cells(screen).map(|cell| (cell.fgcolor(), cell.bgcolor()));
        colors.filter(|(fg, _)| matches!(fg, vt100::Color::Idx(16..))).count()
    };
    terminal.wait("an image", |screen| fixed(screen) > 50);
    terminal.press("l");
    terminal.wait_for("camera moved");
    terminal.look(|screen| {
        for cell in super::pty::cells(screen) {
            assert!(is_of_palette(cell.fgcolor()) && is_of_palette(cell.bgcolor()), "{:?}", cell.contents());
        }
    });
}
