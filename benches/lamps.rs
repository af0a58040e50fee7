//! Measures the time needed to reach a fixed error as the number of lights grows at constant total power.
//!
//! `cargo bench --bench lamps` renders a room with 10, 100, 1000 and 10,000 small lights using both
//! integrators: first a reference with many samples, then three images with four samples per pixel.
//!
//! The error is inversely proportional to the number of samples, so seconds × relMSE / 1e-2 would be the time
//! to reach a relMSE of 1e-2 if fractional sample counts were possible. The last columns show the smallest
//! whole number of samples with a relMSE of at most 1e-2, and the time that the lights and render stages take
//! with that many samples. `-- whitted 10 1000` selects rows.

#![allow(clippy::print_stdout)]

use std::error;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

const RUNS: usize = 3;

/// Target relMSE.
const GOAL: f64 = 1e-2;

/// Maximum number of samples per pixel to try.
const MAX_SAMPLES: u32 = 64;

fn main() -> Result<(), Box<dyn error::Error>> {
    let asked: Vec<String> = std::env::args().skip(1).filter(|name| !name.starts_with("--")).collect();
    let is_asked = |name: &str, others: &[&str]| {
        asked.iter().any(|one| one == name) || !asked.iter().any(|one| others.contains(&one.as_str()))
    };
    let integrators = ["whitted", "path"];
    let counts = ["10", "100", "1000", "10000"];
    let folder = tempfile::tempdir()?;
    println!(
        "{:<8} {:>6} {:>8} {:>9} {:>12} {:>12} {:>15} {:>8} {:>9}",
        "", "lights", "build", "render", "shadow rays", "relMSE", "s x relMSE/1e-2", "samples", "s in all"
    );
    for integrator in integrators.into_iter().filter(|name| is_asked(name, &integrators)) {
        for count in counts.into_iter().filter(|count| is_asked(count, &counts)) {
            fs::write(folder.path().join("scene.toml"), scene(integrator, count.parse()?))?;
            render(folder.path(), &["--samples", "128", "--seed", "1", "-o", "reference.exr"])?;
            let RenderFigures { lights, seconds, rays, relmse } = fastest_render(folder.path(), 4)?;
            let to_goal = seconds * relmse / GOAL;
            let (mut samples, mut enough) = (1, fastest_render(folder.path(), 1)?);
            while enough.relmse > GOAL && samples < MAX_SAMPLES {
                samples += 1;
                enough = fastest_render(folder.path(), samples)?;
            }
            let waited = enough.lights + enough.seconds;
            println!(
                "{integrator:<8} {count:>6} {lights:>8.4} {seconds:>9.3} {rays:>12} {relmse:>12.2e} {to_goal:>15.4} {samples:>8} {waited:>9.3}"
            );
        }
    }
    Ok(())
}

/// Measurements of one render.
struct RenderFigures {
    /// Duration of the lights stage in seconds.
    lights: f64,
    /// Duration of the render stage in seconds.
    seconds: f64,
    /// Number of shadow rays.
    rays: f64,
    relmse: f64,
}

/// Returns the fastest of several renders.
fn fastest_render(folder: &Path, samples: u32) -> Result<RenderFigures, Box<dyn error::Error>> {
    let mut best: Option<[f64; 3]> = None;
    for _ in 0..RUNS {
        let figures = render(folder, &["--samples", &samples.to_string(), "-o", "picture.exr"])?;
        if best.is_none_or(|best| figures[0] + figures[1] < best[0] + best[1]) {
            best = Some(figures);
        }
    }
    let [lights, seconds, rays] = best.ok_or("no render")?;
    Ok(RenderFigures { lights, seconds, rays, relmse: error_of(folder)? })
}

/// Renders once. Returns the seconds spent in the lights and render stages, and the number of shadow rays.
fn render(folder: &Path, options: &[&str]) -> Result<[f64; 3], Box<dyn error::Error>> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_glimt"));
    command.current_dir(folder).args(["scene.toml", "--once", "--report", "report.json"]).args(options);
    if !command.stderr(Stdio::null()).status()?.success() {
        return Err("the render failed".into());
    }
    let report: serde_json::Value = serde_json::from_str(&fs::read_to_string(folder.join("report.json"))?)?;
    let stage = |name: &str| {
        let stages = report["stages"].as_array().into_iter().flatten();
        stages.filter(|stage| stage["name"] == name).filter_map(|stage| stage["seconds"].as_f64()).sum()
    };
    Ok([stage("lights"), stage("render"), report["counters"]["shadow_rays"].as_f64().unwrap_or(f64::NAN)])
}

/// Returns the relMSE of `picture.exr` against the reference.
fn error_of(folder: &Path) -> Result<f64, Box<dyn error::Error>> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_glimt"));
    let output =
        command.current_dir(folder).args(["compare", "picture.exr", "reference.exr", "--json"]).output()?;
    let errors: serde_json::Value = serde_json::from_slice(&output.stdout)?;
    errors["relmse"].as_f64().ok_or_else(|| "no relMSE".into())
}

/// Returns a room with objects and `count` small sphere lights outside the camera's view.
fn scene(integrator: &str, count: u32) -> String {
    let mut scene = format!(
        r#"[render]
width = 192
height = 192
max_depth = 4
integrator = "{integrator}"

[camera]
position = [0, 2.2, 7]
look_at = [0, 0.2, 0]
fov = 40

[materials]
wall = {{ diffuse = [0.6, 0.6, 0.6] }}
clay = {{ diffuse = [0.6, 0.4, 0.3] }}
gloss = {{ diffuse = [0.3, 0.3, 0.4], specular = [0.3, 0.3, 0.3], shininess = 30 }}
lamp = {{ diffuse = [0, 0, 0], emission = {emission} }}

[[plane]]
material = "wall"

[[box]]
center = [0, 2, -6.4]
size = [14, 4, 0.2]
material = "wall"

[[box]]
center = [-1.5, 0.6, 0]
size = [1, 1.2, 1]
rotate = [0, 25, 0]
material = "clay"

[[sphere]]
center = [0.4, 0.7, 0.3]
radius = 0.7
material = "gloss"

[[torus]]
center = [2, 0.4, 0.8]
axis = [0.3, 1, 0.2]
radius = 0.6
tube = 0.25
material = "clay"
"#,
        emission = 12_000.0 / f64::from(count)
    );
    // A low-discrepancy sequence: multiples of powers of the three-dimensional analog of the plastic number.
    let place = |i: u32, step: f64| (f64::from(i) * step).fract();
    for i in 0..count {
        let [x, y, z] = [0.819_172_51, 0.671_043_61, 0.549_700_48].map(|step| place(i, step));
        let _ = write!(
            scene,
            "\n[[sphere]]\ncenter = [{:.5}, {:.5}, {:.5}]\nradius = 0.02\nmaterial = \"lamp\"\n",
            x * 10.0 - 5.0,
            y + 3.2,
            z * 10.0 - 6.0
        );
    }
    scene
}
