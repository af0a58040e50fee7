//! Benchmark requests, events and errors.

use std::path::PathBuf;

use super::methods::SweptSettingValues;
use super::results::Results;
use crate::pipeline::headless::AbortReason;
use crate::pipeline::protocol::Failure;
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::Diagnostic;

/// A benchmark request.
#[derive(Clone, Debug, Default)]
pub struct BenchRequest {
    /// Scene files.
    pub scenes: Vec<PathBuf>,
    /// Overrides that apply to all images and references. Size, samples, seed, time and noise threshold are
    /// ignored.
    pub common: Overrides,
    /// Width in pixels. The default is computed from the height and the scene's aspect ratio.
    pub width: Option<u32>,
    /// Height in pixels. The default is computed from the width and the scene's aspect ratio.
    pub height: Option<u32>,
    /// Settings that define the methods.
    pub swept: SweptSettingValues,
    /// Sample counts or render times to measure.
    pub steps: StepSchedule,
    /// Images per step.
    pub seeds: u32,
    /// Seed of the first image.
    pub seed: u32,
    /// Source of the references.
    pub reference: ReferenceSource,
    /// Time limit in seconds if neither samples nor times are specified.
    pub within: f64,
    /// Folder for cached references. `None` disables the cache.
    pub cache: Option<PathBuf>,
    /// Output files. No scene may depend on them.
    pub targets: Vec<PathBuf>,
}

/// Sample count or render time of each step.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum StepSchedule {
    /// 1, 4, 16, … samples while time remains, up to 1 % of the references' samples.
    #[default]
    Climb,
    /// The listed samples per pixel.
    Samples(Vec<u32>),
    /// The listed render times in seconds.
    Seconds(Vec<f64>),
}

/// Source of the references.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ReferenceSource {
    /// Path traced in the available time, with up to 100 times the largest requested sample count.
    #[default]
    InTime,
    /// Path traced with this many samples per pixel.
    Samples(u32),
    /// Two image files, which may be the same file.
    Files([PathBuf; 2]),
}

/// Events reported during a benchmark.
#[derive(Clone, Debug)]
pub enum BenchEvent {
    /// A task begins.
    Begins {
        /// Name of the task.
        what: String,
        /// Estimated seconds until the benchmark ends.
        left: Option<f64>,
    },
    /// A task is done. Contains a line for the log.
    Done(String),
    /// A step is done. Contains a point for the plot.
    Point {
        /// The scene's path as passed by the caller.
        scene: String,
        /// The method's name, as shown in tables.
        method: String,
        /// Median time of photon mapping and rendering in seconds.
        seconds: f64,
        /// Median relMSE.
        relmse: f64,
    },
    /// Warnings about a scene.
    Warnings(Vec<Diagnostic>),
}

/// The error and the partial results of a benchmark that ended early.
#[derive(Clone, Debug)]
pub struct PartialResultsError {
    /// Why the benchmark ended early.
    pub error: BenchError,
    /// Results of the completed scenes.
    pub done: Results,
}

/// Reasons why a benchmark ends early.
#[derive(Clone, Debug)]
pub enum BenchError {
    /// A scene is invalid, or the work failed.
    Failed(Failure),
    /// The arguments are invalid. Contains a message with a hint.
    Call(String),
    /// The benchmark was canceled.
    Canceled,
}

impl From<AbortReason> for BenchError {
    fn from(why: AbortReason) -> Self {
        match why {
            AbortReason::Failed(failure) => Self::Failed(failure),
            AbortReason::Canceled => Self::Canceled,
        }
    }
}
