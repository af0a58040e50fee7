//! Camera keys and mouse gestures. Steps can arrive faster than previews, so each step waits until the
//! previous one has a preview. Only the newest pending step is rendered.

use std::path::PathBuf;

use super::notices::{
    show_keyboard_change_notice, show_notice, show_notice_only, show_until_key_without_effects,
};
use super::request::request_render;
use crate::camera::{dollied, orbited, zoomed_projection};
use crate::event::Effect;
use crate::messages;
use crate::pipeline::protocol::{CameraSaveResult, Command, UserMovedCamera};
use crate::pipeline::settings::CameraOverrides;
use crate::scene::description::{Pose, Projection, is_same_distance};
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{State, format_exposure_stops};

/// Orbit step in degrees.
const ORBIT_STEP: f64 = 3.0;
/// Factor by which a dolly step changes the distance.
const DOLLY_FACTOR: f64 = 0.95;
/// Factor by which a zoom step changes the field of view.
const ZOOM_FACTOR: f64 = 1.05;
/// Maximum difference between two fields of view that are considered equal. Steps are rounded but always
/// larger than this.
const ROUNDING: f64 = 0.015;
/// Exposure step in stops.
const EXPOSURE_STEP: f32 = 0.25;
/// Maximum exposure change in either direction, in stops.
const MAX_STOPS: f32 = 20.0;

/// Orbits the camera by `right` steps to the right and `up` steps upward.
pub(super) fn orbit_by_steps(state: &mut State, right: f64, up: f64) -> Vec<Effect> {
    orbit_by_degrees(state, right * ORBIT_STEP, up * ORBIT_STEP)
}

/// Orbits the camera by `right` degrees to the right, as seen in the image, and `up` degrees upward.
pub(super) fn orbit_by_degrees(state: &mut State, right: f64, up: f64) -> Vec<Effect> {
    let is_mirrored = state.request.current_camera().is_some_and(|view| view.window.mirror);
    move_camera(state, |pose| orbited(pose, if is_mirrored { -right } else { right }, up))
}

/// Moves the camera closer by a number of steps. Scales the height of an orthographic view by the same
/// factor, because the distance has no effect there.
pub(super) fn dolly(state: &mut State, steps: f64) -> Vec<Effect> {
    let Some((view, own)) = state.request.current_camera().zip(state.request.scene_camera()) else {
        return show_no_scene_notice(state);
    };
    let pose = dollied(&view.pose, libm::pow(DOLLY_FACTOR, steps), own.pose.distance());
    if pose == view.pose {
        return show_notice_only(state, if steps > 0.0 { messages::CLOSEST } else { messages::FARTHEST });
    }
    let factor = pose.distance() / view.pose.distance();
    if let height @ Some(_) = zoomed_projection(view.projection, own.projection, factor).view_height() {
        state.request.toggles.camera.view_height = height;
    }
    move_camera(state, |_| pose)
}

/// Widens the field of view, or the height of an orthographic view, by a number of steps.
pub(super) fn widen_field_of_view(state: &mut State, steps: f64) -> Vec<Effect> {
    let Some((view, own)) = state.request.current_camera().zip(state.request.scene_camera()) else {
        return show_no_scene_notice(state);
    };
    let projection = zoomed_projection(view.projection, own.projection, libm::pow(ZOOM_FACTOR, steps));
    if projection == view.projection {
        let limit = match projection {
            Projection::Perspective { fov } | Projection::Fisheye { fov } => messages::fov_limit(fov),
            Projection::Orthographic { view_height } => messages::view_height_limit(view_height),
            Projection::Spherical => messages::NO_FIELD_OF_VIEW.to_owned(),
        };
        return show_notice_only(state, &limit);
    }
    let camera = &mut state.request.toggles.camera;
    (camera.fov, camera.view_height) = (projection.fov(), projection.view_height());
    render_camera_step(state)
}

