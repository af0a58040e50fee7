//! Moving the camera with keys: effects on the screen and on disk.

use glimt::tui::messages;

use super::pty::{Colors, Terminal};
use crate::test_dir::TestDir;

/// Waits until the preview's number of red cells satisfies `holds`.
#[track_caller]
fn wait_for_red(terminal: &Terminal, what: &str, holds: impl Fn(usize) -> bool) {
    terminal.wait(what, |screen| holds(Colors::of(screen).red));
}

#[test]
fn moved_camera_resets_without_writing() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    let red = terminal.settled(|screen| Colors::of(screen).red);
    for (keys, is_more) in [
        ("\x1b[C".repeat(20), false),
        ("h".repeat(20), false),
        ("\x1b[A".repeat(20), false),
        ("j".repeat(20), false),
        ("+".repeat(10), true),
        ("-".repeat(10), false),
        ("<".repeat(10), true),
        (">".repeat(10), false),
    ] {
        terminal.press(&keys);
        terminal.wait_for_message(messages::CAMERA_MOVED);
        terminal.wait_for("0 reset camera");
        wait_for_red(&terminal, &keys, |now| if is_more { now > red + 20 } else { now + 20 < red });
        terminal.wait_for("done");
        terminal.press("0");
        terminal.wait_for(messages::RESET);
        wait_for_red(&terminal, "the original image", |now| now == red);
        terminal.wait_for("done");
        assert_eq!(folder.bytes("scene.png"), own, "{keys}");
    }
}

#[test]
fn saved_image_has_the_moved_camera() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press(">");
    terminal.wait_for_render(2);
    terminal.press("w");
    terminal.wait_for_message(&messages::files_written("scene.png"));
    assert_eq!(folder.bytes("scene.png"), folder.once(&["--set", "camera.fov=42"]));
}

#[test]
fn saved_image_has_the_changed_exposure() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    terminal.press("[");
    terminal.wait_for_message(&messages::exposure_changed("−0.25"));
    terminal.wait_for_render(1);
    terminal.press("]]");
    terminal.wait_for_message(&messages::exposure_changed("+0.25"));
    terminal.wait_for_render(1);
    assert_eq!(folder.bytes("scene.png"), own);
    terminal.press("w");
    let brighter = folder.once(&["--set", "render.exposure=0.25"]);
    terminal.wait("the image on disk", |_| folder.bytes("scene.png") == brighter);
}
