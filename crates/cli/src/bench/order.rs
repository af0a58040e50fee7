//! What is asked for, what is said meanwhile, and why it may not be done.

use std::path::PathBuf;

use super::methods::Toggles;
use super::results::Results;
use crate::pipeline::protocol::Failure;
use crate::pipeline::session::Unrendered;
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::Diagnostic;

/// What is measured.
#[derive(Clone, Debug, Default)]
pub struct Order {
    /// The scenes.
    pub scenes: Vec<PathBuf>,
    /// What holds for all pictures and references. Size, samples, seed, time and noise bound of it are not heeded.
    pub common: Overrides,
    /// Pixels across; with [`Self::height`] alone or none, by the scene's aspect.
    pub width: Option<u32>,
    /// Pixels down.
    pub height: Option<u32>,
    /// What makes the methods.
    pub toggles: Toggles,
    /// How many samples, or for how long.
    pub steps: Steps,
    /// Pictures of each step.
    pub seeds: u32,
    /// Seed of the first of them.
    pub seed: u32,
    /// What the pictures are held against.
    pub reference: ReferenceOrder,
    /// Seconds that all of it may take, as far as the order leaves it open.
    pub within: f64,
    /// Where references are kept; none: they are not.
    pub cache: Option<PathBuf>,
    /// Files that will be written, which no scene may read.
    pub targets: Vec<PathBuf>,
}

/// Where along a method's line the points are.
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

/// What the pictures are held against.
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

/// What is said while it goes on.
#[derive(Clone, Debug)]
pub enum News {
    /// A piece of work begins.
    Begins {
        /// What it is.
        what: String,
        /// Seconds until everything is done, as far as that can be told.
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
    /// It was told to stop.
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
