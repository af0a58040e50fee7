//! Arguments of the command line.

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
pub use self::parts::{Engine, FarmArgs, MergeArgs};
use crate::choice;
use crate::choice::Choice;
use crate::console::answer_columns;
use crate::environment;
use crate::film::Rect;
use crate::output::{Format, MovingFormat};
use crate::pipeline::settings::{Checkpoints, Layer, Overrides, Resume, Side, UpAxis, View};
use crate::pipeline::turntable::{self, Turn};
use crate::scene::description::{Accel, Integrator, KeyRange, Render, Shadows, render_keys};
use crate::tui::{ColorChoice, PreviewChoice};

/// Example calls and their effects. No line is wider than a narrow terminal.
pub(super) const EXAMPLES: &str = "  \
  glimt new ball.toml                     write a scene to start from
  glimt ball.toml                         edit it in an editor and see it here
  glimt ball.toml --once -o a.png -o a.exr
  glimt ball.toml --once --samples 16 --time 2 --report report.json
  glimt check ball.toml                   find errors without rendering
  glimt explain materials.metal.roughness what a key means
  glimt helmet.glb                        show a model: obj, off, ply, stl, gltf
  glimt helmet.glb --once --turntable 36 -o helmet.gif
  glimt import helmet.glb -o helmet.toml  make a scene of it, to edit
  glimt compare a.exr reference.exr       measure the error of an image
  glimt bench ball.toml --plot plot.svg   plot the error of each method over time
  glimt ball.toml --once -o 1.part --shard 1/2    render the first half
  glimt merge a.png 1.part 2.part         join both halves

The scene that `glimt new` writes has every key, with comments. \
A scene that is named like a command is given with its folder: glimt ./check";

/// Exit codes of all commands.
pub(super) const EXIT_CODES: &str = "\
0 done; 1 the work failed; 2 the call or the scene is wrong; \
130, 143, 129 ended by SIGINT, SIGTERM, SIGHUP.";

/// Width of the help in columns: the terminal's, or 80. `COLUMNS` overrides them.
fn help_columns() -> usize {
    let asked = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    asked.filter(|columns| *columns > 0).unwrap_or_else(answer_columns)
}

/// Text after the options of `--help`.
fn after_long_help() -> String {
    format!("{}\n\n{}", after_help(), environment::section())
}

