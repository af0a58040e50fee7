//! Encoding and writing pictures, each only when it would differ from what was written.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::super::inputs::Inputs;
use super::super::plan::Plan;
use super::super::protocol::Writing;
use super::super::render::film_state::FilmState;
use super::super::render::keeping::head;
use super::super::sink::Sink;
use super::super::targets::{Target, conflicts, guarded};
use super::super::turntable::Turn;
use super::super::watch::content::{Content, Contents};
use super::{Staged, Stop};
use crate::choice::Choice;
use crate::control::CancelToken;
use crate::film::tone::develop;
use crate::film::{Picture, RadianceImage, Rect, SampleStats};
use crate::integrators::{AovSource, LightAov};
use crate::output::part::{self, Head, Kind};
use crate::output::write::{Durability, FolderSweep, Guard};
use crate::output::{self, BitDepth, Finish, Format, LayerImage, OutputError, scene_path};
use crate::output::{MovingFormat, moving};
use crate::scene::fingerprint::{Fingerprint, Key};

/// Name of the scene in the metadata.
const SCENE: &str = "glimt:scene";

/// Files that glimt wrote.
#[derive(Debug, Default)]
pub(crate) struct Written {
    /// Each with the picture's key and the file's content at that time.
    files: HashMap<PathBuf, (Key, Content)>,
    /// The scene's own image, if all its files hold it.
    pub(crate) own: Option<Key>,
    /// Folders of this write, or of the images of a turntable so far, without temporary files of killed writers.
    sweep: FolderSweep,
}

impl Written {
    /// The first of these paths that exists and holds something else than glimt wrote there.
    pub(crate) fn not_ours<'a>(&self, paths: &'a [PathBuf], contents: &Contents) -> Option<&'a Path> {
        let holds = |path: &Path, known: &Content| {
            // A token that nobody cancels.
            contents.read(path, &CancelToken::new()).is_ok_and(|content| content == *known)
        };
        let is_ours = |path: &Path| self.files.get(path).is_some_and(|(_, known)| holds(path, known));
        let is_there = |path: &Path| path.symlink_metadata().is_ok();
        paths.iter().map(PathBuf::as_path).find(|path| is_there(path) && !is_ours(path))
    }

    /// Whether there is none.
    pub(crate) fn is_empty(&self) -> bool {
        self.files.is_empty()
    }

    /// Write everything next time.
    fn forget(&mut self) {
        self.files.clear();
        self.own = None;
    }
}

/// Destination of pictures, and files that must not be lost there.
#[derive(Clone, Copy)]
pub(crate) struct Destination<'a> {
    pub(crate) plan: &'a Plan,
    /// Layers of the picture for EXR files.
    pub(crate) layers: &'a [LayerImage],
    pub(crate) inputs: &'a Inputs,
    pub(crate) contents: &'a Contents,
    /// Whether the picture is the scene's own image, not one that keys changed.
    pub(crate) is_own: bool,
    pub(crate) sink: &'a Sink,
}

/// Look at all targets before work is put into a picture for them, and say what is wrong.
///
/// # Errors
/// The first that cannot be written, where it must be.
pub(crate) fn check_targets(writing: Writing, plan: &Plan, sink: &Sink) -> Result<(), Stop> {
    match writing {
        Writing::No => Ok(()),
        Writing::Must => find_targets(plan, output::check_target, output::check_place).map_err(Stop::work),
        Writing::Try => {
            if let Err(error) = find_targets(plan, output::look_at_target, output::look_at_place) {
                sink.write_failed(None, error.to_string());
            }
            Ok(())
        }
    }
}

