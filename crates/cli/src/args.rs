//! Command-line arguments.

mod bench;
pub(crate) mod candidates;
#[cfg(test)]
mod help_tests;
mod parts;

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::Parser;
use clap::builder::styling::{AnsiColor, Styles};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

pub use self::bench::BenchArgs;
pub use self::parts::{ClusterScheduler, FarmArgs, MergeArgs};
use crate::choice;
use crate::choice::Choice;
use crate::console::stdout_columns_or_default;
use crate::environment;
use crate::film::Rect;
use crate::output::{AnimationFormat, Format};
use crate::pipeline::settings::{
    CheckpointSettings, OutputLayer, Overrides, ResumeMode, UpAxis, ViewMode, ViewSide,
};
use crate::pipeline::turntable::{self, TurntableFrame};
use crate::scene::description::{Accel, Integrator, ShadowMode, render_keys};
use crate::scene::keys::{ValueKind, find_key};
use crate::tui::{ColorDepthChoice, PreviewChoice};

/// Examples for the long help and the manual page, in lines of at most 80 columns.
pub(super) const EXAMPLES: &str = "  \
  glimt new ball.toml                     write a commented scene
  glimt ball.toml                         render it live while you edit it
  glimt ball.toml --once -o a.png -o a.exr
  glimt ball.toml --once --samples 16 --time 2 --report report.json
  glimt check ball.toml                   report errors without rendering
  glimt explain materials.metal.roughness describe a key
  glimt helmet.glb                        view a model: obj, off, ply, stl, gltf
  glimt helmet.glb --once --turntable 36 -o helmet.gif
  glimt import helmet.glb -o helmet.toml  convert it to an editable scene
  glimt compare a.exr reference.exr       measure the error of an image
  glimt bench ball.toml --plot plot.svg   plot the error of each method
  glimt ball.toml --once -o 1.part --shard 1/2    render the first half
  glimt merge a.png 1.part 2.part         merge both halves

`glimt new` writes a scene with every key, commented. \
If a scene is named like a command, add its folder: glimt ./check";

/// Exit codes shared by all commands.
pub(super) const EXIT_CODES: &str = "\
0 success; 1 failure; 2 invalid arguments or scene; \
130, 143 or 129 terminated by SIGINT, SIGTERM or SIGHUP.";

/// Returns the help width in columns: `COLUMNS` if set, else the terminal's width, else 80.
fn help_columns() -> usize {
    let columns = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    columns.filter(|columns| *columns > 0).unwrap_or_else(stdout_columns_or_default)
}

/// Text after the options in `-h`.
const AFTER_HELP: &str = "Run `glimt --help` for details and examples.";

