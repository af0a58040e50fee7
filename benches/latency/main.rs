//! Latency from a save or key press to the first changed image cell, and from a cancellation until the render
//! stops.
//!
//! `cargo bench --bench latency [-- [settled] [busy] [cancel] [camera] [SCENE…]]` copies scenes and assets to
//! a temporary folder, runs glimt on each scene in a pseudo-terminal of 120×40 cells, edits the file, presses
//! keys, and prints medians and maxima in milliseconds. The clock starts before the file is written or the
//! key is pressed, and stops when the terminal has read the first bytes that change the image.
//!
//! `settled` saves the file while nothing is rendering, `busy` while the previous image is still rendering.
//! `cancel` measures the time until the worker starts on a newer request, whatever kind of work is in
//! progress. `camera` presses camera keys in every bundled scene while the previous image is rendering, and
//! prints the time to the first changed cell and the images per second while a key is held. Set `GLIMT` to
//! measure a different build.

#![allow(clippy::print_stdout)]

mod camera;
mod cancel;
mod scenes;
mod terminal;

use std::error::Error;
use std::fs;
use std::time::{Duration, Instant};

use scenes::{EditedScene, SCENES, SceneCopies};
use terminal::{Cells, TimedTerminal};

type BenchResult<T> = Result<T, Box<dyn Error>>;

const COLUMNS: u16 = 120;
const ROWS: u16 = 40;
/// Number of measurements per edit or key.
const ROUNDS: usize = 7;
/// Idle time after a save.
const PAUSE: Duration = Duration::from_millis(300);

fn main() -> BenchResult<()> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|one| !one.starts_with('-')).collect();
    let modes = ["settled", "busy", "cancel", "camera"];
    let all_modes = !arguments.iter().any(|one| modes.contains(&one.as_str()));
    let all_scenes = !arguments.iter().any(|one| !modes.contains(&one.as_str()));
    let is_wanted = |mode: &str| all_modes || arguments.iter().any(|one| one == mode);
    let mut copies = SceneCopies::new()?;
    let scenes = SCENES.iter().filter(|scene| all_scenes || arguments.iter().any(|one| one == scene.name));
    let scenes: Vec<&EditedScene> = scenes.collect();
    for mode in [Mode::Settled, Mode::Busy] {
        if is_wanted(mode.name()) {
            println!(
                "{}: from a save or key press to the first changed cell, ms, median (maximum)",
                mode.name()
            );
            for scene in &scenes {
                row(&mut copies, scene, mode)?;
            }
        }
    }
    if is_wanted("cancel") {
        println!("cancel: until the worker starts on the next request, ms, median (maximum)");
        for scene in &scenes {
            println!("{:<14} {}", scene.name, figures(cancel::times(&copies.scene(scene))?));
        }
    }
    if is_wanted("camera") {
        println!("camera: from a key press to the first changed cell, ms, median (maximum)");
        for path in copies.all()? {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            if all_scenes || arguments.contains(&name) {
                println!("{name:<14} {}", camera::row(copies.folder(), &path)?);
            }
        }
    }
    Ok(())
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Settled,
    Busy,
}

impl Mode {
    fn name(self) -> &'static str {
        match self {
            Self::Settled => "settled",
            Self::Busy => "busy",
        }
    }

    /// Returns whether a different image is shown. If rendering is in progress, differences due to noise are
    /// ignored.
    fn shows_other_image(self, before: &Cells, now: &Cells) -> bool {
        let differ = |most: u8| {
            let pairs = before.iter().zip(now).filter_map(|(a, b)| Some(((*a)?, (*b)?)));
            let far = move |(a, b): &([[u8; 3]; 2], [[u8; 3]; 2])| {
                a.as_flattened().iter().zip(b.as_flattened()).any(|(a, b)| a.abs_diff(*b) > most)
            };
            pairs.filter(far).count()
        };
        match self {
            Self::Settled => differ(0) > 0,
            Self::Busy => differ(16) > 20,
        }
    }
}

/// Measures every edit and key in one scene.
fn row(copies: &mut SceneCopies, scene: &EditedScene, mode: Mode) -> BenchResult<()> {
    let path = copies.scene(scene);
    let path = path.to_str().ok_or("a file name is not valid UTF-8")?;
    let samples = if mode == Mode::Settled { "2" } else { "100000" };
    let arguments = [path, "--samples", samples, "-o", "out.png"];
    let mut terminal = TimedTerminal::open(copies.folder(), &arguments, COLUMNS, ROWS)?;
    terminal.wait("a picture", |screen| screen.contents().contains('▀'))?;
    // Wait until the files are old enough for their modification times to identify their contents.
    std::thread::sleep(Duration::from_millis(2500));
    let mut words = Vec::new();
    for edit in scene.edits {
        let mut times = Vec::new();
        for _ in 0..ROUNDS {
            let before = ready(&mut terminal, mode)?;
            let (file, bytes) = copies.edit(scene, *edit)?;
            let begin = Instant::now();
            fs::write(&file, &bytes)?;
            let end = terminal
                .time_of_change(PAUSE, |now| mode.shows_other_image(&before, now))
                .map_err(|error| format!("{} {}: {error}", scene.name, edit.0))?;
            times.push(end - begin);
        }
        words.push(format!("{} {}", edit.0, figures(times)));
    }
    for key in scene.keys {
        let mut times = Vec::new();
        for _ in 0..ROUNDS {
            // Request a different image each time, so that no image is cached. Camera edits change every
            // view.
            ready(&mut terminal, mode)?;
            let (file, bytes) = copies.edit(scene, scene.camera())?;
            fs::write(&file, &bytes)?;
            std::thread::sleep(2 * PAUSE);
            let before = ready(&mut terminal, mode)?;
            let begin = Instant::now();
            terminal.press(key)?;
            let end = terminal
                .time_of_change(PAUSE, |now| mode.shows_other_image(&before, now))
                .map_err(|error| format!("{} {key}: {error}", scene.name))?;
            times.push(end - begin);
        }
        words.push(format!("{key} {}", figures(times)));
    }
    println!("{:<14} {}", scene.name, words.join("  "));
    Ok(())
}

/// Waits until the image is ready for an edit or key press.
fn ready(terminal: &mut TimedTerminal, mode: Mode) -> BenchResult<Cells> {
    if mode == Mode::Settled {
        terminal.wait("the render to finish", |screen| {
            screen.contents().lines().next().is_some_and(|line| line.contains("done"))
        })?;
        std::thread::sleep(PAUSE);
    }
    Ok(terminal.cells())
}

/// Formats the median and the maximum in milliseconds.
fn figures(mut times: Vec<Duration>) -> String {
    times.sort();
    let milliseconds = |time: Option<&Duration>| time.map_or(0.0, |time| time.as_secs_f64() * 1e3);
    format!("{:5.1} ({:.0})", milliseconds(times.get(times.len() / 2)), milliseconds(times.last()))
}