fn find_targets(
    plan: &Plan,
    target: impl Fn(&Path) -> Result<Format, OutputError>,
    place: impl Fn(&Path) -> Result<(), OutputError>,
) -> Result<(), OutputError> {
    let check = |path: &PathBuf| {
        let format = target(path)?;
        format.check_picture(
            plan.settings.render.width,
            plan.settings.render.height,
            BitDepth::try_from(plan.bit_depth)?,
        )
    };
    match plan.shard {
        // A part has any ending.
        Some(_) => plan.outputs.iter().try_for_each(|path| place(path))?,
        // Nothing that is in the way of a later image of a turntable is found when hours of work are done.
        None => plan.outputs.iter().chain(&plan.to_come).try_for_each(check)?,
    }
    plan.moving.iter().try_for_each(|path| place(path))?;
    plan.report.iter().try_for_each(|path| place(path))
}

/// The last stage of a request; whether the picture is on disk then.
///
/// # Errors
/// What went wrong, where the picture must be written.
pub(crate) fn write_if_wanted(
    writing: Writing,
    canvas: &FilmState,
    to: Destination<'_>,
    written: &mut Written,
    token: &CancelToken,
) -> Result<Staged<bool>, Stop> {
    match writing {
        Writing::No => Ok(Staged::skipped(false, "nothing is to be written")),
        Writing::Try | Writing::Must => write(canvas, to, written, token, writing == Writing::Must),
    }
}

/// Write the film as it is to every output that does not hold it already. All outputs are tried, and failures are reported as events.
/// Returns whether all outputs hold it.
///
/// # Errors
/// Cancelled; or, if the picture must be written, the last file that could not be, and why.
fn write(
    canvas: &FilmState,
    to: Destination<'_>,
    written: &mut Written,
    token: &CancelToken,
    is_must: bool,
) -> Result<Staged<bool>, Stop> {
    let Destination { plan, contents, is_own, sink, .. } = to;
    if plan.turn.is_none_or(|turn| turn.number == 0) {
        written.sweep = FolderSweep::default();
    }
    let mut radiance: Option<RadianceImage> = None;
    let (mut count, mut errors) = (0, Vec::new());
    for path in &plan.outputs {
        let key = key(canvas, plan, path);
        if let Some((known, content)) = written.files.get(path)
            && *known == key
            && contents.read(path, token)? == *content
        {
            continue;
        }
        contents.outputs.begin(path);
        let wrote = match canvas.share {
            Some(_) => write_part(canvas, to, (path, &written.sweep), token),
            None => {
                let image = radiance.get_or_insert_with(|| canvas.film.image(plan.settings.view.quantity()));
                token
                    .check()
                    .map_err(OutputError::from)
                    .and_then(|()| write_one(image, canvas, to, (path, &written.sweep), token))
            }
        };
        match wrote {
            Ok(bytes) => {
                count += 1;
                // The picture is on disk: a cancel from here on does not undo that. Look at the content before anybody hears of
                // the file and may change it.
                let content = contents.read(path, &CancelToken::new())?;
                contents.outputs.end(path, Some(content));
                written.files.insert(path.clone(), (key, content));
                sink.written(path, bytes, is_own);
            }
            Err(error) => {
                contents.outputs.end(path, None);
                if matches!(error, OutputError::Cancelled(_)) {
                    return Err(Stop::Cancelled);
                }
                errors.push((path, error.to_string()));
            }
        }
    }
    let outputs: HashSet<&PathBuf> = plan.outputs.iter().collect();
    written.files.retain(|path, _| outputs.contains(path));
    contents.outputs.retain(|path| outputs.contains(path));
    match (errors.is_empty(), count) {
        (false, _) => {
            // Report each failure by itself, but for the last one if that is the reason why the request fails.
            let last = errors.last().map(|(_, message)| message.clone()).unwrap_or_default();
            errors.truncate(errors.len() - usize::from(is_must));
            errors.into_iter().for_each(|(path, message)| sink.write_failed(Some(path), message));
            if is_must { Err(Stop::work(last)) } else { Ok(Staged::skipped(false, last)) }
        }
        (true, 0) => Ok(Staged::reused(true, "the picture is on disk")),
        (true, 1) => Ok(Staged::done(true, "")),
        (true, _) => Ok(Staged::done(true, format!("{count} files"))),
    }
}

