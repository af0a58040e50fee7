//! Decides which previews to draw, when, and with what precision.
//!
//! The current time is passed to each call so that tests can control it.

use std::path::PathBuf;
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::display::Display;
use super::event::Event;
use super::file_urls::FileUrlBuilder;
use super::paint::{
    Hyperlink, LinksAndDelayedText, PacingDecision, PacingInputs, PreviewFidelity, preview_pacing_decision,
};
use super::state::State;
use super::view;
use super::view::FileLinksAndDelayedText;
use super::view::layout::Layout;
use super::window_title::TitleAndProgress;
use crate::film::Srgb8Image;
use crate::pipeline::protocol::PreviewSlot;

/// Frame interval. Output is limited to 20 frames per second, except in response to keys.
const FRAME_INTERVAL: Duration = Duration::from_millis(50);

/// Draws the state to the terminal.
pub(super) struct FramePresenter {
    pub(super) display: Display,
    drawn: DrawnPreview,
    previews: PreviewSlot,
    /// Creates URLs for written files.
    files: FileUrlBuilder,
    /// Earliest time of the next frame, except for urgent frames.
    next_frame: Instant,
    /// The newest request for which a preview has been drawn.
    newest: u64,
}

/// The last drawn preview.
#[derive(Default)]
struct DrawnPreview {
    picture: Option<Arc<Srgb8Image>>,
    generation: u64,
    /// Mean samples per pixel when the preview was drawn.
    samples: f64,
    /// Time when this preview became the display's target.
    at: Option<Instant>,
    /// Whether the slot contains a newer preview of the same request that is not worth sending yet.
    is_old: bool,
    /// Whether this is the first preview of its request.
    is_first: bool,
    /// Whether part of this preview may have been sent.
    is_shown: bool,
    /// Whether idle bandwidth is being used to redraw the preview with exact colors.
    is_refined: bool,
}

impl FramePresenter {
    pub(super) fn new(display: Display, previews: PreviewSlot, now: Instant) -> Self {
        Self {
            display,
            drawn: DrawnPreview::default(),
            previews,
            files: FileUrlBuilder::for_this_machine(),
            next_frame: now,
            newest: 0,
        }
    }

    /// Handles a new preview in the slot. If it should be drawn, takes it out of the slot. Otherwise it stays
    /// there until a newer one replaces it, so previews never queue up.
    pub(super) fn take_preview_event_if_due(
        &mut self,
        generation: u64,
        state: &State,
        now: Instant,
    ) -> Option<Event> {
        let is_same_request = generation == self.drawn.generation && !self.newest_preview_kind_differs(state);
        if is_same_request && self.pacing_decision(state, now) == PacingDecision::Wait {
            self.drawn.is_old = true;
            return None;
        }
        self.take_preview_event()
    }

    /// Whether the newest preview differs from the drawn one in size, section or missing photons.
    fn newest_preview_kind_differs(&self, state: &State) -> bool {
        let latest = self.previews.lock().unwrap_or_else(PoisonError::into_inner);
        let what = |picture: &Srgb8Image| (picture.width, picture.height);
        latest.as_ref().zip(state.preview.shown.as_ref()).is_some_and(|(new, old)| {
            let is_same = what(&new.picture) == what(&old.picture) && new.section == old.section;
            !is_same || new.lacks_photons != old.lacks_photons
        })
    }

    /// Whether to draw a newer preview of the same request.
    fn pacing_decision(&self, state: &State, now: Instant) -> PacingDecision {
        preview_pacing_decision(&self.pacing_inputs(state, now))
    }

