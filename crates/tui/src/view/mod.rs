//! Draws the state into a cell buffer.

mod curve;
pub(super) mod diagnostics;
mod extras;
mod header;
pub(super) mod help;
mod keys;
pub(super) mod layout;
mod marks;
mod message;
mod panel;
pub(super) mod preview;
pub(super) mod ramp;
mod side_panel;
mod stages;
pub(super) mod status_line;
mod strip;
mod strip_words;
pub(super) mod text;
pub(super) mod views;

use ratatui::buffer::Buffer;

pub(super) use self::extras::FileLinksAndDelayedText;
pub(super) use self::header::worker_activity_word;
use self::layout::Layout;
use super::state::State;

/// Returns the index of the history entry shown at a cell in the history strip.
pub(super) fn history_index_at(state: &State, column: u16, row: u16) -> Option<usize> {
    let layout = Layout::for_state(state);
    let is_open = state.overlays.help.open || layout.panel.is_empty();
    (!is_open).then(|| panel::history_index_at(state, layout.panel, column, row)).flatten()
}

/// Draws the whole screen.
pub(super) fn draw(state: &State, buffer: &mut Buffer) -> FileLinksAndDelayedText {
    let layout = Layout::for_state(state);
    header::draw(state, &layout, buffer);
    preview::draw(state, layout.preview, buffer);
    let mut drawn = panel::draw(state, layout.panel, buffer);
    status_line::draw(
        state,
        &layout,
        message::status_line_area_beside_message(state, &layout),
        buffer,
        &mut drawn,
    );
    keys::draw(state, &layout, buffer);
    if state.overlays.diagnostics.open {
        diagnostics::draw(state, layout.pane, buffer);
    }
    // A long message covers everything drawn before it.
    message::draw(state, &layout, buffer);
    if state.overlays.views.is_some() {
        views::draw_view_mode_list(state, &layout, buffer);
    }
    if state.overlays.help.open {
        help::draw(state, buffer);
    }
    // Covered text is neither linked nor delayed.
    let is_covered =
        state.overlays.help.open || state.overlays.views.is_some() || message::covers_preview(state);
    if is_covered || state.overlays.diagnostics.open && layout.pane == layout.panel {
        FileLinksAndDelayedText::default()
    } else {
        drawn
    }
}
