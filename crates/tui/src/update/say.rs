//! Messages to the user.

use std::time::Duration;

use crate::event::Effect;
use crate::state::{Message, State};

/// Time for which a notice is shown.
const NOTICE: Duration = Duration::from_secs(4);

/// Shows a notice: until the next key, for four seconds at most.
pub(crate) fn say(state: &mut State, words: impl Into<String>) {
    let until = Some(state.now + NOTICE);
    show(state, Message { words: words.into(), until });
}

/// Shows a message until the next key: a fault, or a prompt for what has to follow.
pub(super) fn say_until_key(state: &mut State, words: impl Into<String>) {
    show(state, Message { words: words.into(), until: None });
}

fn show(state: &mut State, message: Message) {
    (state.overlays.message, state.selection.facts) = (Some(message), None);
    state.dirty = true;
}

/// Shows a notice; no effect follows.
pub(super) fn notify(state: &mut State, words: &str) -> Vec<Effect> {
    say(state, words);
    Vec::new()
}

/// Shows a message until the next key; no effect follows.
pub(super) fn prompt(state: &mut State, words: &str) -> Vec<Effect> {
    say_until_key(state, words);
    Vec::new()
}
