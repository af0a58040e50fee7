//! Ways to save a file. Each triggers exactly one render and no intermediate error.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use super::pty::{BLUE, GREEN, RED, SCENE, Terminal};
use crate::test_dir::{PROGRAM, TestDir};

/// A way to save text to a file.
type Save = fn(&Path, &str);

const SAVE_METHODS: [(&str, Save); 6] = [
    ("truncate and write", |path, text| fs::write(path, text).expect("written")),
    ("atomic rename", |path, text| {
        fs::write(sibling_path(path, ".new"), text).expect("written");
        fs::rename(sibling_path(path, ".new"), path).expect("renamed");
    }),
    ("vim", |path, text| {
        fs::write(sibling_path(path, "4913"), "").expect("written");
        fs::remove_file(sibling_path(path, "4913")).expect("removed");
        fs::rename(path, sibling_path(path, "~")).expect("renamed");
        fs::write(path, text).expect("written");
        let mode = fs::metadata(sibling_path(path, "~")).expect("the backup").permissions();
        fs::set_permissions(path, mode).expect("permitted");
        fs::remove_file(sibling_path(path, "~")).expect("removed");
    }),
    ("Emacs", |path, text| {
        fs::rename(path, sibling_path(path, "~")).expect("renamed");
        fs::write(path, text).expect("written");
    }),
    ("unlink and write", |path, text| {
        fs::remove_file(path).expect("removed");
        fs::write(path, text).expect("written");
    }),
    ("replaced link target", |path, text| {
        // The first save turns the file into a link with the same contents. The watcher must then find the
        // target.
        let folder = sibling_path(path, ".d");
        if !folder.is_dir() {
            fs::create_dir(&folder).expect("a folder");
            fs::rename(path, folder.join("real")).expect("renamed");
            std::os::unix::fs::symlink(folder.join("real"), path).expect("a link");
        }
        fs::write(folder.join("new"), text).expect("written");
        fs::rename(folder.join("new"), folder.join("real")).expect("renamed");
    }),
];

fn sibling_path(path: &Path, ending: &str) -> std::path::PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

/// Two alternating colors that identify the saved versions.
fn alternating_colors() -> impl Iterator<Item = (&'static str, &'static str)> {
    [("green", GREEN), ("blue", BLUE)].into_iter().cycle()
}

#[test]
fn every_way_of_saving_a_scene_renders_once() {
    for options in [&[][..], &["--poll"]] {
        let folder = TestDir::with_board();
        let terminal = folder.terminal_with(&[&[PROGRAM, "scene.toml"], options].concat(), &[]);
        terminal.wait_for_render(1);
        for ((render, (way, save)), (color, value)) in (2..).zip(SAVE_METHODS).zip(alternating_colors()) {
            save(&folder.path("scene.toml"), &SCENE.replace(RED, value));
            terminal.wait_for_color(color);
            terminal.wait_for_render(render);
            // Saving the same contents again triggers no render, as the next iteration's render count
            // confirms.
            save(&folder.path("scene.toml"), &SCENE.replace(RED, value));
            println!("{way} {options:?}");
        }
        terminal.wait_for_render(SAVE_METHODS.len() + 1);
    }
}

#[test]
fn every_way_of_saving_an_asset_renders_once() {
    for options in [&[][..], &["--poll"]] {
        let folder = TestDir::with_board();
        let texture = "[textures.paint]\nfile = \"paint.ppm\"\n";
        let scene = SCENE.replace(RED, "{ texture = \"paint\" }");
        folder.write("scene.toml", scene.replace("[materials]", &format!("{texture}[materials]")));
        folder.write("paint.ppm", "P3\n1 1\n255\n230 20 20\n");
        let terminal = folder.terminal_with(&[&[PROGRAM, "scene.toml"], options].concat(), &[]);
        terminal.wait_for_render(1);
        for ((render, (way, save)), (color, _)) in (2..).zip(SAVE_METHODS).zip(alternating_colors()) {
            let paint = if color == "green" { "20 230 20" } else { "20 20 230" };
            save(&folder.path("paint.ppm"), &format!("P3\n1 1\n255\n{paint}\n"));
            terminal.wait_for_color(color);
            terminal.wait_for_render(render);
            println!("{way} {options:?}");
        }
    }
}

/// Checks that no error appears before a render with the given color is finished.
#[track_caller]
fn no_error_until(terminal: &Terminal, color: &'static str, render: usize) {
    terminal.wait(color, |screen| {
        let text = screen.contents();
        assert!(!text.contains("error") && !text.contains("broken"), "intermediate error\n{text}");
        super::Colors::of(screen).is_dominant(color)
    });
    terminal.wait_for_render(render);
}

