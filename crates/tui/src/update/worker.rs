//! Handles worker events. Events from older generations are ignored unless they concern files or user
//! actions.

use std::path::PathBuf;
use std::time::Duration;

use super::notices::{show_notice, show_until_key};
use super::request::request_resized_preview;
use super::{camera, history, pointer};
use crate::event::{Effect, WriteFailure};
use crate::exit_summary;
use crate::messages;
use crate::noise_curve::NoiseCurve;
use crate::options::OutputChange;
use crate::pipeline::protocol::{
    AssetProgress, CheckpointUpdate, Event, Failure, LastValidSceneRenderOutcome, Report, SampleCounts,
    SavedSceneRenderStatus, Stage, StageReport, Status,
};
use crate::scene::MAX_COMPARED_BYTES;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{
    AssetProgressBar, BlockingErrors, PaneState, RenderState, RequestStatus, SceneImageProgress, State,
    WrittenFile,
};
use crate::window_title;

pub(super) fn handle_worker_event(state: &mut State, event: Event) -> Vec<Effect> {
    state.saving.write_results += u64::from(event.is_write_result());
    let event = match event {
        // Replies to user actions are never outdated.
        Event::CameraKept { outcome, .. } => return camera::handle_camera_save_result(state, outcome),
        Event::CameraUndone { outcome, .. } => return camera::handle_camera_save_undone(state, outcome),
        Event::Picked { picked, .. } => return pointer::handle_pick_reply(state, &picked),
        Event::WriteDone { paths, .. } => {
            report_written_files(state, &paths);
            return Vec::new();
        }
        // Images from earlier requests may be written after a new request has started.
        Event::Written { path, bytes, generation, is_own, unfinished }
            if generation != state.request.generation =>
        {
            record_written_file(state, path, bytes, generation, is_own, unfinished);
            return Vec::new();
        }
        Event::Done { generation, report, .. } if generation != state.request.generation => {
            set_written_image_descriptions(state, generation, &report);
            return Vec::new();
        }
        event => event,
    };
    if generation_of_event(&event) != state.request.generation {
        return Vec::new();
    }
    // Previews come from their slot and file changes from the watcher.
    let shows_nothing = matches!(event, Event::Preview { .. } | Event::Files { .. });
    state.dirty |= !shows_nothing;
    match event {
        Event::Started { .. } => reset_work_for_new_request(state),
        Event::Stage { stage, .. } => record_stage(state, stage),
        Event::Asset { progress, .. } => update_asset_bar(state, progress),
        Event::Settings { settings, own, .. } => {
            state.request.own = Some(own);
            state.request.drop_overrides_saved_to_scene();
            let pinhole = state.request.combined_overrides().dof == Some(true) && !settings.dof;
            state.request.effective = Some(*settings);
            clear_blocking_errors(state);
            state.preview.history.mark_scene_edits_read();
            if pinhole {
                show_notice(state, messages::PINHOLE);
            }
            // The preview size depends on the image's aspect ratio.
            return request_resized_preview(state);
        }
        Event::Warnings { warnings, .. } => set_warnings(state, warnings),
        Event::Progress { progress, .. } => {
            if let Some(noise) = progress.noise {
                state.work.curve.record(progress.earlier_seconds + noise.seconds, noise.now);
            }
            state.work.progress = Some(progress);
            let is_rendering = SavedSceneRenderStatus::Begun { is_rendering: true };
            if state.request.has_no_keyboard_overrides() {
                state.saving.own.state = is_rendering;
            }
            if state.saving.own.state == is_rendering {
                state.saving.own.fraction = progress.fraction;
            }
        }
        Event::Files { files, .. } => state.request.record_input_files(files),
        Event::Preview { .. }
        | Event::WriteDone { .. }
        | Event::CameraKept { .. }
        | Event::CameraUndone { .. }
        | Event::Picked { .. } => {}
        Event::Written { path, bytes, generation, is_own, unfinished } => {
            record_written_file(state, path, bytes, generation, is_own, unfinished);
        }
        Event::OwnImage { state: own, .. } => state.saving.own.state = own,
        Event::WriteFailed { path, message, .. } => {
            let was_requested_by_user = std::mem::take(&mut state.saving.is_write_requested);
            // A failed write requested during the render does not affect the final image.
            if !was_requested_by_user || state.work.activity == RequestStatus::Done {
                state.saving.unwritten = Some(messages::NOT_WRITTEN.to_owned());
            }
            let is_failed_file = |written: &&mut WrittenFile| Some(&written.path) == path.as_ref();
            state
                .saving
                .written
                .iter_mut()
                .filter(is_failed_file)
                .for_each(|written| written.is_stale = true);
            show_until_key(state, format!("error: {}", escape_invisible_chars(&message)));
            state.saving.write_failed =
                Some(WriteFailure { why: message, generation: state.request.generation, is_refused: false });
        }
        Event::WriteWarning { warning, .. } => {
            show_until_key(state, format!("warning: {}", escape_invisible_chars(&warning.to_string())));
        }
        Event::Checkpoint { news, .. } => match news {
            CheckpointUpdate::Failed { message } => {
                show_until_key(state, format!("warning: {}", escape_invisible_chars(&message)));
            }
            CheckpointUpdate::Resumed { path, .. } => {
                show_notice(
                    state,
                    format!("{} {}", messages::RESUMING, escape_invisible_chars(&path.to_string_lossy())),
                );
            }
            CheckpointUpdate::SetAside { path } => {
                show_until_key(
                    state,
                    messages::other_render_checkpoint_renamed(&escape_invisible_chars(
                        &path.to_string_lossy(),
                    )),
                );
            }
            CheckpointUpdate::Unused { path, why } => {
                let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
                show_until_key(
                    state,
                    messages::checkpoint_ignored(
                        &escape_invisible_chars(&name),
                        &escape_invisible_chars(&why),
                    ),
                );
            }
            CheckpointUpdate::Written { .. }
            | CheckpointUpdate::Finished { .. }
            | CheckpointUpdate::Absent { .. }
            | CheckpointUpdate::Ignored { .. } => {}
        },
        Event::Refused { conflicts, .. } => show_write_conflicts(state, conflicts),
        Event::Text { text, .. } => state.request.text = (text.len() <= MAX_COMPARED_BYTES).then_some(text),
        Event::WritePostponed { .. } => {
            show_notice(state, messages::WRITE_POSTPONED);
        }
        Event::Done { report, warnings, unchanged, .. } => {
            let time = state.work.total_rendering_time(state.now);
            handle_done(state, report, warnings, unchanged);
            return notify_long_render_ended(state, time);
        }
        Event::Failed { failure, .. } => {
            let time = state.work.total_rendering_time(state.now);
            handle_failure(state, failure);
            return notify_long_render_ended(state, time);
        }
        Event::LastGoodEnded { end, .. } => handle_last_valid_render_end(state, end),
        Event::Canceled { .. } => {
            (state.work.activity, state.work.rendering) = (RequestStatus::Canceled, RenderState::Stopped);
            state.set_clock_paused(false);
            state.work.assets.clear();
        }
    }
    Vec::new()
}

