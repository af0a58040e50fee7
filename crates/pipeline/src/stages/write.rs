//! The write stage: encodes and writes images that have changed since they were last written.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::super::inputs::ProtectedInputs;
use super::super::plan::RenderPlan;
use super::super::protocol::{Event, WriteRequirement, reasons};
use super::super::render::checkpointer::create_header;
use super::super::render::film_state::FilmState;
use super::super::render::layers::layer_images;
use super::super::sink::EventSink;
use super::super::targets::{OutputTarget, output_conflicts, overwrite_protection, write_guarded};
use super::super::turntable::TurntableFrame;
use super::super::watch::content::FileHashCache;
use super::{AbortReason, StageResult};
use crate::choice::Choice;
use crate::control::CancelToken;
use crate::film::tone::tone_map_to_8_bits;
use crate::film::{RadianceImage, Rect, SampleCountStats, Srgb8Image};
use crate::integrators::{AovSource, PathAov, RenderSettings};
use crate::output::part::{self, PartFileKind, PartHeader};
use crate::output::write::{Durability, ExistingFilePolicy, SweptFolders};
use crate::output::{self, BitDepth, FilmEncodingSettings, Format, OutputError, scene_path};
use crate::output::{AnimationFormat, animation};
use crate::scene::description::RenderOptions;
use crate::scene::fingerprint::{Fingerprint, FingerprintHasher};

/// Metadata key for the scene file.
const SCENE: &str = "glimt:scene";

/// State of the write stage between requests.
#[derive(Debug, Default)]
pub(crate) struct WriteState {
    /// Number of times the scene had been saved at the newest request with a valid scene.
    saves: u64,
    /// Whether the files contain an image with keyboard changes.
    is_by_hand: bool,
    /// Key of the scene's own image, if all of its output files are up to date.
    pub(crate) own: Option<Fingerprint>,
    /// Folders from which this write or turntable has already removed temporary files left by killed
    /// processes.
    sweep: SweptFolders,
    /// Finished frames of a turntable, with their sample counts.
    frames: Vec<(Srgb8Image, SampleCountStats)>,
}

impl WriteState {
    /// Whether a file on disk contains an image that the user wrote and that includes keyboard changes. Such
    /// a file is replaced only after the scene is saved, or when the user writes another image.
    pub(crate) fn has_user_written_image_on_disk(&self, contents: &FileHashCache) -> bool {
        self.is_by_hand && contents.outputs.has_any_unchanged_file(contents)
    }

    /// Allows the scene's own image to replace any other image if the scene has been saved since the last
    /// call.
    pub(crate) fn allow_replacing_if_scene_saved(&mut self, saves: u64) {
        if std::mem::replace(&mut self.saves, saves) != saves {
            self.is_by_hand = false;
        }
    }
}

/// An image's output files, and files that must not be overwritten.
#[derive(Clone, Copy)]
pub(crate) struct ImageWriteContext<'a> {
    pub(crate) plan: &'a RenderPlan,
    pub(crate) inputs: &'a ProtectedInputs,
    pub(crate) contents: &'a FileHashCache,
    /// Whether this is the scene's own image, without keyboard changes.
    pub(crate) is_own: bool,
    pub(crate) sink: &'a EventSink,
}

/// Checks all output files before rendering starts.
///
/// # Errors
/// With [`WriteRequirement::Must`], returns an error for the first file that cannot be written. Otherwise,
/// reports failures as events.
pub(crate) fn check_outputs_are_writable(
    writing: WriteRequirement,
    plan: &RenderPlan,
    sink: &EventSink,
) -> Result<(), AbortReason> {
    match writing {
        WriteRequirement::No => Ok(()),
        WriteRequirement::Must => {
            check_each_target_is_writable(plan, output::check_image_target, output::check_output_is_writable)
                .map_err(AbortReason::from_work_error)
        }
        WriteRequirement::Try => {
            if let Err(error) = check_each_target_is_writable(
                plan,
                output::check_image_target_without_writing,
                output::check_file_target_without_writing,
            ) {
                sink.send_write_failed(None, error.to_string());
            }
            Ok(())
        }
    }
}