/// Text after the options.
fn after_help() -> String {
    format!("Examples:\n{EXAMPLES}\n\nExit codes: {EXIT_CODES}")
}

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Green.on_default().bold())
    .usage(AnsiColor::Green.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

/// A ray tracer that lives in the terminal: edit a scene, save it, see it.
#[derive(Clone, Debug, Parser)]
#[command(name = "glimt", version = crate::pipeline::BUILD, after_help = after_help(), after_long_help = after_long_help(), styles = STYLES)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true, term_width = help_columns())]
pub struct Args {
    /// A command other than rendering.
    #[command(subcommand)]
    pub command: Option<Subcommand>,
    /// Scene and options of a render.
    #[command(flatten)]
    pub render: RenderArgs,
}

impl Args {
    /// The colours asked for, by whatever command.
    pub(super) fn color(&self) -> ColorChoice {
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
    /// Read and validate a scene and everything that it names; render nothing
    Check {
        /// The scene file
        #[arg(add = candidates::scenes())]
        scene: PathBuf,
        /// Another value for a key of the scene, as in a render
        #[arg(long = "set", add = candidates::sets(), value_name = "TABLE.KEY=VALUE")]
        sets: Vec<String>,
        /// One JSON object on stdout, with a list of what is wrong, in place of messages
        #[arg(long)]
        json: bool,
        /// Colours of the messages
        #[arg(long, value_parser = one_of::<ColorChoice>(), default_value = "auto", value_name = "HOW")]
        color: ColorChoice,
    },
    /// Write a commented scene to start from; refuses to overwrite
    New {
        /// The file to write; - is stdout
        file: PathBuf,
        /// Begin it with a line that leads an editor to the schema, and write that beside it
        #[arg(long)]
        schema: bool,
    },
    /// Make a scene of a glTF file, with its meshes as PLY files and its images beside it; refuses to overwrite
    #[command(after_help = IMPORT_HELP)]
    Import(ImportArgs),
    /// Say how a picture was made: the settings that a file carries
    #[command(after_help = INFO_HELP)]
    Info(InfoArgs),
    /// Measure the error of a picture against a reference
    #[command(after_help = COMPARE_HELP)]
    Compare(CompareArgs),
    /// Benchmark error against time: the error of methods against their seconds, over several seeds
    #[command(after_help = bench::HELP)]
    Bench(Box<BenchArgs>),
    /// Join the parts of a picture that --shard wrote
    #[command(after_help = parts::MERGE_HELP)]
    Merge(MergeArgs),
    /// Print the job script that renders a picture in parts on several machines
    #[command(after_help = parts::FARM_HELP)]
    Farm(Box<FarmArgs>),
    /// Print the script that makes a shell complete commands, options, scenes and the keys of --set
    #[command(after_help = COMPLETIONS_HELP)]
    Completions {
        /// The shell
        #[arg(value_parser = one_of::<Shell>(), value_name = "SHELL")]
        shell: Shell,
    },
    /// Print the manual page of glimt or of a command, as roff
    #[command(after_help = MAN_HELP)]
    Man {
        /// The command
        command: Option<String>,
    },
    /// Print what a key of a scene means: type, unit, default, range
    #[command(after_help = EXPLAIN_HELP)]
    Explain {
        /// The key, as in render.samples, materials.metal.roughness or samples; a table lists its keys
        #[arg(add = candidates::keys())]
        key: Option<String>,
    },
    /// Print the JSON Schema of a scene, by which editors complete keys and find mistakes
    #[command(after_help = SCHEMA_HELP)]
    Schema {
        /// The draft of JSON Schema
        #[arg(long, value_parser = one_of::<Draft>(), default_value = "4", value_name = "DRAFT")]
        draft: Draft,
    },
    /// Serve an editor as a language server, over stdin and stdout
    #[command(after_help = LSP_HELP)]
    Lsp {
        /// Accepted and without effect: there is no other way to talk
        #[arg(long, hide = true)]
        stdio: bool,
    },
    /// Report what glimt finds here: terminal, colours, protocols, processor, threads, cache
    #[command(after_help = DOCTOR_HELP)]
    Doctor,
}

const COMPLETIONS_HELP: &str = "\
Load it when the shell starts:
  bash        source <(glimt completions bash)                in ~/.bashrc
  zsh         source <(glimt completions zsh)                 in ~/.zshrc, after compinit
  fish        glimt completions fish | source                 in ~/.config/fish/config.fish
  elvish      eval (glimt completions elvish | slurp)         in ~/.config/elvish/rc.elv
  powershell  glimt completions powershell | Out-String | Invoke-Expression   in $PROFILE

The script calls glimt for each completion: --set knows the tables and names of the scene in the line.";

const MAN_HELP: &str = "\
  glimt man | man -l -                     read it
  glimt man > ~/.local/share/man/man1/glimt.1
  glimt man check > ~/.local/share/man/man1/glimt-check.1";

const EXPLAIN_HELP: &str = "\
  glimt explain                               all tables
  glimt explain sphere                        the keys of a table
  glimt explain render.samples
  glimt explain materials.metal.roughness     of one type; materials.roughness is that of all types
  glimt explain roughness                     wherever it occurs

Exit codes: 0 explained; 2 there is no such key.";

const SCHEMA_HELP: &str = "\
A scene that begins with the line
  #:schema glimt.schema.json
has the schema beside it in editors with Taplo (VS Code: Even Better TOML; also Helix, Neovim, Zed). `glimt new --schema` \
writes both. Names of materials, files and geometry are left to `glimt check`.";

choice! {
    /// Drafts of JSON Schema.
    pub enum Draft {
        /// Draft 4, which Taplo reads.
        Four = "4",
        /// Draft 2020-12.
        Latest = "2020-12",
    }
}

impl Draft {
    /// The key that holds definitions.
    pub(super) fn definitions(self) -> &'static str {
        match self {
            Self::Four => "definitions",
            Self::Latest => "$defs",
        }
    }

    /// The name by which a schema says its draft.
    pub(super) fn uri(self) -> &'static str {
        match self {
            Self::Four => "http://json-schema.org/draft-04/schema#",
            Self::Latest => "https://json-schema.org/draft/2020-12/schema",
        }
    }
}

