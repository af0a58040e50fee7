//! Text over the image: messages, diagnostics, help, and the list of view modes.

use std::time::{Duration, Instant};

use crate::scene::diagnostic::Diagnostic;
use crate::scene::is_scene_not_found_diagnostic;

/// Errors that prevent the preview from showing the current file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct BlockingErrors {
    /// Diagnostics with source positions.
    pub diagnostics: Vec<Diagnostic>,
    /// A failure without a source position.
    pub work: Option<String>,
}

/// The open list of view modes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ViewModeList {
    /// Time when the list closes automatically.
    pub until: Instant,
    /// Search text typed after `/`, or `None` if not searching.
    pub name: Option<String>,
}

/// A scrollable pane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PaneState {
    pub open: bool,
    /// Index of the first line shown.
    pub scroll: usize,
}

/// A message to the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    pub words: String,
    /// Time when the message disappears, or `None` for errors and prompts, which stay until a key is pressed.
    pub until: Option<Instant>,
}

/// Messages, diagnostics and panes.
#[derive(Default)]
pub(crate) struct OverlayState {
    /// The last message, until a key is pressed.
    pub message: Option<Message>,
    /// Errors in the scene, or `None` if it is valid.
    pub problems: Option<BlockingErrors>,
    /// Errors in a file that may still be incomplete.
    pub unconfirmed: Option<Vec<Diagnostic>>,
    pub warnings: Vec<Diagnostic>,
    /// Whether the warnings belong to the newest request.
    pub are_warnings_known: bool,
    /// The pane that lists errors and warnings.
    pub diagnostics: PaneState,
    pub help: PaneState,
    pub views: Option<ViewModeList>,
}

impl OverlayState {
    /// Whether the scene file does not exist.
    pub(crate) fn is_scene_missing(&self) -> bool {
        self.problems
            .as_ref()
            .is_some_and(|problems| problems.diagnostics.iter().any(is_scene_not_found_diagnostic))
    }

    /// Opens the list of view modes, or restarts its timeout if it is already open.
    pub(crate) fn open_or_extend_view_mode_list(&mut self, now: Instant) {
        const MOMENT: Duration = Duration::from_secs(4);
        let name = self.views.take().and_then(|views| views.name);
        self.views = Some(ViewModeList { until: now + MOMENT, name });
    }
}
