//! Messages to the person.

use crate::tui::event::Effect;
use crate::tui::state::State;

/// Shows a message until the next key.
pub(super) fn say(state: &mut State, message: impl Into<String>) {
    (state.overlays.message, state.selection.facts) = (Some(message.into()), None);
    state.dirty = true;
}

/// Shows a message; no effect follows.
pub(super) fn notify(state: &mut State, message: &str) -> Vec<Effect> {
    say(state, message);
    Vec::new()
}