    fn pacing_inputs(&self, state: &State, now: Instant) -> PacingInputs {
        let progress = state.work.progress.as_ref();
        let picture = self.drawn.picture.as_ref();
        let is_fast = self.display.is_fast();
        let is_shown = if is_fast { self.display.is_acknowledged() } else { self.display.is_target_sent() };
        PacingInputs {
            bytes_per_second: self.display.estimated_bytes_per_second(),
            cells: picture.map_or(0, |picture| self.preview_cell_count(state, picture)),
            samples: mean_samples_so_far(state),
            aimed_samples: picture.map(|_| self.drawn.samples),
            since_aim: self.drawn.at.map_or(Duration::MAX, |at| now.saturating_duration_since(at)),
            is_shown,
            is_fast,
            is_in_pixels: self.display.draws_pixels(),
            is_final: is_final_preview(state),
            final_in: progress
                .and_then(|progress| progress.eta_seconds)
                .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()),
        }
    }

    /// Returns the number of cells in a preview, or an equivalent number if it is drawn as pixels.
    fn preview_cell_count(&self, state: &State, picture: &Srgb8Image) -> u32 {
        if self.display.draws_pixels() {
            return picture.width * picture.height / 4;
        }
        let across = state.display.horizontal_pixels_per_cell();
        let pixels = (across * across) as f32 * state.display.window.cell_aspect;
        (f64::from(picture.width) * f64::from(picture.height) / f64::from(pixels)) as u32
    }

    fn take_preview_event(&mut self) -> Option<Event> {
        self.drawn.is_old = false;
        self.previews.lock().unwrap_or_else(PoisonError::into_inner).take().map(Event::Preview)
    }

    /// Delays the next frame, even an urgent one, until one frame interval after `now`.
    pub(super) fn postpone_next_frame(&mut self, state: &mut State, now: Instant) {
        state.urgent = false;
        self.next_frame = now + FRAME_INTERVAL;
    }

    /// Updates the display's target if a frame is due.
    pub(super) fn draw_if_due(&mut self, state: &mut State, now: Instant) {
        let is_due = state.dirty && (state.urgent || now >= self.next_frame);
        let is_refined = self.should_redraw_in_exact_colors(state);
        if !is_due && !is_refined {
            return;
        }
        self.drawn.is_refined |= is_refined;
        self.postpone_next_frame(state, now);
        state.dirty = false;
        self.display.enable_pixel_preview_if_required(state.display.kind);
        let window = state.display.window;
        let mut buffer = Buffer::empty(Rect::new(0, 0, window.columns, window.rows));
        let drawn = view::draw(state, &mut buffer);
        if let Some(title) =
            TitleAndProgress::for_state(state, self.display.estimated_bytes_per_second().is_some())
        {
            self.display.set_title_and_progress(title);
        }
        let is_new = self.record_drawn_preview(state, now);
        // A preview counts as the first until it is complete on the screen or a newer one is drawn.
        self.drawn.is_first &= is_new || !self.display.is_target_sent();
        let area = Layout::for_state(state).preview;
        self.display
            .set_pixel_preview(view::preview::placed_pixel_preview(state, area), is_final_preview(state));
        let extras = self.links_and_delayed_text(state, drawn);
        self.display.set_target(&buffer, area, self.preview_fidelity(state), is_new, &extras);
    }

    /// The frame's hyperlinks, if the terminal supports them, and the text to draw after the preview.
    fn links_and_delayed_text(&self, state: &State, drawn: FileLinksAndDelayedText) -> LinksAndDelayedText {
        let files = drawn.files.into_iter().filter(|_| state.display.capabilities.links);
        let link = |(cells, path): (Rect, PathBuf)| Hyperlink { cells, address: self.files.url(&path) };
        LinksAndDelayedText { later: drawn.later, links: files.map(link).collect() }
    }

    /// Whether to redraw the preview with exact colors because the connection is idle while a key moves the
    /// camera: the last preview is on the screen at reduced precision, and the next one has not arrived.
    fn should_redraw_in_exact_colors(&self, state: &State) -> bool {
        let is_step = state.request.camera_step.generation == Some(self.drawn.generation);
        is_step && self.drawn.is_first && !self.drawn.is_refined && self.display.is_target_sent()
    }

    /// Records the preview being drawn. Returns true if it is new.
    fn record_drawn_preview(&mut self, state: &State, now: Instant) -> bool {
        let Some(shown) = &state.preview.shown else { return false };
        if self.drawn.picture.as_ref().is_some_and(|drawn| Arc::ptr_eq(drawn, &shown.picture)) {
            return false;
        }
        let is_first = self.drawn.generation != shown.generation;
        let (picture, samples, at) = (Some(shown.picture.clone()), mean_samples_so_far(state), Some(now));
        let generation = shown.generation;
        if generation > self.newest {
            self.newest = generation;
            self.display.reset_byte_count();
        }
        self.drawn = DrawnPreview { picture, generation, samples, at, is_first, ..DrawnPreview::default() };
        true
    }

    fn preview_fidelity(&self, state: &State) -> PreviewFidelity {
        match () {
            () if is_final_preview(state) => PreviewFidelity::Still,
            () if self.drawn.is_refined => PreviewFidelity::Following,
            () if self.drawn.is_first => PreviewFidelity::First,
            () if self.display.is_fast() => PreviewFidelity::Following,
            () => PreviewFidelity::Moving,
        }
    }

    /// Sends as much as the connection allows, stopping early once `is_late` returns true. Returns events for
    /// the state.
    pub(super) fn send_pending(
        &mut self,
        state: &State,
        now: Instant,
        is_late: impl Fn() -> bool,
    ) -> Vec<Event> {
        let has_sent = self.display.send_next_slice(now, is_late);
        let mut events: Vec<Event> =
            self.display.take_send_report().map(Event::PreviewSent).into_iter().collect();
        if self.drawn.is_old && self.pacing_decision(state, now) != PacingDecision::Wait {
            events.extend(self.take_preview_event());
        }
        let is_new = |drawn: &mut DrawnPreview| !std::mem::replace(&mut drawn.is_shown, true);
        if self.drawn.picture.is_some() && has_sent && is_new(&mut self.drawn) {
            events.push(Event::FirstPreviewSent { generation: self.drawn.generation });
        }
        events
    }

    /// When to act next if no event arrives, or `None` if there is nothing to do.
    pub(super) fn next_action_time(&mut self, state: &State, now: Instant) -> Option<Instant> {
        let due = self
            .drawn
            .at
            .filter(|_| self.drawn.is_old)
            .and_then(|at| self.pacing_inputs(state, now).next_due_time(at));
        let refine = self.should_redraw_in_exact_colors(state).then_some(now);
        let due = due.into_iter().chain(refine);
        next_frame_or_tick_time(state, self.next_frame)
            .into_iter()
            .chain(self.display.next_send_time(now))
            .chain(due)
            .min()
    }
}

/// Mean samples per pixel rendered so far.
fn mean_samples_so_far(state: &State) -> f64 {
    state.work.progress.as_ref().map_or(0.0, |progress| progress.fraction * f64::from(progress.total_samples))
}

/// Whether the newest preview is final.
fn is_final_preview(state: &State) -> bool {
    state.work.paused
        || !state.work.is_request_running() && view::status_line::last_valid_render_progress(state).is_none()
}

/// Time at which the state next needs a frame or a tick.
fn next_frame_or_tick_time(state: &State, next_frame: Instant) -> Option<Instant> {
    let frame = state.dirty.then_some(if state.urgent { state.now } else { next_frame });
    [frame, state.next_tick()].into_iter().flatten().min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::state;

    #[test]
    fn idle_state_is_not_woken() {
        let now = Instant::now();
        let mut state = state(80, 24);
        state.dirty = true;
        assert_eq!(next_frame_or_tick_time(&state, now), Some(now));
        state.dirty = false;
        assert!(
            next_frame_or_tick_time(&state, now).is_some(),
            "expected a wakeup to update the elapsed time"
        );
        state.work.activity = crate::state::RequestStatus::Done;
        assert_eq!(next_frame_or_tick_time(&state, now), None);
    }
}
