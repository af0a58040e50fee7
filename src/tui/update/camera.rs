//! Keys and the mouse on the camera. Steps come faster than pictures: a step waits until the one before has its first picture, and
//! only the newest of those that wait is rendered.

use super::keys::told;
use super::{render, say};
use crate::scene::description::Pose;
use crate::tui::camera::{dollied, orbited, zoomed};
use crate::tui::event::Effect;
use crate::tui::state::State;

/// Degrees of a step around.
const TURN: f64 = 3.0;
/// What a step brings the eye nearer by.
const NEARER: f64 = 0.95;
/// What a step widens the field of view by.
const WIDER: f64 = 1.05;
/// Stops of a step of exposure.
const STOPS: f32 = 0.25;

/// So many steps to the right and up.
pub(super) fn orbit(state: &mut State, right: f64, up: f64) -> Vec<Effect> {
    moved(state, |pose| orbited(pose, right * TURN, up * TURN))
}

/// So many steps nearer.
pub(super) fn dolly(state: &mut State, steps: f64) -> Vec<Effect> {
    moved(state, |pose| dollied(pose, libm::pow(NEARER, steps)))
}

/// So many steps wider.
pub(super) fn zoom(state: &mut State, steps: f64) -> Vec<Effect> {
    let Some(view) = state.viewpoint() else { return unknown(state) };
    state.toggles.camera.fov = Some(zoomed(&view, libm::pow(WIDER, steps)));
    step_of_camera(state)
}

/// So many steps brighter.
pub(super) fn expose(state: &mut State, steps: f32) -> Vec<Effect> {
    let Some(effective) = &state.effective else { return unknown(state) };
    let stops = state.toggles.exposure.unwrap_or(effective.exposure) + steps * STOPS;
    state.toggles.exposure = Some(stops);
    let effects = step(state);
    say(state, format!("exposure {stops:+}"));
    effects
}

fn moved(state: &mut State, how: impl FnOnce(&Pose) -> Pose) -> Vec<Effect> {
    let Some(view) = state.viewpoint() else { return unknown(state) };
    state.toggles.camera.pose = Some(how(&view.pose));
    step_of_camera(state)
}

fn unknown(state: &mut State) -> Vec<Effect> {
    told(state, "the scene has not been read yet")
}

fn step_of_camera(state: &mut State) -> Vec<Effect> {
    let effects = step(state);
    say(state, "camera moved: shown, not written; w writes it, 0 goes back");
    effects
}

/// The newest step, now or as soon as the one before has a picture.
fn step(state: &mut State) -> Vec<Effect> {
    state.dirty = true;
    if state.awaits_step() {
        state.nudge.is_waiting = true;
        return Vec::new();
    }
    let effects = render(state, false);
    state.nudge.request = Some(state.generation);
    effects
}

/// The step that waits, if its turn has come.
pub(super) fn keep_up(state: &mut State) -> Vec<Effect> {
    if state.nudge.is_waiting && !state.awaits_step() { step(state) } else { Vec::new() }
}