/// Increases the exposure by a number of steps.
pub(super) fn change_exposure(state: &mut State, steps: f32) -> Vec<Effect> {
    let Some(scene) = state.request.own.map(|own| own.exposure) else { return show_no_scene_notice(state) };
    let own = state.request.command_line.exposure.unwrap_or(scene);
    let before = state.request.toggles.exposure.unwrap_or(own);
    let stops = (before + steps * EXPOSURE_STEP).clamp((-MAX_STOPS).min(before), MAX_STOPS.max(before));
    if stops == before {
        return show_notice_only(state, &messages::exposure_limit(&format_exposure_stops(stops)));
    }
    state.request.toggles.exposure = (stops != own).then_some(stops);
    let effects = render_step_or_await_preview(state);
    show_notice(state, messages::exposure_changed(&format_exposure_stops(stops)));
    effects
}

fn move_camera(state: &mut State, how: impl FnOnce(&Pose) -> Pose) -> Vec<Effect> {
    let Some(view) = state.request.current_camera() else { return show_no_scene_notice(state) };
    state.request.toggles.camera.pose = Some(how(&view.pose));
    render_camera_step(state)
}

fn show_no_scene_notice(state: &mut State) -> Vec<Effect> {
    show_notice_only(state, messages::NO_SCENE)
}

pub(super) fn render_camera_step(state: &mut State) -> Vec<Effect> {
    drop_noop_camera_changes(state);
    let effects = render_step_or_await_preview(state);
    show_keyboard_change_notice(
        state,
        if state.request.toggles.camera.has_changes() {
            messages::CAMERA_MOVED
        } else {
            messages::CAMERA_RESET
        },
    );
    effects
}

/// Drops camera changes that are equal to the scene's own values.
fn drop_noop_camera_changes(state: &mut State) {
    let Some(own) = state.request.scene_camera() else { return };
    let camera = &mut state.request.toggles.camera;
    camera.pose = camera.pose.filter(|pose| *pose != own.pose);
    let (fov, height) = (own.projection.fov(), own.projection.view_height());
    camera.fov = camera.fov.filter(|now| fov.is_some_and(|fov| (now - fov).abs() > ROUNDING));
    camera.view_height =
        camera.view_height.filter(|now| height.is_some_and(|height| !is_same_distance(*now, height)));
    let pose = CameraOverrides { focus: None, ..*camera };
    camera.focus = camera.focus.filter(|focus| *focus != own.with_change(&pose).focus);
}

/// Asks the worker to write the current camera into the scene file.
pub(super) fn save_camera(state: &mut State) -> Vec<Effect> {
    let Some((camera, own)) = state.request.current_camera().zip(state.request.scene_camera()) else {
        return show_no_scene_notice(state);
    };
    let is_set = state.request.command_line.sets.iter().any(|set| set.trim_start().starts_with("camera"));
    // For models, `c` writes a new scene file, even with the default camera.
    if !state.request.toggles.camera.has_changes() && !is_set && !state.request.is_model() {
        return show_notice_only(state, messages::NOTHING_TO_KEEP);
    }
    let saved = state.request.file_camera_changes_since_move();
    // Models do not contain a camera that could be overwritten.
    if !saved.is_empty() && !state.request.is_model() {
        // The message below lists the saved values, so they cause no further conflict.
        state.request.reset_move_origin_to_scene_camera();
        let saved = saved.join(", ");
        return show_until_key_without_effects(
            state,
            &format!("error: {saved} {}", messages::CAMERA_CONFLICT),
        );
    }
    state.saving.is_camera_of_newest = state.preview.history.is_viewing_older();
    vec![Effect::Send(Command::KeepCamera(Box::new(UserMovedCamera { camera, own })))]
}

