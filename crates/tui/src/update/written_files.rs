//! Files that were written, or that another program has modified.

use std::path::PathBuf;

use super::diagnostics::close_empty_pane;
use super::notices::{show_notice, show_until_key};
use crate::event::Effect;
use crate::options::OutputChange;
use crate::pipeline::protocol::{Report, SampleCounts, SavedSceneRenderStatus};
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{RequestStatus, SceneImageRenderProgress, State, WrittenImageFile};
use crate::{exit_summary, messages};

/// Reports the files written at the user's request.
pub(super) fn report_written_files(state: &mut State, paths: &[PathBuf]) {
    state.saving.is_write_requested = false;
    let is_open = state.preview.history.is_viewing_older();
    let which = if is_open { messages::WROTE_NEWEST } else { "" };
    let names: Vec<String> =
        paths.iter().map(|path| escape_invisible_chars(&path.to_string_lossy()).into_owned()).collect();
    show_notice(state, messages::files_written(&names.join(", ")) + which);
}

/// Records that an image has been written, possibly while its render is still running. If a report exists,
/// it describes the same image. The file is listed next to the image because a message would cover the keys.
pub(super) fn record_written_file(
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
    state.saving.written.push(WrittenImageFile {
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
        state.saving.own = SceneImageRenderProgress { state: SavedSceneRenderStatus::Written, fraction: 1.0 };
    }
}

/// Whether this request has written the finished image, without keyboard changes, to all output files.
fn is_scene_image_written(state: &State, generation: u64) -> bool {
    let is_complete = |written: &WrittenImageFile| {
        written.generation == generation && written.shows.is_none() && !written.is_unfinished
    };
    let is_written =
        |path: &PathBuf| state.saving.written.iter().any(|it| it.path == *path && is_complete(it));
    let outputs = state.request.effective.as_ref().map(|settings| &settings.outputs);
    outputs.is_some_and(|outputs| !outputs.is_empty() && outputs.iter().all(is_written))
}

/// Adds a description to the files that contain a finished request's image.
pub(super) fn describe_files_of_request(state: &mut State, generation: u64, report: &Report) {
    let base = state.request.base_view_mode();
    let has_image =
        |written: &&mut WrittenImageFile| written.generation == generation && !written.is_unfinished;
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
