//! Warnings, the help under the wheel, earlier pictures, and a screen on which another program wrote.

use super::pty::{BLUE, Folder, GREEN, RED, SCENE};

#[test]
fn warnings_are_told_and_shown_when_asked() {
    let folder = Folder::new();
    folder.write("scene.toml", &SCENE.replace(RED, "[0.8, 0.02, 0.02], specular = [0.5, 0.5, 0.5]"));
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.wait_for("1 warning");
    let line = SCENE.lines().position(|line| line.starts_with("board")).expect("a board") + 1;
    let place = format!("scene.toml:{line}:");
    assert!(!terminal.text().contains(&place));
    terminal.press("e");
    terminal.wait_for(&place);
    terminal.press("e");
    terminal.wait("no warning in sight", |screen| !screen.contents().contains(&place));
    terminal.wait_for_render(1);
}

#[test]
fn the_wheel_scrolls_the_help_and_moves_nothing_under_it() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.resize(60, 12);
    terminal.press("?");
    terminal.wait_for("show or hide this help");
    terminal.wait_for("j k scroll");
    terminal.press("\x1b[<65;20;6M");
    terminal.wait("further lines", |screen| !screen.contents().contains("show or hide this help"));
    terminal.press("\x1b[<64;20;6M");
    terminal.wait_for("show or hide this help");
    terminal.press("?0");
    terminal.wait_for("nothing to reset");
}

#[test]
fn pictures_end_at_the_oldest_and_at_the_newest() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("b");
    terminal.wait_for("there is no picture from before an edit");
    for (render, (color, value)) in (2..).zip([("green", GREEN), ("blue", BLUE)]) {
        folder.write("scene.toml", &SCENE.replace(RED, value));
        terminal.wait_for_color(color);
        terminal.wait_for_render(render);
    }
    for (key, color, place) in [
        ("n", "green", "picture 2 of 3"),
        ("n", "red", "picture 1 of 3"),
        ("N", "green", "picture 2 of 3"),
        ("N", "blue", "this is the newest picture"),
    ] {
        terminal.press(key);
        terminal.wait_for_color(color);
        terminal.wait_for(place);
    }
    terminal.press("N");
    terminal.wait_for("this is the newest picture");
    // `b` is the picture from before the last edit, not the one before in the list.
    terminal.press("n");
    terminal.wait_for_color("green");
    terminal.press("b");
    terminal.wait_for_color("blue");
}

#[test]
fn what_something_else_wrote_on_the_screen_goes_by_a_key() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.scribble("\x1b[10;5Hsomebody was here");
    terminal.wait_for("somebody was here");
    terminal.press("\x0c");
    terminal.wait("it is gone", |screen| !screen.contents().contains("somebody was here"));
    terminal.wait_for_color("red");
}
