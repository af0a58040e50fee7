//! Requests sent to the worker.

use super::history;
use crate::event::Effect;
use crate::pipeline::protocol::{Command, Request, WriteRequirement};
use crate::state::{CameraStepStatus, KeyboardOverrides, RenderState, RequestStatus, State};
use crate::view::layout::Layout;

/// Creates a request with the current settings. The stage table is unchanged until the worker starts on the
/// request.
pub(super) fn request_render(state: &mut State, force: bool) -> Vec<Effect> {
    // Do not fill up the history while the camera is moving.
    if state.request.camera_step.generation == Some(state.request.generation) {
        state.preview.history.drop_unfinished_of_request(state.request.generation);
    } else {
        history::record_newest_image(state);
    }
    state.preview.shown = state.preview.history.return_to_newest().or_else(|| state.preview.shown.take());
    let before = std::mem::replace(&mut state.request.sent_toggles, state.request.toggles);
    let now = KeyboardOverrides { exposure: before.exposure, ..state.request.toggles };
    state.request.is_exposure_only = before == now && before != state.request.toggles;
    if state.request.is_exposure_only {
        // Exposure only affects how the image is displayed.
        state.preview.history.reassign_entry_to_next_request(state.request.generation);
    }
    state.work.is_counted &= state.request.is_exposure_only;
    state.request.generation += 1;
    let is_moved = state.request.toggles.camera.has_changes();
    state.request.moved_since =
        is_moved.then_some(state.request.moved_since.unwrap_or(state.request.generation));
    state.request.record_original_camera();
    state.request.preview_size = Layout::max_preview_size(state);
    state.request.resize_due = None;
    state.request.camera_step = CameraStepStatus::default();
    // Forget the last saved change. If this request renders a new one, the caller records it afterwards.
    (state.saving.change, state.saving.first_change) = (None, None);
    state.overlays.unconfirmed = None;
    state.overlays.are_warnings_known = false;
    state.dirty = true;
    let request = Request {
        generation: state.request.generation,
        scene: state.request.scene.clone(),
        overrides: state.request.combined_overrides(),
        preview: state.request.preview_size,
        write: if state.request.has_no_keyboard_overrides() {
            WriteRequirement::Try
        } else {
            WriteRequirement::No
        },
        own: state.request.command_line_overrides_if_keys_changed(),
        saves: state.saving.edits,
        force,
        first: state.request.first_section,
    };
    let mut effects = Vec::new();
    if state.work.paused {
        state.set_clock_paused(false);
        effects.push(Effect::Send(Command::Pause(false)));
    }
    state.work.activity = RequestStatus::Running { since: state.now };
    state.work.rendering = RenderState::UnderWay;
    effects.push(Effect::Send(Command::Render(Box::new(request))));
    effects
}

/// If the preview size has changed, requests a preview of the same image at the new size, without restarting
/// the render.
pub(super) fn request_resized_preview(state: &mut State) -> Vec<Effect> {
    let size = Layout::max_preview_size(state);
    if size == state.request.preview_size || size.is_none() {
        return Vec::new();
    }
    state.request.preview_size = size;
    vec![Effect::Send(Command::Preview(size))]
}
