//! Arguments for `merge` and `farm`.

use std::path::PathBuf;

use super::parsers::{MAX_PARTS, choice_long_help, choice_parser};
use super::{ProgressMode, candidates};
use crate::choice;
use crate::tui::ColorDepthChoice;

pub(super) const MERGE_HELP: &str = "\
The result is identical to that of a single run: the same linear values in an EXR file, the same pixel bytes in a PNG \
file, regardless of the order of the parts and the machines that rendered them.

Exit codes: 0 success; 1 the image could not be written; 2 a part is missing, duplicated, damaged, or from another image \
or version.";

pub(super) const FARM_HELP: &str = "\
Options after -- are passed to every render:
  glimt farm room.toml -o room.exr --shards 8 --engine slurm -- --samples 4096

Nothing is submitted: review the script, then run it in a shell (slurm, parallel) or pass it to kubectl apply -f -. \
The scene, its files and the output must have the same paths on all machines.";

/// Arguments of `merge`.
#[derive(Clone, Debug, clap::Args)]
pub struct MergeArgs {
    /// The image to write; the extension determines the format
    pub out: PathBuf,
    /// The parts, in any order
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// Merge the existing parts and list the missing ones
    #[arg(long)]
    pub partial: bool,
    /// Show the image as parts arrive, and merge them when complete
    #[arg(long)]
    pub watch: bool,
    /// Progress on stderr: auto, plain, json, none
    #[arg(long, value_parser = choice_parser::<ProgressMode>(), hide_possible_values = true, long_help = choice_long_help::<ProgressMode>("Progress on stderr"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub progress: ProgressMode,
    /// Colors: auto, truecolor, 256, 16, none
    #[arg(long, value_parser = choice_parser::<ColorDepthChoice>(), hide_possible_values = true, long_help = choice_long_help::<ColorDepthChoice>("Colors of messages and images"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub color: ColorDepthChoice,
}

choice! {
    /// Job schedulers.
    pub enum ClusterScheduler {
        /// An sbatch array and a merge job that depends on it.
        Slurm = "slurm",
        /// A GNU parallel command, optionally over ssh.
        Parallel = "parallel",
        /// An indexed Job and a second Job that merges the parts.
        Kubernetes = "kubernetes",
    }
}

/// Arguments of `farm`.
#[derive(Clone, Debug, clap::Args)]
pub struct FarmArgs {
    /// The scene file
    #[arg(add = candidates::scene_completer())]
    pub scene: PathBuf,
    /// The image to write; parts are saved next to it
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Number of parts
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MAX_PARTS as i64))]
    pub shards: u32,
    /// The job scheduler
    #[arg(long, value_parser = choice_parser::<ClusterScheduler>(), value_name = "ENGINE")]
    pub engine: ClusterScheduler,
    /// ssh login for parallel, such as user@machine; can be given several times
    #[arg(long = "host", value_name = "LOGIN")]
    pub hosts: Vec<String>,
    /// Container image with glimt, for kubernetes
    #[arg(long, value_name = "NAME", default_value = concat!("glimt:", env!("CARGO_PKG_VERSION")))]
    pub image: String,
    /// Volume claim for kubernetes; holds the scene and the output, mounted at /work
    #[arg(long, value_name = "NAME", default_value = "glimt")]
    pub claim: String,
    /// Colors: auto, truecolor, 256, 16, none
    #[arg(long, value_parser = choice_parser::<ColorDepthChoice>(), hide_possible_values = true, long_help = choice_long_help::<ColorDepthChoice>("Colors of messages and images"), default_value = "auto", value_name = "HOW")]
    pub color: ColorDepthChoice,
    /// Options for every render
    #[arg(last = true, value_name = "OPTIONS")]
    pub options: Vec<String>,
}