const LSP_HELP: &str = "\
Mistakes while you type, completion of keys, words and names, what a key means, definitions of names, colours. \
The editor starts it for scenes; docs/editors.md has the lines for Neovim, Helix and others.";

const DOCTOR_HELP: &str = "\
On a terminal it asks the terminal what it is and does, and waits a second at most for answers. The exit code is 0 \
whatever it finds.";

choice! {
    /// Shells that complete.
    pub enum Shell {
        /// GNU bash, 4.4 or later.
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
The scene is what `glimt FILE` shows, as a text to edit. Its meshes and images are in a folder beside it that has its \
name. Where the file has something that glimt lacks, a comment names it and what stands for it, and so does a message. \
Lights: 1 cd counts as 1 W/sr, 1 lx as 1 W/m2.

Exit codes: 0 written; 1 it could not be written, or --strict and something has no equal; 2 the file is wrong, or \
there is a file of that name.";

/// A file of another program, and the scene to write.
#[derive(Clone, Debug, clap::Args)]
pub struct ImportArgs {
    /// The file to read: gltf, glb
    #[arg(add = candidates::importable())]
    pub file: PathBuf,
    /// The scene to write [FILE with .toml, in the working directory]
    #[arg(short, long, value_name = "SCENE")]
    pub output: Option<PathBuf>,
    /// Exit with 1, and write nothing, if something has no equal
    #[arg(long)]
    pub strict: bool,
    /// Colours of the messages
    #[arg(long, value_parser = one_of::<ColorChoice>(), default_value = "auto", value_name = "HOW")]
    pub color: ColorChoice,
}

const INFO_HELP: &str = "\
All formats that glimt writes carry the settings; parts and checkpoints have the files that the picture was made of, too.

Exit codes: 0 glimt made it; 1 the file does not say so; 2 it cannot be read, or is no picture.";

/// A picture.
#[derive(Clone, Debug, clap::Args)]
pub struct InfoArgs {
    /// The picture: png, apng, gif, exr, hdr, jpg, ppm; a part or a checkpoint
    pub image: PathBuf,
    /// One JSON object on stdout in place of the lines
    #[arg(long)]
    pub json: bool,
    /// Colours of the messages
    #[arg(long, value_parser = one_of::<ColorChoice>(), default_value = "auto", value_name = "HOW")]
    pub color: ColorChoice,
}

const COMPARE_HELP: &str = "\
On linear values as they are: RMSE, max |a - b|, and relMSE = mean of (a - b)^2/(b^2 + 0.01), also \
without the 0.1 % of the pixels that have the largest errors. On what a display shows, clamped sRGB: \
PSNR; SSIM (Wang et al. 2004, on Rec. 709 luma); FLIP (Andersson et al. 2020, 67 pixels a degree).

Bias is mean(a - b)/mean(b) of the luminance. EXR files of light that glimt rendered, whole, without photons and \
with two samples a pixel or more, hold the standard error of their mean luminance: z is the bias over the standard \
error that both give it. It asks for two seeds: with one, both pictures may have the same noise. The error is an \
estimate by the samples: mostly 0.8 to 1.5 times the true one, up to 2 times at small details in few samples.

On a terminal the pictures are above the table, the difference as FLIP; where FLIP is below 0.1 everywhere, as \
|a - b| with its greatest value in white. --json shows none.

Files of 8 and 16 bits are taken for sRGB, float files for linear; alpha is left out.

Exit codes: 0 measured, and not above --max-relmse; 1 above it, or --diff could not be written; \
2 the call or a file is wrong: sizes that differ, values that are not finite.";

/// Two pictures and what is made of their difference.
#[derive(Clone, Debug, clap::Args)]
pub struct CompareArgs {
    /// The picture that is judged: png, jpg, ppm, tga, bmp, webp, exr or hdr
    pub a: PathBuf,
    /// The reference, of the same size
    pub b: PathBuf,
    /// Exit with 1 if relMSE (of all pixels) is above X
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = error_bound)]
    pub max_relmse: Option<f64>,
    /// Write the error as a picture, png, jpg, ppm: FLIP of each pixel, black for 0 through purple, red and orange to
    /// pale yellow for 1; exr, hdr: |a - b|, linear
    #[arg(long, value_name = "FILE")]
    pub diff: Option<PathBuf>,
    /// One JSON object on stdout in place of the table; psnr_db is null where the pictures are equal, as is what is not known
    #[arg(long)]
    pub json: bool,
    /// Show both pictures and their difference above the table
    #[arg(long, value_parser = one_of::<Pictures>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub pictures: Pictures,
    /// Colours of the pictures and of messages; auto looks at the terminal and at NO_COLOR
    #[arg(long, value_parser = one_of::<ColorChoice>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub color: ColorChoice,
}

