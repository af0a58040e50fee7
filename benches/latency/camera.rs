//! Camera keys: time from a key press to the first changed cell, and images per second while a key is held.

use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use super::terminal::{Cells, TimedTerminal};
use super::{COLUMNS, PAUSE, ROUNDS, ROWS, figures};
use crate::BenchResult;

/// How long a key is held.
const HOLD_TIME: Duration = Duration::from_secs(2);
/// Key repeat interval.
const REPEAT: Duration = Duration::from_millis(33);

/// Measures one scene and returns the results as a line of text.
pub fn row(folder: &Path, scene: &Path) -> BenchResult<String> {
    let path = scene.to_str().ok_or("a file name is not valid UTF-8")?;
    let arguments = [path, "--samples", "100000", "-o", "out.png"];
    let mut terminal = TimedTerminal::open(folder, &arguments, COLUMNS, ROWS)?;
    terminal.wait("a picture", |screen| screen.contents().contains('▀'))?;
    thread::sleep(2 * PAUSE);
    let mut times = Vec::new();
    for round in 0..ROUNDS {
        let before = terminal.cells();
        let begin = Instant::now();
        terminal.press(["l", "k", ">"][round % 3])?;
        times.push(terminal.time_of_change(PAUSE, |now| shows_other_image(&before, now))? - begin);
    }
    Ok(format!("first {}  held {:5.1} images per second", figures(times), time_held_keys(&mut terminal)?))
}

/// Holds opposite camera keys alternately, with keyboard repeat. Refined images arrive only after the next
/// press, so each burst of bytes is an image from a new camera position.
fn time_held_keys(terminal: &mut TimedTerminal) -> BenchResult<f64> {
    terminal.cells();
    let begin = Instant::now();
    let mut presses = 0;
    while begin.elapsed() < HOLD_TIME {
        terminal.press(["l", "h"][presses / 10 % 2])?;
        presses += 1;
        thread::sleep((begin + REPEAT * presses as u32).saturating_duration_since(Instant::now()));
    }
    Ok(terminal.bursts() as f64 / begin.elapsed().as_secs_f64())
}

/// Returns whether a different image is shown, ignoring differences due to noise.
fn shows_other_image(before: &Cells, now: &Cells) -> bool {
    let pairs = before.iter().zip(now).filter_map(|(a, b)| Some(((*a)?, (*b)?)));
    let far = |(a, b): &([[u8; 3]; 2], [[u8; 3]; 2])| {
        a.as_flattened().iter().zip(b.as_flattened()).any(|(a, b)| a.abs_diff(*b) > 16)
    };
    pairs.filter(far).count() > 20
}
