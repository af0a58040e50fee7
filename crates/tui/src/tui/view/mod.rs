//! The state as cells.

pub(super) mod diagnostics;
mod header;
pub(super) mod help;
mod keys;
pub(super) mod layout;
mod marks;
mod message;
mod panel;
pub(super) mod preview;
pub(super) mod ramp;
mod stages;
pub(super) mod text;
pub(super) mod under;
pub(super) mod views;

use ratatui::buffer::Buffer;

use self::layout::Layout;
use super::state::State;

/// The state in one word.
pub(super) fn state_word(state: &State) -> &'static str {
    header::word(state)
}

/// The whole screen, into a buffer of the window's size.
pub(super) fn draw(state: &State, buffer: &mut Buffer) {
    let layout = Layout::of(state);
    header::draw(state, &layout, buffer);
    preview::draw(state, layout.preview, buffer);
    panel::draw(state, layout.panel, buffer);
    under::draw(state, &layout, buffer);
    keys::draw(state, &layout, buffer);
    if state.overlays.diagnostics.open {
        diagnostics::draw(state, layout.pane, buffer);
    }
    // A long one goes on over whatever lies there.
    message::draw(state, &layout, buffer);
    if state.overlays.views.is_some() {
        views::draw(state, &layout, buffer);
    }
    if state.overlays.help.open {
        help::draw(state, buffer);
    }
}