/// Text after the options in `--help`.
fn after_long_help() -> String {
    format!("Examples:\n{EXAMPLES}\n\nExit codes: {EXIT_CODES}\n\n{}", environment::help_section())
}

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Green.on_default().bold())
    .usage(AnsiColor::Green.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

/// A ray tracer that lives in the terminal: edit a scene, save it, see it.
#[derive(Clone, Debug, Parser)]
#[command(name = "glimt", version = crate::pipeline::BUILD, after_help = AFTER_HELP, after_long_help = after_long_help(), styles = STYLES)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true, term_width = help_columns())]
pub struct Args {
    /// A command other than rendering.
    #[command(subcommand)]
    pub command: Option<Subcommand>,
    /// Scene and render options.
    #[command(flatten)]
    pub render: RenderArgs,
}

impl Args {
    /// Returns the command's `--color` option.
    pub(super) fn color_depth_choice(&self) -> ColorDepthChoice {
        match &self.command {
            Some(Subcommand::Check { color, .. }) => *color,
            Some(Subcommand::Bench(bench)) => bench.color,
            Some(Subcommand::Compare(compare)) => compare.color,
            Some(Subcommand::Merge(merge)) => merge.color,
            Some(Subcommand::Farm(farm)) => farm.color,
            Some(Subcommand::Import(import)) => import.color,
            Some(Subcommand::Info(info)) => info.color,
            Some(
                Subcommand::New { .. }
                | Subcommand::Completions { .. }
                | Subcommand::Man { .. }
                | Subcommand::Explain { .. }
                | Subcommand::Schema { .. }
                | Subcommand::Lsp { .. }
                | Subcommand::Doctor,
            )
            | None => self.render.color,
        }
    }
}

/// Commands other than rendering.
#[derive(Clone, Debug, clap::Subcommand)]
pub enum Subcommand {
    /// Validate a scene and its files without rendering
    Check {
        /// The scene file
        #[arg(add = candidates::scene_completer())]
        scene: PathBuf,
        /// Override a scene key
        #[arg(long = "set", add = candidates::key_assignment_completer(), value_name = "TABLE.KEY=VALUE")]
        sets: Vec<String>,
        /// Print errors and warnings as one JSON object on stdout
        #[arg(long)]
        json: bool,
        /// Colors: auto, truecolor, 256, 16, none
        #[arg(long, value_parser = choice_parser::<ColorDepthChoice>(), hide_possible_values = true, long_help = choice_long_help::<ColorDepthChoice>("Colors of messages and images"), default_value = "auto", value_name = "HOW")]
        color: ColorDepthChoice,
    },
    /// Write a commented starter scene without overwriting files
    New {
        /// The file to write, or - for stdout
        file: PathBuf,
        /// Reference the JSON Schema in the scene, and write it next to the scene
        #[arg(long)]
        schema: bool,
    },
    /// Convert a glTF file to a scene without overwriting files
    ///
    /// Meshes (as PLY files) and images are written to a folder next to the scene.
    #[command(after_long_help = IMPORT_HELP)]
    Import(ImportArgs),
    /// Show the settings that an image was rendered with
    #[command(after_long_help = INFO_HELP)]
    Info(InfoArgs),
    /// Measure the error of an image against a reference
    #[command(after_long_help = COMPARE_HELP)]
    Compare(CompareArgs),
    /// Measure how the error of rendering methods falls over time
    #[command(after_long_help = bench::HELP)]
    Bench(Box<BenchArgs>),
    /// Merge the parts of an image rendered with --shard
    #[command(after_long_help = parts::MERGE_HELP)]
    Merge(MergeArgs),
    /// Print a job script that renders an image on several machines
    #[command(after_long_help = parts::FARM_HELP)]
    Farm(Box<FarmArgs>),
    /// Print a shell completion script
    #[command(after_long_help = COMPLETIONS_HELP)]
    Completions {
        /// The shell
        #[arg(value_parser = choice_parser::<Shell>(), value_name = "SHELL")]
        shell: Shell,
    },
    /// Print the manual page for glimt or a command as roff
    #[command(after_long_help = MAN_HELP)]
    Man {
        /// The command
        command: Option<String>,
    },
    /// Describe a scene key: type, unit, range, default
    #[command(after_long_help = EXPLAIN_HELP)]
    Explain {
        /// A key or table, such as render.samples, materials.metal.roughness, samples or sphere
        #[arg(add = candidates::explain_path_completer())]
        key: Option<String>,
    },
    /// Print the JSON Schema for scenes, for use in editors
    #[command(after_long_help = SCHEMA_HELP)]
    Schema {
        /// JSON Schema draft
        #[arg(long, value_parser = choice_parser::<SchemaDraft>(), default_value = "4", value_name = "DRAFT")]
        draft: SchemaDraft,
    },
    /// Run the language server on stdin and stdout
    #[command(after_long_help = LSP_HELP)]
    Lsp {
        /// Ignored: stdin and stdout are the only transport
        #[arg(long, hide = true)]
        stdio: bool,
    },
    /// Report what glimt detects: terminal, colors, processor, cache
    #[command(after_long_help = DOCTOR_HELP)]
    Doctor,
}

const COMPLETIONS_HELP: &str = "\
Load the script when the shell starts:
  bash        source <(glimt completions bash)                in ~/.bashrc
  zsh         source <(glimt completions zsh)                 in ~/.zshrc, after compinit
  fish        glimt completions fish | source                 in ~/.config/fish/config.fish
  elvish      eval (glimt completions elvish | slurp)         in ~/.config/elvish/rc.elv
  powershell  glimt completions powershell | Out-String | Invoke-Expression   in $PROFILE

The script calls glimt for each completion, so --set completes the tables and names of the given scene.";

const MAN_HELP: &str = "\
  glimt man | man -l -                     show the page
  glimt man > ~/.local/share/man/man1/glimt.1
  glimt man check > ~/.local/share/man/man1/glimt-check.1";

const EXPLAIN_HELP: &str = "\
  glimt explain                               all tables
  glimt explain sphere                        the keys of a table
  glimt explain render.samples
  glimt explain materials.metal.roughness     of one type; materials.roughness covers all types
  glimt explain roughness                     in all tables

Exit codes: 0 success; 2 no such key.";

const SCHEMA_HELP: &str = "\
In editors with Taplo (VS Code: Even Better TOML; also Helix, Neovim, Zed), a scene that starts with the line
  #:schema glimt.schema.json
uses the schema in its folder. `glimt new --schema` writes both. Names of materials, files and geometry are checked \
only by `glimt check`.";

choice! {
    /// JSON Schema drafts.
    pub enum SchemaDraft {
        /// Draft 4, which Taplo supports.
        Four = "4",
        /// Draft 2020-12.
        Latest = "2020-12",
    }
}

impl SchemaDraft {
    /// Returns the schema keyword under which definitions are stored.
    pub(super) fn definitions_keyword(self) -> &'static str {
        match self {
            Self::Four => "definitions",
            Self::Latest => "$defs",
        }
    }

    /// Returns the draft's URI, the value of `$schema`.
    pub(super) fn schema_uri(self) -> &'static str {
        match self {
            Self::Four => "http://json-schema.org/draft-04/schema#",
            Self::Latest => "https://json-schema.org/draft/2020-12/schema",
        }
    }
}

