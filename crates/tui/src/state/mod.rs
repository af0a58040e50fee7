//! State of the front end. It is modified only by `update`.

mod display;
mod overlays;
mod preview;
mod request;
mod saving;
mod selection;
mod work;

use std::path::PathBuf;
use std::time::{Duration, Instant};

pub(super) use self::display::TerminalDisplayState;
pub(super) use self::overlays::{BlockingErrors, Message, OverlayState, PaneState, ViewModeList};
pub(super) use self::preview::DisplayedImageState;
pub(super) use self::request::{CameraStepStatus, ImageProvenance, RequestState};
pub(super) use self::saving::{
    SavedFilesState, SceneImageRenderProgress, UndisplayedChange, WrittenImageFile,
};
pub(super) use self::selection::{HeldMousePress, PickPurpose, PointerState};
pub(super) use self::work::{AssetProgressBar, RenderState, RequestStatus, WorkState};
use super::color::{AnsiColors, ColorDepth};
use super::event::WindowSize;
use super::options::ExternalChange;
use super::preview_style::PreviewStyle;
use super::terminal_replies::TerminalQueries;
use super::terminals::TerminalExtras;
pub(super) use crate::pipeline::key_overrides::{KeyboardOverrides, format_exposure_stops};
use crate::pipeline::settings::Overrides;
use crate::scene::diagnostic::{Diagnostic, Severity};

/// Values for the initial state of the front end.
pub(super) struct InitialState {
    pub scene: PathBuf,
    pub overrides: Overrides,
    pub window: WindowSize,
    pub preview: PreviewStyle,
    pub depth: ColorDepth,
    /// Whether the environment indicates a light background.
    pub is_light: bool,
    /// The 16 ANSI colors assumed until the terminal reports its own.
    pub ansi: AnsiColors,
    /// Terminal queries that have been sent.
    pub ask: TerminalQueries,
    /// Terminal capabilities beyond text, according to environment variables.
    pub capabilities: TerminalExtras,
    /// How long a render must run for its end to trigger a notification. `None` disables notifications.
    pub notify_after: Option<Duration>,
}

/// The complete state of the front end.
pub(super) struct State {
    pub request: RequestState,
    pub work: WorkState,
    pub display: TerminalDisplayState,
    pub preview: DisplayedImageState,
    pub saving: SavedFilesState,
    pub selection: PointerState,
    pub overlays: OverlayState,

    /// Time when the newest event arrived.
    pub now: Instant,
    /// Whether the screen is outdated.
    pub dirty: bool,
    /// Whether the next frame must be drawn without delay, because it shows a request's first preview or the
    /// response to a key.
    pub urgent: bool,
}

impl State {
    pub(super) fn new(setup: InitialState, now: Instant) -> Self {
        Self {
            display: TerminalDisplayState::new(&setup, now),
            request: RequestState::new(setup.scene, setup.overrides),
            work: WorkState::new(now),
            preview: DisplayedImageState::default(),
            saving: SavedFilesState::new(),
            selection: PointerState::new(),
            overlays: OverlayState::default(),
            now,
            dirty: true,
            urgent: false,
        }
    }

    /// Whether the last camera step has no preview yet.
    pub(super) fn awaits_camera_step_preview(&self) -> bool {
        let Self { request, work, preview, .. } = self;
        let is_shown = preview.shown.as_ref().is_some_and(|shown| shown.generation == request.generation);
        // While the scene is broken, the last valid one is being rendered.
        let is_at_work = match work.activity {
            RequestStatus::Running { .. } => true,
            RequestStatus::Waiting | RequestStatus::Broken => request.own.is_some() && self.is_scene_broken(),
            RequestStatus::Done | RequestStatus::Canceled => false,
        };
        let is_newest = request.camera_step.generation == Some(request.generation);
        is_newest && is_at_work && request.preview_size.is_some() && !is_shown
    }

    /// Whether `w` may replace the output files: no known error or external change prevents it.
    pub(super) fn can_overwrite_outputs(&self) -> bool {
        let is_conflict = |found: &Diagnostic| found.severity == Severity::Error;
        let is_kept = |written: &WrittenImageFile| written.lost.is_some_and(ExternalChange::is_kept);
        !self.overlays.warnings.iter().any(is_conflict) && !self.saving.written.iter().any(is_kept)
    }

    /// Returns a valid scene's diagnostics, plus the reason if its image could not be written.
    pub(super) fn warnings_and_write_failure(&self) -> Vec<Diagnostic> {
        let warnings = &self.overlays.warnings;
        let failed = self.saving.write_failed.as_ref();
        let failed = failed.filter(|failed| self.saving.unwritten.is_some() && !failed.is_refused);
        let unwritten = failed.map(|failed| Diagnostic {
            severity: Severity::Error,
            message: failed.why.clone(),
            path: PathBuf::new(),
            place: None,
            help: None,
        });
        unwritten.into_iter().chain(warnings.iter().cloned()).collect()
    }

    /// Whether the current scene is invalid. A failed render does not make its scene invalid.
    pub(super) fn is_scene_broken(&self) -> bool {
        let has_failed = match self.work.activity {
            RequestStatus::Waiting | RequestStatus::Broken => true,
            RequestStatus::Running { .. } | RequestStatus::Done | RequestStatus::Canceled => false,
        };
        has_failed && self.overlays.problems.as_ref().is_none_or(|problems| problems.work.is_none())
    }

    /// Opens the list of view modes, or restarts its timeout if it is already open.
    pub(super) fn open_view_mode_list(&mut self) {
        self.overlays.open_or_extend_view_mode_list(self.now);
        self.dirty = true;
    }

    /// Pauses or resumes the clock of the current request.
    pub(super) fn set_clock_paused(&mut self, paused: bool) {
        self.work.set_clock_paused(paused, self.now);
    }

    /// Time of the next tick that the state needs.
    pub(super) fn next_tick(&self) -> Option<Instant> {
        const CLOCK: Duration = Duration::from_millis(250);
        const AGE: Duration = Duration::from_secs(1);
        let clock = (self.work.is_request_running() && !self.work.paused).then(|| self.now + CLOCK);
        let bars = self.work.assets.iter().filter_map(AssetProgressBar::disappears_at).min();
        let views = self.overlays.views.as_ref().map(|views| views.until);
        let notice = self.overlays.message.as_ref().and_then(|message| message.until);
        // The displayed age of an older render changes.
        let age = self.preview.history.is_viewing_older().then(|| self.now + AGE);
        let pixels = self.display.pixels_until;
        [clock, age, self.request.resize_due, bars, views, notice, pixels].into_iter().flatten().min()
    }
}
