//! Viewing a model in the terminal.

use std::fs;

use glimt::tui::messages;

use crate::test_dir::{PROGRAM, TestDir};

/// An OBJ file of a red wall that faces the camera, one unit wide and `height` units high.
fn wall(height: f32) -> String {
    format!("mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 1 {height} 0\nv 0 {height} 0\nf 1 2 3 4\n")
}

#[test]
fn model_is_watched_and_imported_once() {
    let folder = TestDir::with_board();
    folder.write("a.mtl", "newmtl red\nKd 0.9 0 0\nKe 1 0 0\n");
    folder.write("wall.obj", wall(0.1));
    let small = ["--samples", "2", "--width", "64", "--height", "48", "--from", "front"];
    let call = [&[PROGRAM, "wall.obj"][..], &small].concat();
    let mut terminal = folder.terminal_with(&call, &[]);
    terminal.wait_for_render(1);
    let low = folder.bytes("wall.png");
    // Another program saves the model.
    folder.write("wall.obj", wall(0.7));
    terminal.wait_for_render(2);
    let options = &call[2..];
    assert_ne!(folder.bytes("wall.png"), low);
    assert_eq!(folder.bytes("wall.png"), once(&folder, options), "the image must show the saved model");
    terminal.press("o");
    terminal.wait_for(messages::NO_EDITOR_FOR_MODELS);
    terminal.press("c");
    terminal.wait_for(&messages::model_scene_written("wall.toml"));
    let text = fs::read_to_string(folder.path("wall.toml")).expect("a scene");
    let mesh = "[[mesh]]\nfile = \"wall.obj\"\n";
    assert!(text.contains(mesh) && text.contains("[camera]"), "{text}");
    assert_eq!(fs::read_to_string(folder.path("wall.obj")).expect("the model"), wall(0.7));
    terminal.press("c");
    terminal.wait_for(&format!("wall.toml {}", glimt::pipeline::messages::ALREADY_EXISTS));
    // Write an incomplete file, then the complete file.
    folder.write("wall.obj", "v 0 0");
    terminal.wait_for("wall.obj");
    terminal.wait_for("broken");
    folder.write("wall.obj", wall(0.1));
    terminal.wait("the low wall", |_| fs::read(folder.path("wall.png")).is_ok_and(|bytes| bytes == low));
    terminal.press("q");
    assert_eq!(terminal.end(), 0);
}

/// The image file that `--once` writes.
fn once(folder: &TestDir, options: &[&str]) -> Vec<u8> {
    let mut process = std::process::Command::new(PROGRAM);
    process.args(["wall.obj", "--once", "-o", "once.png", "--progress", "none"]).args(options);
    assert!(process.current_dir(folder.path("")).status().expect("it runs").success());
    folder.bytes("once.png")
}

#[test]
fn missing_model_is_named() {
    let folder = TestDir::with_board();
    folder.write("a.mtl", "newmtl red\nKd 0.9 0 0\n");
    folder.write("wall.obj", wall(0.1));
    let small = ["--width", "32", "--height", "24", "--samples", "4"];
    let call = [&[PROGRAM, "wall.obj"][..], &small].concat();
    let mut terminal = folder.terminal_with(&call, &[]);
    terminal.wait_for_render(1);
    terminal.resize(120, 40);
    fs::remove_file(folder.path("wall.obj")).expect("removed");
    terminal.press("c");
    terminal.wait_for(&format!("wall.obj {}", glimt::pipeline::messages::MODEL_MISSING));
}