const LSP_HELP: &str = "\
Provides errors while you type, completion of keys, values and names, descriptions of keys, definitions of names, and \
colors. The editor starts the server; docs/editors.md has the configuration for Neovim, Helix and others.";

const DOCTOR_HELP: &str = "\
Queries the terminal's features and waits at most one second for answers. The exit code is always 0.";

choice! {
    /// Shells with completions.
    pub enum Shell {
        /// GNU bash 4.4 or later.
        Bash = "bash",
        /// The Z shell.
        Zsh = "zsh",
        /// fish.
        Fish = "fish",
        /// PowerShell.
        Powershell = "powershell",
        /// Elvish.
        Elvish = "elvish",
    }
}

const IMPORT_HELP: &str = "\
The scene renders like `glimt FILE`. Its meshes and images are in a folder with the scene's name next to it. Features \
that glimt lacks are approximated, with a warning and a comment in the scene. 1 cd is converted to 1 W/sr, 1 lx to \
1 W/m2.

Exit codes: 0 success; 1 the scene could not be written; 2 the file is invalid, the scene exists already, or --strict \
and something is approximated.";

/// Arguments of `import`.
#[derive(Clone, Debug, clap::Args)]
pub struct ImportArgs {
    /// The file to read: gltf, glb
    #[arg(add = candidates::import_completer())]
    pub file: PathBuf,
    /// The scene to write [default: FILE with .toml, in the current folder]
    #[arg(short, long, value_name = "SCENE")]
    pub output: Option<PathBuf>,
    /// Fail if anything cannot be converted exactly
    #[arg(long)]
    pub strict: bool,
    /// Colors: auto, truecolor, 256, 16, none
    #[arg(long, value_parser = choice_parser::<ColorDepthChoice>(), hide_possible_values = true, long_help = choice_long_help::<ColorDepthChoice>("Colors of messages and images"), default_value = "auto", value_name = "HOW")]
    pub color: ColorDepthChoice,
}

const INFO_HELP: &str = "\
Settings are stored in all formats that glimt writes. Parts and checkpoints also list the files that the image depends \
on.

Exit codes: 0 rendered by glimt; 1 no settings found; 2 the file cannot be read or is not an image.";

/// Arguments of `info`.
#[derive(Clone, Debug, clap::Args)]
pub struct InfoArgs {
    /// The image (png, apng, gif, exr, hdr, jpg, ppm), part or checkpoint
    pub image: PathBuf,
    /// Print one JSON object on stdout
    #[arg(long)]
    pub json: bool,
    /// Colors: auto, truecolor, 256, 16, none
    #[arg(long, value_parser = choice_parser::<ColorDepthChoice>(), hide_possible_values = true, long_help = choice_long_help::<ColorDepthChoice>("Colors of messages and images"), default_value = "auto", value_name = "HOW")]
    pub color: ColorDepthChoice,
}

