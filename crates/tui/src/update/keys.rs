//! Handles key presses.

use crossterm::event::{KeyCode, KeyModifiers};

use super::notices::{show_notice, show_notice_only};
use super::request::{request_render, request_resized_preview};
use super::views::select_view_and_open_list;
use super::{camera, edit_position, history, overlay, pointer, region};
use crate::ExitStatus;
use crate::action::Action;
use crate::choice::Choice;
use crate::event::{Effect, KeyPress};
use crate::keymap;
use crate::messages;
use crate::pipeline::protocol::Command;
use crate::pipeline::settings::ViewMode;
use crate::preview_style::PreviewStyle;
use crate::scene::description::{Integrator, IntegratorProperties, ShadowMode};
use crate::state::{KeyboardOverrides, PaneState, State};

pub(super) fn handle_key(state: &mut State, key: KeyPress) -> Vec<Effect> {
    if let Some(effects) = overlay::handle_key(state, key) {
        return effects;
    }
    let Some(action) = keymap::action_for_key(key) else {
        let is_digit = key == KeyPress { code: key.code, modifiers: KeyModifiers::NONE }
            && matches!(key.code, KeyCode::Char('1'..='9'));
        return if is_digit { show_notice_only(state, messages::VIEWS_FIRST) } else { Vec::new() };
    };
    state.dirty |= state.overlays.message.take().is_some() | state.selection.facts.take().is_some();
    state.selection.is_focusing &= action == Action::Focus;
    if action != Action::RenderRegionFirst {
        region::cancel_selection(state);
    }
    perform_action(state, action)
}

pub(super) fn perform_action(state: &mut State, action: Action) -> Vec<Effect> {
    match action {
        Action::CycleShadows => cycle_shadows(state),
        Action::ToggleDepthOfField => toggle_depth_of_field(state),
        Action::TogglePhotons => toggle_photon_mapping(state),
        Action::CycleIntegrator => cycle_integrator(state),
        Action::NextView => cycle_view_mode(state, 1),
        Action::PreviousView => cycle_view_mode(state, ViewMode::ALL.len() - 1),
        Action::TogglePause => toggle_pause(state),
        Action::RenderAgain => request_render(state, true),
        Action::WriteImage => write_image_now(state),
        Action::OrbitLeft => camera::orbit_by_steps(state, -1.0, 0.0),
        Action::OrbitRight => camera::orbit_by_steps(state, 1.0, 0.0),
        Action::OrbitUp => camera::orbit_by_steps(state, 0.0, 1.0),
        Action::OrbitDown => camera::orbit_by_steps(state, 0.0, -1.0),
        Action::DollyIn => camera::dolly(state, 1.0),
        Action::DollyOut => camera::dolly(state, -1.0),
        Action::NarrowField => camera::widen_field_of_view(state, -1.0),
        Action::WidenField => camera::widen_field_of_view(state, 1.0),
        Action::Darken => camera::change_exposure(state, -1.0),
        Action::Brighten => camera::change_exposure(state, 1.0),
        Action::KeepCamera => camera::save_camera(state),
        Action::UndoCamera => camera::undo_camera_save(state),
        Action::Inspect => pointer::inspect_at_crosshair(state),
        Action::Copy => pointer::copy_inspected_values(state),
        Action::Focus => pointer::start_or_confirm_focus_pick(state),
        Action::ActualPixels => toggle_actual_pixels(state),
        Action::RenderRegionFirst => region::start_confirm_or_clear_region(state),
        Action::ToggleMouse => pointer::toggle_mouse(state),
        Action::Edit if state.request.is_model() => show_notice_only(state, messages::NO_EDITOR_FOR_MODELS),
        Action::Edit => vec![Effect::Edit(edit_position::position_to_edit(state))],
        Action::CompareLastEdit => history::toggle_render_before_edit(state),
        Action::OlderRender => history::browse_history(state, 1),
        Action::NewerRender => history::browse_history(state, -1),
        Action::ResetSettings => reset_to_scene_settings(state),
        Action::ToggleDiagnostics => toggle_diagnostics(state),
        Action::ToggleHelp => change_and_mark_screen_dirty(state, |state| {
            state.overlays.help = PaneState { open: !state.overlays.help.open, ..PaneState::default() }
        }),
        Action::ShowImageOnly => toggle_image_only(state),
        Action::Redraw => vec![Effect::Redraw],
        Action::Suspend => vec![Effect::StopJob],
        Action::Interrupt => vec![Effect::Quit(ExitStatus::INTERRUPTED)],
        Action::Quit => vec![Effect::Quit(ExitStatus::QUIT)],
    }
}

fn change_and_mark_screen_dirty(state: &mut State, how: impl FnOnce(&mut State)) -> Vec<Effect> {
    how(state);
    state.dirty = true;
    Vec::new()
}

/// Whether a setting differs from `base`, its value before any key changed it.
fn is_different_from_base<T: PartialEq>(next: &T, base: Option<T>) -> bool {
    base.is_none_or(|base| *next != base)
}

fn cycle_integrator(state: &mut State) -> Vec<Effect> {
    let (all, own) = (Integrator::ALL, state.request.integrator());
    let next = all.iter().skip_while(|one| **one != own).nth(1).or(all.first());
    state.request.toggles.integrator =
        next.copied().filter(|next| is_different_from_base(next, state.request.integrator_without_toggles()));
    request_render(state, false)
}

