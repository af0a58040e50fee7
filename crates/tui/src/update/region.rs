//! The image region to render first.

use super::notices::{show_notice, show_until_key_without_effects};
use super::request::request_render;
use crate::event::Effect;
use crate::messages;
use crate::pipeline::protocol::{NormalizedPosition, NormalizedRect};
use crate::state::State;

/// Width and height of a region around a position, as fractions of the image.
const REGION_FRACTION: f64 = 1.0 / 3.0;

/// Handles the key that selects a region. The first press waits for a drag, the second selects the region
/// around the crosshair, and the third clears the region.
pub(super) fn start_confirm_or_clear_region(state: &mut State) -> Vec<Effect> {
    if state.request.first_section.take().is_some() {
        (state.selection.is_marking, state.selection.press) = (false, None);
        let effects = restart_render_with_new_order(state);
        show_notice(state, messages::REGION_CLEARED);
        return effects;
    }
    if state.selection.is_mouse_on && !state.selection.is_marking {
        state.selection.is_marking = true;
        return show_until_key_without_effects(state, messages::DRAG_REGION);
    }
    render_section_first(state, section_around_point(state.selection.crosshair))
}

/// Stops waiting for a drag and cancels any drag in progress.
pub(super) fn cancel_selection(state: &mut State) {
    if std::mem::take(&mut state.selection.is_marking) {
        (state.request.first_section, state.selection.press) = (None, None);
    }
}

/// Updates the region during a drag.
pub(super) fn update_dragged_region(state: &mut State, from: NormalizedPosition, to: NormalizedPosition) {
    state.request.first_section = Some(NormalizedRect::between(from, to));
    state.dirty = true;
}

/// Ends the drag and uses the selected region, or a region around the position if there was no drag.
pub(super) fn end_region_drag(state: &mut State, spot: Option<NormalizedPosition>) -> Vec<Effect> {
    match (state.request.first_section, spot) {
        (Some(marked), _) => render_section_first(state, marked),
        (None, Some(spot)) => render_section_first(state, section_around_point(spot)),
        (None, None) => Vec::new(),
    }
}

fn section_around_point(spot: NormalizedPosition) -> NormalizedRect {
    let start = |middle: f64| (middle - REGION_FRACTION / 2.0).clamp(0.0, 1.0 - REGION_FRACTION);
    NormalizedRect {
        left: start(spot.x),
        top: start(spot.y),
        width: REGION_FRACTION,
        height: REGION_FRACTION,
    }
}

fn render_section_first(state: &mut State, section: NormalizedRect) -> Vec<Effect> {
    state.selection.is_marking = false;
    state.request.first_section = Some(section);
    let words = if state.work.is_request_running() { messages::REGION_FIRST } else { messages::REGION_NEXT };
    let effects = restart_render_with_new_order(state);
    show_notice(state, words);
    effects
}

/// Restarts a running render to change its rendering order. Samples are kept.
fn restart_render_with_new_order(state: &mut State) -> Vec<Effect> {
    state.dirty = true;
    if state.work.is_request_running() && !state.work.paused {
        request_render(state, false)
    } else {
        Vec::new()
    }
}