/// Notifies the user that a long render has ended, provided that the window is not focused and the terminal
/// supports notifications.
fn notify_long_render_ended(state: &State, time: Option<Duration>) -> Vec<Effect> {
    let is_over = matches!(state.work.activity, RequestStatus::Done | RequestStatus::Broken);
    let is_long = |time: &Duration| state.display.notify_after.is_some_and(|least| *time > least);
    let time = time.filter(is_long).filter(|_| is_over && !state.display.has_focus);
    let notice = time.zip(state.display.capabilities.notice);
    notice
        .map(|(time, way)| Effect::Aside(window_title::notification_bytes(state, way, time)))
        .into_iter()
        .collect()
}

fn generation_of_event(event: &Event) -> u64 {
    match event {
        Event::Started { generation }
        | Event::Stage { generation, .. }
        | Event::Asset { generation, .. }
        | Event::Warnings { generation, .. }
        | Event::Settings { generation, .. }
        | Event::Progress { generation, .. }
        | Event::Preview { generation }
        | Event::Written { generation, .. }
        | Event::OwnImage { generation, .. }
        | Event::WriteFailed { generation, .. }
        | Event::WriteWarning { generation, .. }
        | Event::Refused { generation, .. }
        | Event::Checkpoint { generation, .. }
        | Event::WritePostponed { generation }
        | Event::WriteDone { generation, .. }
        | Event::LastGoodEnded { generation, .. }
        | Event::Text { generation, .. }
        | Event::Files { generation, .. }
        | Event::CameraKept { generation, .. }
        | Event::CameraUndone { generation, .. }
        | Event::Picked { generation, .. }
        | Event::Done { generation, .. }
        | Event::Failed { generation, .. }
        | Event::Canceled { generation } => *generation,
    }
}

