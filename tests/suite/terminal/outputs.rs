//! The terminal UI never overwrites inputs either. It reports the conflict and keeps rendering.

use std::fs;
use std::os::unix::fs::symlink;
use std::time::Duration;

use glimt::pipeline::watch::ExternalChange;
use glimt::tui::messages;

use super::pty::{GREEN, RED, SCENE};
use crate::test_dir::{PROGRAM, TestDir, assert_mentions};

/// An image with one red texel.
const PAINT: &str = "P3\n1 1\n255\n230 20 20\n";

/// The scene with a file as the board's texture.
fn textured(file: &str) -> String {
    let texture = format!("[textures.paint]\nfile = \"{file}\"\n[materials]");
    SCENE.replace(RED, "{ texture = \"paint\" }").replace("[materials]", &texture)
}

/// Waits long enough to detect a render loop caused by the file watcher.
fn wait_for_render_loop() {
    std::thread::sleep(Duration::from_millis(1500));
}

#[test]
fn texture_named_like_the_image_is_kept() {
    let folder = TestDir::with_board();
    image::RgbImage::from_pixel(2, 2, image::Rgb([230, 20, 20]))
        .save(folder.path("scene.png"))
        .expect("saved");
    folder.write("scene.toml", textured("scene.png"));
    let before = folder.bytes("scene.png");
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    terminal.wait_for("`paint`");
    wait_for_render_loop();
    terminal.wait_for_render(1);
    assert_eq!(folder.bytes("scene.png"), before);
    terminal.press("\x1b");
    terminal.wait_for_color("red");
    terminal.press("w");
    terminal.wait_for_message(messages::NOT_WRITTEN);
    assert_eq!(folder.bytes("scene.png"), before);
    folder.write("scene.toml", textured("scene.png").replace("[render]", "[render]\noutput = \"other.png\""));
    terminal.wait_for_render(2);
    terminal.wait("no error", |screen| !screen.contents().contains("error"));
    assert!(folder.path("other.png").is_file());
    assert_eq!(folder.bytes("scene.png"), before);
}

#[test]
fn output_that_becomes_an_input_is_kept() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal_with(&[PROGRAM, "scene.toml", "--report", "r.json"], &[]);
    terminal.wait_for_render(1);
    let (picture, report) = (folder.bytes("scene.png"), folder.bytes("r.json"));
    folder.write("scene.toml", textured("scene.png"));
    terminal.wait_for("`paint`");
    wait_for_render_loop();
    assert_eq!(
        (folder.bytes("scene.png"), folder.bytes("r.json")),
        (picture, report),
        "nothing must be written"
    );
    folder.write("scene.toml", SCENE.replace(RED, GREEN));
    terminal.wait_for_color("green");
    terminal.wait("the image on disk", |_| folder.bytes("scene.png") == folder.once(&[]));
}

#[test]
fn unrelated_image_is_not_replaced() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_render(1);
    image::RgbImage::new(3, 2).save(folder.path("scene.png")).expect("saved");
    let photograph = folder.bytes("scene.png");
    folder.write("scene.toml", SCENE.replace(RED, GREEN));
    terminal.wait_for("-o FILE");
    terminal.wait_for_render(2);
    assert_eq!(folder.bytes("scene.png"), photograph);
}

#[test]
fn w_is_not_offered_for_another_scenes_image() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    fs::create_dir(folder.path("other")).expect("a folder");
    folder.write("other/scene.toml", SCENE.replace(RED, GREEN));
    let mut other = std::process::Command::new(PROGRAM);
    other.current_dir(folder.path("")).args(["other/scene.toml", "--once", "--force"]);
    assert!(other.output().expect("it runs").status.success());
    let image = folder.bytes("scene.png");
    let lost = ExternalChange::ReplacedByOtherScene;
    terminal.wait_for(&messages::output_not_overwritten("scene.png", lost.describe()));
    terminal.press("w");
    terminal.wait_for("other/scene.toml");
    assert_eq!(folder.bytes("scene.png"), image);
    terminal.press("q");
    terminal.code();
    assert_mentions(&terminal.last_lines(), &["scene.png", "other/scene.toml", "another scene's image"]);
}