/// A render's options; each overrides the scene for this run.
#[derive(Clone, Debug, clap::Args)]
pub struct RenderArgs {
    /// The scene file (TOML), or a model: obj, off, ply, stl, glb, gltf
    #[arg(required = true, add = candidates::scenes_and_models(), value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Render once without the terminal UI, write the picture, exit
    #[arg(long)]
    pub once: bool,

    /// Another value for a key of the scene, as in render.samples=3, materials.wall.diffuse=red, sphere.2.radius=.3
    /// (the second one) or sphere.ball.radius=.3 (by name); may be given several times. Options come after it
    #[arg(long = "set", add = candidates::sets(), value_name = "TABLE.KEY=VALUE")]
    pub sets: Vec<String>,

    /// Write the picture to this file.
    #[arg(short, long = "output", value_name = "FILE", help = outputs_help(), help_heading = "Output")]
    pub outputs: Vec<PathBuf>,
    /// Numbers about each pixel as channels beside the picture in EXR files, with --once: all, or some of albedo, normal,
    /// depth, variance, samples, ambient, diffuse, specular, emission, with commas between them
    #[arg(long, value_name = "all|LIST", value_parser = layers, help_heading = "Output")]
    pub layers: Option<Layers>,
    /// Bits per channel of PNG files: 8 or 16
    #[arg(long, value_name = "BITS", allow_negative_numbers = true, value_parser = bit_depth, help_heading = "Output")]
    pub bit_depth: Option<u8>,
    /// Write settings, timings and counters of the render as JSON; with --once, - is stdout
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    pub report: Option<PathBuf>,
    /// Let the report and the default picture replace a file that glimt did not write, too
    #[arg(long, help_heading = "Output")]
    pub force: bool,

    /// Render part I of N with --once; -o names its file, and `glimt merge` joins the parts
    #[arg(long, value_name = "I/N", allow_hyphen_values = true, value_parser = shard, help_heading = "Long renders")]
    pub shard: Option<(u32, u32)>,
    /// Seconds between two checkpoints, beside the output as FILE.checkpoint; 0 keeps none
    #[arg(long, value_name = "SECONDS", default_value = "60", allow_negative_numbers = true, value_parser = pause, help_heading = "Long renders")]
    pub checkpoint: f64,
    /// Go on from the checkpoint of an interrupted render; without --once glimt does that by itself
    #[arg(long, help_heading = "Long renders")]
    pub resume: bool,
    /// Keep the last checkpoint of a finished render, which --resume with more --samples extends
    #[arg(long, help_heading = "Long renders")]
    pub keep_checkpoint: bool,
    /// Refuse a render that would need more memory than this, as in 8GiB or 500MB
    #[arg(long, value_name = "SIZE", allow_negative_numbers = true, value_parser = memory, help_heading = "Long renders")]
    pub memory: Option<u64>,