fn reset_work_for_new_request(state: &mut State) {
    for (before, stage) in state.work.last_seconds.iter_mut().zip(&state.work.stages) {
        let done = stage.as_ref().filter(|stage| stage.status == Status::Done);
        *before = done.map(|stage| stage.seconds).or(*before);
    }
    state.work.stages = Default::default();
    state.work.assets.clear();
    state.work.progress = None;
    state.work.curve = NoiseCurve::default();
    state.work.report = None;
    state.saving.unwritten = None;
    // A written image stays up to date until the render of another image begins.
    if state.request.has_no_keyboard_overrides() && state.saving.own.state != SavedSceneRenderStatus::Written
    {
        state.saving.own =
            SceneImageProgress { state: SavedSceneRenderStatus::Begun { is_rendering: true }, fraction: 0.0 };
    }
    close_empty_pane(state);
    state.work.unchanged = false;
}

fn record_stage(state: &mut State, stage: StageReport) {
    // Progress bars disappear when their stage ends.
    if stage.status != Status::Running {
        state.work.assets.clear();
    }
    if let Some(slot) = state.work.stages.get_mut(stage.name as usize) {
        *slot = Some(stage);
    }
}

/// Updates an asset's progress bar. Each asset name has one bar.
fn update_asset_bar(state: &mut State, progress: AssetProgress) {
    let finished = (progress.done >= progress.total).then_some(state.now);
    let bar = AssetProgressBar { progress, finished };
    match state.work.assets.iter_mut().find(|asset| asset.progress.name == bar.progress.name) {
        Some(asset) => *asset = bar,
        None => state.work.assets.push(bar),
    }
}

/// Reports the files written at the user's request.
fn report_written_files(state: &mut State, paths: &[PathBuf]) {
    state.saving.is_write_requested = false;
    let is_open = state.preview.history.is_viewing_older();
    let which = if is_open { messages::WROTE_NEWEST } else { "" };
    let names: Vec<String> =
        paths.iter().map(|path| escape_invisible_chars(&path.to_string_lossy()).into_owned()).collect();
    show_notice(state, messages::files_written(&names.join(", ")) + which);
}

/// Records that an image has been written, possibly while its render is still running. If a report exists,
/// it describes the same image. The file is listed next to the image because a message would cover the keys.
fn record_written_file(
    state: &mut State,
    path: PathBuf,
    bytes: u64,
    generation: u64,
    is_own: bool,
    unfinished: Option<SampleCounts>,
) {
    // If the render is still running, writing another output may have failed.
    if generation == state.request.generation && state.work.activity == RequestStatus::Done {
        (state.saving.unwritten, state.saving.write_failed) = (None, None);
        close_empty_pane(state);
    }
    let shows = (!is_own).then_some(state.saving.write_shows);
    let view = shows.and_then(|shows| shows.view).unwrap_or(state.request.base_view_mode());
    let made = match (unfinished, &state.work.report) {
        (Some(samples), _) => exit_summary::describe_unfinished_image(samples, view),
        (None, Some(report)) => exit_summary::describe_image(report, view),
        (None, None) if generation == state.request.generation => exit_summary::view_name_unless_beauty(view),
        (None, None) => String::new(),
    };
    state.saving.written.retain(|other| other.path != path);
    if !is_own && state.saving.own.state == SavedSceneRenderStatus::Written {
        state.saving.own.state = SavedSceneRenderStatus::Begun { is_rendering: false };
    }
    let is_unfinished = unfinished.is_some();
    let (is_stale, lost) = (false, None);
    state.saving.written.push(WrittenFile {
        path,
        bytes,
        generation,
        made,
        shows,
        is_unfinished,
        is_stale,
        lost,
    });
    if generation >= state.saving.saved_at && is_scene_image_written(state, generation) {
        state.saving.own = SceneImageProgress { state: SavedSceneRenderStatus::Written, fraction: 1.0 };
    }
}