const COMPARE_HELP: &str = "\
Computed from linear values: RMSE, max |a - b|, and relMSE = mean of (a - b)^2/(b^2 + 0.01), also \
without the 0.1 % of the pixels with the largest errors. Computed from clamped sRGB: PSNR; SSIM (Wang et al. 2004, \
on Rec. 709 luma); FLIP (Andersson et al. 2020, 67 pixels per degree).

Bias is mean(a - b)/mean(b) of the luminance. EXR files of complete beauty images without photons and with at least \
two samples per pixel contain the standard error of their mean luminance: z is the bias divided by the combined \
standard error. Use two different seeds, as images with the same seed may share their noise. The standard error is \
estimated from the samples: usually 0.8 to 1.5 times the true value, up to 2 times for small details with few samples.

On a terminal, both images and their difference are shown above the table. The difference is FLIP, or |a - b| scaled \
to its maximum if FLIP is below 0.1 everywhere. --json shows no images.

8- and 16-bit files are read as sRGB, floating-point files as linear. Alpha is ignored.

Exit codes: 0 success, with relMSE at most --max-relmse; 1 relMSE above it, or --diff could not be written; 2 invalid \
arguments or files, such as different sizes or values that are not finite.";

/// Arguments of `compare`.
#[derive(Clone, Debug, clap::Args)]
pub struct CompareArgs {
    /// The image to measure: png, jpg, ppm, tga, bmp, webp, exr or hdr
    pub a: PathBuf,
    /// The reference image, with the same size
    pub b: PathBuf,
    /// Exit with code 1 if relMSE is above X
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = parse_nonnegative_number)]
    pub max_relmse: Option<f64>,
    /// Write the error as an image
    ///
    /// png, jpg, ppm and webp show FLIP in false color, from black for 0 through purple, red and orange to
    /// pale yellow for 1. exr and hdr contain |a - b|, linear.
    #[arg(long, value_name = "FILE")]
    pub diff: Option<PathBuf>,
    /// Print one JSON object on stdout
    ///
    /// Unknown values are null. psnr_db is null for equal images.
    #[arg(long)]
    pub json: bool,
    /// Show the images and their difference: auto, on, off
    #[arg(long, value_parser = choice_parser::<CompareImageVisibility>(), hide_possible_values = true, long_help = choice_long_help::<CompareImageVisibility>("Show the images and their difference above the table"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub pictures: CompareImageVisibility,
    /// Colors: auto, truecolor, 256, 16, none
    #[arg(long, value_parser = choice_parser::<ColorDepthChoice>(), hide_possible_values = true, long_help = choice_long_help::<ColorDepthChoice>("Colors of messages and images"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub color: ColorDepthChoice,
}

/// Arguments of a render. Options override the scene's settings for this run.
#[derive(Clone, Debug, clap::Args)]
pub struct RenderArgs {
    /// A scene (TOML) or a model: obj, off, ply, stl, glb, gltf
    #[arg(required = true, add = candidates::scene_or_foreign_completer(), value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Render once, write the image and exit
    #[arg(long)]
    pub once: bool,

    /// Override a scene key
    ///
    /// For example render.samples=3, materials.wall.diffuse=red, sphere.2.radius=.3 (the second sphere) or
    /// sphere.ball.radius=.3 (the sphere named ball). Can be given several times. Dedicated options have
    /// precedence.
    #[arg(long = "set", add = candidates::key_assignment_completer(), value_name = "TABLE.KEY=VALUE")]
    pub sets: Vec<String>,

    /// Output file; can be given several times
    #[arg(short, long = "output", value_name = "FILE", long_help = outputs_help(), help_heading = "Output")]
    pub outputs: Vec<PathBuf>,
    /// Extra channels (AOVs) in EXR files, with --once
    ///
    /// All, or a comma-separated list of albedo, normal, depth, variance, samples, ambient, diffuse, specular
    /// and emission.
    #[arg(long, value_name = "all|LIST", value_parser = parse_layers, help_heading = "Output")]
    pub layers: Option<OutputLayers>,
    /// Bits per channel of PNG files: 8 or 16
    #[arg(long, value_name = "BITS", allow_negative_numbers = true, value_parser = parse_bit_depth, help_heading = "Output")]
    pub bit_depth: Option<u8>,
    /// Write settings, timings and counters as JSON
    ///
    /// With --once, - is stdout.
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    pub report: Option<PathBuf>,
    /// Replace files not written by glimt
    ///
    /// Without this option, the report and the default image only replace files that glimt wrote.
    #[arg(long, help_heading = "Output")]
    pub force: bool,

