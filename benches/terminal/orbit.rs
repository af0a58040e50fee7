//! Utilization of a slow connection while a held key moves the camera.

use std::error::Error;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use crate::watched::{Connection, WatchedTerminal};

/// Key repeat interval. The key is first held for `WARM_UP_TIME`, then for `HOLD_TIME` while the connection
/// is measured.
const REPEAT: Duration = Duration::from_millis(33);
/// Number of presses in one direction, few enough that the camera stays in front of the scene. Behind a
/// room's wall, the image would be black, with nothing to send.
const PRESSES_PER_DIRECTION: u32 = 8;
const WARM_UP_TIME: Duration = Duration::from_secs(2);
const HOLD_TIME: Duration = Duration::from_secs(6);

/// Prints one line per scene.
pub(crate) fn print() -> Result<(), Box<dyn Error>> {
    println!(
        "camera keys held for {} s over a 1 Mbit/s connection with a round-trip time of 150 ms",
        HOLD_TIME.as_secs()
    );
    println!("{:<16} {:>14} {:>22}", "", "used", "max. unacknowledged bytes");
    for scene in ["cornell", "cornell_glass", "textures", "spheres"] {
        let (share, most) = orbit(scene)?;
        println!("{scene:<16} {:>12.0} % {most:>22}", 100.0 * share);
    }
    Ok(())
}

/// Returns the utilization and the maximum number of unacknowledged bytes.
fn orbit(scene: &str) -> Result<(f64, usize), Box<dyn Error>> {
    let program = std::env::var("GLIMT").unwrap_or(env!("CARGO_BIN_EXE_glimt").to_owned());
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(scene).with_extension("toml");
    let folder = tempfile::tempdir()?;
    let scene = scene.to_str().ok_or("a file name is not valid UTF-8")?;
    let command = [&*program, scene, "--samples", "100000", "-o", "out.png"];
    let terminal = WatchedTerminal::open(&command, folder.path(), Connection::SLOW)?;
    terminal.wait("a picture", |far| far.percent().is_some())?;
    thread::sleep(WARM_UP_TIME);
    hold(&terminal, WARM_UP_TIME)?;
    let before = terminal.far_end().came;
    hold(&terminal, HOLD_TIME)?;
    let far = terminal.far_end();
    let most = Connection::SLOW.bytes_per_second * HOLD_TIME.as_secs_f64();
    Ok(((far.came - before) as f64 / most, far.max_unanswered))
}

/// Alternates between two opposite orbit keys, held with keyboard repeat.
fn hold(terminal: &WatchedTerminal, time: Duration) -> Result<(), Box<dyn Error>> {
    let begin = Instant::now();
    let mut presses = 0;
    while begin.elapsed() < time {
        // The first and last swings are half as long, to center them on the scene's camera.
        let is_right = ((presses + PRESSES_PER_DIRECTION / 2) / PRESSES_PER_DIRECTION).is_multiple_of(2);
        terminal.press(if is_right { "l" } else { "h" })?;
        presses += 1;
        thread::sleep((begin + REPEAT * presses).saturating_duration_since(Instant::now()));
    }
    Ok(())
}