fn check_each_target_is_writable(
    plan: &RenderPlan,
    target: impl Fn(&Path) -> Result<Format, OutputError>,
    place: impl Fn(&Path) -> Result<(), OutputError>,
) -> Result<(), OutputError> {
    let check = |path: &PathBuf| {
        let format = target(path)?;
        format.check_image(
            plan.settings.render.width,
            plan.settings.render.height,
            BitDepth::try_from(plan.bit_depth)?,
        )
    };
    match plan.shard {
        // A part file may have any extension.
        Some(_) => plan.outputs.images.iter().try_for_each(|path| place(path))?,
        // Also check later turntable frames, to detect problems before hours of rendering.
        None => plan.outputs.images.iter().chain(&plan.outputs.later_images).try_for_each(check)?,
    }
    plan.outputs.animations.iter().try_for_each(|path| place(path))?;
    plan.outputs.report.iter().try_for_each(|path| place(path))
}

/// Runs the last stage of a request. Returns whether the image is on disk.
///
/// # Errors
/// With [`WriteRequirement::Must`], returns an error if the image could not be written.
pub(crate) fn write_if_wanted(
    writing: WriteRequirement,
    state: &FilmState,
    to: ImageWriteContext<'_>,
    written: &mut WriteState,
    token: &CancelToken,
) -> Result<StageResult<bool>, AbortReason> {
    match writing {
        WriteRequirement::No => Ok(StageResult::skipped(false, reasons::PREVIEW_ONLY)),
        WriteRequirement::Try | WriteRequirement::Must => {
            write_outdated_outputs(state, to, written, token, writing == WriteRequirement::Must)
        }
    }
}

/// Writes the film to every output file that is not up to date. Tries all files and reports failures as
/// events. Returns whether all files are now up to date.
///
/// # Errors
/// Returns [`AbortReason::Canceled`] if the token is canceled. If `is_must`, returns the last failure to
/// write a file.
fn write_outdated_outputs(
    state: &FilmState,
    to: ImageWriteContext<'_>,
    written: &mut WriteState,
    token: &CancelToken,
    is_must: bool,
) -> Result<StageResult<bool>, AbortReason> {
    let ImageWriteContext { plan, contents, is_own, sink, .. } = to;
    if plan.turn.is_none_or(|turn| turn.number == 0) {
        written.sweep = SweptFolders::default();
    }
    let unfinished = (!state.is_finished(plan)).then(|| state.film.sample_count_stats().into());
    let mut radiance: Option<RadianceImage> = None;
    let (mut count, mut errors) = (0, Vec::new());
    for path in &plan.outputs.images {
        let key = image_file_key(state, plan, path);
        if let Some(content) = contents.outputs.content_written_for_image(path, key)
            && contents.read_content_id(path, token)? == content
        {
            continue;
        }
        contents.outputs.begin_write(path, overwrite_protection(plan));
        let wrote = match state.share {
            Some(_) => write_part(state, to, path, &written.sweep, token),
            None => {
                let image = radiance
                    .get_or_insert_with(|| state.film.image(plan.settings.view.displayed_film_quantity()));
                token
                    .check_pause_and_cancel()
                    .map_err(OutputError::from)
                    .and_then(|()| write_image_file(image, state, to, path, &written.sweep, token))
            }
        };
        match wrote {
            Ok(bytes) => {
                count += 1;
                // The image is on disk, so ignore cancellation. Record the content before notifying other
                // programs, which may change the file.
                let content = contents.read_content_id(path, &CancelToken::new())?;
                contents.outputs.end_write(path, Some(content));
                contents.outputs.record_image_key(path, key);
                written.is_by_hand = !is_own;
                sink.send_image_written(path, bytes, is_own, unfinished);
            }
            Err(error) => {
                contents.outputs.end_write(path, None);
                if matches!(error, OutputError::Canceled(_)) {
                    return Err(AbortReason::Canceled);
                }
                errors.push((path, error.to_string()));
            }
        }
    }
    let outputs: HashSet<&PathBuf> = plan.outputs.images.iter().collect();
    contents.outputs.retain(|path| outputs.contains(path));
    match (errors.is_empty(), count) {
        (false, _) => {
            // Report each failure separately, except for the last one if it will be returned.
            let last = errors.last().map(|(_, message)| message.clone()).unwrap_or_default();
            errors.truncate(errors.len() - usize::from(is_must));
            errors.into_iter().for_each(|(path, message)| sink.send_write_failed(Some(path), message));
            if is_must {
                Err(AbortReason::from_work_error(last))
            } else {
                Ok(StageResult::skipped(false, last))
            }
        }
        (true, 0) => Ok(StageResult::reused(true, reasons::ALREADY_WRITTEN)),
        (true, 1) => Ok(StageResult::done(true, "")),
        (true, _) => Ok(StageResult::done(true, format!("{count} files"))),
    }
}

