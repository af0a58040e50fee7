//! Arguments of `glimt bench`.

use std::path::PathBuf;

use super::{
    CLAMP, Progress, Switch, any_whole, candidates, nice, number_of, one_of, seconds, threads, whole,
    whole_of,
};
use crate::scene::description::{Accel, Integrator, Shadows};
use crate::tui::ColorChoice;

pub(super) const HELP: &str = "\
Every picture is measured against two references of independent noise, by mean of (x - r1)(x - r2)/(r² + 0.01): \
their noise is not read as error. What pictures of different seeds have in common is the method's bias; a slope \
that flattens is called so, with the size. References are kept in $XDG_CACHE_HOME/glimt/references, else \
~/.cache/glimt/references, as long as the scene, its files and the size are the same.

Without --samples or --time, each method goes on to 4 times the samples as long as there is time (--within). \
Without options of methods: path, whitted with photons, and the scene as it is where that is neither. Lists are \
multiplied: --integrator path,whitted --photons on,off. Without SCENE, the one that glimt new writes.

Exit codes: 0 measured; 1 the work failed; 2 the call or a scene is wrong; 130, 143, 129 ended by a signal.";

/// Scenes, methods and outputs of a benchmark.
#[derive(Clone, Debug, clap::Args)]
pub struct BenchArgs {
    /// The scene files
    #[arg(value_name = "SCENE", add = candidates::scenes())]
    pub scenes: Vec<PathBuf>,

    /// Write every picture's seconds and error, a line each
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub csv: Option<PathBuf>,
    /// Write everything that was measured, also for a later --baseline
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub json: Option<PathBuf>,
    /// Draw the error against the seconds on log axes
    #[arg(long, value_name = "FILE.svg", help_heading = "Output")]
    pub plot: Option<PathBuf>,
    /// Replace files that glimt did not write, too
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Say what became slower or worse since the run that wrote this file by --json, and whether it is noise
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub baseline: Option<PathBuf>,

    /// Samples per pixel to measure at, such as 1,4,16,64
    #[arg(long, value_name = "N,N", value_delimiter = ',', allow_negative_numbers = true, value_parser = whole_of("samples"), help_heading = "Measurement")]
    pub samples: Vec<u32>,
    /// Seconds of rendering to measure at, in place of samples, such as 0.1,0.5,2
    #[arg(long, value_name = "S,S", value_delimiter = ',', allow_negative_numbers = true, value_parser = seconds, conflicts_with = "samples", help_heading = "Measurement")]
    pub time: Vec<f64>,
    /// Pictures at each point, each of a seed of its own
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = seeds, default_value = "6", help_heading = "Measurement")]
    pub seeds: u32,
    /// The first of the seeds
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = any_whole, default_value = "1", help_heading = "Measurement")]
    pub seed: u32,
    /// Pixels across [default: with the scene's aspect, 96 on the longer side]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("width"), help_heading = "Measurement")]
    pub width: Option<u32>,
    /// Pixels down
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("height"), help_heading = "Measurement")]
    pub height: Option<u32>,
    /// Seconds that all of it may take, as far as samples are left open
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds, default_value = "240", help_heading = "Measurement")]
    pub within: f64,
    /// A float picture as the reference; given twice, two of independent noise
    #[arg(long, value_name = "FILE", conflicts_with_all = ["reference_samples", "width", "height"], help_heading = "Measurement")]
    pub reference: Vec<PathBuf>,
    /// Samples per pixel of each reference [default: by the time, or 100 times the most --samples]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("samples"), help_heading = "Measurement")]
    pub reference_samples: Option<u32>,
    /// Folder for references
    #[arg(long, value_name = "FOLDER", help_heading = "Measurement")]
    pub cache: Option<PathBuf>,
    /// Make references anew and keep none
    #[arg(long, conflicts_with = "cache", help_heading = "Measurement")]
    pub no_cache: bool,

    /// Rendering algorithms
    #[arg(long, value_delimiter = ',', value_parser = one_of::<Integrator>(), value_name = "LIST", help_heading = "Methods, each a list")]
    pub integrator: Vec<Integrator>,
    /// Indirect light and caustics from photon maps, in whitted
    #[arg(long, value_delimiter = ',', value_parser = one_of::<Switch>(), value_name = "LIST", help_heading = "Methods, each a list")]
    pub photons: Vec<Switch>,
    /// Shadows, in whitted
    #[arg(long, value_delimiter = ',', value_parser = one_of::<Shadows>(), value_name = "LIST", help_heading = "Methods, each a list")]
    pub shadows: Vec<Shadows>,
    /// Most radiance that a path brings by one vertex after its first diffuse or glossy reflection; 0: none
    #[arg(long, value_delimiter = ',', value_parser = number_of("clamp", CLAMP), value_name = "LIST", allow_negative_numbers = true, help_heading = "Methods, each a list")]
    pub clamp: Vec<f32>,
    /// Acceleration structure
    #[arg(long, value_delimiter = ',', value_parser = one_of::<Accel>(), value_name = "LIST", help_heading = "Methods, each a list")]
    pub accel: Vec<Accel>,

    /// Another value for a key of the scenes, as in a render
    #[arg(long = "set", add = candidates::sets(), value_name = "TABLE.KEY=VALUE", help_heading = "All pictures and references")]
    pub sets: Vec<String>,
    /// Scatterings along one path
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("max_depth"), help_heading = "All pictures and references")]
    pub max_depth: Option<u32>,
    /// Depth of field, where the camera has an aperture
    #[arg(long, value_parser = one_of::<Switch>(), value_name = "on|off", help_heading = "All pictures and references")]
    pub dof: Option<Switch>,
    /// Threads that render; 0: one per core
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = threads, help_heading = "All pictures and references")]
    pub threads: Option<usize>,
    /// Give way to other programs, from 0, not at all, to 19
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = nice, default_value = "0", help_heading = "All pictures and references")]
    pub nice: u8,

    /// Progress on stderr
    #[arg(long, value_parser = one_of::<Progress>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub progress: Progress,
    /// Colours of messages and of the plot in the terminal; auto looks at the terminal and at NO_COLOR
    #[arg(long, value_parser = one_of::<ColorChoice>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub color: ColorChoice,
}

fn seeds(text: &str) -> Result<u32, String> {
    whole(text, 1..=1000)
}