    /// Pixels across
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("width"), help_heading = "Picture")]
    pub width: Option<u32>,
    /// Pixels down
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("height"), help_heading = "Picture")]
    pub height: Option<u32>,
    /// Samples per pixel, at most
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("samples"), help_heading = "Picture")]
    pub samples: Option<u32>,
    /// Stop sampling each tile once its noise is below this part of its brightness; 0: never
    #[arg(long, value_name = "E", allow_negative_numbers = true, value_parser = number_of("error", ERROR), help_heading = "Picture")]
    pub error: Option<f32>,
    /// Stop after this long; until then, samples go where they lower the error most
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds, help_heading = "Picture")]
    pub time: Option<f64>,
    /// Render these pixels only (left, top, width, height); the rest stays black
    #[arg(long, value_name = "X,Y,W,H", allow_hyphen_values = true, value_parser = crop, help_heading = "Picture")]
    pub crop: Option<Rect>,
    /// The view to render: the beauty picture or an AOV
    #[arg(long, value_parser = one_of::<View>(), value_name = "NAME", help_heading = "Picture")]
    pub view: Option<View>,
    /// The side from which a model is seen, in place of its own camera
    #[arg(long, value_parser = one_of::<Side>(), value_name = "SIDE", help_heading = "Picture")]
    pub from: Option<Side>,
    /// The axis of a model that points upwards [default: z of stl, and of ply by Blender, else y]
    #[arg(long, value_parser = one_of::<UpAxis>(), value_name = "AXIS", help_heading = "Picture")]
    pub up: Option<UpAxis>,
    /// Render N pictures all around the point that the camera looks at, with --once; -o names a file each, as in
    /// name_####.png, or a moving picture: .gif, .apng. --samples, --error and --time count for each picture
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = turntable, help_heading = "Picture")]
    pub turntable: Option<u32>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("seed"), help_heading = "Picture")]
    pub seed: Option<u32>,

    /// Rendering algorithm
    #[arg(long, value_parser = one_of::<Integrator>(), value_name = "NAME", help_heading = "Method")]
    pub integrator: Option<Integrator>,
    /// Scatterings along one path; 0: emitted light only, 1: direct light
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = whole_of("max_depth"), help_heading = "Method")]
    pub max_depth: Option<u32>,
    /// Shadows; hard: one ray to the middle of an area light
    #[arg(long, value_parser = one_of::<Shadows>(), value_name = "HOW", help_heading = "Method")]
    pub shadows: Option<Shadows>,
    /// Most radiance that a path brings by one vertex after its first diffuse or glossy reflection: less noise, but too dark; 0: none
    #[arg(long, value_name = "L", allow_negative_numbers = true, value_parser = number_of("clamp", CLAMP), help_heading = "Method")]
    pub clamp: Option<f32>,
    /// Indirect light and caustics from photon maps, in whitted
    #[arg(long, value_parser = one_of::<Switch>(), value_name = "on|off", help_heading = "Method")]
    pub photons: Option<Switch>,
    /// Depth of field, where the camera has an aperture
    #[arg(long, value_parser = one_of::<Switch>(), value_name = "on|off", help_heading = "Method")]
    pub dof: Option<Switch>,
    /// Acceleration structure
    #[arg(long, value_parser = one_of::<Accel>(), value_name = "NAME", help_heading = "Method")]
    pub accel: Option<Accel>,
    /// Threads that render; 0: one per core
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = threads, help_heading = "Method")]
    pub threads: Option<usize>,
    /// Give way to other programs, from 0, not at all, to 19 [default: 0 with --once, else 10]
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = nice, help_heading = "Method")]
    pub nice: Option<u8>,

    /// Progress on stderr with --once
    #[arg(long, value_parser = one_of::<Progress>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub progress: Progress,
    /// Kind of preview
    #[arg(long, value_parser = one_of::<PreviewChoice>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub preview: PreviewChoice,
    /// Colours of the preview and of messages; auto looks at the terminal and at NO_COLOR
    #[arg(long, value_parser = one_of::<ColorChoice>(), default_value = "auto", value_name = "HOW", help_heading = "Terminal")]
    pub color: ColorChoice,
    /// Notify through the terminal when a render of more seconds than this ends while its window has no focus; 0 turns this off
    #[arg(long, allow_negative_numbers = true, value_parser = notice, default_value = "30", value_name = "SECONDS", help_heading = "Terminal")]
    pub notify_after: f64,
    /// Look at the files several times a second rather than rely on the system's notifications
    #[arg(long, help_heading = "Terminal")]
    pub poll: bool,
}

