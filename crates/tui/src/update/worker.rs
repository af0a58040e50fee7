//! Handles worker events. Events from older generations are ignored unless they concern files or user
//! actions.

mod completion;

use std::time::Duration;

use super::diagnostics::{clear_blocking_errors, close_empty_pane, set_warnings, show_write_conflicts};
use super::notices::{show_notice, show_until_key};
use super::request::request_resized_preview;
use super::written_files::{describe_files_of_request, record_written_file, report_written_files};
use super::{camera, pointer};
use crate::event::{Effect, WriteFailure};
use crate::noise_curve::NoiseCurve;
use crate::pipeline::protocol::{
    AssetProgress, CheckpointUpdate, Event, SavedSceneRenderStatus, StageReport, StageStatus,
};
use crate::scene::MAX_COMPARED_BYTES;
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{
    AssetProgressBar, RenderState, RequestStatus, SceneImageRenderProgress, State, WrittenImageFile,
};
use crate::{messages, window_title};
use completion::{handle_done, handle_failure, handle_last_valid_render_end};

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
            describe_files_of_request(state, generation, &report);
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
            state.preview.history.record_scene_read();
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
            let is_failed_file = |written: &&mut WrittenImageFile| Some(&written.path) == path.as_ref();
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
        let done = stage.as_ref().filter(|stage| stage.status == StageStatus::Done);
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
        state.saving.own = SceneImageRenderProgress {
            state: SavedSceneRenderStatus::Begun { is_rendering: true },
            fraction: 0.0,
        };
    }
    close_empty_pane(state);
    state.work.unchanged = false;
}

fn record_stage(state: &mut State, stage: StageReport) {
    // Progress bars disappear when their stage ends.
    if stage.status != StageStatus::Running {
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
