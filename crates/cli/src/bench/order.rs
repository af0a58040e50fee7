//! Orders for a benchmark, news during it, and reasons for its failure.

use std::path::PathBuf;

use super::methods::Toggles;
use super::results::Results;
use crate::pipeline::protocol::Failure;
use crate::pipeline::session::Unrendered;
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::Diagnostic;

/// Order for a benchmark.
#[derive(Clone, Debug, Default)]
pub struct Order {
    /// The scenes.
    pub scenes: Vec<PathBuf>,
    /// Overrides of all pictures and references. Size, samples, seed, time and noise threshold are ignored.
    pub common: Overrides,
    /// Pixels across; with [`Self::height`] alone or none, by the scene's aspect.
    pub width: Option<u32>,
    /// Pixels down.
    pub height: Option<u32>,
    /// Toggles that make the methods.
    pub toggles: Toggles,
    /// Steps: samples, or times.
    pub steps: Steps,
    /// Pictures of each step.
    pub seeds: u32,
    /// Seed of the first of them.
    pub seed: u32,
    /// Reference of the pictures.
    pub reference: ReferenceOrder,
    /// Seconds that all of it may take, as far as the order leaves it open.
    pub within: f64,
    /// Folder for references. `None` if they are not kept.
    pub cache: Option<PathBuf>,
    /// Files that will be written, which no scene may read.
    pub targets: Vec<PathBuf>,
}

/// Points along a method's line.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Steps {
    /// At 1, 4, 16, … samples, as long as there is time, and up to a hundredth of the samples of the references.
    #[default]
    Climb,
    /// At so many samples.
    Samples(Vec<u32>),
    /// After so many seconds of rendering.
    Seconds(Vec<f64>),
}

/// Reference of the pictures.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ReferenceOrder {
    /// Paths, as many as there is time for; of a fixed number of samples a hundred times as many at most.
    #[default]
    InTime,
    /// Paths of so many samples.
    Samples(u32),
    /// These two files, which may be one.
    Files([PathBuf; 2]),
}

/// News during a benchmark.
#[derive(Clone, Debug)]
pub enum News {
    /// A piece of work begins.
    Begins {
        /// Name of the task.
        what: String,
        /// Seconds until everything is done, if known.
        left: Option<f64>,
    },
    /// A piece of work is done: a line for logs.
    Done(String),
    /// A point of the plot: the pictures of a step are done.
    Point {
        /// The scene as named by the caller.
        scene: String,
        /// The method's name in tables.
        method: String,
        /// Median of the seconds of sending photons and tracing.
        seconds: f64,
        /// Median of relMSE.
        relmse: f64,
    },
    /// Warnings about a scene.
    Warnings(Vec<Diagnostic>),
}

/// Why it ended before its end, and what was done by then.
#[derive(Clone, Debug)]
pub struct Unfinished {
    /// Why.
    pub trouble: Trouble,
    /// The scenes that were measured whole.
    pub done: Results,
}

/// Why there are no results.
#[derive(Clone, Debug)]
pub enum Trouble {
    /// A scene is wrong, or the work failed.
    Failed(Failure),
    /// The call is wrong, in words with the way out.
    Call(String),
    /// A cancel token stopped the benchmark.
    Cancelled,
}

impl From<Unrendered> for Trouble {
    fn from(why: Unrendered) -> Self {
        match why {
            Unrendered::Failed(failure) => Self::Failed(failure),
            Unrendered::Cancelled => Self::Cancelled,
        }
    }
}