/// Returns the name of an integrator that supports a setting, or `None` if the current integrator does.
fn supporting_integrator_name_if_needed(
    state: &State,
    supports: impl Fn(IntegratorProperties) -> bool,
) -> Option<&'static str> {
    if supports(state.request.integrator().properties()) {
        return None;
    }
    Integrator::ALL.iter().find(|one| supports(one.properties())).map(|one| one.name())
}

fn cycle_shadows(state: &mut State) -> Vec<Effect> {
    if let Some(other) = supporting_integrator_name_if_needed(state, |method| method.honors_shadows) {
        return show_notice_only(
            state,
            &messages::hard_shadows_unsupported(state.request.integrator().name(), other),
        );
    }
    let next = match state.request.shadow_mode() {
        ShadowMode::Soft => ShadowMode::Hard,
        ShadowMode::Hard => ShadowMode::Off,
        ShadowMode::Off => ShadowMode::Soft,
    };
    state.request.toggles.shadows =
        Some(next).filter(|next| is_different_from_base(next, state.request.shadows_without_toggles()));
    request_render(state, false)
}

/// Toggles depth of field. If no setting has turned it off but it is off, the camera is a pinhole.
fn toggle_depth_of_field(state: &mut State) -> Vec<Effect> {
    let switched_off = state.request.combined_overrides().dof == Some(false);
    match &state.request.effective {
        None => return show_notice_only(state, messages::NO_SCENE),
        Some(effective) if !effective.dof && !switched_off => {
            return show_notice_only(state, messages::PINHOLE);
        }
        Some(_) => {}
    }
    // By default, depth of field is on and depends only on the lens.
    let base = state.request.command_line.dof.or(Some(true));
    state.request.toggles.dof = Some(switched_off).filter(|next| is_different_from_base(next, base));
    request_render(state, false)
}

fn toggle_photon_mapping(state: &mut State) -> Vec<Effect> {
    if let Some(other) = supporting_integrator_name_if_needed(state, |method| method.gathers) {
        return show_notice_only(state, &messages::photons_unsupported(other));
    }
    let next = !state.request.are_photons_enabled();
    state.request.toggles.photons =
        Some(next).filter(|next| is_different_from_base(next, state.request.photons_without_toggles()));
    request_render(state, false)
}

fn cycle_view_mode(state: &mut State, steps: usize) -> Vec<Effect> {
    let current = ViewMode::ALL.iter().position(|view| *view == state.request.view_mode()).unwrap_or(0);
    select_view_and_open_list(state, ViewMode::ALL[(current + steps) % ViewMode::ALL.len()])
}

fn toggle_image_only(state: &mut State) -> Vec<Effect> {
    match state.display.kind {
        PreviewStyle::None => return show_notice_only(state, messages::NO_PREVIEW),
        PreviewStyle::HalfBlock
        | PreviewStyle::Quadrant
        | PreviewStyle::Sextant
        | PreviewStyle::Octant
        | PreviewStyle::Ascii
        | PreviewStyle::Pixels(_) => {}
    }
    state.preview.is_image_only = !state.preview.is_image_only;
    state.dirty = true;
    request_resized_preview(state)
}

/// Toggles between actual pixels around the crosshair and the whole image.
fn toggle_actual_pixels(state: &mut State) -> Vec<Effect> {
    if state.request.preview_size.is_none() {
        return show_notice_only(state, messages::NO_PREVIEW);
    }
    history::return_to_newest(state, "");
    state.preview.close_up =
        if state.preview.close_up.is_some() { None } else { Some(state.selection.crosshair) };
    match state.preview.close_up {
        Some(_) => show_notice(state, messages::ACTUAL_PIXELS),
        None => state.overlays.message = None,
    }
    state.dirty = true;
    request_resized_preview(state)
}

fn toggle_pause(state: &mut State) -> Vec<Effect> {
    if !state.work.is_request_running() && !state.work.paused {
        return show_notice_only(state, messages::NOT_RENDERING);
    }
    state.set_clock_paused(!state.work.paused);
    state.dirty = true;
    vec![Effect::Send(Command::Pause(state.work.paused))]
}

fn write_image_now(state: &mut State) -> Vec<Effect> {
    let is_open = state.preview.history.is_viewing_older();
    let mut effects = camera::render_waiting_step_now(state);
    show_notice(state, if is_open { messages::WRITING_NEWEST } else { messages::WRITING });
    (state.saving.is_write_requested, state.saving.write_shows) = (true, state.request.sent_toggles);
    effects.push(Effect::Send(Command::Write));
    effects
}

fn reset_to_scene_settings(state: &mut State) -> Vec<Effect> {
    if state.request.toggles == KeyboardOverrides::default() {
        return show_notice_only(state, messages::NOTHING_TO_RESET);
    }
    state.request.toggles = KeyboardOverrides::default();
    let effects = request_render(state, false);
    show_notice(state, messages::RESET);
    effects
}

fn toggle_diagnostics(state: &mut State) -> Vec<Effect> {
    if state.overlays.problems.is_none() && state.warnings_and_write_failure().is_empty() {
        let is_read = state.overlays.are_warnings_known || !state.work.is_request_running();
        return show_notice_only(
            state,
            if is_read { messages::NO_DIAGNOSTICS } else { messages::STILL_READING },
        );
    }
    change_and_mark_screen_dirty(state, |state| {
        state.overlays.diagnostics.open = !state.overlays.diagnostics.open;
        state.overlays.diagnostics.scroll = 0;
    })
}