/// Splits text in the middle of a line.
fn halves(text: &str) -> (&str, &str) {
    text.split_at(text.find("diffuse").expect("a material") + 4)
}

/// Pause between the two writes. If a busy machine makes it much longer, errors are allowed.
const PAUSE: Duration = Duration::from_millis(200);

#[test]
fn slow_save_shows_no_error() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_render(1);
    let mut render = 1;
    for (number, (color, value)) in (0..6).zip(alternating_colors()) {
        let text = SCENE.replace(RED, value);
        let (first, second) = halves(&text);
        let begin;
        if number % 3 == 0 {
            let mut file = fs::File::create(folder.path("scene.toml")).expect("opened");
            file.write_all(first.as_bytes()).expect("written");
            begin = Instant::now();
            std::thread::sleep(PAUSE);
            file.write_all(second.as_bytes()).expect("written");
        } else {
            folder.write("scene.toml", first);
            begin = Instant::now();
            std::thread::sleep(PAUSE);
            let mut file =
                fs::OpenOptions::new().append(true).open(folder.path("scene.toml")).expect("opened");
            file.write_all(second.as_bytes()).expect("written");
        }
        render += 1;
        if begin.elapsed() < PAUSE + PAUSE / 4 {
            no_error_until(&terminal, color, render);
        } else {
            terminal.wait_for_color(color);
            terminal.wait_for_render(render);
        }
    }
}

#[test]
fn persistent_error_is_shown() {
    let folder = TestDir::with_board();
    let terminal = folder.terminal();
    terminal.wait_for_render(1);
    let (half, _) = halves(SCENE);
    let mut file = fs::File::create(folder.path("scene.toml")).expect("opened");
    file.write_all(half.as_bytes()).expect("written");
    // The error is reported even if the file remains open.
    terminal.wait_for("broken");
    drop(file);
    folder.write("scene.toml", SCENE.replace(RED, GREEN));
    terminal.wait_for_color("green");
    folder.write("scene.toml", half);
    terminal.wait_for("broken");
}

#[test]
fn broken_save_does_not_stop_the_render() {
    let folder = TestDir::with_board();
    // A render slow enough for the scene to be saved before it ends.
    let slow = SCENE.replace("samples = 4", "samples = 1000").replace("width = 64", "width = 320");
    let slow = slow.replace("height = 48", "height = 240");
    folder.write("scene.toml", &slow);
    let terminal = folder.terminal();
    terminal.wait_for("ETA");
    folder.write("scene.toml", "[render");
    terminal.wait_for("broken");
    terminal.wait("the image on disk", |_| folder.path("scene.png").is_file());
    terminal.wait_for("broken");
    let path = folder.path("scene.png");
    let written = std::fs::read(&path).expect("an image");
    folder.write("scene.toml", &slow);
    terminal.wait_for("done");
    assert_eq!(written, folder.once(&[]));
}

/// Removes and recreates the scene's folder like `git checkout`. The program runs inside or outside the
/// folder.
#[test]
fn recreated_folder_is_watched() {
    for (line, picture) in [
        ("cd work && exec \"$0\" scene.toml", "work/scene.png"),
        ("exec \"$0\" work/scene.toml", "scene.png"),
    ] {
        let folder = TestDir::with_board();
        let make = |color: &str| {
            fs::create_dir(folder.path("work")).expect("a folder");
            folder.write("work/scene.toml", SCENE.replace(RED, color));
        };
        make(RED);
        let terminal = folder.terminal_with(&["/bin/sh", "-c", line, PROGRAM], &[]);
        terminal.wait_for_render(1);
        fs::remove_dir_all(folder.path("work")).expect("removed");
        terminal.wait_for("missing");
        make(BLUE);
        terminal.wait_for_color("blue");
        terminal.wait_for_render(2);
        assert!(folder.path(picture).is_file(), "{picture}");
        // Saving must work as before.
        folder.write("work/scene.toml", SCENE.replace(RED, GREEN));
        terminal.wait_for_color("green");
        terminal.wait_for_render(3);
        // Remove and recreate the folder between two polls.
        fs::remove_dir_all(folder.path("work")).expect("removed");
        make(GREEN);
        folder.write("work/scene.toml", SCENE);
        terminal.wait_for_color("red");
        folder.write("work/scene.toml", SCENE.replace(RED, BLUE));
        terminal.wait_for_color("blue");
    }
}