    /// Render part I of N, with --once
    ///
    /// -o names the file for this part. `glimt merge` merges the parts.
    #[arg(long, value_name = "I/N", allow_hyphen_values = true, value_parser = parse_shard, help_heading = "Long renders")]
    pub shard: Option<(u32, u32)>,
    /// Interval between checkpoints; 0 disables them
    ///
    /// Checkpoints are saved next to the output as FILE.checkpoint.
    #[arg(long, value_name = "SECONDS", default_value = "60", allow_negative_numbers = true, value_parser = parse_checkpoint_interval, help_heading = "Long renders")]
    pub checkpoint: f64,
    /// Resume from a checkpoint (automatic without --once)
    #[arg(long, help_heading = "Long renders")]
    pub resume: bool,
    /// Keep the checkpoint of a finished render
    ///
    /// Use --resume with more --samples to continue.
    #[arg(long, help_heading = "Long renders")]
    pub keep_checkpoint: bool,
    /// Memory limit, such as 8GiB or 500MB; larger renders are refused
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true, value_parser = parse_byte_size, help_heading = "Long renders")]
    pub memory: Option<u64>,

    /// Width in pixels
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("width"), help_heading = "Image")]
    pub width: Option<u32>,
    /// Height in pixels
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("height"), help_heading = "Image")]
    pub height: Option<u32>,
    /// Maximum samples per pixel
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("samples"), help_heading = "Image")]
    pub samples: Option<u32>,
    /// Noise threshold for finishing a tile; 0 disables it
    #[arg(long, value_name = "E", allow_negative_numbers = true, value_parser = number_override_parser("error", ERROR), help_heading = "Image")]
    pub error: Option<f32>,
    /// Stop after this time
    ///
    /// Until then, glimt takes more samples wherever they reduce the error most.
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_positive_seconds, help_heading = "Image")]
    pub time: Option<f64>,
    /// Render only this rectangle: left, top, width, height
    #[arg(long, value_name = "X,Y,W,H", allow_hyphen_values = true, value_parser = parse_crop, help_heading = "Image")]
    pub crop: Option<Rect>,
    /// Render a view (AOV), such as normal or albedo
    #[arg(long, value_parser = choice_parser::<ViewMode>(), hide_possible_values = true, long_help = choice_long_help::<ViewMode>("Render a view: the beauty image or an AOV"), value_name = "NAME", help_heading = "Image")]
    pub view: Option<ViewMode>,
    /// Side of a model: front, back, left, right, top, bottom, iso
    #[arg(long, value_parser = choice_parser::<ViewSide>(), hide_possible_values = true, long_help = choice_long_help::<ViewSide>("View a model from this side instead of through its own camera"), value_name = "SIDE", help_heading = "Image")]
    pub from: Option<ViewSide>,
    /// Up axis of a model: x, y, z
    #[arg(long, value_parser = choice_parser::<UpAxis>(), hide_possible_values = true, long_help = choice_long_help::<UpAxis>("Up axis of a model. The default is z for STL and for PLY files from Blender, otherwise y"), value_name = "AXIS", help_heading = "Image")]
    pub up: Option<UpAxis>,
    /// Render N frames around look_at, with --once
    ///
    /// -o is either a pattern for one file per frame, such as name_####.png, or an animation (.gif or .apng).
    /// --samples, --error and --time apply to each frame.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_turntable_frames, help_heading = "Image")]
    pub turntable: Option<u32>,
    /// Random seed
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("seed"), help_heading = "Image")]
    pub seed: Option<u32>,

    /// Integrator: whitted, path
    #[arg(long, value_parser = choice_parser::<Integrator>(), hide_possible_values = true, long_help = choice_long_help::<Integrator>("Integrator"), value_name = "NAME", help_heading = "Rendering")]
    pub integrator: Option<Integrator>,
    /// Maximum bounces per path; 1 is direct light only
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = integer_override_parser("max_depth"), help_heading = "Rendering")]
    pub max_depth: Option<u32>,
    /// Shadows: off, hard, soft
    #[arg(long, value_parser = choice_parser::<ShadowMode>(), hide_possible_values = true, long_help = choice_long_help::<ShadowMode>("Shadows, in whitted"), value_name = "HOW", help_heading = "Rendering")]
    pub shadows: Option<ShadowMode>,
    /// Limit indirect radiance per bounce (removes fireflies, biased)
    ///
    /// Applies after the first diffuse or glossy reflection of a path. 0 disables the limit.
    #[arg(long, value_name = "L", allow_negative_numbers = true, value_parser = number_override_parser("clamp", CLAMP), help_heading = "Rendering")]
    pub clamp: Option<f32>,
    /// Photon mapping in whitted: indirect light and caustics
    #[arg(long, value_parser = choice_parser::<Switch>(), hide_possible_values = true, value_name = "on|off", help_heading = "Rendering")]
    pub photons: Option<Switch>,
    /// Depth of field, if the camera has an aperture
    #[arg(long, value_parser = choice_parser::<Switch>(), hide_possible_values = true, value_name = "on|off", help_heading = "Rendering")]
    pub dof: Option<Switch>,
    /// Acceleration structure: bvh, bvh-high, kdtree
    #[arg(long, value_parser = choice_parser::<Accel>(), hide_possible_values = true, long_help = choice_long_help::<Accel>("Acceleration structure"), value_name = "NAME", help_heading = "Rendering")]
    pub accel: Option<Accel>,
    /// Rendering threads; 0 is one per core
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_thread_count, help_heading = "Rendering")]
    pub threads: Option<usize>,
    /// Scheduling niceness, 0–19 [default: 0 with --once, else 10]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_niceness, help_heading = "Rendering")]
    pub nice: Option<u8>,

    /// Progress with --once: auto, plain, json, none
    #[arg(long, value_parser = choice_parser::<ProgressMode>(), hide_possible_values = true, long_help = choice_long_help::<ProgressMode>("Progress on stderr with --once"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub progress: ProgressMode,
    /// Preview: auto, halfblock, sextant, kitty, …
    #[arg(long, value_parser = choice_parser::<PreviewChoice>(), hide_possible_values = true, long_help = choice_long_help::<PreviewChoice>("How the preview is drawn"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub preview: PreviewChoice,
    /// Colors: auto, truecolor, 256, 16, none
    #[arg(long, value_parser = choice_parser::<ColorDepthChoice>(), hide_possible_values = true, long_help = choice_long_help::<ColorDepthChoice>("Colors of messages and images"), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub color: ColorDepthChoice,
    /// Minimum render time for notifications; 0 disables them
    ///
    /// When a longer render ends while the window is not focused, the terminal shows a desktop notification.
    #[arg(long, allow_negative_numbers = true, value_parser = parse_notification_time, default_value = "30", value_name = "SECONDS", help_heading = "Terminal")]
    pub notify_after: f64,
    /// Poll files instead of using system notifications
    #[arg(long, help_heading = "Terminal")]
    pub poll: bool,
}

