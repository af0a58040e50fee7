//! Keys on the camera: the first changed cell after a press, and pictures a second while a key is held.

use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use super::terminal::{Cells, Terminal};
use super::{COLUMNS, PAUSE, ROUNDS, ROWS, figures};
use crate::Outcome;

/// Time for which a key is held.
const HELD: Duration = Duration::from_secs(2);
/// Time between its repeats.
const REPEAT: Duration = Duration::from_millis(33);

/// A line of figures for a scene of this path.
pub fn row(folder: &Path, scene: &Path) -> Outcome<String> {
    let path = scene.to_str().ok_or("a name that is no text")?;
    let arguments = [path, "--samples", "100000", "-o", "out.png"];
    let mut terminal = Terminal::open(folder, &arguments, COLUMNS, ROWS)?;
    terminal.wait("a picture", |screen| screen.contents().contains('▀'))?;
    thread::sleep(2 * PAUSE);
    let mut times = Vec::new();
    for round in 0..ROUNDS {
        let before = terminal.cells();
        let begin = Instant::now();
        terminal.press(["l", "k", ">"][round % 3])?;
        times.push(terminal.when(PAUSE, |now| is_other(&before, now))? - begin);
    }
    Ok(format!("first {}  held {:5.1} pictures a second", figures(times), held(&mut terminal)?))
}

/// Holds a key that repeats as keyboards do, to and fro. Refined pictures of the same camera come later than the next press, so
/// that each burst of bytes is a picture of another camera.
fn held(terminal: &mut Terminal) -> Outcome<f64> {
    terminal.cells();
    let begin = Instant::now();
    let mut presses = 0;
    while begin.elapsed() < HELD {
        terminal.press(["l", "h"][presses / 10 % 2])?;
        presses += 1;
        thread::sleep((begin + REPEAT * presses as u32).saturating_duration_since(Instant::now()));
    }
    Ok(terminal.bursts() as f64 / begin.elapsed().as_secs_f64())
}

/// Whether another picture is shown; less noise does not count.
fn is_other(before: &Cells, now: &Cells) -> bool {
    let pairs = before.iter().zip(now).filter_map(|(a, b)| Some(((*a)?, (*b)?)));
    let far = |(a, b): &([[u8; 3]; 2], [[u8; 3]; 2])| {
        a.as_flattened().iter().zip(b.as_flattened()).any(|(a, b)| a.abs_diff(*b) > 16)
    };
    pairs.filter(far).count() > 20
}