/// Writes the image at the user's request, even if the files are up to date. Reports failures as events.
/// Returns whether all files were written.
pub(crate) fn write_on_request(
    state: &FilmState,
    to: ImageWriteContext<'_>,
    written: &mut WriteState,
) -> bool {
    let conflicts = output_conflicts(to.plan, to.inputs);
    if !conflicts.is_empty() {
        to.sink.send_write_refused(conflicts);
        return false;
    }
    to.contents.outputs.mark_images_outdated();
    written.own = None;
    // Use a token that is never canceled, because the user requested the image.
    let outcome = write_outdated_outputs(state, to, written, &CancelToken::new(), false);
    let is_written = outcome.is_ok_and(|stage| stage.value);
    if is_written {
        let (generation, paths) = (to.sink.generation, to.plan.outputs.images.clone());
        to.sink.send(Event::WriteDone { generation, paths });
    }
    is_written
}

/// Adds an image to the turntable's frames. After the last frame, writes the animations. Returns whether they
/// have been written.
///
/// # Errors
/// The token is canceled, or a file could not be written.
pub(crate) fn add_frame_and_write_if_last(
    state: &FilmState,
    to: ImageWriteContext<'_>,
    turn: TurntableFrame,
    written: &mut WriteState,
    token: &CancelToken,
) -> Result<StageResult<bool>, AbortReason> {
    let ImageWriteContext { plan, inputs, sink, .. } = to;
    let finish = image_encoding_settings(plan);
    let image = finish.extract_quantity(&state.film);
    written.frames.truncate(turn.number as usize);
    written.frames.push((
        tone_map_to_8_bits(&image, &finish.tone.with_image_range(&image)),
        state.film.sample_count_stats(),
    ));
    if !turn.is_last() {
        return Ok(StageResult::skipped(false, format!("frame {} of {}", turn.number + 1, turn.of)));
    }
    let (frames, samples): (Vec<_>, Vec<_>) = std::mem::take(&mut written.frames).into_iter().unzip();
    let samples = SampleCountStats {
        min: samples.iter().map(|one| one.min).min().unwrap_or(0),
        mean: samples.iter().map(|one| one.mean).sum::<f64>() / samples.len() as f64,
        max: samples.iter().map(|one| one.max).max().unwrap_or(0),
    };
    for path in &plan.outputs.animations {
        let Some(format) = AnimationFormat::from_path(path) else { continue };
        let write = || {
            let metadata = encoding_settings_with_relative_scene(plan, path).metadata_with_samples(samples);
            let bytes = animation::encode(&frames, &metadata, format, token)?;
            let write = |guard: &ExistingFilePolicy<'_>| {
                output::write::write_atomically_with_policy(path, &bytes, guard, token)
            };
            write_guarded(plan, inputs, OutputTarget::from_image_path(plan, path), None, sink, write)?;
            Ok(bytes.len() as u64)
        };
        match write() {
            Ok(bytes) => sink.send_image_written(path, bytes, true, None),
            Err(OutputError::Canceled(_)) => return Err(AbortReason::Canceled),
            Err(error) => return Err(AbortReason::from_work_error(error)),
        }
    }
    Ok(StageResult::done(true, format!("{} frames", frames.len())))
}

fn write_image_file(
    image: &RadianceImage,
    state: &FilmState,
    ImageWriteContext { plan, inputs, sink, .. }: ImageWriteContext<'_>,
    path: &Path,
    sweep: &SweptFolders,
    token: &CancelToken,
) -> Result<u64, OutputError> {
    let mut finish = encoding_settings_with_relative_scene(plan, path);
    // Record the time limit only if it ended the render.
    if let Some(seconds) = state.ended_by {
        finish.metadata.push(("glimt:time".to_owned(), format!("{seconds} s")));
    }
    let layers = layer_images(state, plan);
    let bytes =
        finish.encode_with_film_metadata(&state.film, image, &layers, Format::from_path(path)?, token)?;
    write_guarded(plan, inputs, OutputTarget::from_image_path(plan, path), Some(sweep), sink, |guard| {
        output::write::write_atomically_with_policy(path, &bytes, guard, token)
    })?;
    Ok(bytes.len() as u64)
}