impl RenderArgs {
    /// Returns the overrides specified by these options.
    pub(super) fn overrides(&self) -> Overrides {
        let mut overrides = Overrides {
            sets: self.sets.clone(),
            outputs: self.outputs.clone(),
            report: self.report.clone(),
            replaces_foreign: self.force,
            time_seconds: self.time,
            photons: self.photons.map(bool::from),
            dof: self.dof.map(bool::from),
            view: self.view,
            from: self.from,
            up: self.up,
            layers: self.layers.clone().map_or_else(Vec::new, |OutputLayers(layers)| layers),
            turn: self.turntable.map(|of| TurntableFrame { number: 0, of }),
            crop: self.crop,
            threads: self.threads,
            bit_depth: self.bit_depth,
            shard: self.shard,
            memory: self.memory,
            checkpoints: CheckpointSettings {
                seconds: self.checkpoint,
                resume: match (self.resume, self.once) {
                    (true, true) => ResumeMode::Asked,
                    (false, true) => ResumeMode::No,
                    // Continue after a dropped connection. If the scene was edited, no checkpoint matches it.
                    (_, false) => ResumeMode::IfSame,
                },
                are_kept: self.keep_checkpoint,
            },
            ..Overrides::default()
        };
        macro_rules! copy {
            ($(
                $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, $change:ident;
            )*) => {
                $(overrides.$name = self.$name;)*
            };
        }
        render_keys!(copy, option);
        overrides
    }
}

