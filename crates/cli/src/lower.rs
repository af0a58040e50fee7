//! Validates render arguments and lowers them to a [`RenderRequest`].

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::args::{ProgressMode, RenderArgs};
use crate::output::AnimationFormat;
use crate::output::Format;
use crate::output::write::STDOUT;
use crate::pipeline::settings::Overrides;
use crate::pipeline::turntable;
use crate::tui::{ColorDepthChoice, PreviewChoice};

/// The file name for standard output.
pub(super) const STDOUT_NAME: &str = "-";

/// Default niceness of render threads in the terminal UI. Keeps the UI and other programs responsive.
const UI_NICENESS: u8 = 10;

/// A validated render request.
#[derive(Clone, Debug)]
pub(super) struct RenderRequest {
    pub(super) scene: PathBuf,
    pub(super) overrides: Overrides,
    pub(super) is_once: bool,
    pub(super) progress: ProgressMode,
    pub(super) preview: PreviewChoice,
    pub(super) color: ColorDepthChoice,
    pub(super) poll: bool,
    pub(super) notify_after: f64,
    /// Niceness of the whole process if `is_once`, otherwise of the render threads only.
    pub(super) nice: u8,
}

impl RenderRequest {
    /// Whether errors are reported as JSON lines.
    pub(super) fn reports_json_errors(&self) -> bool {
        self.is_once && self.progress == ProgressMode::Json
    }
}

/// Validates and lowers the arguments.
///
/// # Errors
/// An error message with a hint.
pub(super) fn lower_args(args: RenderArgs) -> Result<RenderRequest, String> {
    match args.shard {
        Some(_) if !args.once => {
            return Err("--shard needs --once: the terminal UI renders complete images".to_owned());
        }
        // Parts can have any file name.
        Some(_) => {}
        None if args.turntable.is_some() => check_turntable_args(&args)?,
        None => check_output_formats_and_duplicates(&args.outputs)?,
    }
    if args.turntable.is_some() && args.shard.is_some() {
        return Err(
            "--turntable cannot be used with --shard: a turntable is rendered on one machine".to_owned()
        );
    }
    if args.layers.is_some() {
        let why = match (args.once, args.shard) {
            (false, _) => "--layers needs --once: the terminal UI shows one view at a time (key v)",
            (true, Some(_)) => "--layers cannot be used with --shard: parts contain only the beauty image",
            (true, None) => "",
        };
        if !why.is_empty() {
            return Err(why.to_owned());
        }
    }
    let mut overrides = args.overrides();
    if overrides.turn.is_some() {
        // Disable checkpoints: finished frames are saved, and a single frame renders quickly.
        overrides.checkpoints.seconds = 0.0;
    }
    if overrides.report.as_deref() == Some(Path::new(STDOUT_NAME)) {
        if !args.once {
            let hint = "pass a file or use --once";
            return Err(format!("--report {STDOUT_NAME} would write to the terminal UI: {hint}"));
        }
        overrides.report = Some(STDOUT.into());
    }
    let scene = args.scene.ok_or("no scene given; see glimt --help")?;
    Ok(RenderRequest {
        scene,
        overrides,
        is_once: args.once,
        progress: args.progress,
        preview: args.preview,
        color: args.color,
        poll: args.poll,
        notify_after: args.notify_after,
        nice: args.nice.unwrap_or(if args.once { 0 } else { UI_NICENESS }),
    })
}

/// Checks that every frame of a turntable has its own file and that no single-image options are used.
fn check_turntable_args(args: &RenderArgs) -> Result<(), String> {
    if !args.once {
        return Err("--turntable needs --once: the terminal UI shows one image".to_owned());
    }
    for (is_given, name) in [(args.resume, "--resume"), (args.keep_checkpoint, "--keep-checkpoint")] {
        if is_given {
            return Err(format!("{name} cannot be used with --turntable, which has no checkpoints"));
        }
    }
    let mut known = HashSet::new();
    for path in &args.outputs {
        if AnimationFormat::from_path(path).is_none() {
            Format::from_path(path)
                .map_err(|error| format!("{error}; a turntable also accepts .gif and .apng"))?;
        }
        turntable::check_turntable_output(path)?;
        reject_duplicate_path(path, &mut known)?;
    }
    if let Some(twin) = turntable::first_file_shared_by_frames(&args.outputs, args.turntable.unwrap_or(1)) {
        let name = twin.display();
        return Err(format!("{name} would be written twice: choose distinct file names"));
    }
    match &args.report {
        Some(path) if path != Path::new(STDOUT_NAME) && !turntable::has_frame_placeholder(path) => {
            let name = turntable::add_frame_placeholder(path);
            Err(format!("a turntable has one report per frame: use --report {}", name.display()))
        }
        Some(_) | None => Ok(()),
    }
}

