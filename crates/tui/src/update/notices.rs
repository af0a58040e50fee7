//! Messages to the user.

use std::time::Duration;

use crate::event::Effect;
use crate::state::{Message, State};

/// Duration of a notice.
const NOTICE: Duration = Duration::from_secs(4);

/// Shows a notice until the next key, for at most four seconds.
pub(crate) fn show_notice(state: &mut State, words: impl Into<String>) {
    let until = Some(state.now + NOTICE);
    show(state, Message { words: words.into(), until });
}

/// Shows an error or a prompt until the next key.
pub(super) fn show_until_key(state: &mut State, words: impl Into<String>) {
    show(state, Message { words: words.into(), until: None });
}

fn show(state: &mut State, message: Message) {
    (state.overlays.message, state.selection.facts) = (Some(message), None);
    state.dirty = true;
}

/// Shows a notice; returns no effects.
pub(super) fn notify(state: &mut State, words: &str) -> Vec<Effect> {
    show_notice(state, words);
    Vec::new()
}

/// Shows a message until the next key; returns no effects.
pub(super) fn prompt(state: &mut State, words: &str) -> Vec<Effect> {
    show_until_key(state, words);
    Vec::new()
}
