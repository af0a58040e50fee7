//! Browses the history and switches to the render before the last edit.

use std::sync::Arc;

use super::notices::{show_notice, show_notice_only, show_until_key};
use crate::event::Effect;
use crate::messages;
use crate::pipeline::protocol::PreviewUpdate;
use crate::state::{RenderState, State};

/// Adds the current image to the history.
pub(super) fn record_newest_image(state: &mut State) {
    if let Some(shown) =
        clone_newest_image(state).filter(|shown| shown.generation == state.request.generation)
    {
        let is_finished = state.work.rendering == RenderState::Finished || shown.shows_finished_image();
        let origin = state.request.image_provenance(!is_finished);
        state.preview.history.record_shown_image(shown, state.now, origin);
    }
}

/// Records a new image for the newest request, even if an older render is being viewed. The last image often
/// arrives after the end of its render. A section shown at 1:1 scale never replaces a finished image.
pub(super) fn record_newly_arrived_image(state: &mut State) {
    let is_over = !state.work.is_rendering();
    if is_over && clone_newest_image(state).is_some_and(|shown| shown.section.is_some()) {
        return;
    }
    let (count, last) = (state.preview.history.len(), state.preview.history.last_image().cloned());
    record_newest_image(state);
    let history = &state.preview.history;
    let is_new = history.len() != count;
    let is_other = history.last_image().zip(last).is_some_and(|(now, before)| !Arc::ptr_eq(now, &before));
    state.dirty |= is_new || is_over && is_other;
}

/// Moves back by `steps` renders, or forward if `steps` is negative.
pub(super) fn browse_history(state: &mut State, steps: isize) -> Vec<Effect> {
    record_newest_image(state);
    let Some(newest) = clone_newest_image(state) else { return report_no_image(state) };
    if state.preview.history.step_reaches_newest(steps) {
        return return_to_newest(state, messages::NEWEST_RENDER);
    }
    match state.preview.history.step_back_by(steps, newest) {
        Some(shown) => show_history_render(state, shown),
        None => {
            show_notice_only(state, if steps > 0 { messages::OLDEST_RENDER } else { messages::NEWEST_RENDER })
        }
    }
}

/// Opens a render from the history strip.
pub(super) fn open_entry_at_index(state: &mut State, at: usize) -> Vec<Effect> {
    record_newest_image(state);
    let Some(newest) = clone_newest_image(state) else { return Vec::new() };
    if at + 1 >= state.preview.history.len() {
        return return_to_newest(state, messages::NEWEST_RENDER);
    }
    match state.preview.history.open_entry(at, newest) {
        Some(shown) => show_history_render(state, shown),
        None => Vec::new(),
    }
}

/// Toggles between the render before the last edit and the newest one.
pub(super) fn toggle_render_before_edit(state: &mut State) -> Vec<Effect> {
    if state.preview.history.is_viewing_older() {
        return return_to_newest(state, messages::AFTER_EDIT);
    }
    record_newest_image(state);
    let Some(newest) = clone_newest_image(state) else { return report_no_image(state) };
    match state.preview.history.open_render_before_edit(newest) {
        Some(shown) => {
            let effects = show_history_render(state, shown);
            let edits = state.preview.history.describe_edits_since_viewed();
            let edits = if edits.is_empty() { edits } else { format!(", {edits}") };
            show_until_key(state, format!("{}{edits}", messages::BEFORE_EDIT));
            effects
        }
        None => show_notice_only(state, messages::NO_EARLIER_RENDER),
    }
}

/// Returns to the newest render.
pub(super) fn return_to_newest(state: &mut State, words: &str) -> Vec<Effect> {
    if let Some(newest) = state.preview.history.return_to_newest() {
        state.preview.shown = Some(newest);
        show_notice(state, words);
    }
    Vec::new()
}

/// Explains why the history, which consists of previews, has no image.
fn report_no_image(state: &mut State) -> Vec<Effect> {
    let is_shown = state.request.preview_size.is_some();
    show_notice_only(state, if is_shown { messages::NO_IMAGE } else { messages::NO_PREVIEW })
}

fn clone_newest_image(state: &State) -> Option<PreviewUpdate> {
    if state.preview.history.is_viewing_older() {
        state.preview.history.newest_while_viewing_older()
    } else {
        state.preview.shown.clone()
    }
}

fn show_history_render(state: &mut State, shown: PreviewUpdate) -> Vec<Effect> {
    state.preview.shown = Some(shown);
    // The header already shows the render's number and age.
    let keys = &messages::HISTORY_KEYS[usize::from(state.preview.history.is_viewing_oldest())..];
    let words = [&[&*state.preview.history.viewed_changes_text()], keys].concat().join(" · ");
    show_until_key(state, words);
    Vec::new()
}