choice! {
    /// Progress reports.
    pub enum ProgressMode {
        /// Bars on a terminal, plain lines elsewhere.
        Auto = "auto",
        /// Occasional lines.
        Plain = "plain",
        /// One JSON object per line. The key "event" is stage, asset, progress, written, done, failed or
        /// cancelled.
        Json = "json",
        /// Only errors and warnings.
        None = "none",
    }
}

choice! {
    /// Whether `compare` shows images.
    pub enum CompareImageVisibility {
        /// On a terminal with at least 30 columns.
        Auto = "auto",
        /// Always; 80 columns wide without a terminal.
        On = "on",
        /// Never.
        Off = "off",
    }
}

choice! {
    /// On or off.
    pub enum Switch {
        /// On.
        On = "on",
        /// Off.
        Off = "off",
    }
}

impl From<Switch> for bool {
    fn from(switch: Switch) -> Self {
        switch == Switch::On
    }
}

/// Creates a parser that accepts the names of a choice's values.
fn choice_parser<C: Choice>() -> impl TypedValueParser<Value = C> {
    let known = C::ALL.iter().map(|one| PossibleValue::new(one.name()).help(one.meaning()));
    let other = C::UNAVAILABLE.iter().map(|&name| PossibleValue::new(name).help(UNAVAILABLE));
    PossibleValuesParser::new(known.chain(other)).try_map(|name| {
        let names = || C::ALL.iter().map(|one| one.name()).collect::<Vec<_>>().join(", ");
        C::named(&name).ok_or_else(|| format!("{UNAVAILABLE}; use {}", names()))
    })
}

const UNAVAILABLE: &str = "not available in this version";

/// Returns long help that lists a choice's values, in clap's format.
fn choice_long_help<C: Choice>(about: &str) -> String {
    let values: String = C::ALL.iter().map(|one| format!("\n- {}: {}", one.name(), one.meaning())).collect();
    format!("{about}\n\nPossible values:{values}")
}

/// Returns the long help for `--output`, with the extensions of all supported formats.
fn outputs_help() -> String {
    // Skip jpeg: it is the same format as jpg.
    let still: Vec<_> = Format::all_extensions().filter(|ending| *ending != "jpeg").collect();
    let moving: Vec<_> = AnimationFormat::known_extensions().collect();
    format!(
        "Output file; can be given several times\n\n\
         The extension determines the format: {}; with --turntable also {}. The default is the scene's `output`, relative to \
         the scene, or else the scene's name with .png, in the current folder.",
        still.join(", "),
        moving.join(", ")
    )
}

fn parse_bit_depth(text: &str) -> Result<u8, String> {
    match text {
        "8" => Ok(8),
        "16" => Ok(16),
        _ => Err("expected 8 or 16".to_owned()),
    }
}

fn parse_u32(text: &str) -> Result<u32, String> {
    parse_integer_in_range(text, 0..=u32::MAX)
}

/// Parses an option that overrides an integer key in `[render]`.
fn integer_override_parser(
    key: &'static str,
) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync + 'static {
    move |text| {
        let Some(ValueKind::Whole(least, most)) = find_key("render", key).map(|key| key.kind) else {
            return Err(format!("`{key}` is not an integer key of [render]"));
        };
        parse_integer_in_range(text, least as u32..=most as u32)
    }
}

/// Parses an option that overrides a number key in `[render]`. `expected` is the error message for an invalid
/// value.
fn number_override_parser(
    key: &'static str,
    expected: &'static str,
) -> impl Fn(&str) -> Result<f32, String> + Clone + Send + Sync + 'static {
    move |text| {
        let limits = find_key("render", key).and_then(|key| key.kind.limits());
        let limits = limits.ok_or_else(|| format!("`{key}` is not a number key of [render]"))?;
        let number = text.parse::<f32>().ok();
        let number = number.filter(|number| limits.violation(f64::from(*number)).is_none());
        number.ok_or_else(|| expected.to_owned())
    }
}

