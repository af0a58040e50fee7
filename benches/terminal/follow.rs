//! Difference between the screen and the final image during a render.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::thread;
use std::time::Duration;

use crate::watched::{COLUMNS, Connection, ROWS, WatchedTerminal};

/// Render progress in percent at which to compare the screen, with the maximum difference on a scale of 0 to
/// 255.
const CHECKPOINTS: [(u32, f64); 3] = [(10, 1.5), (25, 0.8), (50, 0.5)];

const TERMINALS: [(&str, &[&str]); 5] = [
    ("half blocks", &["--preview", "halfblock", "--color", "truecolor"]),
    ("sextants", &["--preview", "sextant", "--color", "truecolor"]),
    ("256 colors", &["--preview", "halfblock", "--color", "256"]),
    ("kitty", &["--preview", "kitty", "--color", "truecolor"]),
    ("sixel", &["--preview", "sixel", "--color", "truecolor"]),
];

/// tmux settings: 24-bit color on both sides.
const TMUX: &str =
    "set -g default-terminal tmux-256color\nset -as terminal-features ',*:RGB'\nset -g status off\n";

/// Prints a line for each display mode.
pub(crate) fn print() -> Result<(), Box<dyn Error>> {
    println!(
        "mean absolute difference from the final screen on a scale of 0 to 255: cornell_glass, 256 samples,"
    );
    println!("{COLUMNS}×{ROWS} cells, a terminal that answers immediately; bounds {CHECKPOINTS:?}\n");
    println!("{:<14} {:>7} {:>7} {:>7} {:>9} {:>9}", "", "10 %", "25 %", "50 %", "seconds", "kB/s");
    let program = std::env::var("GLIMT").unwrap_or(env!("CARGO_BIN_EXE_glimt").to_owned());
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell_glass.toml");
    let scene = scene.to_str().ok_or("a file name is not valid UTF-8")?;
    let folder = tempfile::tempdir()?;
    let render = [&*program, scene, "--samples", "256", "-o", "out.png"];
    for (name, options) in TERMINALS {
        println!("{name:<14} {}", follow(&[&render, options].concat(), folder.path())?);
    }
    let settings = folder.path().join("tmux.conf");
    fs::write(&settings, TMUX)?;
    let settings = settings.to_str().ok_or("a file name is not valid UTF-8")?;
    let socket = format!("glimt-bench-{}", std::process::id());
    let tmux = ["tmux", "-L", &socket, "-f", settings, "new-session"];
    let line = follow(&[&tmux, &render[..], TERMINALS[0].1].concat(), folder.path());
    // Ignore errors: the server exits with its last session.
    let _ = std::process::Command::new("tmux").args(["-L", &socket, "kill-server"]).output();
    println!("{:<14} {}", "through tmux", line?);
    Ok(())
}

/// Renders once, and compares the screen during the render with its final state.
fn follow(command: &[&str], folder: &Path) -> Result<String, Box<dyn Error>> {
    let terminal = WatchedTerminal::open(command, folder, Connection::NONE)?;
    let begin = std::time::Instant::now();
    let mut screens = Vec::new();
    for (percent, _) in CHECKPOINTS {
        terminal.wait("progress", |far| far.percent().is_some_and(|now| now >= percent))?;
        screens.push(terminal.far_end().colors());
    }
    terminal.wait("the end", |far| far.percent() == Some(100))?;
    let (seconds, came) = (begin.elapsed().as_secs_f64(), terminal.far_end().came);
    // The last image may still be in transit.
    thread::sleep(Duration::from_secs(2));
    let last = terminal.far_end().colors();
    let figures: Vec<String> = screens
        .iter()
        .map(|screen| mean_difference(screen, &last).map_or("–".into(), |it| format!("{it:.2}")))
        .collect();
    let rate = came as f64 / seconds / 1e3;
    Ok(format!("{:>7} {:>7} {:>7} {seconds:>9.1} {rate:>9.0}", figures[0], figures[1], figures[2]))
}

/// Returns the mean absolute difference between pixels. `None` if the sizes differ.
fn mean_difference(a: &[[u8; 3]], b: &[[u8; 3]]) -> Option<f64> {
    let pairs = a.iter().zip(b).filter(|(a, b)| **a != [0; 3] || **b != [0; 3]);
    let (mut sum, mut count) = (0, 0);
    for (a, b) in pairs {
        sum += a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>();
        count += 3_u64;
    }
    (a.len() == b.len()).then(|| sum as f64 / count.max(1) as f64)
}
