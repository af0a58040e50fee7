//! Inspecting a point of the image with a click, and at the crosshair with keys.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use glimt::tui::messages;

use super::mouse_and_editor::{EDITOR, editing};
use super::pty::{Colors, SCENE, Terminal};
use crate::test_dir::{PROGRAM, TestDir};

/// A click on a cell, numbered from 1.
fn click(column: u16, row: u16) -> String {
    format!("\x1b[<0;{column};{row}M\x1b[<0;{column};{row}m")
}

/// The scene with a named ball in front of the board's center.
fn centered() -> String {
    SCENE.replace("center = [0.5, 0.2, 0.8]", "name = \"apple\"\ncenter = [0, 0, 0.8]")
}

/// Line number of the ball in the scene, from 1.
fn line_of_ball() -> usize {
    centered().lines().position(|line| line == "[[sphere]]").expect("a ball") + 1
}

fn terminal(folder: &TestDir, text: &str, variables: &[(&str, &str)]) -> Terminal {
    folder.write("scene.toml", text);
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml"], variables);
    terminal.wait_for_render(1);
    // Enlarge the window so that each fact fits on a line.
    terminal.resize(120, 40);
    terminal.wait("a large image", |screen| {
        screen.contents().lines().nth(39).is_some_and(|line| line.trim_end().ends_with("? help"))
    });
    terminal
}

#[test]
fn crosshair_shows_all_facts() {
    let folder = TestDir::with_board();
    let mut terminal = terminal(&folder, &centered(), &[]);
    terminal.press("\r");
    let place = format!("scene.toml:{}", line_of_ball());
    for words in
        ["sphere \"apple\"", &place, "phong ball", "distance 3", "position (", "radiance (", "normal ("]
    {
        terminal.wait_for(words);
    }
    // The next key closes the facts. A click inspects another point and moves the crosshair there.
    terminal.press("e");
    terminal.wait("no facts", |screen| !screen.contents().contains("apple"));
    terminal.press(&click(30, 10));
    terminal.wait_for("quad");
    terminal.press("e\r");
    terminal.wait("the board", |screen| ["phong", "board"].iter().all(|it| screen.contents().contains(it)));
    assert!(!terminal.text().contains("apple"));
    terminal.press(&click(4, 4));
    terminal.wait_for("nothing at pixel");
}

#[test]
fn focus_moves_to_crosshair_and_is_saved() {
    let folder = TestDir::with_board();
    let mut terminal = terminal(&folder, &centered(), &[]);
    terminal.press("f");
    terminal.wait_for(messages::CLICK_TO_FOCUS);
    terminal.press("f");
    let message = messages::focus_moved(0.0);
    let (before, _) = message.split_once('0').expect("a distance");
    terminal.wait_for(before);
    let text = terminal.settled(|screen| screen.contents());
    let focus = text.split(before).nth(1).and_then(|it| it.split(' ').next()).expect("a distance");
    let depth: f64 = focus.parse().expect("a number");
    assert!((depth - 3.0).abs() < 0.01, "{depth}");
    // Wait, because `w` would save an unfinished image.
    terminal.wait_for_render(2);
    terminal.press("w");
    terminal.wait_for_message(&messages::files_written("scene.png"));
    let expected = folder.once(&["--set", &format!("camera.focus={focus}")]);
    assert_eq!(folder.bytes("scene.png"), expected);
    assert_ne!(expected, folder.once(&[]), "the focus must change the image");
    terminal.press("c");
    terminal.wait_for_message(&messages::camera_saved("scene.toml"));
    let written = fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    assert_eq!(written, centered().replace("focus = 4.0", &format!("focus = {focus}")));
}

#[test]
fn pinhole_has_no_focus() {
    let folder = TestDir::with_board();
    let mut terminal = terminal(&folder, &centered().replace("aperture = 0.2\n", ""), &[]);
    terminal.press("ff");
    terminal.wait_for(messages::PINHOLE);
    terminal.press("0");
    terminal.wait_for(messages::NOTHING_TO_RESET);
    terminal.press("d");
    terminal.wait_for(messages::PINHOLE);
}

#[test]
fn editor_opens_at_the_clicked_object() {
    let folder = TestDir::with_board();
    folder.write("vi", EDITOR);
    fs::set_permissions(folder.path("vi"), fs::Permissions::from_mode(0o755)).expect("permitted");
    let editor = folder.path("vi");
    let variables = [("VISUAL", ""), ("EDITOR", editor.to_str().expect("a name"))];
    let mut terminal = terminal(&folder, &centered(), &variables);
    terminal.press("\r");
    terminal.wait_for("apple");
    terminal.press("o");
    terminal.wait_for(&editing(line_of_ball()));
    terminal.press("\n");
    terminal.wait("glimt's screen", vt100::Screen::alternate_screen);
}

#[test]
fn actual_size_preview_centers_on_the_click() {
    let folder = TestDir::with_board();
    let large = SCENE.replace("width = 64", "width = 320").replace("height = 48", "height = 240");
    let mut terminal = terminal(&folder, &large, &[]);
    let before = terminal.settled(|screen| Colors::of(screen).red);
    // Click the corner of the image, outside the board.
    terminal.press(&click(4, 4));
    terminal.wait_for("nothing at pixel");
    terminal.press("x");
    terminal
        .wait("no board", |screen| screen.contents().contains("1:1") && Colors::of(screen).red < before / 2);
    terminal.press("x");
    // A few edge cells may keep an equally close value.
    terminal.wait("the original preview", |screen| Colors::of(screen).red.abs_diff(before) <= before / 8);
}

#[test]
fn region_without_mouse_uses_the_crosshair() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 10000000"));
    let mut terminal = folder.terminal();
    terminal.wait_for("ETA");
    let has_corners = |screen: &vt100::Screen| {
        let text = screen.contents();
        ["┌", "┐", "└", "┘"].iter().all(|it| text.contains(it))
    };
    assert!(!terminal.look(has_corners));
    for keys in ["zz", "mz"] {
        terminal.press(keys);
        terminal.wait_for(messages::REGION_FIRST);
        terminal.wait("its corners", has_corners);
        terminal.press("z");
        terminal.wait_for(messages::REGION_CLEARED);
        terminal.wait("no corners", |screen| !has_corners(screen));
    }
}
