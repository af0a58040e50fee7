//! Pictures of before: the last ones, older and newer, and the one from before the last edit.

use super::keys::told;
use super::say;
use crate::tui::event::Effect;
use crate::tui::history::ago;
use crate::tui::state::State;

const NEWEST: &str = "this is the newest picture";

/// The picture that stands goes to those of before.
pub(super) fn record(state: &mut State) {
    let newest = if state.history.is_open() { state.history.newest() } else { state.picture.clone() };
    if let Some(shown) = newest.filter(|shown| shown.generation == state.generation) {
        state.history.record(shown, state.now);
    }
}

/// So many pictures back; negative: forth.
pub(super) fn browse(state: &mut State, steps: isize) -> Vec<Effect> {
    record(state);
    let Some(newest) = newest(state) else { return told(state, "there is no picture yet") };
    if state.history.leads_to_newest(steps) {
        return close(state, NEWEST);
    }
    match state.history.step(steps, newest) {
        Some(shown) => look_at(state, shown),
        None => told(state, if steps > 0 { "this is the oldest picture that is kept" } else { NEWEST }),
    }
}

/// The picture from before the last edit, or the newest again.
pub(super) fn before_and_after(state: &mut State) -> Vec<Effect> {
    if state.history.is_open() {
        return close(state, "after the last edit: the newest picture");
    }
    record(state);
    let Some(newest) = newest(state) else { return told(state, "there is no picture yet") };
    match state.history.before_edit(newest) {
        Some(shown) => {
            let effects = look_at(state, shown);
            let edit = state.history.last_edit().map_or(String::new(), |what| format!(", {what}"));
            say(state, format!("before the last edit{edit}; b is after it"));
            effects
        }
        None => told(state, "there is no picture from before an edit"),
    }
}

/// Back to the newest picture.
pub(super) fn close(state: &mut State, words: &str) -> Vec<Effect> {
    if let Some(newest) = state.history.close() {
        state.picture = Some(newest);
        say(state, words);
    }
    Vec::new()
}

fn newest(state: &State) -> Option<crate::tui::state::Shown> {
    if state.history.is_open() { state.history.newest() } else { state.picture.clone() }
}

fn look_at(state: &mut State, shown: crate::tui::state::Shown) -> Vec<Effect> {
    state.picture = Some(shown);
    let place = state.history.place().map_or(String::new(), |(number, count, time)| {
        let age = ago(state.now.saturating_duration_since(time));
        let edit = state.history.edit_of_open().map_or(String::new(), |what| format!(", after {what}"));
        format!("picture {number} of {count}, {age}{edit}; n older, N newer")
    });
    say(state, place);
    Vec::new()
}
