//! Arguments of a render.

use std::path::PathBuf;

use super::parsers::{
    CLAMP, ERROR, OutputLayers, choice_long_help, choice_parser, integer_override_parser,
    number_override_parser, parse_bit_depth, parse_byte_size, parse_checkpoint_interval, parse_crop,
    parse_layers, parse_niceness, parse_notification_time, parse_positive_seconds, parse_shard,
    parse_thread_count, parse_turntable_frames,
};
use super::{ForeignArgs, ProgressMode, Switch, candidates};
use crate::film::Rect;
use crate::output::{AnimationFormat, Format};
use crate::pipeline::settings::{CheckpointSettings, Overrides, ResumeMode, UpAxis, ViewMode, ViewSide};
use crate::pipeline::turntable::TurntableFrame;
use crate::scene::description::{Accel, Integrator, ShadowMode, render_keys};
use crate::tui::{ColorDepthChoice, PreviewChoice};

/// Arguments of a render. Options override the scene's settings for this run.
#[derive(Clone, Debug, clap::Args)]
pub struct RenderArgs {
    /// A scene (TOML, Mitsuba's XML, or pbrt) or a model: obj, off, ply, stl, glb, gltf
    #[arg(required = true, add = candidates::scene_or_model_completer(), value_name = "SCENE")]
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

    /// Options for scenes from other renderers.
    #[command(flatten)]
    pub foreign: ForeignArgs,

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
    /// Use -o to name the file for this part. `glimt merge` merges the parts.
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
    pub fn overrides(&self) -> Overrides {
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
            foreign: self.foreign.options(),
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
