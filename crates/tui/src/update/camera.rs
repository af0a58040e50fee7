//! Keys and the mouse on the camera. Steps come faster than pictures: a step waits until the one before has its first picture,
//! and glimt renders only the newest step that waits.

use std::path::PathBuf;

use super::request::render;
use super::say::{notify, prompt, say};
use crate::camera::{dollied, orbited, zoomed};
use crate::event::Effect;
use crate::pipeline::protocol::{Command, Kept, MovedCamera};
use crate::pipeline::settings::CameraChange;
use crate::scene::description::Pose;
use crate::scene::is_mesh;
use crate::scene::sanitize::visible;
use crate::state::{State, signed_stops};

/// Degrees of a step around.
const TURN: f64 = 3.0;
/// Factor of the eye's distance for a step nearer.
const NEARER: f64 = 0.95;
/// Factor of the field of view for a step wider.
const WIDER: f64 = 1.05;
/// Greatest difference from the first field of view that counts as none, since each step is rounded; every step is larger.
const ROUNDING: f64 = 0.015;
/// Stops of a step of exposure.
const STOPS: f32 = 0.25;
/// The most that keys expose, and darken.
const MOST_STOPS: f32 = 20.0;

/// Turns by so many steps to the right and up.
pub(super) fn orbit(state: &mut State, right: f64, up: f64) -> Vec<Effect> {
    turn(state, right * TURN, up * TURN)
}

/// Turns by so many degrees to the right and up.
pub(super) fn turn(state: &mut State, right: f64, up: f64) -> Vec<Effect> {
    moved(state, |pose| orbited(pose, right, up))
}

/// Moves so many steps nearer.
pub(super) fn dolly(state: &mut State, steps: f64) -> Vec<Effect> {
    let Some((view, own)) = state.request.viewpoint().zip(state.request.camera) else {
        return unknown(state);
    };
    let pose = dollied(&view.pose, libm::pow(NEARER, steps), own.pose.distance());
    if pose == view.pose {
        let (end, part) = if steps > 0.0 { ("near", "a thousandth of") } else { ("far", "1000 times") };
        return notify(state, &format!("this is as {end} as keys go: {part} the scene's own distance"));
    }
    moved(state, |_| pose)
}

/// Widens the field of view by so many steps.
pub(super) fn zoom(state: &mut State, steps: f64) -> Vec<Effect> {
    let Some(view) = state.request.viewpoint() else { return unknown(state) };
    let fov = zoomed(&view, libm::pow(WIDER, steps));
    if fov == view.fov {
        return notify(state, &format!("field of view {fov}°: keys go from 1° to 160°"));
    }
    state.request.toggles.camera.fov = Some(fov);
    step_of_camera(state)
}

/// Brightens by so many steps.
pub(super) fn expose(state: &mut State, steps: f32) -> Vec<Effect> {
    let Some(scene) = state.request.exposure else { return unknown(state) };
    let own = state.request.command_line.exposure.unwrap_or(scene);
    let before = state.request.toggles.exposure.unwrap_or(own);
    let stops = (before + steps * STOPS).clamp((-MOST_STOPS).min(before), MOST_STOPS.max(before));
    if stops == before {
        return notify(state, &format!("exposure {}: keys go from −20 to +20", signed_stops(stops)));
    }
    state.request.toggles.exposure = (stops != own).then_some(stops);
    let effects = step(state);
    say(state, format!("exposure {}", signed_stops(stops)));
    effects
}

fn moved(state: &mut State, how: impl FnOnce(&Pose) -> Pose) -> Vec<Effect> {
    let Some(view) = state.request.viewpoint() else { return unknown(state) };
    state.request.toggles.camera.pose = Some(how(&view.pose));
    step_of_camera(state)
}

fn unknown(state: &mut State) -> Vec<Effect> {
    notify(state, "the scene has not been read yet")
}

pub(super) fn step_of_camera(state: &mut State) -> Vec<Effect> {
    forget_own(state);
    let effects = step(state);
    say(
        state,
        if state.request.toggles.camera.is_any() {
            "camera moved (preview only). w: save image · c: keep in scene · 0: reset"
        } else {
            "the camera is where the scene has it"
        },
    );
    effects
}

/// Drops changes back to the scene's own values.
fn forget_own(state: &mut State) {
    let Some(own) = state.request.camera else { return };
    let camera = &mut state.request.toggles.camera;
    camera.pose = camera.pose.filter(|pose| *pose != own.pose);
    camera.fov = camera.fov.filter(|fov| (fov - own.fov).abs() > ROUNDING);
    let pose = CameraChange { focus: None, ..*camera };
    camera.focus = camera.focus.filter(|focus| *focus != own.changed(&pose).focus);
}

