//! The end of a request: its report, its noise curve, or its failure.

use super::super::diagnostics::{clear_blocking_errors, set_warnings, show_errors};
use super::super::history;
use super::super::written_files::describe_files_of_request;
use super::record_stage;
use crate::messages;
use crate::pipeline::protocol::{
    Failure, LastValidSceneRenderOutcome, Report, SavedSceneRenderStatus, Stage, StageStatus,
};
use crate::scene::diagnostic::Diagnostic;
use crate::state::{BlockingErrors, RenderState, RequestStatus, SceneImageRenderProgress, State};

pub(super) fn handle_done(
    state: &mut State,
    mut report: Box<Report>,
    warnings: Vec<Diagnostic>,
    unchanged: bool,
) {
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
    let is_on_disk = report.stages[Stage::Write as usize].status != StageStatus::Skipped;
    if state.request.has_no_keyboard_overrides() && is_on_disk && state.saving.unwritten.is_none() {
        state.saving.write_failed = None;
        state.saving.own = SceneImageRenderProgress { state: SavedSceneRenderStatus::Written, fraction: 1.0 };
    }
    complete_noise_curve(state, &report, unchanged);
    describe_files_of_request(state, state.request.generation, &report);
    state.work.report = Some(report);
    state.work.unchanged = unchanged;
    set_warnings(state, warnings);
    history::record_newest_image(state);
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
    if render.status == StageStatus::Done && all > render.seconds {
        report.seconds += all - render.seconds;
        render.seconds = all;
    }
}

/// Counts a finished render, unless it did not change the newest image.
fn count_finished_render(state: &mut State, unchanged: bool) {
    let is_counted = std::mem::replace(&mut state.work.is_counted, true);
    let is_new = !unchanged && !is_counted || state.work.renders == 0;
    let is_shown = state.preview.history.newest_is_from_request(state.request.generation);
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
        StageStatus::Done => {
            if let Some(error) = report.image.error {
                state.work.curve.record_final(render.seconds, error);
            }
            state.work.store_finished_noise_curve(origin);
        }
        StageStatus::Reused if unchanged || state.request.is_exposure_only => {
            state.work.curve = state.work.last_curve.clone();
        }
        StageStatus::Reused => state.work.restore_noise_curve_for_image(&origin),
        StageStatus::Running | StageStatus::Skipped => {}
    }
    state.work.last_curve = state.work.curve.clone();
}

/// Handles a failure. Errors in a file that may be incomplete are withheld until the file has stopped
/// changing.
pub(super) fn handle_failure(state: &mut State, failure: Failure) {
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
pub(super) fn handle_last_valid_render_end(state: &mut State, end: LastValidSceneRenderOutcome) {
    match end {
        LastValidSceneRenderOutcome::Finished { unchanged } => {
            state.work.rendering = RenderState::Finished;
            history::record_newest_image(state);
            count_finished_render(state, unchanged);
        }
        LastValidSceneRenderOutcome::Stopped => state.work.rendering = RenderState::Stopped,
    }
}