/// [`write`] by a person's order, whatever is on disk. Failures are reported as events. Returns whether all outputs hold the picture.
pub(crate) fn write_by_hand(canvas: &FilmState, to: Destination<'_>, written: &mut Written) -> bool {
    let conflicts = conflicts(to.plan, to.inputs);
    if !conflicts.is_empty() {
        to.sink.refused(conflicts);
        return false;
    }
    written.forget();
    // Nobody cancels this token: a person ordered this picture. Events tell what failed.
    let outcome = write(canvas, to, written, &CancelToken::new(), false);
    let is_written = outcome.is_ok_and(|stage| stage.value);
    if is_written {
        to.sink.write_done(to.plan.outputs.clone());
    }
    is_written
}

/// Frames of a turntable so far, each with its samples.
#[derive(Debug, Default)]
pub(crate) struct Frames(Vec<(Picture, SampleStats)>);

/// Adds the picture to the frames of its turntable; with the last one, writes the moving pictures. Returns whether they are on disk.
///
/// # Errors
/// The first file that could not be written, and why. Or cancelled.
pub(crate) fn write_moving(
    canvas: &FilmState,
    to: Destination<'_>,
    (turn, frames): (Turn, &mut Frames),
    token: &CancelToken,
) -> Result<Staged<bool>, Stop> {
    let Destination { plan, inputs, sink, .. } = to;
    let finish = finish(plan);
    let image = finish.image(&canvas.film);
    frames.0.truncate(turn.number as usize);
    frames.0.push((develop(&image, &finish.tone.resolved_for(&image)), canvas.film.samples()));
    if !turn.is_last() {
        return Ok(Staged::skipped(false, format!("it is kept as frame {} of {}", turn.number + 1, turn.of)));
    }
    let (frames, samples): (Vec<_>, Vec<_>) = std::mem::take(frames).0.into_iter().unzip();
    let samples = SampleStats {
        min: samples.iter().map(|one| one.min).min().unwrap_or(0),
        mean: samples.iter().map(|one| one.mean).sum::<f64>() / samples.len() as f64,
        max: samples.iter().map(|one| one.max).max().unwrap_or(0),
    };
    for path in &plan.moving {
        let Some(format) = MovingFormat::of(path) else { continue };
        let write = || {
            let metadata = finish_at(plan, path).metadata_with(samples);
            let bytes = moving::encode(&frames, &metadata, format, token)?;
            let write = |guard: &Guard<'_>| output::write::atomic_until(path, &bytes, guard, token);
            guarded(plan, inputs, (Target::picture(plan, path), None), sink, write)?;
            Ok(bytes.len() as u64)
        };
        match write() {
            Ok(bytes) => sink.written(path, bytes, true),
            Err(OutputError::Cancelled(_)) => return Err(Stop::Cancelled),
            Err(error) => return Err(Stop::work(error)),
        }
    }
    Ok(Staged::done(true, format!("{} frames", frames.len())))
}

fn write_one(
    image: &RadianceImage,
    canvas: &FilmState,
    Destination { plan, layers, inputs, sink, .. }: Destination<'_>,
    (path, sweep): (&Path, &FolderSweep),
    token: &CancelToken,
) -> Result<u64, OutputError> {
    let mut finish = finish_at(plan, path);
    // A budget that suffices changes nothing.
    if let Some(seconds) = canvas.ended_by {
        finish.metadata.push(("glimt:time".to_owned(), format!("{seconds} s")));
    }
    let bytes = finish.encode(&canvas.film, (image, layers), Format::of(path)?, token)?;
    let target = (Target::picture(plan, path), Some(sweep));
    guarded(plan, inputs, target, sink, |guard| output::write::atomic_until(path, &bytes, guard, token))?;
    Ok(bytes.len() as u64)
}