/// The camera as it is now is to be put into the scene file.
pub(super) fn keep(state: &mut State) -> Vec<Effect> {
    let Some((camera, own)) = state.request.viewpoint().zip(state.request.camera) else {
        return unknown(state);
    };
    let is_set = state.request.command_line.sets.iter().any(|set| set.trim_start().starts_with("camera"));
    // The scene of a model is worth writing with its own camera, too.
    if !state.request.toggles.camera.is_any() && !is_set && !is_mesh(&state.request.scene) {
        return notify(state, "camera unchanged: nothing to keep");
    }
    let saved = state.request.saved_since_moved();
    // A model has no file in which a camera is saved.
    if !saved.is_empty() && !is_mesh(&state.request.scene) {
        // The person knows of it from here on.
        state.request.move_from_own();
        let saved = saved.join(", ");
        let why = "was saved since the keys moved the camera: press c again to write over it";
        return prompt(state, &format!("error: {saved} {why}"));
    }
    state.saving.is_camera_of_newest = state.picture.history.is_open();
    vec![Effect::Send(Command::KeepCamera(MovedCamera { camera, own }))]
}

/// Tells the outcome of keeping the camera. A camera that the file has now does not count as moved by keys.
pub(super) fn kept(state: &mut State, outcome: Result<Kept, String>) -> Vec<Effect> {
    let Kept { path, is_new, is_own, of_model, edit } = match outcome {
        Ok(kept) => kept,
        Err(why) => {
            state.saving.camera_refused = Some(state.now);
            state.saving.has_scene_of_model |= is_mesh(&state.request.scene);
            return prompt(state, &format!("error: {}", visible(&why)));
        }
    };
    if of_model {
        (state.saving.has_scene_of_model, state.saving.camera_of_model) = (true, state.request.viewpoint());
    }
    let name = visible(&path.to_string_lossy()).into_owned();
    let which = if state.saving.is_camera_of_newest {
        ": that of the newest picture, not of the one that was shown"
    } else {
        ""
    };
    let words = match (is_new, is_own) {
        _ if of_model => format!("wrote {name}, a scene of this model with this camera{which}"),
        (true, true) => format!("camera saved to {name}{which} · u: undo"),
        (true, false) => format!("the camera is in {name}{which}; in this call --set comes first"),
        (false, _) => format!("{name} has this camera already{which}"),
    };
    state.saving.camera_edits.extend(edit);
    let mut effects = Vec::new();
    if let Some(since) = state.request.moved_since.filter(|_| is_new) {
        state.picture.history.kept_camera(since);
    }
    if is_own && state.request.toggles.camera.is_any() {
        state.request.toggles.camera = CameraChange::default();
        effects = render(state, false);
    }
    state.saving.camera_kept = is_new.then_some(state.now);
    say(state, words);
    effects
}

/// The last camera that was written into the scene file is to be taken back.
pub(super) fn undo(state: &mut State) -> Vec<Effect> {
    match state.saving.camera_edits.last() {
        Some(edit) => vec![Effect::Send(Command::UndoCamera(edit.clone()))],
        None if state.saving.camera_of_model.is_some() => {
            notify(state, "the scene that c wrote beside the model stays: there is nothing in it to undo")
        }
        None => notify(state, "nothing to undo"),
    }
}

/// Tells the outcome of that. The picture is that of the file again.
pub(super) fn undone(state: &mut State, outcome: Result<PathBuf, String>) -> Vec<Effect> {
    let path = match outcome {
        Ok(path) => path,
        Err(why) => {
            state.saving.camera_refused = Some(state.now);
            return prompt(state, &format!("error: {}", visible(&why)));
        }
    };
    state.saving.camera_edits.pop();
    state.picture.history.edited();
    let effects = render(state, false);
    state.saving.camera_kept = Some(state.now);
    let name = visible(&path.to_string_lossy()).into_owned();
    say(state, format!("undone: {name} restored"));
    effects
}

/// The newest step, now or as soon as the one before has a picture.
fn step(state: &mut State) -> Vec<Effect> {
    state.dirty = true;
    if state.awaits_step() {
        state.request.camera_step.is_waiting = true;
        return Vec::new();
    }
    let effects = render(state, false);
    state.request.camera_step.generation = Some(state.request.generation);
    effects
}

/// The step that waits, if its turn has come.
pub(super) fn keep_up(state: &mut State) -> Vec<Effect> {
    if state.request.camera_step.is_waiting && !state.awaits_step() { step(state) } else { Vec::new() }
}
