//! Keys for navigating, searching and closing the open view list.

use crossterm::event::{KeyCode, KeyModifiers};

use super::notices::show_keyboard_change_notice;
use super::request::request_render;
use crate::choice::Choice;
use crate::event::{Effect, KeyPress};
use crate::keymap::OverlayAction;
use crate::messages;
use crate::pipeline::settings::ViewMode;
use crate::state::State;
use crate::view::views::views_per_column;

/// Handles an overlay action, or returns `None` if the list is closed, covered by the help or does not use
/// the action.
pub(super) fn handle_view_mode_list_action(state: &mut State, action: OverlayAction) -> Option<Vec<Effect>> {
    if state.overlays.views.is_none() || state.overlays.help.open {
        return None;
    }
    let current = ViewMode::ALL.iter().position(|view| *view == state.request.view_mode()).unwrap_or(0);
    let last = ViewMode::ALL.len() - 1;
    let column = views_per_column(state);
    let chosen = match action {
        OverlayAction::LineUp => current.saturating_sub(1),
        OverlayAction::LineDown => (current + 1).min(last),
        OverlayAction::ColumnLeft => current.checked_sub(column).unwrap_or(current),
        OverlayAction::ColumnRight if current + column <= last => current + column,
        OverlayAction::ColumnRight => current,
        OverlayAction::PageUp => 0,
        OverlayAction::PageDown => last,
        OverlayAction::Find => {
            open_list_with_search_text(state, String::new());
            return Some(Vec::new());
        }
        OverlayAction::Take => {
            close_view_list(state);
            return Some(Vec::new());
        }
        OverlayAction::Close => return None,
    };
    Some(select_view_if_changed(state, ViewMode::ALL[chosen]))
}

/// Handles a key while the user is typing a search, or returns `None` if no search is active or it does not
/// use the key.
pub(super) fn handle_search_key(state: &mut State, key: KeyPress) -> Option<Vec<Effect>> {
    let mut name = state.overlays.views.as_ref().filter(|_| !state.overlays.help.open)?.name.clone()?;
    let is_held = key.modifiers.contains(KeyModifiers::CONTROL);
    match key.code {
        KeyCode::Char(letter) if !is_held => name.extend(letter.to_lowercase()),
        KeyCode::Backspace => drop(name.pop()),
        KeyCode::Enter | KeyCode::Esc => {
            close_view_list(state);
            return Some(Vec::new());
        }
        _ => return None,
    }
    let found = find_view_by_partial_name(&name);
    open_list_with_search_text(state, name);
    Some(found.map_or_else(Vec::new, |view| select_view_if_changed(state, view)))
}

/// Selects a view and opens the list.
pub(super) fn select_view_and_open_list(state: &mut State, view: ViewMode) -> Vec<Effect> {
    state.open_view_mode_list();
    state.request.toggles.view = (view != state.request.base_view_mode()).then_some(view);
    let effects = request_render(state, false);
    if state.request.toggles.view.is_some() {
        let is_empty = view == ViewMode::Photons && !state.request.are_photons_enabled();
        let words = if is_empty {
            messages::VIEW_WITHOUT_PHOTONS.to_owned()
        } else {
            messages::view_mode_chosen(view.name())
        };
        show_keyboard_change_notice(state, words);
    }
    effects
}

/// Finds the first view whose name starts with `name` or, failing that, contains it.
fn find_view_by_partial_name(name: &str) -> Option<ViewMode> {
    let begins = |view: &&ViewMode| view.name().starts_with(name);
    let has = |view: &&ViewMode| view.name().contains(name);
    let all = || ViewMode::ALL.iter().filter(|_| !name.is_empty());
    all().find(begins).or_else(|| all().find(has)).copied()
}

fn open_list_with_search_text(state: &mut State, name: String) {
    state.open_view_mode_list();
    if let Some(views) = &mut state.overlays.views {
        views.name = Some(name);
    }
}

fn close_view_list(state: &mut State) {
    state.overlays.views = None;
    state.dirty = true;
}

/// Selects a view unless it is already selected.
fn select_view_if_changed(state: &mut State, view: ViewMode) -> Vec<Effect> {
    state.open_view_mode_list();
    if view == state.request.view_mode() {
        return Vec::new();
    }
    state.overlays.message = None;
    select_view_and_open_list(state, view)
}
