//! Saves that change no picture: typos, their mends, and comments. They add no picture, and nothing is before them.

use super::pty::{BLUE, Folder, RED, SCENE, Terminal};

/// Words of the panel, without the blocks of small pictures.
fn words(screen: &vt100::Screen) -> String {
    let text: String = screen.contents().chars().filter(|c| !('▀'..='▟').contains(c)).collect();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Breaks the scene, and mends it.
fn typo(folder: &Folder, terminal: &Terminal, text: &str, while_broken: &str) {
    folder.write("scene.toml", &text.replace("radius", "radus"));
    terminal.wait_for("broken");
    terminal.wait_for(while_broken);
    folder.write("scene.toml", text);
    terminal.wait("a mended scene", |screen| !screen.contents().contains("broken"));
}

#[test]
fn after_a_typo_b_shows_the_picture_before_the_last_edit_that_is_seen() {
    let folder = Folder::new();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let blue = SCENE.replace(RED, BLUE);
    folder.write("scene.toml", &blue);
    terminal.wait_for_color("blue");
    terminal.wait_for_render(2);
    typo(&folder, &terminal, &blue, "radus");
    terminal.wait_for("unchanged · run 2");
    terminal.press("b");
    terminal.wait_for_color("red");
    terminal.wait_for("picture 1 of 2");
    terminal.wait_for("before the last edit, materials.board.diffuse");
    terminal.press("b");
    terminal.wait_for_color("blue");
}

/// Cells of a picture that is found again differ from those of its render if colors are mixed.
#[test]
fn in_256_colours_a_comment_and_a_typo_add_no_picture() {
    let folder = Folder::new();
    let soft = "samples = 200\nintegrator = \"path\"";
    let scene =
        SCENE.replace("width = 64\nheight = 48\nsamples = 4", &format!("width = 160\nheight = 120\n{soft}"));
    folder.write("scene.toml", &scene);
    let mut terminal = folder.terminal_with(&[folder.program(), "scene.toml"], &[("COLORTERM", "")]);
    terminal.resize(120, 40);
    terminal.wait_for_render(1);
    let blue = scene.replace(RED, BLUE);
    folder.write("scene.toml", &blue);
    terminal.wait_for_render(2);
    terminal.wait("a strip", |screen| words(screen).contains("▸2 materials."));
    let commented = blue.replace("[camera]", "# the eye\n[camera]");
    folder.write("scene.toml", &commented);
    terminal.wait_for("unchanged · run 2");
    typo(&folder, &terminal, &commented, "radus");
    terminal.wait_for("unchanged · run 2");
    terminal.press("n");
    terminal.wait_for("picture 1 of 2");
    terminal.wait("two pictures", |screen| {
        let words = words(screen);
        words.contains("▸1 first") && words.contains("2 materials.") && !words.contains("rendered again")
    });
    terminal.press("N");
    terminal.wait_for("this is the newest picture");
}

#[test]
fn a_typo_during_a_render_leaves_one_picture_of_it() {
    let folder = Folder::new();
    let mut terminal = folder.terminal_of(120, 40);
    terminal.wait_for_render(1);
    let long = SCENE.replace("samples = 4", "samples = 10000000");
    folder.write("scene.toml", &long);
    // The strip has the picture once its first cells are on the screen.
    let is_there = |screen: &vt100::Screen| words(screen).contains("▸2 render.");
    terminal.wait("a picture under way", is_there);
    for _ in 0..2 {
        typo(&folder, &terminal, &long, "the last good scene goes on");
        terminal.wait_for("ETA");
    }
    terminal.wait("a picture under way", is_there);
    terminal.press("n");
    terminal.wait_for("picture 1 of 2");
    terminal.wait("two pictures", |screen| {
        let words = words(screen);
        // What is rendered is no picture whose render was stopped.
        words.contains("▸1 first") && words.contains(" 2 render.") && !words.contains("unfinished")
    });
}
