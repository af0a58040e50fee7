//! Share of a thin line that pictures use while a held key moves the camera.

use std::error::Error;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use crate::watched::{Line, Watched};

/// Time between repeats of the key; then the time for which it is held before the line is measured, and the time of the
/// measurement.
const REPEAT: Duration = Duration::from_millis(33);
/// Presses in one direction. The camera swings in front of the scene: behind the wall of a room all is black, and there is nothing
/// to send.
const SWING: u32 = 8;
const BEFORE: Duration = Duration::from_secs(2);
const HELD: Duration = Duration::from_secs(6);

/// Prints a line for each of some scenes.
pub(crate) fn print() -> Result<(), Box<dyn Error>> {
    println!(
        "keys on the camera are held for {} s, at the end of a line of 1 Mbit/s and 150 ms",
        HELD.as_secs()
    );
    println!("{:<16} {:>14} {:>22}", "", "line used", "most unanswered bytes");
    for scene in ["cornell", "cornell_glass", "textures", "spheres"] {
        let (share, most) = orbit(scene)?;
        println!("{scene:<16} {:>12.0} % {most:>22}", 100.0 * share);
    }
    Ok(())
}

/// The used part of the line, and the most bytes without an answer.
fn orbit(scene: &str) -> Result<(f64, usize), Box<dyn Error>> {
    let program = std::env::var("GLIMT").unwrap_or(env!("CARGO_BIN_EXE_glimt").to_owned());
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene).with_extension("toml");
    let folder = tempfile::tempdir()?;
    let scene = scene.to_str().ok_or("a name that is no text")?;
    let command = [&*program, scene, "--samples", "100000", "-o", "out.png"];
    let terminal = Watched::open(&command, folder.path(), Line::THIN)?;
    terminal.wait("a picture", |far| far.percent().is_some())?;
    thread::sleep(BEFORE);
    hold(&terminal, BEFORE)?;
    let before = terminal.far().came;
    hold(&terminal, HELD)?;
    let far = terminal.far();
    let most = Line::THIN.bytes_per_second * HELD.as_secs_f64();
    Ok(((far.came - before) as f64 / most, far.most_unanswered))
}

/// Holds two opposite keys that orbit, in turns, and repeats them as keyboards do.
fn hold(terminal: &Watched, time: Duration) -> Result<(), Box<dyn Error>> {
    let begin = Instant::now();
    let mut presses = 0;
    while begin.elapsed() < time {
        // The first and the last swing are halves, so that the scene's own camera is in the middle.
        let is_right = ((presses + SWING / 2) / SWING).is_multiple_of(2);
        terminal.press(if is_right { "l" } else { "h" })?;
        presses += 1;
        thread::sleep((begin + REPEAT * presses).saturating_duration_since(Instant::now()));
    }
    Ok(())
}
