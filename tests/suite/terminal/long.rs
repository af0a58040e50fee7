//! Long renders: checkpoints in interactive use, and a merge that waits for parts.

use std::fs;

use glimt::tui::messages;

use super::pty::{SCENE, Terminal, shows};
use crate::test_dir::{PROGRAM, TestDir, assert_mentions, mentions};

/// The scene with `samples` samples per pixel.
fn scene(samples: u32, rest: &str) -> String {
    SCENE.replace("samples = 4", &format!("samples = {samples}\n{rest}"))
}

/// A folder with the checkpoint of a finished render.
fn with_checkpoint(samples: u32) -> TestDir {
    let folder = TestDir::with_board();
    folder.write("scene.toml", scene(samples, ""));
    let options = ["-o", "scene.png", "--keep-checkpoint"];
    let mut process = std::process::Command::new(PROGRAM);
    process.current_dir(folder.path("")).args(["scene.toml", "--once"]).args(options);
    assert!(process.output().expect("it runs").status.success());
    assert!(folder.path("scene.png.checkpoint").is_file());
    fs::remove_file(folder.path("scene.png")).expect("removed");
    folder
}

fn terminal(folder: &TestDir, options: &[&str]) -> Terminal {
    folder.terminal_with(&[&[PROGRAM, "scene.toml"], options].concat(), &[])
}

/// Start of the message about an ignored checkpoint.
fn ignored_checkpoint_message() -> String {
    messages::checkpoint_ignored("scene.png.checkpoint", "")
}

#[test]
fn ignored_checkpoint_is_reported() {
    let is_fine = |terminal: &Terminal, facts: &[&str]| {
        terminal.wait_for_message(&ignored_checkpoint_message());
        assert_mentions(&terminal.text().split_whitespace().collect::<Vec<_>>().join(" "), facts);
        terminal.wait_for_render(1);
        let text = terminal.text();
        assert!(!text.contains("error") && !text.contains("--resume"), "{text}");
    };
    // The checkpoint has more samples than requested.
    let folder = with_checkpoint(8);
    folder.write("scene.toml", scene(3, ""));
    let long = terminal(&folder, &[]);
    is_fine(&long, &[&glimt::pipeline::messages::oversampled_checkpoint_message(3)]);
    assert_eq!(folder.bytes("scene.png"), folder.once(&[]), "the image must not contain its samples");
    assert!(folder.path("scene.png.checkpoint").exists(), "it has more samples than the image");
    drop(long);
    // The checkpoint belongs to a different image. This is reported once, not after each edit.
    folder.write("scene.toml", scene(9, "seed = 5"));
    let other = terminal(&folder, &[]);
    is_fine(&other, &["seed", "0", "5"]);
    folder.write("scene.toml", scene(9, "seed = 6"));
    other.wait_for_render(2);
    assert!(!other.look(|screen| shows(screen, &ignored_checkpoint_message())), "{}", other.text());
    drop(other);
    // The checkpoint is damaged.
    let mut bytes = folder.bytes("scene.png.checkpoint");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(folder.path("scene.png.checkpoint"), bytes).expect("written");
    folder.write("scene.toml", scene(9, ""));
    let damaged = terminal(&folder, &["--resume"]);
    is_fine(&damaged, &[glimt::pipeline::messages::DAMAGED]);
    assert_eq!(folder.bytes("scene.png"), folder.once(&[]));
}

#[test]
fn quit_saves_and_reports_a_long_render() {
    let folder = TestDir::with_board();
    folder.write("scene.toml", scene(10_000_000, ""));
    let mut long = terminal(&folder, &["--checkpoint", "0.2"]);
    long.wait_for("ETA");
    std::thread::sleep(std::time::Duration::from_millis(400));
    long.press("q");
    assert_eq!(long.end_showing("continues"), 0);
    assert!(folder.path("scene.png.checkpoint").is_file());
    let mut again = terminal(&folder, &[]);
    again.wait_for(messages::RESUMING);
    again.press("q");
    assert_eq!(again.end_showing("continues"), 0);
    // Short renders do not write a checkpoint.
    fs::remove_file(folder.path("scene.png.checkpoint")).expect("removed");
    let mut short = terminal(&folder, &["--checkpoint", "1000"]);
    short.wait_for("ETA");
    short.press("q");
    assert_eq!(short.end(), 0);
    assert!(!folder.path("scene.png.checkpoint").exists());
}

#[test]
fn watching_merge_shows_arriving_parts() {
    let folder = TestDir::with_board();
    let run = |line: &str| {
        let mut process = std::process::Command::new(PROGRAM);
        process.current_dir(folder.path("")).args(line.split_whitespace());
        assert!(process.output().expect("it runs").status.success(), "{line}");
    };
    for index in 1..=3 {
        run(&format!("scene.toml --once -o {index} --shard {index}/3"));
    }
    run("scene.toml --once -o one.png");
    fs::rename(folder.path("1"), folder.path("1.part")).expect("renamed");
    let parts = ["1.part", "2.part", "3.part"];
    let command = [&[PROGRAM, "merge", "joined.png"], parts.as_slice(), &["--watch"]].concat();
    let merge = folder.terminal_with(&command, &[]);
    let cells = |merge: &Terminal| merge.settled(|screen| super::Colors::of(screen).total());
    merge.wait_for("1 of 3 parts");
    let first = cells(&merge);
    fs::write(folder.path("2.part"), &folder.bytes("2")[..100]).expect("written");
    merge.wait("an incomplete part", |screen| {
        mentions(&screen.contents(), "1 of 3") && mentions(&screen.contents(), "2.part")
    });
    fs::rename(folder.path("2"), folder.path("2.part")).expect("renamed");
    merge.wait_for("2 of 3 parts");
    let second = cells(&merge);
    fs::rename(folder.path("3"), folder.path("3.part")).expect("renamed");
    merge.wait_for("joined.png (64×48)");
    let all = cells(&merge);
    assert!(first > 0 && first < second && second < all, "{first}, {second}, {all} cells");
    // The image and text are at most 80 columns wide, and no line wraps.
    let text = merge.text();
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    assert_eq!(merge.end(), 0);
    assert_eq!(folder.bytes("joined.png"), folder.bytes("one.png"));
}