/// Handles the result of writing the camera. If the scene now uses this camera, the camera no longer counts
/// as moved.
pub(super) fn handle_camera_save_result(
    state: &mut State,
    outcome: Result<CameraSaveResult, String>,
) -> Vec<Effect> {
    let CameraSaveResult { path, is_new, is_own, of_model, edit } = match outcome {
        Ok(kept) => kept,
        Err(why) => {
            state.saving.camera_refused = Some(state.now);
            state.saving.has_scene_of_model |= state.request.is_model();
            return show_until_key_without_effects(
                state,
                &format!("error: {}", escape_invisible_chars(&why)),
            );
        }
    };
    if of_model {
        (state.saving.has_scene_of_model, state.saving.camera_of_model) =
            (true, state.request.current_camera());
    }
    let name = escape_invisible_chars(&path.to_string_lossy()).into_owned();
    let words = match (is_new, is_own) {
        _ if of_model => messages::model_scene_written(&name),
        (true, true) => messages::camera_saved(&name),
        (true, false) => messages::camera_saved_but_overridden(&name),
        (false, _) => messages::camera_already_in_scene(&name),
    };
    let which = if state.saving.is_camera_of_newest { messages::OF_NEWEST_RENDER } else { "" };
    state.saving.camera_edits.extend(edit);
    let mut effects = Vec::new();
    if let Some(since) = state.request.moved_since.filter(|_| is_new) {
        state.preview.history.record_camera_save_as_edit(since);
    }
    if is_own && state.request.toggles.camera.has_changes() {
        state.request.toggles.camera = CameraOverrides::default();
        effects = request_render(state, false);
    }
    state.saving.camera_kept = is_new.then_some(state.now);
    show_notice(state, words + which);
    effects
}

/// Asks the worker to undo the last camera edit in the scene file.
pub(super) fn undo_camera_save(state: &mut State) -> Vec<Effect> {
    match state.saving.camera_edits.last() {
        Some(edit) => vec![Effect::Send(Command::UndoCamera(edit.clone()))],
        None if state.saving.camera_of_model.is_some() => show_notice_only(state, messages::NEW_SCENE_STAYS),
        None => show_notice_only(state, messages::NOTHING_TO_UNDO),
    }
}

/// Handles the result of undoing a camera edit.
pub(super) fn handle_camera_save_undone(state: &mut State, outcome: Result<PathBuf, String>) -> Vec<Effect> {
    let path = match outcome {
        Ok(path) => path,
        Err(why) => {
            state.saving.camera_refused = Some(state.now);
            return show_until_key_without_effects(
                state,
                &format!("error: {}", escape_invisible_chars(&why)),
            );
        }
    };
    state.saving.camera_edits.pop();
    state.preview.history.record_scene_edit();
    let effects = request_render(state, false);
    state.saving.camera_kept = Some(state.now);
    let name = escape_invisible_chars(&path.to_string_lossy()).into_owned();
    show_notice(state, messages::camera_save_undone(&name));
    effects
}

/// Renders the newest step immediately if the previous one has a preview. Otherwise the step waits.
fn render_step_or_await_preview(state: &mut State) -> Vec<Effect> {
    state.dirty = true;
    if state.awaits_camera_step_preview() {
        state.request.camera_step.is_waiting = true;
        return Vec::new();
    }
    request_camera_step_render(state)
}

fn request_camera_step_render(state: &mut State) -> Vec<Effect> {
    let effects = request_render(state, false);
    state.request.camera_step.generation = Some(state.request.generation);
    effects
}

/// Renders the pending step, if any, even if the previous one has no preview.
pub(super) fn render_waiting_step_now(state: &mut State) -> Vec<Effect> {
    if state.request.camera_step.is_waiting { request_camera_step_render(state) } else { Vec::new() }
}

/// Renders the pending step if the previous one has a preview.
pub(super) fn try_render_waiting_step(state: &mut State) -> Vec<Effect> {
    if state.request.camera_step.is_waiting && !state.awaits_camera_step_preview() {
        render_step_or_await_preview(state)
    } else {
        Vec::new()
    }
}
