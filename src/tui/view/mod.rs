//! The state as cells.

pub(super) mod diagnostics;
mod help;
pub(super) mod layout;
pub(super) mod preview;
mod stages;
mod status;
mod text;

use ratatui::Frame;

use self::layout::Layout;
use super::state::State;

/// The whole screen.
pub(super) fn draw(state: &State, frame: &mut Frame<'_>) {
    let layout = Layout::of(state);
    let buffer = frame.buffer_mut();
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
