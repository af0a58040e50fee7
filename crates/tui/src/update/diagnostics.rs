//! Errors, warnings and write conflicts in the diagnostics pane.

use super::notices::show_notice;
use crate::event::WriteFailure;
use crate::messages;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::state::{BlockingErrors, PaneState, RequestStatus, State};

/// Shows new conflicts immediately. If the user has closed the pane, only new conflicts reopen it.
pub(super) fn show_write_conflicts(state: &mut State, conflicts: Vec<Diagnostic>) {
    state.saving.is_write_requested = false;
    state.saving.unwritten = Some(messages::NOT_WRITTEN.to_owned());
    show_notice(state, messages::NOT_WRITTEN);
    let why = conflicts.first().map_or(String::new(), |conflict| conflict.message.clone());
    let generation = state.request.generation;
    state.saving.write_failed = Some(WriteFailure { why, generation, is_refused: true });
    if !conflicts.iter().all(|conflict| state.overlays.warnings.contains(conflict)) {
        state.overlays.diagnostics = PaneState { open: true, scroll: 0 };
    }
    state.overlays.warnings.retain(|one| one.severity == Severity::Warning);
    state.overlays.warnings.splice(0..0, conflicts);
}

/// Clears the errors once the file is valid again.
pub(super) fn clear_blocking_errors(state: &mut State) {
    if state.overlays.problems.take().is_some() {
        state.overlays.diagnostics = PaneState::default();
    }
}

pub(super) fn set_warnings(state: &mut State, warnings: Vec<Diagnostic>) {
    state.overlays.warnings = warnings;
    state.overlays.diagnostics.open &= !state.warnings_and_write_failure().is_empty();
    state.overlays.are_warnings_known = true;
}

/// Closes the diagnostics pane if it is empty.
pub(super) fn close_empty_pane(state: &mut State) {
    state.overlays.diagnostics.open &=
        state.overlays.problems.is_some() || !state.warnings_and_write_failure().is_empty();
}

/// Shows new errors. If the user has closed the pane, only new errors reopen it.
pub(super) fn show_errors(state: &mut State, problems: BlockingErrors) {
    state.work.activity = RequestStatus::Broken;
    if state.overlays.problems.as_ref() != Some(&problems) {
        state.overlays.problems = Some(problems);
        state.overlays.diagnostics = PaneState { open: true, scroll: 0 };
    }
    state.dirty = true;
}

/// Shows errors that were withheld, now that the files are complete.
pub(super) fn show_withheld_errors(state: &mut State) {
    state.saving.is_settled = true;
    if let Some(diagnostics) = state.overlays.unconfirmed.take() {
        show_errors(state, BlockingErrors { diagnostics, work: None });
    }
}
