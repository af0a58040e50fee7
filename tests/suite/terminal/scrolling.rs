//! Warnings, scrolling the help with the wheel, the history, and redrawing a screen overwritten by another
//! program.

use glimt::tui::messages;

use super::pty::{BLUE, GREEN, RED, SCENE};
use crate::test_dir::TestDir;

#[test]
fn warnings_are_counted_and_shown_on_request() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", SCENE.replace(RED, "[0.8, 0.02, 0.02], specular = [0.5, 0.5, 0.5]"));
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.wait_for("1 warning");
    let line = SCENE.lines().position(|line| line.starts_with("board")).expect("a board") + 1;
    let place = format!("scene.toml:{line}:");
    assert!(!terminal.text().contains(&place));
    terminal.press("e");
    terminal.wait_for(&place);
    terminal.press("e");
    terminal.wait("no warning on the screen", |screen| !screen.contents().contains(&place));
    terminal.wait_for_render(1);
}

#[test]
fn wheel_scrolls_only_the_help() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.resize(60, 12);
    terminal.press("?");
    terminal.wait_for_message(messages::HELP_TOGGLE);
    terminal.wait_for("j k scroll");
    terminal.press("\x1b[<65;20;6M");
    terminal.wait("more lines", |screen| !screen.contents().contains(messages::HELP_TOGGLE));
    terminal.press("\x1b[<64;20;6M");
    terminal.wait_for_message(messages::HELP_TOGGLE);
    terminal.press("?0");
    terminal.wait_for(messages::NOTHING_TO_RESET);
}

#[test]
fn history_ends_at_oldest_and_newest() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("b");
    terminal.wait_for(messages::NO_EARLIER_RENDER);
    for (render, (color, value)) in (2..).zip([("green", GREEN), ("blue", BLUE)]) {
        folder.write("scene.toml", SCENE.replace(RED, value));
        terminal.wait_for_color(color);
        terminal.wait_for_render(render);
    }
    for (key, color, place) in [
        ("n", "green", messages::render_number_of_count(2, 3)),
        ("n", "red", messages::render_number_of_count(1, 3)),
        ("N", "green", messages::render_number_of_count(2, 3)),
        ("N", "blue", messages::NEWEST_RENDER.to_owned()),
    ] {
        terminal.press(key);
        terminal.wait_for_color(color);
        terminal.wait_for(&place);
    }
    terminal.press("N");
    terminal.wait_for(messages::NEWEST_RENDER);
    // `b` shows the render before the last edit, which is not the previous history entry.
    terminal.press("n");
    terminal.wait_for_color("green");
    terminal.press("b");
    terminal.wait_for_color("blue");
}

#[test]
fn ctrl_l_redraws_the_screen() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let text = "written by another program";
    terminal.scribble(&format!("\x1b[10;5H{text}"));
    terminal.wait_for(text);
    terminal.press("\x0c");
    terminal.wait("the text to disappear", |screen| !screen.contents().contains(text));
    terminal.wait_for_color("red");
}