/// Whether this request has written the finished image, without keyboard changes, to all output files.
fn is_scene_image_written(state: &State, generation: u64) -> bool {
    let is_complete = |written: &WrittenFile| {
        written.generation == generation && written.shows.is_none() && !written.is_unfinished
    };
    let is_written =
        |path: &PathBuf| state.saving.written.iter().any(|it| it.path == *path && is_complete(it));
    let outputs = state.request.effective.as_ref().map(|settings| &settings.outputs);
    outputs.is_some_and(|outputs| !outputs.is_empty() && outputs.iter().all(is_written))
}

/// Adds a description to the files that contain a finished request's image.
fn set_written_image_descriptions(state: &mut State, generation: u64, report: &Report) {
    let base = state.request.base_view_mode();
    let has_image = |written: &&mut WrittenFile| written.generation == generation && !written.is_unfinished;
    for written in state.saving.written.iter_mut().filter(has_image) {
        let view = written.shows.and_then(|shows| shows.view).unwrap_or(base);
        written.made = exit_summary::describe_image(report, view);
    }
}

/// Handles an output file that another program has modified.
pub(super) fn handle_external_output_change(
    state: &mut State,
    OutputChange { path, lost }: &OutputChange,
) -> Vec<Effect> {
    let Some(written) = state.saving.written.iter_mut().find(|written| written.path == *path) else {
        return Vec::new();
    };
    (written.lost, state.dirty) = (*lost, true);
    if let Some(words) = written.describe_external_change() {
        show_until_key(state, words);
    }
    Vec::new()
}

/// Shows new conflicts immediately. If the user has closed the pane, only new conflicts reopen it.
fn show_write_conflicts(state: &mut State, conflicts: Vec<Diagnostic>) {
    state.saving.is_write_requested = false;
    state.saving.unwritten = Some(messages::NOT_WRITTEN.to_owned());
    show_notice(state, messages::NOT_WRITTEN);
    let why = conflicts.first().map_or(String::new(), |conflict| conflict.message.clone());
    let generation = state.request.generation;
    state.saving.write_failed = Some(WriteFailure { why, generation, is_refused: true });
    if !conflicts.iter().all(|conflict| state.overlays.warnings.contains(conflict)) {
        state.overlays.diagnostics = PaneState { open: true, scroll: 0 };
    }
    state.overlays.warnings.retain(|one| one.severity == Severity::Warning);
    state.overlays.warnings.splice(0..0, conflicts);
}

/// Clears the errors once the file is valid again.
fn clear_blocking_errors(state: &mut State) {
    if state.overlays.problems.take().is_some() {
        state.overlays.diagnostics = PaneState::default();
    }
}

fn handle_done(state: &mut State, mut report: Box<Report>, warnings: Vec<Diagnostic>, unchanged: bool) {
    add_seconds_of_earlier_requests(&mut report);
    state.overlays.message.take_if(|message| message.words.starts_with(messages::RESUMING));
    clear_blocking_errors(state);
    for stage in &report.stages {
        record_stage(state, stage.clone());
    }
    state.request.effective = Some(report.settings.clone());
    (state.work.activity, state.work.rendering) = (RequestStatus::Done, RenderState::Finished);
    state.set_clock_paused(false);
    state.work.assets.clear();
    // This request's image has been written, so earlier write failures no longer matter.
    let is_on_disk = report.stages[Stage::Write as usize].status != Status::Skipped;
    if state.request.has_no_keyboard_overrides() && is_on_disk && state.saving.unwritten.is_none() {
        state.saving.write_failed = None;
        state.saving.own = SceneImageProgress { state: SavedSceneRenderStatus::Written, fraction: 1.0 };
    }
    complete_noise_curve(state, &report, unchanged);
    set_written_image_descriptions(state, state.request.generation, &report);
    state.work.report = Some(report);
    state.work.unchanged = unchanged;
    set_warnings(state, warnings);
    history::record_current_image(state);
    count_finished_render(state, unchanged);
    if unchanged {
        state.saving.last_edit.take_if(|edit| *edit == state.request.generation);
    }
    if unchanged && state.saving.change.is_some_and(|change| change.generation == state.request.generation) {
        state.saving.change = None;
        state.saving.first_change = None;
    }
}

