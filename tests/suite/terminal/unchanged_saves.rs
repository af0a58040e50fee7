//! Saves that do not change the image, such as a typo that is corrected right away or a new comment, add no
//! history entry and are ignored by comparisons.

use glimt::tui::messages;

use super::pty::{BLUE, RED, SCENE, Terminal};
use crate::test_dir::{PROGRAM, TestDir};

/// Text of the panel, without thumbnails.
fn words(screen: &vt100::Screen) -> String {
    let text: String = screen.contents().chars().filter(|c| !('▀'..='▟').contains(c)).collect();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Breaks the scene, then repairs it.
fn typo(folder: &TestDir, terminal: &Terminal, text: &str, while_broken: &str) {
    folder.write("scene.toml", text.replace("radius", "radus"));
    terminal.wait_for("broken");
    terminal.wait_for(while_broken);
    folder.write("scene.toml", text);
    terminal.wait("a repaired scene", |screen| !screen.contents().contains("broken"));
}

#[test]
fn comparison_ignores_a_typo() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let blue = SCENE.replace(RED, BLUE);
    folder.write("scene.toml", &blue);
    terminal.wait_for_color("blue");
    terminal.wait_for_render(2);
    typo(&folder, &terminal, &blue, "radus");
    terminal.wait_for(&format!("unchanged · {}", messages::numbered_render(2)));
    terminal.press("b");
    terminal.wait_for_color("red");
    terminal.wait_for(&messages::render_number_of_count(1, 2));
    terminal.wait_for(&format!("{}, materials.board.diffuse", messages::BEFORE_EDIT));
    terminal.press("b");
    terminal.wait_for_color("blue");
}

/// With dithered colors, some cells of a cached preview differ from the preview shown during the render.
#[test]
fn comment_and_typo_add_no_history_entry() {
    let folder = TestDir::with_board();
    let soft = "samples = 200\nintegrator = \"path\"";
    let scene =
        SCENE.replace("width = 64\nheight = 48\nsamples = 4", &format!("width = 160\nheight = 120\n{soft}"));
    folder.write("scene.toml", &scene);
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml"], &[("COLORTERM", "")]);
    terminal.resize(120, 40);
    terminal.wait_for_render(1);
    let blue = scene.replace(RED, BLUE);
    folder.write("scene.toml", &blue);
    terminal.wait_for_render(2);
    terminal.wait("a strip", |screen| words(screen).contains("▸2 materials."));
    let commented = blue.replace("[camera]", "# the eye\n[camera]");
    folder.write("scene.toml", &commented);
    terminal.wait_for(&format!("unchanged · {}", messages::numbered_render(2)));
    typo(&folder, &terminal, &commented, "radus");
    terminal.wait_for(&format!("unchanged · {}", messages::numbered_render(2)));
    terminal.press("n");
    terminal.wait_for(&messages::render_number_of_count(1, 2));
    terminal.wait("two images", |screen| {
        let words = words(screen);
        words.contains(&format!("▸1 {}", messages::OPENED))
            && words.contains("2 materials.")
            && !words.contains(messages::AGAIN)
    });
    terminal.press("N");
    terminal.wait_for(messages::NEWEST_RENDER);
}

#[test]
fn typo_while_rendering_adds_one_entry() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal_of(120, 40);
    terminal.wait_for_render(1);
    let long = SCENE.replace("samples = 4", "samples = 10000000");
    folder.write("scene.toml", &long);
    // The history entry exists when its first cells are on the screen.
    let is_there = |screen: &vt100::Screen| words(screen).contains("▸2 render.");
    terminal.wait("an unfinished image", is_there);
    for _ in 0..2 {
        typo(&folder, &terminal, &long, messages::LAST_GOOD_SCENE);
        terminal.wait_for("ETA");
    }
    terminal.wait("an unfinished image", is_there);
    terminal.press("n");
    terminal.wait_for(&messages::render_number_of_count(1, 2));
    terminal.wait("two images", |screen| {
        let words = words(screen);
        // An unfinished render does not count as stopped.
        words.contains(&format!("▸1 {}", messages::OPENED))
            && words.contains(" 2 render.")
            && !words.contains(messages::STOPPED)
    });
}
