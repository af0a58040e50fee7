//! Text over the picture: messages, errors and warnings, the help, the list of views.

use std::time::{Duration, Instant};

use crate::scene::diagnostic::Diagnostic;
use crate::scene::is_absence;

/// Errors because of which the picture does not show the current file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Problems {
    /// Errors and warnings with places.
    pub diagnostics: Vec<Diagnostic>,
    /// A failure without a place.
    pub work: Option<String>,
}

/// The list of views, while it is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ViewList {
    /// Time at which the list closes by itself.
    pub until: Instant,
    /// Letters of a name, typed after `/`. `None` unless the list is being searched.
    pub name: Option<String>,
}

/// Text over the picture that can be scrolled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Pane {
    pub open: bool,
    /// First line shown.
    pub scroll: usize,
}

/// A message to the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    pub words: String,
    /// Time at which it disappears without a key. `None` for a fault or a prompt.
    pub until: Option<Instant>,
}

/// Texts, and the panes that show them.
#[derive(Default)]
pub(crate) struct OverlayState {
    /// The last message, until the next key.
    pub message: Option<Message>,
    /// Errors of the scene. `None` while the scene is valid.
    pub problems: Option<Problems>,
    /// Errors in a file that may still be being written.
    pub unconfirmed: Option<Vec<Diagnostic>>,
    pub warnings: Vec<Diagnostic>,
    /// Whether the warnings belong to the newest request.
    pub are_warnings_known: bool,
    /// The pane of errors and warnings.
    pub diagnostics: Pane,
    pub help: Pane,
    pub views: Option<ViewList>,
}

impl OverlayState {
    /// Whether the scene file does not exist.
    pub(crate) fn is_scene_missing(&self) -> bool {
        self.problems.as_ref().is_some_and(|problems| problems.diagnostics.iter().any(is_absence))
    }

    /// Shows the list of views for a moment more.
    pub(crate) fn list_views(&mut self, now: Instant) {
        const MOMENT: Duration = Duration::from_secs(4);
        let name = self.views.take().and_then(|views| views.name);
        self.views = Some(ViewList { until: now + MOMENT, name });
    }
}