/// Writes the part of the image that was rendered by this process.
fn write_part(
    state: &FilmState,
    ImageWriteContext { plan, inputs, sink, .. }: ImageWriteContext<'_>,
    path: &Path,
    sweep: &SweptFolders,
    token: &CancelToken,
) -> Result<u64, OutputError> {
    let identity = state.identity.clone().unwrap_or_default();
    let scene = scene_path::relative_to_image(&plan.path, path);
    let references = inputs.paths_relative_to_scene(&plan.path);
    let head = create_header(PartFileKind::Part, state, identity, &image_encoding_settings(plan));
    let head = PartHeader { scene, references, ..head };
    let save = |guard: &ExistingFilePolicy<'_>| {
        part::save(path, &head, &state.film, &Value::Null, guard, token, Durability::Power).map(drop)
    };
    write_guarded(plan, inputs, OutputTarget::from_image_path(plan, path), Some(sweep), sink, save)?;
    Ok(path.metadata().map_or(0, |found| found.len()))
}

/// Returns the settings for developing and encoding a film.
pub(crate) fn image_encoding_settings(plan: &RenderPlan) -> FilmEncodingSettings {
    FilmEncodingSettings {
        quantity: plan.settings.view.displayed_film_quantity(),
        tone: plan.tone_mapping(),
        bit_depth: BitDepth::try_from(plan.bit_depth).unwrap_or_default(),
        metadata: image_metadata(plan),
        is_light: matches!(plan.settings.view.aov_source(), AovSource::Light(PathAov::Radiance(_))),
    }
}

/// Like [`image_encoding_settings`], but with the scene's path relative to the image.
fn encoding_settings_with_relative_scene(plan: &RenderPlan, path: &Path) -> FilmEncodingSettings {
    let mut finish = image_encoding_settings(plan);
    let scene = finish.metadata.iter_mut().find(|(name, _)| name == SCENE);
    if let Some((_, value)) = scene {
        *value = scene_path::relative_to_image(&plan.path, path);
    }
    finish
}

/// Returns the metadata needed to reproduce an image, except for metadata stored in the film.
fn image_metadata(plan: &RenderPlan) -> Vec<(String, String)> {
    let RenderSettings { render, dof, view, photons, layers: _ } =
        plan.settings.without_ineffective_settings();
    let RenderOptions { shadows, max_depth, .. } = plan.settings.render;
    let pairs = [
        (SCENE, plan.scene_file_name()),
        ("glimt:integrator", render.integrator.name().to_owned()),
        ("glimt:shadows", shadows.name().to_owned()),
        ("glimt:max_depth", max_depth.to_string()),
        ("glimt:dof", dof.to_string()),
        ("glimt:view", view.name().to_owned()),
        ("glimt:photons", photons.is_some().to_string()),
        ("glimt:error", render.error.to_string()),
        ("glimt:seed", render.seed.to_string()),
        ("glimt:exposure", plan.tone_mapping().exposure_stops.to_string()),
    ];
    let mut pairs = pairs.map(|(key, value)| (key.to_owned(), value)).to_vec();
    let mut add = |name: &str, value: String| pairs.push((format!("glimt:{name}"), value));
    if let Some(from) = plan.model_view.from {
        add("from", from.name().to_owned());
    }
    if let Some(up) = plan.model_view.up {
        add("up", up.name().to_owned());
    }
    if render.clamp > 0.0 {
        add("clamp", render.clamp.to_string());
    }
    if plan.settings.render.gain != 1.0 {
        add("gain", plan.settings.render.gain.to_string());
    }
    if let Some(Rect { x, y, width, height }) = plan.crop {
        add("crop", format!("{x},{y},{width},{height}"));
    }
    if !plan.layers.is_empty() {
        let names: Vec<_> = plan.layers.iter().map(|layer| layer.name()).collect();
        add("layers", names.join(","));
    }
    if let Some(TurntableFrame { number, of }) = plan.turn {
        let which = if plan.outputs.animations.is_empty() {
            format!("{} of {of}", number + 1)
        } else {
            of.to_string()
        };
        add("turntable", which);
    }
    pairs
}

fn image_file_key(state: &FilmState, plan: &RenderPlan, path: &Path) -> Fingerprint {
    let SampleCountStats { min, mean, max } = state.film.sample_count_stats();
    let tone = plan.tone_mapping();
    let mut key = FingerprintHasher::new("write");
    key.add_fingerprint(&state.key).add_u64(min.into()).add_f64(mean).add_u64(max.into());
    key.add_choice_name(plan.settings.view).add_f32(tone.exposure_stops).add_usize(tone.curve as usize);
    key.add_usize(tone.transfer as usize).add_u64(plan.bit_depth.into());
    plan.layers.iter().for_each(|layer| {
        key.add_choice_name(*layer);
    });
    key.add_path_bytes(path).finish()
}