/// Adds a path to `known`, or returns an error if it is already there.
fn reject_duplicate_path<'a>(path: &'a Path, known: &mut HashSet<&'a Path>) -> Result<(), String> {
    if !known.insert(path) {
        return Err(format!("-o {} is specified twice", path.display()));
    }
    Ok(())
}

/// Checks that all extensions are known and that no output is specified twice.
fn check_output_formats_and_duplicates(outputs: &[PathBuf]) -> Result<(), String> {
    let mut known = HashSet::new();
    for path in outputs {
        if AnimationFormat::from_path(path).is_some() {
            let name = path.display();
            return Err(format!(
                "{name} is an animation, which needs --turntable N; use .png for a single image"
            ));
        }
        Format::from_path(path).map_err(|error| error.to_string())?;
        reject_duplicate_path(path, &mut known)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;
    use crate::args::{Args, Subcommand};
    use crate::choice::Choice;
    use crate::film::Rect;
    use crate::math::limits::MAX_MAGNITUDE;
    use crate::pipeline::settings::{CheckpointSettings, ResumeMode, ViewMode};
    use crate::scene::description::{self, render_keys};
    use crate::scene::keys::limits::Limits;
    use crate::scene::keys::{ValueKind, find_table};

    fn lowered(line: &str) -> Result<RenderRequest, String> {
        let words = std::iter::once("glimt").chain(line.split_whitespace());
        lower_args(Args::try_parse_from(words).map_err(|error| error.to_string())?.render)
    }

    #[test]
    fn clap_definition_is_valid() {
        Args::command().debug_assert();
    }

    #[test]
    fn default_arguments_change_no_settings() {
        let request = lowered("a.toml").expect("valid arguments");
        let checkpoints = CheckpointSettings { seconds: 60.0, resume: ResumeMode::IfSame, are_kept: false };
        assert_eq!(request.overrides, Overrides { checkpoints, ..Overrides::default() });
        let once = lowered("a.toml --once").expect("valid arguments").overrides.checkpoints;
        assert_eq!(once, CheckpointSettings { resume: ResumeMode::No, ..checkpoints });
        assert!(!request.is_once && !request.poll);
    }

    #[test]
    fn every_option_is_lowered() {
        let request = lowered(
            "a.toml --once --set a.b=1 --set a.c=x -o a.png --output b.exr --width 3 --height 4 --samples 5 --error 0.02 --time 0.5 --max-depth 0 \
             --integrator path --shadows hard --clamp 2.5 --photons on --dof off --accel bvh --view normal --seed 7 \
             --threads 2 --crop 1,2,3,4 --bit-depth 16 --report r.json --force --progress json --color 256 --poll \
             --nice 3 --notify-after 7 --checkpoint 5 --resume --keep-checkpoint --memory 1.5GiB",
        )
        .expect("valid arguments");
        let expected = Overrides {
            sets: vec!["a.b=1".into(), "a.c=x".into()],
            outputs: vec!["a.png".into(), "b.exr".into()],
            report: Some("r.json".into()),
            replaces_foreign: true,
            width: Some(3),
            height: Some(4),
            samples: Some(5),
            error: Some(0.02),
            time_seconds: Some(0.5),
            max_depth: Some(0),
            integrator: Some(description::Integrator::Path),
            shadows: Some(description::ShadowMode::Hard),
            clamp: Some(2.5),
            photons: Some(true),
            dof: Some(false),
            accel: Some(description::Accel::Bvh),
            view: Some(ViewMode::Normal),
            seed: Some(7),
            crop: Some(Rect { x: 1, y: 2, width: 3, height: 4 }),
            threads: Some(2),
            bit_depth: Some(16),
            memory: Some(3 << 29),
            checkpoints: CheckpointSettings { seconds: 5.0, resume: ResumeMode::Asked, are_kept: true },
            ..Default::default()
        };
        assert_eq!(request.overrides, expected);
        assert!(request.is_once && request.poll);
        assert_eq!((request.nice, request.notify_after), (3, 7.0));
        assert_eq!((request.progress, request.color), (ProgressMode::Json, ColorDepthChoice::Indexed256));
    }

    #[test]
    fn invalid_arguments_are_rejected() {
        for wrong in [
            "",
            "a.toml --samples 0",
            "a.toml --width 65537",
            "a.toml --time 0",
            "a.toml --time nan",
            "a.toml --crop 1,2,3",
            "a.toml --crop 1,2,3,0",
            "a.toml --crop 1,2,3,4,x",
            "a.toml --bit-depth 12",
            "a.toml --view nothing",
            "a.toml -o a.xyz",
            "a.toml -o a.png -o a.png",
            "a.toml b.toml",
            "a.toml --threads 5000",
            "a.toml --integrator paths",
            "a.toml --clamp -1",
            "a.toml --clamp nan",
            "a.toml --accel octree",
            "a.toml --seed -1",
            "a.toml --nice 20",
            "a.toml --nice -1",
            "a.toml --notify-after -1",
            "a.toml --checkpoint -1",
            "a.toml --memory 0",
            "a.toml --memory 5XB",
            "a.toml --memory GiB",
            "a.toml --memory inf",
            "a.toml --shard 1/2",
            "a.toml --once -o a.part --shard 0/2",
            "a.toml --once -o a.part --shard 3/2",
            "a.toml --once -o a.part --shard 1",
        ] {
            assert!(lowered(wrong).is_err(), "{wrong}");
        }
    }

    macro_rules! names {
        ($(
            $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, option;
        )*) => {
            &[$(stringify!($name)),*]
        };
    }

    /// Checks that options accept and reject the same values as the corresponding `[render]` keys.
    #[test]
    fn options_have_the_same_ranges_as_keys() {
        const NAMES: &[&str] = render_keys!(names, option);
        let command = Args::command();
        let keys = find_table("render").expect("a table").keys.iter().filter(|key| key.name != "output");
        for key in keys {
            let name = key.name.replace('_', "-");
            let option = command.get_arguments().find(|option| option.get_long() == Some(&*name));
            assert_eq!(option.is_some(), NAMES.contains(&key.name), "--{name}");
            let Some(option) = option else { continue };
            assert!(option.get_help().is_some(), "--{name} has no help");
            let (accepted, refused) = match key.kind {
                ValueKind::Whole(least, most) => (
                    [least, most].map(|end| end.to_string()).to_vec(),
                    vec![least as i64 - 1, most as i64 + 1],
                ),
                ValueKind::Number(Limits::AtLeast(least)) => {
                    let ends = [least as f32, MAX_MAGNITUDE as f32];
                    (ends.map(|end| end.to_string()).to_vec(), vec![least as i64 - 1])
                }
                ValueKind::Words(values) => {
                    (values().iter().map(|value| value.name.to_owned()).collect(), Vec::new())
                }
                kind => panic!("--{name}: no option takes a {kind:?}"),
            };
            let refused = refused.iter().map(i64::to_string).chain(["another".to_owned()]);
            for value in accepted {
                let request = lowered(&format!("a.toml --{name} {value}")).expect(&name);
                assert_ne!(request.overrides, Overrides::default(), "--{name} {value} has no effect");
            }
            for value in refused {
                assert!(lowered(&format!("a.toml --{name} {value}")).is_err(), "--{name} {value}");
            }
        }
    }

    #[test]
    fn scenes_named_like_commands_need_a_path() {
        let parsed =
            |words: &[&str]| Args::try_parse_from([&["glimt"], words].concat()).expect("valid arguments");
        assert!(matches!(parsed(&["check", "a.toml"]).command, Some(Subcommand::Check { .. })));
        assert_eq!(parsed(&["./check"]).render.scene, Some("./check".into()));
    }

    #[test]
    fn every_view_has_a_name() {
        for &view in ViewMode::ALL {
            let request = lowered(&format!("a.toml --view {}", view.name())).expect("valid arguments");
            assert_eq!(request.overrides.view, Some(view));
        }
    }
}