/// Error message for `--error`.
const ERROR: &str = "expected a relative error, such as 0.02, or 0 to disable it";
/// Error message for `--clamp`.
const CLAMP: &str = "expected a radiance from 0 to 1e18 (0 disables the limit)";

fn parse_integer_in_range(text: &str, range: RangeInclusive<u32>) -> Result<u32, String> {
    let number = text.parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("expected a whole number from {} to {}", range.start(), range.end()))
}

fn parse_positive_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("expected a number of seconds above 0".to_owned()),
    }
}

/// Parses a checkpoint interval.
fn parse_checkpoint_interval(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds >= 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("expected a number of seconds, or 0 for no checkpoints".to_owned()),
    }
}

/// Parses the minimum render time for notifications.
fn parse_notification_time(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds >= 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("expected a number of seconds, or 0 for no notifications".to_owned()),
    }
}

/// Parses a size in bytes, with an optional unit.
fn parse_byte_size(text: &str) -> Result<u64, String> {
    let expected = || "expected a size, such as 8GiB, 500MB or 1000000".to_owned();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let number: f64 = digits.trim().parse().map_err(|_| expected())?;
    let unit: u64 = match text[digits.len()..].to_lowercase().as_str() {
        "" | "b" => 1,
        "k" | "kib" => 1 << 10,
        "kb" => 1000,
        "m" | "mib" => 1 << 20,
        "mb" => 1_000_000,
        "g" | "gib" => 1 << 30,
        "gb" => 1_000_000_000,
        "t" | "tib" => 1 << 40,
        "tb" => 1_000_000_000_000,
        _ => return Err(expected()),
    };
    let bytes = number * unit as f64;
    if (1.0..1e18).contains(&bytes) { Ok(bytes as u64) } else { Err(expected()) }
}

/// Parses `I/N`: the number of a part and the total number of parts.
fn parse_shard(text: &str) -> Result<(u32, u32), String> {
    let numbers =
        text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
    match numbers {
        Some((index, count)) if (1..=count).contains(&index) && count <= parts::MAX_PARTS => {
            Ok((index, count))
        }
        _ => Err(format!(
            "expected I/N, such as 1/8 for the first of 8 parts, with N at most {}",
            parts::MAX_PARTS
        )),
    }
}

fn parse_nonnegative_number(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(bound) if bound >= 0.0 && bound.is_finite() => Ok(bound),
        _ => Err("expected a nonnegative number".to_owned()),
    }
}

/// Layers to write to EXR files, without duplicates.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputLayers(pub Vec<OutputLayer>);

fn parse_layers(text: &str) -> Result<OutputLayers, String> {
    if text == "all" {
        return Ok(OutputLayers(OutputLayer::ALL.to_vec()));
    }
    let mut layers = Vec::new();
    for name in text.split(',').map(str::trim) {
        let layer = OutputLayer::named(name).ok_or_else(|| {
            let known: Vec<_> = OutputLayer::ALL.iter().map(|layer| layer.name()).collect();
            format!("unknown layer {name:?}; expected all, {}", known.join(", "))
        })?;
        if !layers.contains(&layer) {
            layers.push(layer);
        }
    }
    Ok(OutputLayers(layers))
}

fn parse_turntable_frames(text: &str) -> Result<u32, String> {
    parse_integer_in_range(text, 1..=turntable::MAX_FRAMES)
}

fn parse_thread_count(text: &str) -> Result<usize, String> {
    const MAX_THREADS: usize = 4096;
    match text.parse::<usize>() {
        Ok(count) if count <= MAX_THREADS => Ok(count),
        _ => Err(format!("expected a number from 0 to {MAX_THREADS}")),
    }
}

fn parse_niceness(text: &str) -> Result<u8, String> {
    parse_integer_in_range(text, 0..=19).map(|steps| steps as u8)
}

fn parse_crop(text: &str) -> Result<Rect, String> {
    let numbers: Vec<u32> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
    match (numbers.as_slice(), text.split(',').count()) {
        (&[x, y, width, height], 4) if width > 0 && height > 0 => Ok(Rect { x, y, width, height }),
        _ => Err("expected X,Y,W,H with W and H above 0, such as 100,50,64,64".to_owned()),
    }
}
