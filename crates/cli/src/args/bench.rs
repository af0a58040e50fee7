//! Arguments of `glimt bench`.

use std::path::PathBuf;

use super::parsers::{
    CLAMP, choice_long_help, choice_parser, integer_override_parser, number_override_parser,
    parse_integer_in_range, parse_niceness, parse_positive_seconds, parse_thread_count, parse_u32,
};
use super::{ProgressMode, Switch, candidates};
use crate::scene::description::{Accel, Integrator, ShadowMode};
use crate::tui::ColorDepthChoice;

pub(super) const HELP: &str = "\
Each image is compared with two references whose noise is independent, using the mean of (x - r1)(x - r2)/(r² + 0.01), so their \
noise does not count as error. The error that images with different seeds have in common is the bias of the method. \
References are cached in $XDG_CACHE_HOME/glimt/references or ~/.cache/glimt/references, and reused while the scene, its \
files and the size are unchanged.

Without --samples or --time, each method quadruples its samples while time remains (--within). The default methods are \
path, whitted with photons, and the scene's own settings if they differ. All combinations of lists are measured, as with \
--integrator path,whitted --photons on,off. The default scene is the one that `glimt new` writes.

Exit codes: 0 success; 1 failure; 2 invalid arguments or scene; 130, 143 or 129 terminated by a signal.";

/// Arguments of `bench`.
#[derive(Clone, Debug, clap::Args)]
pub struct BenchArgs {
    /// The scene files
    #[arg(value_name = "SCENE", add = candidates::scene_completer())]
    pub scenes: Vec<PathBuf>,

    /// Write the time and error of every image as CSV
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub csv: Option<PathBuf>,
    /// Write all results as JSON, also for --baseline
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub json: Option<PathBuf>,
    /// Write an SVG plot of error over time
    #[arg(long, value_name = "FILE.svg", help_heading = "Output")]
    pub plot: Option<PathBuf>,
    /// Replace files not written by glimt
    #[arg(long, help_heading = "Output")]
    pub force: bool,
    /// Report regressions against an earlier --json file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub baseline: Option<PathBuf>,

    /// Sample counts per pixel to measure, such as 1,4,16
    #[arg(long, value_name = "N,N", value_delimiter = ',', allow_negative_numbers = true, value_parser = integer_override_parser("samples"), help_heading = "Measurement")]
    pub samples: Vec<u32>,
    /// Render times to measure instead, such as 0.1,0.5,2
    #[arg(long, value_name = "S,S", value_delimiter = ',', allow_negative_numbers = true, value_parser = parse_positive_seconds, conflicts_with = "samples", help_heading = "Measurement")]
    pub time: Vec<f64>,
    /// Images per point, each with a different seed
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed_count, default_value = "6", help_heading = "Measurement")]
    pub seeds: u32,
    /// The first seed
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_u32, default_value = "1", help_heading = "Measurement")]
    pub seed: u32,
    /// Width in pixels [default: 96 on the longer side]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("width"), help_heading = "Measurement")]
    pub width: Option<u32>,
    /// Height in pixels
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("height"), help_heading = "Measurement")]
    pub height: Option<u32>,
    /// Time limit if neither --samples nor --time is used
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_positive_seconds, default_value = "240", help_heading = "Measurement")]
    pub within: f64,
    /// Floating-point image to use as a reference
    ///
    /// Can be given twice, to use two references with independent noise.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["reference_samples", "width", "height"], help_heading = "Measurement")]
    pub reference: Vec<PathBuf>,
    /// Samples per pixel of each reference
    ///
    /// By default, as many as fit in the available time, up to 100 times the largest --samples.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("samples"), help_heading = "Measurement")]
    pub reference_samples: Option<u32>,
    /// Folder for cached references
    #[arg(long, value_name = "FOLDER", help_heading = "Measurement")]
    pub cache: Option<PathBuf>,
    /// Render new references without caching them
    #[arg(long, conflicts_with = "cache", help_heading = "Measurement")]
    pub no_cache: bool,

    /// Integrators: whitted, path
    #[arg(long, value_delimiter = ',', value_parser = choice_parser::<Integrator>(), hide_possible_values = true, long_help = choice_long_help::<Integrator>("Integrators"), value_name = "LIST", help_heading = "Methods (comma-separated lists)")]
    pub integrator: Vec<Integrator>,
    /// Photon mapping in whitted: on, off
    #[arg(long, value_delimiter = ',', value_parser = choice_parser::<Switch>(), hide_possible_values = true, value_name = "LIST", help_heading = "Methods (comma-separated lists)")]
    pub photons: Vec<Switch>,
    /// Shadows in whitted: off, hard, soft
    #[arg(long, value_delimiter = ',', value_parser = choice_parser::<ShadowMode>(), hide_possible_values = true, long_help = choice_long_help::<ShadowMode>("Shadows, in whitted"), value_name = "LIST", help_heading = "Methods (comma-separated lists)")]
    pub shadows: Vec<ShadowMode>,
    /// Limits on indirect radiance per bounce; 0 disables the limit
    #[arg(long, value_delimiter = ',', value_parser = number_override_parser("clamp", CLAMP), value_name = "LIST", allow_negative_numbers = true, help_heading = "Methods (comma-separated lists)")]
    pub clamp: Vec<f32>,
    /// Acceleration structures: bvh, bvh-high, kdtree
    #[arg(long, value_delimiter = ',', value_parser = choice_parser::<Accel>(), hide_possible_values = true, long_help = choice_long_help::<Accel>("Acceleration structures"), value_name = "LIST", help_heading = "Methods (comma-separated lists)")]
    pub accel: Vec<Accel>,

    /// Override a scene key
    #[arg(long = "set", add = candidates::key_assignment_completer(), value_name = "TABLE.KEY=VALUE", help_heading = "All images and references")]
    pub sets: Vec<String>,
    /// Maximum bounces per path
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("max_depth"), help_heading = "All images and references")]
    pub max_depth: Option<u32>,
    /// Depth of field, if the camera has an aperture
    #[arg(long, value_parser = choice_parser::<Switch>(), hide_possible_values = true, value_name = "on|off", help_heading = "All images and references")]
    pub dof: Option<Switch>,
    /// Rendering threads; 0 is one per core
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_thread_count, help_heading = "All images and references")]
    pub threads: Option<usize>,
    /// Scheduling niceness, 0–19
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_niceness, default_value = "0", help_heading = "All images and references")]
    pub nice: u8,

    /// Progress on stderr: auto, plain, json, none
    #[arg(long, value_parser = choice_parser::<ProgressMode>(), hide_possible_values = true, long_help = choice_long_help::<ProgressMode>("Progress on stderr"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub progress: ProgressMode,
    /// Colors: auto, truecolor, 256, 16, none
    #[arg(long, value_parser = choice_parser::<ColorDepthChoice>(), hide_possible_values = true, long_help = choice_long_help::<ColorDepthChoice>("Colors of messages and images"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub color: ColorDepthChoice,
}

fn parse_seed_count(text: &str) -> Result<u32, String> {
    parse_integer_in_range(text, 1..=1000)
}
