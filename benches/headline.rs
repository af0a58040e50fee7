//! Headline figures: run times of whole processes on all threads, including file I/O.
//!
//! `cargo bench --bench headline` generates meshes and scenes in a temporary folder, renders each scene three
//! times and prints the fastest run: wall-clock and CPU time, and the time spent on loading, building and
//! rendering.

#![allow(clippy::print_stdout)]

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;
use std::{error, fs};

use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeValLike;

const RUNS: usize = 3;

/// A table row: title, scene, goal and options.
struct HeadlineRow {
    name: &'static str,
    goal: &'static str,
    scene: String,
    options: &'static [&'static str],
}

fn main() -> Result<(), Box<dyn error::Error>> {
    let folder = tempfile::tempdir()?;
    let path = |name: &str| folder.path().join(name);
    // Arguments: rings, columns, position. The meshes have 871,200, 78,804 and 1,700,168 triangles.
    fs::write(path("large.off"), ball(660, 661, -1.1))?;
    fs::write(path("small.off"), ball(198, 200, 1.1))?;
    fs::write(path("largest.off"), ball(922, 923, 0.0))?;
    let rows = [
        HeadlineRow {
            name: "950,000 triangles, 10 samples, 10 shadow rays",
            goal: "< 1.5 s wall clock",
            scene: meshes(10, 10, &["large.off", "small.off"]),
            options: &[],
        },
        HeadlineRow {
            name: "Cornell box, 10 samples, 5 shadow rays",
            goal: "< 0.5 s CPU time",
            scene: fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.toml"))?.replace(
                "width = 512\nheight = 512\nsamples = 64",
                "width = 480\nheight = 480\nsamples = 10\nshadow_samples = 5",
            ),
            options: &[],
        },
        HeadlineRow {
            name: "1.7 million triangles, 1 sample",
            goal: "building < 0.5 s, rendering < 0.1 s",
            scene: meshes(1, 1, &["largest.off"]),
            options: &[],
        },
        HeadlineRow {
            name: "the same scene with the k-d tree",
            goal: "",
            scene: meshes(1, 1, &["largest.off"]),
            options: &["--accel", "kdtree"],
        },
    ];
    println!(
        "{:<48} {:>7} {:>9} {:>7} {:>7} {:>7}  goal",
        "480 × 480 pixels, seconds", "wall", "processor", "meshes", "accel", "render"
    );
    for row in rows {
        fs::write(path("scene.toml"), &row.scene)?;
        let mut best: Option<[f64; 5]> = None;
        for _ in 0..RUNS {
            let figures = render(folder.path(), row.options)?;
            if best.is_none_or(|best| figures[0] < best[0]) {
                best = Some(figures);
            }
        }
        let [all, processor, meshes, accel, render] = best.unwrap_or_default();
        println!(
            "{:<48} {all:>7.2} {processor:>9.2} {meshes:>7.3} {accel:>7.3} {render:>7.3}  {}",
            row.name, row.goal
        );
    }
    Ok(())
}

/// Renders once. Returns wall-clock and CPU seconds, and the seconds spent in the meshes, accel and render
/// stages.
fn render(folder: &Path, options: &[&str]) -> Result<[f64; 5], Box<dyn error::Error>> {
    let processor = || -> nix::Result<f64> {
        let usage = getrusage(UsageWho::RUSAGE_CHILDREN)?;
        Ok((usage.user_time() + usage.system_time()).num_microseconds() as f64 * 1e-6)
    };
    let before = processor()?;
    let begin = Instant::now();
    let mut command = Command::new(env!("CARGO_BIN_EXE_glimt"));
    command.current_dir(folder).args(["scene.toml", "--once", "--report", "report.json"]).args(options);
    if !command.stderr(Stdio::null()).status()?.success() {
        return Err("the render failed".into());
    }
    let all = begin.elapsed().as_secs_f64();
    let report: serde_json::Value = serde_json::from_str(&fs::read_to_string(folder.join("report.json"))?)?;
    let stage = |name: &str| {
        let stages = report["stages"].as_array().into_iter().flatten();
        stages.filter(|stage| stage["name"] == name).filter_map(|stage| stage["seconds"].as_f64()).sum()
    };
    Ok([all, processor()? - before, stage("meshes"), stage("accel"), stage("render")])
}

/// Returns a scene with a floor, a light and the meshes in `files`.
fn meshes(samples: u32, shadow_samples: u32, files: &[&str]) -> String {
    let mut scene = format!(
        r#"[render]
width = 480
height = 480
samples = {samples}
shadow_samples = {shadow_samples}
ambient = [0.1, 0.1, 0.1]

[camera]
position = [0, 2, 6]
look_at = [0, 0.9, 0]
fov = 42

[materials]
clay = {{ diffuse = [0.7, 0.5, 0.4], specular = [0.2, 0.2, 0.2] }}
floor = {{ diffuse = [0.6, 0.6, 0.6] }}
lamp = {{ diffuse = [0, 0, 0], emission = [20, 20, 20] }}

[[plane]]
point = [0, -0.05, 0]
normal = [0, 1, 0]
material = "floor"

[[sphere]]
center = [1, 5, 3]
radius = 0.5
material = "lamp"
"#
    );
    for file in files {
        let _ = write!(scene, "\n[[mesh]]\nfile = \"{file}\"\nmaterial = \"clay\"\n");
    }
    scene
}

/// Generates an OFF file that contains a bumpy ball on the ground at `x`, with 2·rings·columns triangles
/// minus the degenerate triangles at the poles.
fn ball(rings: u32, columns: u32, x: f64) -> String {
    use std::f64::consts::{PI, TAU};
    let mut text = format!("OFF\n{} {} 0\n", (rings + 1) * columns, 2 * rings * columns - 2 * columns);
    for ring in 0..=rings {
        let height = PI * f64::from(ring) / f64::from(rings);
        for column in 0..columns {
            let around = TAU * f64::from(column) / f64::from(columns);
            let radius = 1.0 + 0.03 * (20.0 * height).sin() * (23.0 * around).cos();
            let point = [
                x + radius * height.sin() * around.cos(),
                1.0 + radius * height.cos(),
                radius * height.sin() * around.sin(),
            ];
            let _ = writeln!(text, "{:.6} {:.6} {:.6}", point[0], point[1], point[2]);
        }
    }
    for ring in 0..rings {
        for column in 0..columns {
            let index = |ring: u32, column: u32| ring * columns + column % columns;
            let (a, b) = (index(ring, column), index(ring, column + 1));
            let (c, d) = (index(ring + 1, column), index(ring + 1, column + 1));
            if ring + 1 < rings {
                let _ = writeln!(text, "3 {b} {d} {c}");
            }
            if ring > 0 {
                let _ = writeln!(text, "3 {a} {b} {c}");
            }
        }
    }
    text
}
