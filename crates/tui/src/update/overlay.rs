//! Effects of keys on overlays: the help, the list of views, the errors.

use crossterm::event::KeyCode;

use super::views::{self, choose_view};
use super::{history, rectangle};
use crate::choice::Choice;
use crate::event::{Effect, KeyPress};
use crate::keymap::{self, Overlay};
use crate::pipeline::settings::View;
use crate::state::State;
use crate::view::{diagnostics, help};

/// None: nothing is open that the key means something to.
pub(super) fn update(state: &mut State, key: KeyPress) -> Option<Vec<Effect>> {
    if let Some(effects) = views::typed(state, key) {
        return Some(effects);
    }
    if let Some(view) = chosen(state, key) {
        state.overlays.message = None;
        return Some(choose_view(state, view));
    }
    let action = keymap::overlay(key)?;
    if let Some(effects) = views::update(state, action) {
        return Some(effects);
    }
    act(state, action).then(Vec::new)
}

/// Whether there is anything open that this means something to.
pub(super) fn act(state: &mut State, action: Overlay) -> bool {
    match action {
        Overlay::Close => close(state),
        Overlay::LineUp => scroll(state, |line, _| line.saturating_sub(1)),
        Overlay::LineDown => scroll(state, |line, _| line + 1),
        Overlay::PageUp => scroll(state, |line, page| line.saturating_sub(page)),
        Overlay::PageDown => scroll(state, |line, page| line + page),
        // They are for the list of views alone.
        Overlay::ColumnLeft | Overlay::ColumnRight | Overlay::Take | Overlay::Find => false,
    }
}

/// The view of a digit, while the list of them is open.
fn chosen(state: &State, key: KeyPress) -> Option<View> {
    let KeyCode::Char(digit @ '1'..='9') = key.code else { return None };
    state.overlays.views.as_ref().filter(|_| key.modifiers.is_empty())?;
    View::ALL.get(digit.to_digit(10)? as usize - 1).copied()
}

/// Closes the topmost overlay: first those over all else, then waiting for a click or a drag, then facts about a place, then an
/// older picture.
fn close(state: &mut State) -> bool {
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
        rectangle::leave(state);
        true
    } else if state.selection.facts.take().is_some() {
        true
    } else if state.picture.history.is_open() {
        history::close(state, "the newest picture");
        true
    } else {
        false
    };
    state.dirty |= is_open;
    is_open
}

/// The help, or errors that are longer than their pane; in a shorter one the keys mean what they mean else.
fn scroll(state: &mut State, step: impl FnOnce(usize, usize) -> usize) -> bool {
    let (is_help, (page, last)) = match () {
        () if state.overlays.help.open => (true, help::extent(state)),
        () if state.overlays.diagnostics.open => (false, diagnostics::extent(state)),
        () => return false,
    };
    let pane = if is_help { &mut state.overlays.help } else { &mut state.overlays.diagnostics };
    let line = step(pane.scroll.min(last), page).min(last);
    state.dirty |= line != pane.scroll;
    pane.scroll = line;
    is_help || last > 0
}