impl RenderArgs {
    /// Overrides of a scene by these options.
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
            layers: self.layers.clone().map_or_else(Vec::new, |Layers(layers)| layers),
            turn: self.turntable.map(|of| Turn { number: 0, of }),
            crop: self.crop,
            threads: self.threads,
            bit_depth: self.bit_depth,
            shard: self.shard,
            memory: self.memory,
            checkpoints: Checkpoints {
                seconds: self.checkpoint,
                resume: match (self.resume, self.once) {
                    (true, true) => Resume::Asked,
                    (false, true) => Resume::No,
                    // A dropped line is no reason to begin anew; an edit makes another picture, which has no checkpoint yet.
                    (_, false) => Resume::IfSame,
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
    /// Ways to say progress.
    pub enum Progress {
        /// Bars on a terminal, plain lines elsewhere.
        Auto = "auto",
        /// Lines now and then.
        Plain = "plain",
        /// One JSON object a line: its key "event" is stage, asset, progress, written, done, failed or cancelled.
        Json = "json",
        /// Nothing but errors and warnings.
        None = "none",
    }
}

choice! {
    /// Whether pictures are shown with the answer.
    pub enum Pictures {
        /// On a terminal of 30 columns or more.
        Auto = "auto",
        /// Always; for 80 columns if there is no terminal.
        On = "on",
        /// Never.
        Off = "off",
    }
}

choice! {
    /// On or off.
    pub enum Switch {
        /// Yes.
        On = "on",
        /// No.
        Off = "off",
    }
}

impl From<Switch> for bool {
    fn from(switch: Switch) -> Self {
        switch == Switch::On
    }
}

/// Reads a choice by its name; help lists the names with what they mean.
fn one_of<C: Choice>() -> impl TypedValueParser<Value = C> {
    let known = C::ALL.iter().map(|one| PossibleValue::new(one.name()).help(one.meaning()));
    let other = C::UNAVAILABLE.iter().map(|&name| PossibleValue::new(name).help(UNAVAILABLE));
    PossibleValuesParser::new(known.chain(other)).try_map(|name| {
        let names = || C::ALL.iter().map(|one| one.name()).collect::<Vec<_>>().join(", ");
        C::named(&name).ok_or_else(|| format!("{UNAVAILABLE}; use {}", names()))
    })
}

const UNAVAILABLE: &str = "not available in this version";

/// Help of `--output`, with the endings of all formats that glimt writes.
fn outputs_help() -> String {
    // The other spelling of jpg says nothing new.
    let still: Vec<_> = Format::endings().filter(|ending| *ending != "jpeg").collect();
    let moving: Vec<_> = MovingFormat::endings().collect();
    format!(
        "Write the picture to this file; may be given several times. The ending chooses the format: {}; with --turntable also \
         {}. [default: the scene's `output`, which lies beside the scene, else the scene's name with .png]",
        still.join(", "),
        moving.join(", ")
    )
}

fn bit_depth(text: &str) -> Result<u8, String> {
    match text {
        "8" => Ok(8),
        "16" => Ok(16),
        _ => Err("expected 8 or 16".to_owned()),
    }
}

fn any_whole(text: &str) -> Result<u32, String> {
    whole(text, 0..=u32::MAX)
}

/// Reads the value of an option that overrides a whole number of `[render]`.
fn whole_of(key: &'static str) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync + 'static {
    move |text| match Render::key(key).map(|key| key.range) {
        Some(KeyRange::Whole(range)) => whole(text, range),
        Some(KeyRange::Number(_) | KeyRange::Names(_) | KeyRange::Color) | None => {
            Err(format!("`{key}` is no whole number of [render]"))
        }
    }
}

/// Reads the value of an option that overrides a number of `[render]`; `expected` is the message for a wrong one.
fn number_of(
    key: &'static str,
    expected: &'static str,
) -> impl Fn(&str) -> Result<f32, String> + Clone + Send + Sync + 'static {
    move |text| {
        let range = match Render::key(key).map(|key| key.range) {
            Some(KeyRange::Number(range)) => range,
            Some(KeyRange::Whole(_) | KeyRange::Names(_) | KeyRange::Color) | None => {
                return Err(format!("`{key}` is no number of [render]"));
            }
        };
        let number = text.parse::<f32>().ok().filter(|number| range.contains(&f64::from(*number)));
        number.ok_or_else(|| expected.to_owned())
    }
}

/// The message for a wrong `--error`.
const ERROR: &str = "expected a part of the brightness, such as 0.02; 0 for none";
/// The message for a wrong `--clamp`.
const CLAMP: &str = "expected a radiance from 0 to 1e18; 0 for none";

fn whole(text: &str, range: RangeInclusive<u32>) -> Result<u32, String> {
    let number = text.parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("expected a whole number from {} to {}", range.start(), range.end()))
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("expected a number of seconds above 0".to_owned()),
    }
}