/// Adds the time that earlier requests spent on this image's samples.
fn add_seconds_of_earlier_requests(report: &mut Report) {
    let all = report.image.render_seconds;
    let render = &mut report.stages[Stage::Render as usize];
    if render.status == Status::Done && all > render.seconds {
        report.seconds += all - render.seconds;
        render.seconds = all;
    }
}

/// Counts a finished render, unless it did not change the newest image.
fn count_finished_render(state: &mut State, unchanged: bool) {
    let is_counted = std::mem::replace(&mut state.work.is_counted, true);
    let is_new = !unchanged && !is_counted || state.work.renders == 0;
    let is_shown = state.preview.history.is_newest_from_request(state.request.generation);
    if is_new || is_shown && state.preview.history.is_newest_unfinished() {
        state.work.renders += 1;
        if is_shown {
            state.preview.history.finish_newest(state.work.renders);
        }
    }
}

/// Completes the noise curve with the final measurement. Keeps the existing curve if the image is unchanged
/// or differs only in exposure.
fn complete_noise_curve(state: &mut State, report: &Report, unchanged: bool) {
    let render = &report.stages[Stage::Render as usize];
    let origin = state.request.image_provenance(false).without_exposure();
    match render.status {
        Status::Done => {
            if let Some(error) = report.image.error {
                state.work.curve.record_final(render.seconds, error);
            }
            state.work.store_finished_noise_curve(origin);
        }
        Status::Reused if unchanged || state.request.is_exposure_only => {
            state.work.curve = state.work.last_curve.clone();
        }
        Status::Reused => state.work.restore_noise_curve_for_image(&origin),
        Status::Running | Status::Skipped => {}
    }
    state.work.last_curve = state.work.curve.clone();
}

fn set_warnings(state: &mut State, warnings: Vec<Diagnostic>) {
    state.overlays.warnings = warnings;
    state.overlays.diagnostics.open &= !state.warnings_and_write_failure().is_empty();
    state.overlays.are_warnings_known = true;
}

/// Closes the diagnostics pane if it is empty.
fn close_empty_pane(state: &mut State) {
    state.overlays.diagnostics.open &=
        state.overlays.problems.is_some() || !state.warnings_and_write_failure().is_empty();
}

/// Handles a failure. Errors in a file that may be incomplete are withheld until the file has stopped
/// changing.
fn handle_failure(state: &mut State, failure: Failure) {
    state.set_clock_paused(false);
    state.work.assets.clear();
    state.saving.change = None;
    match failure {
        // The last valid scene is being rendered.
        Failure::Scene(_) => state.preview.history.discard_edits_of_invalid_scene(),
        Failure::Work(_) => state.work.rendering = RenderState::Stopped,
    }
    match failure {
        Failure::Scene(diagnostics) if !state.saving.is_settled => {
            state.work.activity = RequestStatus::Waiting;
            state.overlays.unconfirmed = Some(diagnostics);
        }
        Failure::Scene(diagnostics) => show_errors(state, BlockingErrors { diagnostics, work: None }),
        Failure::Work(message) => {
            show_errors(state, BlockingErrors { diagnostics: Vec::new(), work: Some(message) });
        }
    }
}

/// Handles the end of a render of the last valid scene. Such a render continues while the scene file is
/// broken.
fn handle_last_valid_render_end(state: &mut State, end: LastValidSceneRenderOutcome) {
    match end {
        LastValidSceneRenderOutcome::Finished { unchanged } => {
            state.work.rendering = RenderState::Finished;
            history::record_current_image(state);
            count_finished_render(state, unchanged);
        }
        LastValidSceneRenderOutcome::Stopped => state.work.rendering = RenderState::Stopped,
    }
}

/// Shows new errors. If the user has closed the pane, only new errors reopen it.
fn show_errors(state: &mut State, problems: BlockingErrors) {
    state.work.activity = RequestStatus::Broken;
    if state.overlays.problems.as_ref() != Some(&problems) {
        state.overlays.problems = Some(problems);
        state.overlays.diagnostics = PaneState { open: true, scroll: 0 };
    }
    state.dirty = true;
}

/// Shows errors that were withheld, now that the files are complete.
pub(super) fn show_withheld_errors(state: &mut State) {
    state.saving.is_settled = true;
    if let Some(diagnostics) = state.overlays.unconfirmed.take() {
        show_errors(state, BlockingErrors { diagnostics, work: None });
    }
}
