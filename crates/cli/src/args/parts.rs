//! Arguments of `merge` and `farm`.

use std::path::PathBuf;

use super::{Progress, candidates, one_of};
use crate::choice;
use crate::tui::ColorChoice;

/// Most parts of a picture.
pub(super) const MOST: u32 = 1 << 20;

pub(super) const MERGE_HELP: &str = "\
The picture is the one that a single run would have written: the same linear values in an EXR, the same bytes of \
pixels in a PNG, whatever the order of the parts and the machines that made them.

Exit codes: 0 done; 1 the picture could not be written; 2 a part is missing, doubled, damaged, of another picture \
or of another version: it is named, and nothing is written.";

pub(super) const FARM_HELP: &str = "\
Options behind -- go to every render:
  glimt farm room.toml -o room.exr --shards 8 --engine slurm -- --samples 4096

Nothing is submitted: look at the script, then give it to a shell (slurm, parallel) or to kubectl apply -f -. \
The scene, its files and the output must have the same paths on all machines.";

/// Parts and where their picture goes.
#[derive(Clone, Debug, clap::Args)]
pub struct MergeArgs {
    /// The picture; the ending chooses the format, as in a render
    pub out: PathBuf,
    /// The parts, in any order
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// Join the parts that are there; list the missing ones
    #[arg(long)]
    pub partial: bool,
    /// Show the picture as parts arrive, and join them when all are there
    #[arg(long)]
    pub watch: bool,
    /// Progress on stderr
    #[arg(long, value_parser = one_of::<Progress>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub progress: Progress,
    /// Colours of the picture and of messages; auto looks at the terminal and at NO_COLOR
    #[arg(long, value_parser = one_of::<ColorChoice>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub color: ColorChoice,
}

choice! {
    /// Programs that spread jobs.
    pub enum Engine {
        /// An sbatch array, and a merge that waits for it.
        Slurm = "slurm",
        /// A command line of GNU parallel, also over ssh.
        Parallel = "parallel",
        /// An indexed Job, and one that joins the parts.
        Kubernetes = "kubernetes",
    }
}

/// A render in parts, and the program that spreads it.
#[derive(Clone, Debug, clap::Args)]
pub struct FarmArgs {
    /// The scene file
    #[arg(add = candidates::scenes())]
    pub scene: PathBuf,
    /// The picture that the parts are joined to; parts lie beside it
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Number of parts
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST as i64))]
    pub shards: u32,
    /// The program that spreads the jobs
    #[arg(long, value_parser = one_of::<Engine>(), value_name = "ENGINE")]
    pub engine: Engine,
    /// A login for parallel, as in user@machine; may be given several times
    #[arg(long = "host", value_name = "LOGIN")]
    pub hosts: Vec<String>,
    /// The container image for kubernetes, which holds glimt
    #[arg(long, value_name = "NAME", default_value = concat!("glimt:", env!("CARGO_PKG_VERSION")))]
    pub image: String,
    /// The volume claim for kubernetes, mounted as /work with the scene and the output
    #[arg(long, value_name = "NAME", default_value = "glimt")]
    pub claim: String,
    /// Colours of messages
    #[arg(long, value_parser = one_of::<ColorChoice>(), default_value = "auto", value_name = "HOW")]
    pub color: ColorChoice,
    /// Options of every render
    #[arg(last = true, value_name = "OPTIONS")]
    pub options: Vec<String>,
}
