//! Effects of each key on the screen and on disk.

use std::fs;

use glimt::tui::messages;

use super::pty::{SCENE, cells, upper};
use crate::test_dir::TestDir;

const ESCAPE: &str = "\x1b";
const PAGE_UP: &str = "\x1b[5~";
const PAGE_DOWN: &str = "\x1b[6~";
const UP: &str = "\x1b[A";
const DOWN: &str = "\x1b[B";

#[test]
fn keys_change_and_reset_settings() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    let mut renders = 1;
    for (key, words, options) in [
        ("s", "s hard", ["--shadows", "hard"]),
        ("s", "s off", ["--shadows", "off"]),
        ("s", "s soft", ["--shadows", "soft"]),
        ("d", "d off", ["--dof", "off"]),
        ("d", "d on", ["--dof", "on"]),
    ] {
        terminal.press(key);
        renders += 1;
        terminal.wait_for_render(renders);
        terminal.wait_for(words);
        assert_eq!(folder.bytes("scene.png"), own, "{words}: must not be written");
        let is_own = matches!(words, "s soft" | "d on");
        if !is_own {
            terminal.press("w");
            let expected = folder.once(&options);
            terminal.wait(words, |_| fs::read(folder.path("scene.png")).is_ok_and(|bytes| bytes == expected));
            assert!(expected != own, "{words} must change the image");
            // Restore the original image, which a reset does not write.
            fs::write(folder.path("scene.png"), &own).expect("put back");
        }
    }
    terminal.press("s");
    terminal.wait_for_render(renders + 1);
    terminal.press("0");
    terminal.wait_for_render(renders + 2);
    terminal.wait_for(messages::RESET);
    terminal.wait_for("s soft");
    assert_eq!(folder.bytes("scene.png"), own);
    terminal.press("0");
    terminal.wait_for(messages::NOTHING_TO_RESET);
    terminal.press("r");
    terminal.wait_for_render(renders + 3);
    assert_eq!(folder.bytes("scene.png"), own);
}

#[test]
fn views_are_shown_and_saved_on_request() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let beauty = folder.bytes("scene.png");

    terminal.press("v");
    terminal.wait_for_message(&messages::view_mode_chosen("normal"));
    terminal.wait_for_render(2);
    // The board faces the camera, so its normal (0, 0, 1) is shown as (n + 1)/2, without tone mapping.
    let board = vt100::Color::Rgb(128, 128, 255);
    terminal.wait("normals", |screen| cells(screen).filter(|cell| upper(cell) == Some(board)).count() > 100);
    assert_eq!(folder.bytes("scene.png"), beauty);
    terminal.press("w");
    terminal.wait_for_message(&messages::files_written("scene.png"));
    assert_eq!(folder.bytes("scene.png"), folder.once(&["--view", "normal"]));

    let views = [
        "depth",
        "barycentric",
        "uv",
        "albedo",
        "ambient",
        "diffuse",
        "specular",
        "emission",
        "indirect",
        "caustic",
        "photons",
        "shadow",
        "bounds",
        "cost",
        "samples",
        "error",
    ];
    for (number, view) in views.iter().enumerate() {
        terminal.press("v");
        terminal.wait_for(&format!("  view {view}"));
        terminal.wait_for_render(3 + number);
    }
    terminal.press("V");
    terminal.wait_for("  view samples");
    terminal.wait_for_render(19);
    terminal.press("vv");
    terminal.wait_for("v beauty");
    terminal.wait_for("done");
    // Switching back to the scene's own image does not replace the written image.
    terminal.wait_for_message(&messages::written_image_differs("scene.png", "view normal"));
    assert_eq!(folder.bytes("scene.png"), folder.once(&["--view", "normal"]));
    terminal.press("w");
    terminal.wait_for_message(&messages::files_written("scene.png"));
    assert_eq!(folder.bytes("scene.png"), beauty);
}

#[test]
fn paused_render_can_be_saved_and_resumed() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = 10000000"));
    let mut terminal = folder.terminal();
    terminal.wait_for_color("red");
    terminal.wait_for("ETA");
    // The file is written when every pixel has a sample.
    terminal.press("w");
    terminal.wait("the first image on disk", |_| folder.path("scene.png").is_file());
    fs::remove_file(folder.path("scene.png")).expect("removed");
    terminal.press(" ");
    terminal.wait("a paused render", |screen| {
        let text = screen.contents();
        text.lines().next().is_some_and(|line| line.contains("‖ paused")) && !text.contains("ETA")
    });
    terminal.press("w");
    terminal.wait("the image on disk", |_| folder.path("scene.png").is_file());
    terminal.wait_for_message(&messages::files_written("scene.png"));
    terminal.press(" ");
    terminal.wait_for("ETA");
    fs::remove_file(folder.path("scene.png")).expect("removed");
    terminal.press("w");
    terminal.wait("the image on disk", |_| folder.path("scene.png").is_file());
    folder.write("scene.toml", SCENE);
    terminal.wait_for_render(1);
    terminal.press(" ");
    terminal.wait_for(messages::NOT_RENDERING);
    fs::remove_file(folder.path("scene.png")).expect("removed");
    terminal.press("w");
    terminal.wait_for_message(&messages::files_written("scene.png"));
    assert_eq!(folder.bytes("scene.png"), folder.once(&[]));
}

#[test]
fn help_and_errors_open_scroll_and_close() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let gone = |text: &'static str| move |screen: &vt100::Screen| !screen.contents().contains(text);
    terminal.press("?");
    terminal.wait_for_message(messages::HELP_TOGGLE);
    terminal.press("?");
    terminal.wait("no help", gone(messages::HELP_TOGGLE));
    terminal.press("?");
    terminal.wait_for_message(messages::HELP_TOGGLE);
    terminal.press(ESCAPE);
    terminal.wait("no help", gone(messages::HELP_TOGGLE));
    terminal.press("e");
    terminal.wait_for(messages::NO_DIAGNOSTICS);

    folder.write("scene.toml", SCENE.replace("[0", "[\"0\"").replace("radius =", "radios ="));
    terminal.wait_for(messages::LAST_GOOD_RENDER);
    terminal.wait_for("lines 1-");
    for (forth, back) in [(PAGE_DOWN, PAGE_UP), (DOWN, UP)] {
        terminal.press(forth);
        terminal.wait("the next page", gone("lines 1-"));
        terminal.press(back);
        terminal.wait_for("lines 1-");
    }
    terminal.press("e");
    terminal.wait("no errors on the screen", gone("lines 1-"));
    terminal.press("e");
    terminal.wait_for("lines 1-");
    terminal.press(ESCAPE);
    terminal.wait("no errors on the screen", gone("lines 1-"));
    terminal.wait_for("broken");
}
