//! A rectangle of the picture that is rendered before the rest.

use super::request::render;
use super::say::{prompt, say};
use crate::event::Effect;
use crate::pipeline::protocol::{Section, Spot};
use crate::state::State;

/// Width and height of the one around a place.
const SIDE: f64 = 1.0 / 3.0;

/// The key: first it waits for a drag; asked again it takes what is around the crosshair; then there is none any more.
pub(super) fn press(state: &mut State) -> Vec<Effect> {
    if state.request.first_section.take().is_some() {
        (state.selection.is_marking, state.selection.press) = (false, None);
        let effects = again(state);
        say(state, "no rectangle is rendered first any more");
        return effects;
    }
    if state.selection.is_mouse_on && !state.selection.is_marking {
        state.selection.is_marking = true;
        return prompt(
            state,
            "drag a rectangle: it is rendered first; z again takes what is around the crosshair",
        );
    }
    take(state, around(state.selection.crosshair))
}

/// No drag is waited for any more; one under way is none.
pub(super) fn leave(state: &mut State) {
    if std::mem::take(&mut state.selection.is_marking) {
        (state.request.first_section, state.selection.press) = (None, None);
    }
}

/// The hand has come from one place to another.
pub(super) fn drag(state: &mut State, from: Spot, to: Spot) {
    state.request.first_section = Some(Section::between(from, to));
    state.dirty = true;
}

/// Ends a drag: takes the marked rectangle, else one around the place.
pub(super) fn release(state: &mut State, spot: Option<Spot>) -> Vec<Effect> {
    match (state.request.first_section, spot) {
        (Some(marked), _) => take(state, marked),
        (None, Some(spot)) => take(state, around(spot)),
        (None, None) => Vec::new(),
    }
}

fn around(spot: Spot) -> Section {
    let start = |middle: f64| (middle - SIDE / 2.0).clamp(0.0, 1.0 - SIDE);
    Section { left: start(spot.x), top: start(spot.y), width: SIDE, height: SIDE }
}

fn take(state: &mut State, section: Section) -> Vec<Effect> {
    state.selection.is_marking = false;
    state.request.first_section = Some(section);
    let words = if state.work.is_running() {
        "the rectangle is rendered first; z ends that"
    } else {
        "the rectangle is rendered first from the next render on; z ends that"
    };
    let effects = again(state);
    say(state, words);
    effects
}

/// The render under way, in another order: it keeps what it has.
fn again(state: &mut State) -> Vec<Effect> {
    state.dirty = true;
    if state.work.is_running() && !state.work.paused { render(state, false) } else { Vec::new() }
}
