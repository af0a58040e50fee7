//! Time to render a model from the command line: `glimt MODEL --once` as a new process, including file input
//! and output. Also measures subdivision.
//!
//! `cargo bench --bench models` generates a model with 100,352 triangles in a temporary folder, renders it
//! twenty times to a 512 × 512 PNG at `--error 0.05`, and prints the seconds, how many runs reached the goal,
//! and the machine's load. `-- FILE` renders a different model. `others.py` in this folder measures f3d and
//! Blender the same way.
//!
//! `-- --subdivide` subdivides a ball of 200,344 triangles twice, with and without texture coordinates, in this
//! process. It prints wall-clock and processor seconds, which do not depend on the machine's load.

#![allow(clippy::print_stdout)]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use std::{error, fs};

use glimt::assets::LoadedMesh;
use glimt::assets::mesh::{self, subdivide::subdivide};
use glimt::control::{CancelToken, ignore_progress};
use glimt::math::Vec2;
use glimt::system::cpu_time::process_cpu_seconds;

const RUNS: usize = 20;
/// Target seconds per run.
const GOAL: f64 = 1.0;

fn main() -> Result<(), Box<dyn error::Error>> {
    let folder = tempfile::tempdir()?;
    if std::env::args().any(|word| word == "--subdivide") {
        return measure_subdivision(folder.path());
    }
    let asked = std::env::args().skip(1).find(|word| !word.starts_with('-'));
    let model = match asked {
        Some(file) => PathBuf::from(file).canonicalize()?,
        None => {
            let model = folder.path().join("bumps.ply");
            fs::write(&model, bumps(224))?;
            model
        }
    };
    let mut seconds = Vec::new();
    for _ in 0..RUNS {
        seconds.push(run(folder.path(), &model)?);
    }
    seconds.sort_by(f64::total_cmp);
    let within = seconds.iter().filter(|seconds| **seconds <= GOAL).count();
    let (minimum, median, maximum) = (seconds[0], seconds[RUNS / 2], seconds[RUNS - 1]);
    println!(
        "{}, 512 × 512, --error 0.05: {minimum:.2} {median:.2} {maximum:.2} s (minimum, median, maximum)",
        model.display()
    );
    println!("{within} of {RUNS} runs took at most {GOAL} s");
    println!("load: {}", fs::read_to_string("/proc/loadavg").unwrap_or_default().trim());
    Ok(())
}

/// Wall-clock seconds of a process.
fn run(folder: &Path, model: &Path) -> Result<f64, Box<dyn error::Error>> {
    let begin = Instant::now();
    let status = Command::new(env!("CARGO_BIN_EXE_glimt"))
        .current_dir(folder)
        .arg(model)
        .args([
            "--once",
            "--force",
            "-o",
            "picture.png",
            "--width",
            "512",
            "--height",
            "512",
            "--error",
            "0.05",
        ])
        .args(["--progress", "none"])
        .stdin(Stdio::null())
        .status()?;
    if status.success() { Ok(begin.elapsed().as_secs_f64()) } else { Err("glimt failed".into()) }
}

/// Measures two levels of subdivision.
fn measure_subdivision(folder: &Path) -> Result<(), Box<dyn error::Error>> {
    const LEVELS: u32 = 2;
    let (path, token) = (folder.join("bumps.ply"), CancelToken::new());
    fs::write(&path, bumps(317))?;
    let plain = mesh::load(&path, &ignore_progress, &token)?;
    let mut textured = plain.clone();
    textured.mesh.uvs = plain.mesh.positions.iter().map(|at| Vec2::new(at.x, at.y * at.z)).collect();
    for (name, loaded) in [("plain", &plain), ("textured", &textured)] {
        let runs: Vec<_> = (0..RUNS / 4).map(|_| subdivision_seconds(loaded, LEVELS, &path)).collect();
        let runs = runs.into_iter().collect::<Result<Vec<_>, _>>()?;
        let least = |seconds: fn(&[f64; 2]) -> f64| runs.iter().map(seconds).fold(f64::INFINITY, f64::min);
        println!(
            "{name}: {} triangles, level {LEVELS}: {:.2} s, {:.2} s of processor time on {} threads",
            loaded.mesh.triangles.len() << (2 * LEVELS),
            least(|[wall, _]| *wall),
            least(|[_, processor]| *processor),
            rayon::current_num_threads()
        );
    }
    println!("load: {}", fs::read_to_string("/proc/loadavg").unwrap_or_default().trim());
    Ok(())
}

/// Wall-clock and processor seconds of a subdivision.
fn subdivision_seconds(
    loaded: &LoadedMesh,
    levels: u32,
    path: &Path,
) -> Result<[f64; 2], Box<dyn error::Error>> {
    let loaded = loaded.clone();
    let (wall, processor) = (Instant::now(), process_cpu_seconds());
    let fine = subdivide(loaded, levels, path, &CancelToken::new())?;
    let seconds = [wall.elapsed().as_secs_f64(), process_cpu_seconds() - processor];
    std::hint::black_box(fine);
    Ok(seconds)
}

/// A bumpy ball in ASCII PLY with about 2·rows² triangles.
fn bumps(rows: u32) -> String {
    let at = |i: u32| {
        let (row, column) = (f64::from(i / rows), f64::from(i % rows));
        let (polar, turn) = (
            std::f64::consts::PI * (row + 0.5) / f64::from(rows),
            std::f64::consts::TAU * column / f64::from(rows),
        );
        let radius = 1.0 + 0.05 * (9.0 * polar).sin() * (12.0 * turn).sin();
        [radius * polar.sin() * turn.cos(), radius * polar.cos(), radius * polar.sin() * turn.sin()]
    };
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        rows * rows,
        2 * (rows - 1) * rows
    );
    for i in 0..rows * rows {
        let [x, y, z] = at(i);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{x:.6} {y:.6} {z:.6}");
    }
    for i in 0..(rows - 1) * rows {
        let next = i / rows * rows + (i + 1) % rows;
        let _ = writeln!(text, "3 {i} {next} {}\n3 {next} {} {}", i + rows, next + rows, i + rows);
    }
    text
}
