//! The state as cells.

pub(super) mod diagnostics;
mod help;
pub(super) mod layout;
pub(super) mod preview;
pub(super) mod ramp;
mod stages;
mod status;
mod text;

use ratatui::buffer::Buffer;

use self::layout::Layout;
use super::state::State;

/// The whole screen, into a buffer of the window's size.
pub(super) fn draw(state: &State, buffer: &mut Buffer) {
    let layout = Layout::of(state);
    status::header(state, layout.header, buffer);
    preview::draw(state, layout.preview, buffer);
    stages::draw(state, layout.stages, buffer);
    status::bar(state, layout.bar, buffer);
    status::status(state, &layout, buffer);
    status::bottom(state, layout.bottom, buffer);
    if state.pane.open {
        diagnostics::draw(state, layout.pane, buffer);
    }
    if state.help {
        help::draw(state, buffer);
    }
}
