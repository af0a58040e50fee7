//! Renders scenes with the program and compares the images.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::row::{RowMeasure, SceneFiles, StressRow};

/// Time limit for a render, after which it is considered hung.
const RENDER_TIME_LIMIT: Duration = Duration::from_secs(120);

/// Maximum time relative to the reference.
pub(crate) const MAX_SLOWDOWN: f64 = 3.0;

/// A rendered image.
#[derive(Clone)]
pub(crate) struct Rendered {
    pub(crate) pixels: Vec<f32>,
    /// Seconds spent in all stages except reading and writing.
    pub(crate) seconds: f64,
    pub(crate) non_finite: u64,
    /// The render report.
    pub(crate) report: serde_json::Value,
}

/// Measured results for one table row.
pub(crate) struct RowResult {
    /// The largest error over all pairs.
    pub(crate) figure: f64,
    pub(crate) non_finite: u64,
    /// Total seconds for the cases, and for their references.
    pub(crate) seconds: [f64; 2],
}

impl RowResult {
    /// Whether the images are within their bounds, regardless of time.
    pub(crate) fn is_within_bounds(&self, row: &StressRow) -> bool {
        self.figure <= row.bound && self.non_finite == 0
    }

    /// The reasons why the row fails.
    pub(crate) fn failures(&self, row: &StressRow) -> Vec<&'static str> {
        let slower = self.seconds[0] / self.seconds[1];
        let faults = [
            (!(self.figure <= row.bound), "exceeds its bound"),
            (self.non_finite > 0, "has non-finite samples"),
            (row.is_timed && !(slower <= MAX_SLOWDOWN), "too slow"),
        ];
        faults.into_iter().filter(|(holds, _)| *holds).map(|(_, what)| what).collect()
    }
}

/// Renders all images in a row `rounds` times, interleaved, and keeps the shortest times.
///
/// # Errors
/// The program failed, crashed or took too long.
pub(crate) fn measure(row: &StressRow, rounds: u32) -> Result<RowResult, String> {
    let mut measured = RowResult { figure: 0.0, non_finite: 0, seconds: [0.0; 2] };
    let mut last: Option<(&SceneFiles, Rendered)> = None;
    for (case, twin) in &row.pairs {
        let mut case_of = render(case)?;
        let mut twin_of = match last.take() {
            Some((picture, rendered)) if picture.scene == twin.scene && picture.options == twin.options => {
                rendered
            }
            Some(_) | None => render(twin)?,
        };
        for _ in 1..rounds {
            case_of.seconds = case_of.seconds.min(render(case)?.seconds);
            twin_of.seconds = twin_of.seconds.min(render(twin)?.seconds);
        }
        // Treat NaN as the worst value.
        let figure = figure(row.figure, &case_of.pixels, &twin_of.pixels)?;
        measured.figure = if figure <= measured.figure { measured.figure } else { figure };
        measured.non_finite += case_of.non_finite + twin_of.non_finite;
        measured.seconds[0] += case_of.seconds;
        measured.seconds[1] += twin_of.seconds;
        last = Some((twin, twin_of));
    }
    Ok(measured)
}

fn figure(figure: RowMeasure, case: &[f32], twin: &[f32]) -> Result<f64, String> {
    Ok(match figure {
        RowMeasure::Mean(right) => {
            let mean = case.iter().map(|&x| f64::from(x)).sum::<f64>() / case.len() as f64;
            (mean / right - 1.0).abs()
        }
        RowMeasure::Difference(times) => {
            if case.len() != twin.len() {
                return Err("the images have different sizes".to_owned());
            }
            let pairs = case.iter().zip(twin).map(|(&a, &b)| (f64::from(a) * times, f64::from(b)));
            let off: f64 = pairs.map(|(a, b)| (a - b).powi(2)).sum();
            (off / twin.iter().map(|&b| f64::from(b).powi(2)).sum::<f64>()).sqrt()
        }
    })
}

/// Renders once, on one thread.
///
/// # Errors
/// The program failed, crashed or took too long.
pub(crate) fn render(picture: &SceneFiles) -> Result<Rendered, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    render_in(folder.path(), picture)
}

/// Prepares a command that renders a scene in a folder on one thread. `program` is glimt or a wrapper that
/// runs it.
///
/// # Errors
/// The files cannot be written.
pub(crate) fn call(
    folder: &Path,
    picture: &SceneFiles,
    mut program: Command,
) -> Result<Command, std::io::Error> {
    fs::write(folder.join("scene.toml"), &picture.scene)?;
    for (name, content) in &picture.files {
        fs::write(folder.join(name), content)?;
    }
    program.current_dir(folder).args("scene.toml --once -o a.exr --report a.json --threads 1".split(' '));
    program.args(picture.options.split_whitespace()).stdin(Stdio::null());
    Ok(program)
}

fn render_in(folder: &Path, picture: &SceneFiles) -> Result<Rendered, String> {
    let said = |error: std::io::Error| error.to_string();
    let mut command = call(folder, picture, Command::new(env!("CARGO_BIN_EXE_glimt"))).map_err(said)?;
    let errors = fs::File::create(folder.join("said")).map_err(said)?;
    let (mut child, begin) = (command.stderr(errors).spawn().map_err(said)?, Instant::now());
    let status = loop {
        if let Some(status) = child.try_wait().map_err(said)? {
            break status;
        }
        if begin.elapsed() > RENDER_TIME_LIMIT {
            child.kill().and_then(|()| child.wait()).map_err(said)?;
            return Err("hangs".to_owned());
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    if !status.success() {
        return Err(format!("{status}: {}", fs::read_to_string(folder.join("said")).map_err(said)?));
    }
    let report = fs::read_to_string(folder.join("a.json")).map_err(said)?;
    let report: serde_json::Value = serde_json::from_str(&report).map_err(|error| error.to_string())?;
    let image = image::open(folder.join("a.exr")).map_err(|error| error.to_string())?;
    Ok(Rendered {
        pixels: image.to_rgb32f().into_raw(),
        seconds: seconds(&report),
        non_finite: report["counters"]["non_finite_samples"].as_u64().unwrap_or(u64::MAX),
        report,
    })
}

/// Returns the seconds spent in all stages except parse and write.
fn seconds(report: &serde_json::Value) -> f64 {
    let stages = report["stages"].as_array().into_iter().flatten();
    let counts = |stage: &&serde_json::Value| stage["name"] != "parse" && stage["name"] != "write";
    stages.filter(counts).filter_map(|stage| stage["seconds"].as_f64()).sum()
}
