//! The position to open in the editor.

use crate::event::FileLineColumn;
use crate::scene::diagnostic::{Diagnostic, SourceSpan};
use crate::state::State;

/// Returns the position to open: the first error, or else the clicked object, the first warning or the start
/// of the scene.
pub(super) fn position_to_edit(state: &State) -> FileLineColumn {
    let errors = state
        .overlays
        .problems
        .iter()
        .flat_map(|problems| &problems.diagnostics)
        .find_map(diagnostic_position);
    let warnings = || state.overlays.warnings.iter().find_map(diagnostic_position);
    let scene = || FileLineColumn { path: state.request.scene.clone(), line: 1, column: 1 };
    errors.or_else(|| state.selection.picked.clone()).or_else(warnings).unwrap_or_else(scene)
}

/// A diagnostic's position, if it refers to a file.
fn diagnostic_position(diagnostic: &Diagnostic) -> Option<FileLineColumn> {
    let SourceSpan { source, span, .. } = diagnostic.place.as_ref()?;
    let before = source.get(..span.start)?;
    let start = before.rfind('\n').map_or(0, |end| end + 1);
    let line = before.matches('\n').count() + 1;
    let column = before.get(start..)?.chars().count() + 1;
    let path = diagnostic.path.clone();
    // Settings from the command line have no position in a file.
    (!path.as_os_str().is_empty() && path.as_os_str() != "--set").then_some(FileLineColumn {
        path,
        line,
        column,
    })
}
