//! Command-line arguments.

mod bench;
pub(crate) mod candidates;
mod foreign;
#[cfg(test)]
mod help_tests;
mod parsers;
mod parts;
mod render;

use std::path::PathBuf;

use clap::Parser;
use clap::builder::styling::{AnsiColor, Styles};

pub use self::bench::BenchArgs;
pub use self::foreign::ForeignArgs;
use self::parsers::{choice_long_help, choice_parser, parse_nonnegative_number};
pub use self::parts::{ClusterScheduler, FarmArgs, MergeArgs};
pub use self::render::RenderArgs;
use crate::choice;
use crate::console::stdout_columns_or_default;
use crate::environment;
use crate::tui::ColorDepthChoice;

/// Examples for the long help and the manual page, in lines of at most 80 columns.
pub(super) const EXAMPLES: &str = "  \
  glimt new ball.toml                     write a commented scene
  glimt ball.toml                         render it live while you edit it
  glimt ball.toml --once -o a.png -o a.exr
  glimt ball.toml --once --samples 16 --time 2 --report report.json
  glimt check ball.toml                   report errors without rendering
  glimt explain materials.metal.roughness describe a key
  glimt helmet.glb                        view a model: obj, off, ply, stl, gltf
  glimt kitchen.xml -D spp=64             render a scene of Mitsuba
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
fn help_width() -> usize {
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
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true, term_width = help_width())]
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
        #[arg(add = candidates::any_scene_completer())]
        scene: PathBuf,
        /// Override a scene key
        #[arg(long = "set", add = candidates::key_assignment_completer(), value_name = "TABLE.KEY=VALUE")]
        sets: Vec<String>,
        /// Print errors and warnings as one JSON object on stdout
        #[arg(long)]
        json: bool,
        /// Options for scenes from other renderers.
        #[command(flatten)]
        foreign: ForeignArgs,
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
    /// Convert a glTF file, a Mitsuba scene or a pbrt scene without overwriting files
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
    /// The file to read: gltf, glb, xml (Mitsuba), pbrt
    #[arg(add = candidates::import_completer())]
    pub file: PathBuf,
    /// The scene to write [default: FILE with .toml, in the current folder]
    #[arg(short, long, value_name = "SCENE")]
    pub output: Option<PathBuf>,
    /// Options for scenes from other renderers.
    #[command(flatten)]
    pub foreign: ForeignArgs,
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

choice! {
    /// Progress reports.
    pub enum ProgressMode {
        /// Bars on a terminal, plain lines elsewhere.
        Auto = "auto",
        /// Occasional lines.
        Plain = "plain",
        /// One JSON object per line. The key "event" is stage, asset, progress, written, done, failed or
        /// canceled.
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