/// Writes the part of a picture that this process rendered.
fn write_part(
    canvas: &FilmState,
    Destination { plan, inputs, sink, .. }: Destination<'_>,
    (path, sweep): (&Path, &FolderSweep),
    token: &CancelToken,
) -> Result<u64, OutputError> {
    let identity = canvas.identity.clone().unwrap_or_default();
    let scene = scene_path::relative(&plan.path, path);
    let head = Head { scene, ..head(Kind::Part, canvas, identity, &finish(plan)) };
    let save = |guard: &Guard<'_>| {
        part::save(path, &head, &canvas.film, &Value::Null, guard, (token, Durability::Power)).map(drop)
    };
    guarded(plan, inputs, (Target::picture(plan, path), Some(sweep)), sink, save)?;
    Ok(path.metadata().map_or(0, |found| found.len()))
}

/// Settings that turn a film into the files of a plan.
pub(crate) fn finish(plan: &Plan) -> Finish {
    Finish {
        quantity: plan.settings.view.quantity(),
        tone: plan.tone,
        bit_depth: BitDepth::try_from(plan.bit_depth).unwrap_or_default(),
        metadata: metadata(plan),
        is_light: matches!(plan.settings.view.source(), AovSource::Light(LightAov::Radiance(_))),
    }
}

/// [`finish`] for an image at a path, which names the scene relative to itself.
fn finish_at(plan: &Plan, path: &Path) -> Finish {
    let mut finish = finish(plan);
    let scene = finish.metadata.iter_mut().find(|(name, _)| name == SCENE);
    if let Some((_, value)) = scene {
        *value = scene_path::relative(&plan.path, path);
    }
    finish
}

/// Metadata of a picture: enough to make it again, beside what its film tells.
fn metadata(plan: &Plan) -> Vec<(String, String)> {
    let settings = &plan.effective;
    let pairs = [
        (SCENE, plan.name.clone()),
        ("glimt:integrator", settings.integrator.name().to_owned()),
        ("glimt:shadows", settings.shadows.name().to_owned()),
        ("glimt:max_depth", plan.settings.render.max_depth.to_string()),
        ("glimt:dof", settings.dof.to_string()),
        ("glimt:view", settings.view.name().to_owned()),
        ("glimt:photons", settings.photons.to_string()),
        ("glimt:error", settings.error.to_string()),
        ("glimt:seed", settings.seed.to_string()),
        ("glimt:exposure", plan.tone.exposure_stops.to_string()),
    ];
    let mut pairs = pairs.map(|(key, value)| (key.to_owned(), value)).to_vec();
    let mut add = |name: &str, value: String| pairs.push((format!("glimt:{name}"), value));
    if let Some(from) = plan.from {
        add("from", from.name().to_owned());
    }
    if let Some(up) = plan.up {
        add("up", up.name().to_owned());
    }
    if settings.clamp > 0.0 {
        add("clamp", settings.clamp.to_string());
    }
    if let Some(Rect { x, y, width, height }) = plan.crop {
        add("crop", format!("{x},{y},{width},{height}"));
    }
    if !plan.layers.is_empty() {
        let names: Vec<_> = plan.layers.iter().map(|layer| layer.name()).collect();
        add("layers", names.join(","));
    }
    if let Some(Turn { number, of }) = plan.turn {
        let which = if plan.moving.is_empty() { format!("{} of {of}", number + 1) } else { of.to_string() };
        add("turntable", which);
    }
    pairs
}

fn key(canvas: &FilmState, plan: &Plan, path: &Path) -> Key {
    let SampleStats { min, mean, max } = canvas.film.samples();
    let mut key = Fingerprint::new("write");
    key.key(&canvas.key).u64(min.into()).f64(mean).u64(max.into());
    key.choice(plan.settings.view).f32(plan.tone.exposure_stops).index(plan.tone.curve as usize);
    key.index(plan.tone.transfer as usize).u64(plan.bit_depth.into());
    plan.layers.iter().for_each(|layer| {
        key.choice(*layer);
    });
    key.path(path).finish()
}
