//! Camera position after each key and mouse action, read from the scene file written by `c`.

use std::fs;

use glimt::tui::messages;

use super::pty::{SCENE, Terminal};
use crate::test_dir::TestDir;

const UP: &str = "\x1b[A";
const DOWN: &str = "\x1b[B";
const RIGHT: &str = "\x1b[C";
const LEFT: &str = "\x1b[D";

/// The numbers of a key's value in the scene file.
fn numbers(folder: &TestDir, key: &str) -> Vec<f64> {
    let text = fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    let line = text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix(" = ")).expect(key);
    line.trim_matches(['[', ']']).split(',').map(|it| it.trim().parse().expect("a number")).collect()
}

/// Presses `keys` and `c`. Returns the value of `key` in the scene file, then restores the file and waits for
/// its image.
fn saved_numbers(folder: &TestDir, terminal: &mut Terminal, own: &[u8], keys: &str, key: &str) -> Vec<f64> {
    terminal.press(keys);
    terminal.wait_for_message(messages::CAMERA_MOVED);
    terminal.press("c");
    terminal.wait_for_message(&messages::camera_saved("scene.toml"));
    let saved = numbers(folder, key);
    let expected = folder.once(&[]);
    assert_ne!(expected, own, "{keys:?} must change the image");
    let is = |bytes: &[u8]| fs::read(folder.path("scene.png")).is_ok_and(|there| there == bytes);
    terminal.wait("the image from the written camera", |_| is(&expected));
    folder.write("scene.toml", SCENE);
    terminal.wait("the original image", |_| is(own));
    terminal.wait_for("done");
    // Wait for the change on the screen. Keys pressed earlier would move the previous camera.
    terminal.settled(|screen| screen.contents());
    saved
}

#[track_caller]
fn assert_near(numbers: &[f64], expected: &[f64], what: &str) {
    let is_near = numbers.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3);
    assert!(numbers.len() == expected.len() && is_near, "{what:?}: {numbers:?}, expected {expected:?}");
}

/// Camera offset along one axis and along z after a 3° step at a distance of 4.
const STEP_SIDEWAYS: f64 = 0.2093;
const STEP_REMAINDER: f64 = 3.9945;

#[test]
fn camera_keys_move_by_documented_steps() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    for (keys, position) in [
        ([LEFT, "h"], [-STEP_SIDEWAYS, 0.0, STEP_REMAINDER]),
        ([RIGHT, "l"], [STEP_SIDEWAYS, 0.0, STEP_REMAINDER]),
        ([UP, "k"], [0.0, STEP_SIDEWAYS, STEP_REMAINDER]),
        ([DOWN, "j"], [0.0, -STEP_SIDEWAYS, STEP_REMAINDER]),
        (["+", "="], [0.0, 0.0, 4.0 * 0.95]),
        (["-", "--+"], [0.0, 0.0, 4.0 / 0.95]),
    ] {
        for keys in keys {
            assert_near(&saved_numbers(&folder, &mut terminal, &own, keys, "position"), &position, keys);
        }
    }
    for (keys, fov) in [("<", 40.0 / 1.05), (">", 40.0 * 1.05)] {
        let written = saved_numbers(&folder, &mut terminal, &own, keys, "fov")[0];
        assert!((written - fov).abs() < 0.006, "{keys}: {written}, expected {fov}");
    }
}

/// The terminal sequence for a mouse button or the wheel over a cell, numbered from 1.
fn mouse(button: u8, column: u16, row: u16) -> String {
    format!("\x1b[<{button};{column};{row}M")
}

fn dragged(from: (u16, u16), to: (u16, u16)) -> String {
    mouse(0, from.0, from.1) + &mouse(32, to.0, to.1) + &format!("\x1b[<0;{};{}m", to.0, to.1)
}

#[test]
fn drag_orbits_and_wheel_moves_the_camera() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    let mut eye = |keys: String| saved_numbers(&folder, &mut terminal, &own, &keys, "position");
    let (right, left) = (eye(dragged((20, 10), (24, 10))), eye(dragged((20, 10), (16, 10))));
    assert!(right[0] < -0.1 && right[1] == 0.0 && right[2] < 4.0, "{right:?}");
    assert_near(&left, &[-right[0], right[1], right[2]], "left");
    let (down, up) = (eye(dragged((20, 10), (20, 12))), eye(dragged((20, 10), (20, 8))));
    assert!(down[0] == 0.0 && down[1] > 0.1 && down[2] < 4.0, "{down:?}");
    assert_near(&up, &[down[0], -down[1], down[2]], "up");
    assert_near(&eye(mouse(64, 20, 10)), &[0.0, 0.0, 4.0 * 0.95], "the wheel");
    assert_near(&eye(mouse(65, 20, 10)), &[0.0, 0.0, 4.0 / 0.95], "wheel down");
}

#[test]
fn drag_outside_the_preview_has_no_effect() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press(&dragged((20, 1), (30, 10)));
    terminal.press("0");
    terminal.wait_for(messages::NOTHING_TO_RESET);
}

#[test]
fn reset_undoes_every_key() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    for (key, message) in [
        ("s", "s hard".to_owned()),
        ("]", messages::exposure_changed("+0.25")),
        ("l", messages::CAMERA_MOVED.to_owned()),
        ("<", messages::CAMERA_MOVED.to_owned()),
        ("v", messages::view_mode_chosen("normal")),
    ] {
        terminal.press(key);
        terminal.wait_for_message(&message);
    }
    terminal.wait_for("done");
    fs::remove_file(folder.path("scene.png")).expect("removed");
    terminal.press("0");
    terminal.wait_for(messages::RESET);
    terminal
        .wait("the original image", |_| fs::read(folder.path("scene.png")).is_ok_and(|bytes| bytes == own));
    let words = ["s soft", "v beauty", "done"];
    terminal.wait("the original settings", |screen| {
        let text = screen.contents();
        words.iter().all(|it| text.contains(it)) && !text.contains("camera moved")
    });
}

#[test]
fn saved_orbiter_becomes_position_and_look_at() {
    let folder = TestDir::with_board();
    let text = SCENE.replace("position = [0, 0, 4]\nlook_at = [0, 0, 0]", "orbiter = \"eye.txt\" # gKit");
    folder.write("eye.txt", "c 0 0 0\ns 4 2\n");
    folder.write("scene.toml", &text);
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press("+");
    terminal.wait_for_message(messages::CAMERA_MOVED);
    terminal.press("c");
    terminal.wait_for_message(&messages::camera_saved("scene.toml"));
    assert_eq!(numbers(&folder, "position").len(), 3);
    let written = fs::read_to_string(folder.path("scene.toml")).expect("a scene");
    assert!(written.contains("look_at = [") && !written.contains("orbiter"), "{written}");
    terminal.wait("the image on disk", |_| folder.bytes("scene.png") == folder.once(&[]));
}

#[test]
fn camera_is_not_saved_to_a_changed_file() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.press(">");
    terminal.wait_for_render(2);
    // Widen the window so that the message fits on one line.
    terminal.resize(120, 40);
    let broken = SCENE.replace("samples = 4", "samples = \"four\"");
    folder.write("scene.toml", &broken);
    terminal.wait_for("broken");
    terminal.press("c");
    terminal.wait_for(glimt::pipeline::messages::SCENE_FILE_CHANGED);
    assert_eq!(fs::read_to_string(folder.path("scene.toml")).expect("a scene"), broken);
}