/// Reads seconds, or 0 for never.
fn pause(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds >= 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("expected a number of seconds, or 0 for no checkpoints".to_owned()),
    }
}

/// Reads seconds, or 0 for never.
fn notice(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds >= 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("expected a number of seconds, or 0 for no notifications".to_owned()),
    }
}

/// Reads a size in bytes, with a unit or without.
fn memory(text: &str) -> Result<u64, String> {
    let expected = || "expected a size, as in 8GiB, 500MB or 1000000".to_owned();
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

/// Reads a part of a picture: its number and the number of parts.
fn shard(text: &str) -> Result<(u32, u32), String> {
    let numbers =
        text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
    match numbers {
        Some((index, count)) if (1..=count).contains(&index) && count <= parts::MOST => Ok((index, count)),
        _ => {
            Err(format!("expected I/N, the part and the number of parts, as in 1/8; at most {}", parts::MOST))
        }
    }
}

fn error_bound(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(bound) if bound >= 0.0 && bound.is_finite() => Ok(bound),
        _ => Err("expected a number that is not below 0".to_owned()),
    }
}

/// Layers of EXR files, each once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layers(pub Vec<Layer>);

fn layers(text: &str) -> Result<Layers, String> {
    if text == "all" {
        return Ok(Layers(Layer::ALL.to_vec()));
    }
    let mut layers = Vec::new();
    for name in text.split(',').map(str::trim) {
        let layer = Layer::named(name).ok_or_else(|| {
            let known: Vec<_> = Layer::ALL.iter().map(|layer| layer.name()).collect();
            format!("there is no layer {name:?}; there are all, {}", known.join(", "))
        })?;
        if !layers.contains(&layer) {
            layers.push(layer);
        }
    }
    Ok(Layers(layers))
}

fn turntable(text: &str) -> Result<u32, String> {
    whole(text, 1..=turntable::MOST)
}

fn threads(text: &str) -> Result<usize, String> {
    const MOST: usize = 4096;
    match text.parse::<usize>() {
        Ok(count) if count <= MOST => Ok(count),
        _ => Err(format!("expected a number from 0 to {MOST}")),
    }
}

fn nice(text: &str) -> Result<u8, String> {
    whole(text, 0..=19).map(|steps| steps as u8)
}

fn crop(text: &str) -> Result<Rect, String> {
    let numbers: Vec<u32> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
    match (numbers.as_slice(), text.split(',').count()) {
        (&[x, y, width, height], 4) if width > 0 && height > 0 => Ok(Rect { x, y, width, height }),
        _ => Err("expected four whole numbers X,Y,W,H with W and H above 0, as in 100,50,64,64".to_owned()),
    }
}