#[test]
fn link_changed_while_rendering_is_detected() {
    let folder = TestDir::with_board();
    folder.write("paint.ppm", PAINT);
    symlink("first.ppm", folder.path("out.ppm")).expect("a link");
    let endless = textured("paint.ppm").replace("samples = 4", "samples = 10000000");
    folder.write("scene.toml", &endless);
    let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml", "-o", "out.ppm"], &[]);
    terminal.wait_for_color("red");
    terminal.wait_for("ETA");
    terminal.press("w");
    terminal.wait_for_message(&messages::files_written("out.ppm"));
    assert!(folder.path("first.ppm").is_file());
    fs::remove_file(folder.path("out.ppm")).expect("removed");
    symlink("paint.ppm", folder.path("out.ppm")).expect("a link");
    terminal.press("w");
    terminal.wait_for("`paint`");
    assert_eq!(folder.bytes("paint.ppm"), PAINT.as_bytes());
}

#[test]
fn finishing_render_keeps_image_written_with_w() {
    let folder = TestDir::with_board();
    let text = SCENE.replace("samples = 4", "samples = 12000");
    folder.write("scene.toml", &text);
    for (keys, changes) in [("]]", "exposure +0.5"), ("s", "shadows hard")] {
        let mut terminal = folder.terminal_with(&[PROGRAM, "scene.toml", "-o", "a.png"], &[]);
        terminal.wait_for_coverage();
        terminal.press(keys);
        terminal.press("w");
        terminal.wait_for_message(&messages::files_written("a.png"));
        let written = folder.bytes("a.png");
        terminal.wait_for_render(1);
        assert_eq!(folder.bytes("a.png"), written, "the render must not replace the image");
        terminal.press("0");
        terminal.wait_for(messages::RESET);
        terminal.wait("the scene's own image", |screen| {
            let text = screen.contents();
            text.contains("✓ done") && text.contains(changes)
        });
        assert_eq!(folder.bytes("a.png"), written, "a reset must not replace the image");
        terminal.press("q");
        assert_eq!(terminal.code(), 0);
        assert_mentions(&terminal.last_lines(), &["a.png", "unfinished", changes]);
        assert_eq!(folder.bytes("a.png"), written);
    }
}

#[test]
fn scene_save_replaces_image_written_with_w() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let own = folder.bytes("scene.png");
    terminal.press("]w");
    terminal.wait("the brighter image", |_| folder.bytes("scene.png") != own);
    folder.write("scene.toml", format!("{SCENE}# saved"));
    terminal.wait("the image of the save", |_| folder.bytes("scene.png") == own);
}

#[test]
fn own_writes_do_not_trigger_renders() {
    let folder = TestDir::with_board();
    folder.write("paint.ppm", PAINT);
    folder.write("scene.toml", textured("paint.ppm"));
    let command = [PROGRAM, "scene.toml", "-o", "a.png", "-o", "b.ppm", "--report", "r.json"];
    for poll in [&[][..], &["--poll"]] {
        let mut terminal = folder.terminal_with(&[&command[..], poll].concat(), &[]);
        terminal.wait_for_render(1);
        for _ in 0..3 {
            terminal.press("w");
            terminal.wait_for_message(&messages::files_written("a.png, b.ppm"));
        }
        wait_for_render_loop();
        terminal.wait_for_render(1);
        let report = folder.bytes("r.json");
        terminal.press("r");
        terminal.wait_for_render(2);
        wait_for_render_loop();
        terminal.wait_for_render(2);
        assert_ne!(folder.bytes("r.json"), report, "each render must have its report");
    }
}
