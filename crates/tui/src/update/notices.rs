//! Messages to the user.

use std::time::Duration;

use crate::event::Effect;
use crate::messages;
use crate::state::{Message, State};

/// How long a notice is shown.
const NOTICE_DURATION: Duration = Duration::from_secs(4);

/// Shows a notice for four seconds or until a key is pressed.
pub(crate) fn show_notice(state: &mut State, words: impl Into<String>) {
    let until = Some(state.now + NOTICE_DURATION);
    set_message(state, Message { words: words.into(), until });
}

/// Shows a notice about a change made with keys, without offering to write the image if that would fail.
pub(super) fn show_keyboard_change_notice(state: &mut State, words: impl Into<String>) {
    let words = words.into();
    let words = if state.can_overwrite_outputs() { words } else { words.replace(messages::WRITE_HINT, "") };
    show_notice(state, words);
}

/// Shows an error or prompt until a key is pressed.
pub(super) fn show_until_key(state: &mut State, words: impl Into<String>) {
    set_message(state, Message { words: words.into(), until: None });
}

fn set_message(state: &mut State, message: Message) {
    (state.overlays.message, state.selection.facts) = (Some(message), None);
    state.dirty = true;
}

/// Shows a notice and returns no effects.
pub(super) fn show_notice_only(state: &mut State, words: &str) -> Vec<Effect> {
    show_notice(state, words);
    Vec::new()
}

/// Shows a message until a key is pressed and returns no effects.
pub(super) fn show_until_key_without_effects(state: &mut State, words: &str) -> Vec<Effect> {
    show_until_key(state, words);
    Vec::new()
}
