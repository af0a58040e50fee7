//! Handles keys for the overlays: help, view list and diagnostics.

use crossterm::event::KeyCode;

use super::views::{self, select_view_and_open_list};
use super::{history, region};
use crate::choice::Choice;
use crate::event::{Effect, KeyPress};
use crate::keymap::{self, OverlayAction};
use crate::messages;
use crate::pipeline::settings::ViewMode;
use crate::state::State;
use crate::view::{diagnostics, help};

/// Handles a key, or returns `None` if no open overlay uses it.
pub(super) fn handle_key(state: &mut State, key: KeyPress) -> Option<Vec<Effect>> {
    if let Some(effects) = views::handle_search_key(state, key) {
        return Some(effects);
    }
    if let Some(view) = view_for_digit(state, key) {
        state.overlays.message = None;
        return Some(select_view_and_open_list(state, view));
    }
    let action = keymap::overlay_action_for_key(key)?;
    if let Some(effects) = views::handle_view_mode_list_action(state, action) {
        return Some(effects);
    }
    perform_action(state, action).then(Vec::new)
}

/// Performs the action if an open overlay uses it. Returns whether it was performed.
pub(super) fn perform_action(state: &mut State, action: OverlayAction) -> bool {
    match action {
        OverlayAction::Close => close_or_cancel_topmost(state),
        OverlayAction::LineUp => scroll_overlay(state, |line, _| line.saturating_sub(1)),
        OverlayAction::LineDown => scroll_overlay(state, |line, _| line + 1),
        OverlayAction::PageUp => scroll_overlay(state, |line, page| line.saturating_sub(page)),
        OverlayAction::PageDown => scroll_overlay(state, |line, page| line + page),
        // These actions are used only by the view list.
        OverlayAction::ColumnLeft
        | OverlayAction::ColumnRight
        | OverlayAction::Take
        | OverlayAction::Find => false,
    }
}

/// The view selected by a digit while the view list is open.
fn view_for_digit(state: &State, key: KeyPress) -> Option<ViewMode> {
    let KeyCode::Char(digit @ '1'..='9') = key.code else { return None };
    state.overlays.views.as_ref().filter(|_| key.modifiers.is_empty())?;
    ViewMode::ALL.get(digit.to_digit(10)? as usize - 1).copied()
}

/// Closes a pane, cancels a pending click or drag, hides the inspected values, or returns to the newest
/// render, whichever applies first.
fn close_or_cancel_topmost(state: &mut State) -> bool {
    let is_open = if state.overlays.help.open {
        state.overlays.help.open = false;
        true
    } else if state.overlays.views.take().is_some() {
        true
    } else if state.overlays.diagnostics.open {
        state.overlays.diagnostics.open = false;
        true
    } else if state.selection.is_focusing || state.selection.is_marking {
        (state.selection.is_focusing, state.overlays.message) = (false, None);
        region::cancel_selection(state);
        true
    } else if state.selection.facts.take().is_some() {
        true
    } else if state.preview.history.is_viewing_older() {
        history::return_to_newest(state, messages::NEWEST_RENDER);
        true
    } else {
        false
    };
    state.dirty |= is_open;
    is_open
}

/// Scrolls the help, or the diagnostics pane if its content does not fit. Returns false if there is nothing
/// to scroll, in which case the key keeps its usual function.
fn scroll_overlay(state: &mut State, step: impl FnOnce(usize, usize) -> usize) -> bool {
    let (is_help, (page, last)) = match () {
        () if state.overlays.help.open => (true, help::page_height_and_max_scroll(state)),
        () if state.overlays.diagnostics.open => (false, diagnostics::page_height_and_max_scroll(state)),
        () => return false,
    };
    let pane = if is_help { &mut state.overlays.help } else { &mut state.overlays.diagnostics };
    let line = step(pane.scroll.min(last), page).min(last);
    state.dirty |= line != pane.scroll;
    pane.scroll = line;
    is_help || last > 0
}
