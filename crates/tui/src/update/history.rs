//! Pictures of before: the last ones, older and newer, and the one from before the last edit.

use std::sync::Arc;

use super::say::{notify, say, say_until_key};
use crate::event::Effect;
use crate::state::{Rendering, State};

const NEWEST: &str = "this is the newest picture";

/// The picture that stands goes to those of before.
pub(super) fn record(state: &mut State) {
    if let Some(shown) = newest(state).filter(|shown| shown.generation == state.request.generation) {
        let is_finished = state.work.rendering == Rendering::Finished || shown.is_finished();
        let origin = state.request.origin(!is_finished);
        state.picture.history.record(shown, state.now, origin);
    }
}

/// Records a picture of the newest request that was shown, or that waits behind an older one. The last one often comes after the
/// end of its render. Pixels 1:1 of a finished picture do not take its place.
pub(super) fn record_newest(state: &mut State) {
    let is_over = !state.work.is_under_way();
    if is_over && newest(state).is_some_and(|shown| shown.section.is_some()) {
        return;
    }
    let (count, last) = (state.picture.history.len(), state.picture.history.last_picture().cloned());
    record(state);
    let history = &state.picture.history;
    let is_new = history.len() != count;
    let is_other = history.last_picture().zip(last).is_some_and(|(now, before)| !Arc::ptr_eq(now, &before));
    state.dirty |= is_new || is_over && is_other;
}

/// Goes so many pictures back; negative: forward.
pub(super) fn browse(state: &mut State, steps: isize) -> Vec<Effect> {
    record(state);
    let Some(newest) = newest(state) else { return notify(state, "there is no picture yet") };
    if state.picture.history.leads_to_newest(steps) {
        return close(state, NEWEST);
    }
    match state.picture.history.step(steps, newest) {
        Some(shown) => look_at(state, shown),
        None => notify(state, if steps > 0 { "this is the oldest picture that is kept" } else { NEWEST }),
    }
}

/// One of the pictures of the strip.
pub(super) fn open_at(state: &mut State, at: usize) -> Vec<Effect> {
    record(state);
    let Some(newest) = newest(state) else { return Vec::new() };
    if at + 1 >= state.picture.history.len() {
        return close(state, NEWEST);
    }
    match state.picture.history.open_at(at, newest) {
        Some(shown) => look_at(state, shown),
        None => Vec::new(),
    }
}

/// The picture from before the last edit, or the newest again.
pub(super) fn before_and_after(state: &mut State) -> Vec<Effect> {
    if state.picture.history.is_open() {
        return close(state, "after the last edit: the newest picture");
    }
    record(state);
    let Some(newest) = newest(state) else { return notify(state, "there is no picture yet") };
    match state.picture.history.before_edit(newest) {
        Some(shown) => {
            let effects = look_at(state, shown);
            let edits = state.picture.history.edits_since_open();
            let edits = if edits.is_empty() { edits } else { format!(", {edits}") };
            say_until_key(state, format!("before the last edit{edits}"));
            effects
        }
        None => notify(state, "there is no picture from before an edit"),
    }
}

/// Back to the newest picture.
pub(super) fn close(state: &mut State, words: &str) -> Vec<Effect> {
    if let Some(newest) = state.picture.history.close() {
        state.picture.shown = Some(newest);
        say(state, words);
    }
    Vec::new()
}

fn newest(state: &State) -> Option<crate::history::ShownImage> {
    if state.picture.history.is_open() { state.picture.history.newest() } else { state.picture.shown.clone() }
}

fn look_at(state: &mut State, shown: crate::history::ShownImage) -> Vec<Effect> {
    state.picture.shown = Some(shown);
    // The first line says which one it is, and how old, which goes on.
    let older = if state.picture.history.is_oldest_open() { "" } else { "n older · " };
    let words = format!("{} · {older}N newer", state.picture.history.reason_of_open());
    say_until_key(state, words);
    Vec::new()
}
