//! Interactive use in a pseudo-terminal.

mod blocks;
mod camera;
mod camera_steps;
mod edits;
mod endings;
mod frame;
mod help_width;
mod history;
mod inline_output;
mod input;
mod inspection;
mod keys;
mod long;
mod model;
mod mouse_and_editor;
mod outputs;
pub(crate) mod pty;
mod relay;
mod saving;
mod screen;
mod scrolling;
mod sequences;
mod slow_connection;
#[cfg(target_os = "linux")]
mod soak;
mod switches;
#[cfg(target_os = "linux")]
mod thread_priority;
mod unchanged_saves;

use std::fs;

use crate::test_dir::{PROGRAM, TestDir};
use pty::{BLUE, Colors, GREEN, RED, SCENE, cells};

#[test]
fn preview_matches_the_written_image() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_color("red");
    terminal.wait_for_render(1);
    assert_eq!(folder.bytes("scene.png"), folder.once(&[]));
}

#[test]
fn each_save_renders_once() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_render(1);
    let path = folder.path("scene.toml");

    folder.write("scene.toml", SCENE.replace(RED, GREEN));
    terminal.wait_for_color("green");
    terminal.wait_for_render(2);

    folder.write(".scene.tmp", SCENE.replace(RED, BLUE));
    fs::rename(folder.path(".scene.tmp"), &path).expect("renamed");
    terminal.wait_for_color("blue");
    terminal.wait_for_render(3);

    // Save like vim: rename the old file to a backup, write a new file, and remove the backup.
    fs::rename(&path, folder.path("scene.toml~")).expect("renamed");
    folder.write("scene.toml", SCENE);
    fs::remove_file(folder.path("scene.toml~")).expect("removed");
    terminal.wait_for_color("red");
    terminal.wait_for_render(4);
    assert_eq!(folder.bytes("scene.png"), folder.once(&[]));

    // Saving unchanged contents or an unrelated file does not trigger a render.
    folder.write("scene.toml", SCENE);
    folder.write("notes.txt", "nothing");
    folder.write("scene.toml", SCENE.replace(RED, GREEN));
    terminal.wait_for_color("green");
    terminal.wait_for_render(5);
}

#[test]
fn last_of_many_fast_saves_wins() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_render(1);
    for i in 0..40 {
        folder.write("scene.toml", SCENE.replace(RED, [RED, GREEN][i % 2]));
    }
    folder.write("scene.toml", SCENE.replace(RED, BLUE));
    terminal.wait_for_color("blue");
    let expected = folder.once(&[]);
    terminal.wait("the last image on disk", |_| {
        fs::read(folder.path("scene.png")).is_ok_and(|bytes| bytes == expected)
    });
}

#[test]
fn broken_scene_shows_position_and_last_image() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_render(1);
    let before = (folder.bytes("scene.png"), modified(&folder));

    folder.write("scene.toml", SCENE.replace("samples = 4", "samples = \"four\""));
    terminal.wait_for("scene.toml:4:11");
    terminal.wait_for("broken");
    let colors = terminal.look(Colors::of);
    assert!(colors.red > 100 && colors.green + colors.blue == 0, "{colors:?}");
    assert_eq!((folder.bytes("scene.png"), modified(&folder)), before);

    folder.write("scene.toml", SCENE);
    terminal.wait("no error", |screen| !screen.contents().contains("error"));
    terminal.wait_for("done");
    assert_eq!((folder.bytes("scene.png"), modified(&folder)), before, "the image must not be written again");

    folder.write("scene.toml", "[render");
    terminal.wait_for("scene.toml:1:");
    folder.write("scene.toml", SCENE.replace(RED, GREEN));
    terminal.wait_for_color("green");
    terminal.wait_for_render(2);
}

fn modified(folder: &TestDir) -> std::time::SystemTime {
    let metadata = fs::metadata(folder.path("scene.png")).expect("an image");
    metadata.modified().expect("a time")
}

#[test]
fn recreated_scene_is_rendered() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_render(1);
    fs::remove_file(folder.path("scene.toml")).expect("removed");
    terminal.wait_for("missing");
    folder.write("scene.toml", SCENE.replace(RED, BLUE));
    terminal.wait_for_color("blue");
    terminal.wait_for_render(2);
}

#[test]
fn changed_asset_renders_again() {
    let folder = TestDir::with_board();
    let texture = "[textures.paint]\nfile = \"paint.ppm\"\n";
    let scene = SCENE
        .replace(RED, "{ texture = \"paint\" }")
        .replace("[materials]", &format!("{texture}[materials]"));
    folder.write("scene.toml", &scene);
    folder.write("paint.ppm", "P3\n1 1\n255\n230 20 20\n");
    let terminal = folder.terminal();
    terminal.wait_for_color("red");
    terminal.wait_for_render(1);
    folder.write("paint.ppm", "P3\n1 1\n255\n20 20 230\n");
    terminal.wait_for_color("blue");
    terminal.wait_for_render(2);
    assert_eq!(folder.bytes("scene.png"), folder.once(&[]));
}

#[test]
fn preview_follows_the_window_size() {
    let folder = TestDir::with_board();
    let mut terminal = folder.terminal();
    terminal.wait_for_render(1);
    let small = terminal.settled(|screen| Colors::of(screen).red);
    terminal.resize(200, 60);
    let is_at = |screen: &vt100::Screen, row: usize| {
        screen.contents().lines().nth(row).is_some_and(|line| line.trim_end().ends_with("? help"))
    };
    terminal.wait("a large image", |screen| is_at(screen, 59) && Colors::of(screen).red > 3 * small);
    terminal.resize(60, 10);
    terminal.wait("a small image", |screen| {
        let red = Colors::of(screen).red;
        is_at(screen, 9) && (1..small).contains(&red)
    });
    terminal.resize(80, 24);
    terminal.wait("the original image", |screen| is_at(screen, 23) && Colors::of(screen).red == small);
}

#[test]
fn no_color_preview_uses_characters() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal_with(&[PROGRAM, "scene.toml"], &[("NO_COLOR", "1")]);
    let is_ink = |cell: &vt100::Cell| "=+*#%@$&{}[]?".contains(cell.contents()) && cell.has_contents();
    terminal.wait("an image", |screen| cells(screen).filter(|cell| is_ink(cell)).count() > 100);
    terminal.wait_for("done");
    terminal.look(|screen| {
        for cell in cells(screen) {
            assert_ne!(cell.contents(), "▀");
            let colors = (cell.fgcolor(), cell.bgcolor());
            assert_eq!(colors, (vt100::Color::Default, vt100::Color::Default), "{:?}", cell.contents());
        }
    });
}
