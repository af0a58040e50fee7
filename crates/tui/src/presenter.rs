//! Decisions which previews are drawn, when, and how exactly.
//!
//! The time comes with each call, so that a test can choose it.

use std::path::PathBuf;
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::display::Display;
use super::event::Event;
use super::file_urls::FileUrls;
use super::paint::{Fidelity, FrameExtras, FrameTiming, Hyperlink, PacingAdvice, advise};
use super::state::State;
use super::view;
use super::view::ViewExtras;
use super::view::layout::Layout;
use super::window_title::WindowTitle;
use crate::film::Picture;
use crate::pipeline::protocol::{LatestPreview, PreviewSlot};

/// At most 20 frames a second, keys aside.
const FRAME: Duration = Duration::from_millis(50);

/// Leads the terminal to the state.
pub(super) struct Presenter {
    pub(super) display: Display,
    drawn: DrawnPreview,
    previews: PreviewSlot,
    /// Addresses of written files.
    files: FileUrls,
    /// No frame before this.
    next_frame: Instant,
    /// The newest request of which a picture was drawn.
    newest: u64,
}

/// The picture that was drawn last.
#[derive(Default)]
struct DrawnPreview {
    picture: Option<Arc<Picture>>,
    generation: u64,
    /// Samples of a pixel, in the mean.
    samples: f64,
    /// When it was aimed at.
    at: Option<Instant>,
    /// Whether the slot holds a newer preview of the same request, put off as it was not worth its bytes.
    is_old: bool,
    /// Whether it is the first one of its request.
    is_first: bool,
    /// Whether anything of it may have been sent.
    is_shown: bool,
    /// Whether what the line had left is used to draw it exactly.
    is_refined: bool,
}

impl Presenter {
    pub(super) fn new(display: Display, previews: PreviewSlot, now: Instant) -> Self {
        Self {
            display,
            drawn: DrawnPreview::default(),
            previews,
            files: FileUrls::here(),
            next_frame: now,
            newest: 0,
        }
    }

    /// Takes note of a newer picture and gives it if it is to be drawn. Until it is worth its bytes it stays in the slot,
    /// where a still newer one takes its place: the line carries whole pictures, and never a queue of them.
    pub(super) fn preview(&mut self, generation: u64, state: &State, now: Instant) -> Option<Event> {
        let is_same_request = generation == self.drawn.generation && !self.is_other(state);
        if is_same_request && self.advice(state, now) == PacingAdvice::Wait {
            self.drawn.is_old = true;
            return None;
        }
        self.take_preview()
    }

    /// Whether the newest picture has another size than the one that is drawn, is of another part, or has the photons that
    /// that one lacks.
    fn is_other(&self, state: &State) -> bool {
        let latest = self.previews.lock().unwrap_or_else(PoisonError::into_inner);
        let what = |picture: &Picture| (picture.width, picture.height);
        latest.as_ref().zip(state.picture.shown.as_ref()).is_some_and(|(new, old)| {
            let is_same = what(&new.picture) == what(&old.picture) && new.section == old.section;
            !is_same || new.lacks_photons != old.lacks_photons
        })
    }

    /// Says what to do with a picture of the same request as the one that is drawn.
    fn advice(&self, state: &State, now: Instant) -> PacingAdvice {
        advise(&self.moment(state, now))
    }

    fn moment(&self, state: &State, now: Instant) -> FrameTiming {
        let progress = state.work.progress.as_ref();
        let picture = self.drawn.picture.as_ref();
        let is_quick = self.display.is_quick();
        let is_shown = if is_quick { self.display.is_answered() } else { self.display.is_complete() };
        FrameTiming {
            bytes_per_second: self.display.bytes_per_second(),
            cells: picture.map_or(0, |picture| self.cells(state, picture)),
            samples: samples(state),
            aimed_samples: picture.map(|_| self.drawn.samples),
            since_aim: self.drawn.at.map_or(Duration::MAX, |at| now.saturating_duration_since(at)),
            is_shown,
            is_quick,
            is_in_pixels: self.display.draws_pixels(),
            is_final: is_still(state),
            final_in: progress
                .and_then(|progress| progress.eta_seconds)
                .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()),
        }
    }

    /// Number of cells of a preview; of pixels, the number of cells that cost as many bytes.
    fn cells(&self, state: &State, picture: &Picture) -> u32 {
        if self.display.draws_pixels() {
            return picture.width * picture.height / 4;
        }
        let across = state.display.pixels_across();
        let pixels = (across * across) as f32 * state.display.window.cell_aspect;
        (f64::from(picture.width) * f64::from(picture.height) / f64::from(pixels)) as u32
    }

    fn take_preview(&mut self) -> Option<Event> {
        self.drawn.is_old = false;
        let latest = self.previews.lock().unwrap_or_else(PoisonError::into_inner).take()?;
        let LatestPreview { generation, picture, range, section, lacks_photons, source } = latest;
        Some(Event::Picture { generation, picture, range, section, lacks_photons, source })
    }

    /// Looks again after a frame's time: somebody else has the screen.
    pub(super) fn postpone(&mut self, state: &mut State, now: Instant) {
        state.urgent = false;
        self.next_frame = now + FRAME;
    }

    /// Aims the screen at the state as it is now.
    pub(super) fn draw_if_due(&mut self, state: &mut State, now: Instant) {
        let is_due = state.dirty && (state.urgent || now >= self.next_frame);
        let is_refined = self.has_room_to_refine(state);
        if !is_due && !is_refined {
            return;
        }
        self.drawn.is_refined |= is_refined;
        self.postpone(state, now);
        state.dirty = false;
        self.display.draw_as(state.display.kind);
        let window = state.display.window;
        let mut buffer = Buffer::empty(Rect::new(0, 0, window.columns, window.rows));
        let drawn = view::draw(state, &mut buffer);
        if let Some(chrome) = WindowTitle::of(state, self.display.bytes_per_second().is_some()) {
            self.display.dress(chrome);
        }
        let is_new = self.note_picture(state, now);
        // The first preview stops being the first once all of it is on the screen, or once a newer one is noted.
        self.drawn.is_first &= is_new || !self.display.is_complete();
        let area = Layout::of(state).preview;
        self.display.place(view::preview::placement(state, area), is_still(state));
        let besides = self.besides(state, drawn);
        self.display.aim(&buffer, area, self.fidelity(state), (is_new, &besides));
    }

    /// Links, if the terminal has them, and what waits for the picture.
    fn besides(&self, state: &State, drawn: ViewExtras) -> FrameExtras {
        let files = drawn.files.into_iter().filter(|_| state.display.abilities.links);
        let link = |(cells, path): (Rect, PathBuf)| Hyperlink { cells, address: self.files.address(&path) };
        FrameExtras { later: drawn.later, links: files.map(link).collect() }
    }

    /// Whether the line is idle between two previews while a key moves the camera: the last one is on the screen, as exactly as a
    /// moving one has to be, and the next one has not come.
    fn has_room_to_refine(&self, state: &State) -> bool {
        let is_step = state.request.camera_step.generation == Some(self.drawn.generation);
        is_step && self.drawn.is_first && !self.drawn.is_refined && self.display.is_complete()
    }

    /// Keeps which picture is drawn; whether it is another one than before.
    fn note_picture(&mut self, state: &State, now: Instant) -> bool {
        let Some(shown) = &state.picture.shown else { return false };
        if self.drawn.picture.as_ref().is_some_and(|drawn| Arc::ptr_eq(drawn, &shown.picture)) {
            return false;
        }
        let is_first = self.drawn.generation != shown.generation;
        let (picture, samples, at) = (Some(shown.picture.clone()), samples(state), Some(now));
        let generation = shown.generation;
        if generation > self.newest {
            self.newest = generation;
            self.display.begin_count();
        }
        self.drawn = DrawnPreview { picture, generation, samples, at, is_first, ..DrawnPreview::default() };
        true
    }

    fn fidelity(&self, state: &State) -> Fidelity {
        match () {
            () if is_still(state) => Fidelity::Still,
            () if self.drawn.is_refined => Fidelity::Following,
            () if self.drawn.is_first => Fidelity::First,
            () if self.display.is_quick() => Fidelity::Following,
            () => Fidelity::Moving,
        }
    }

    /// Sends what the line has room for, and stops early once `is_late`. Returns the events that follow for the state.
    pub(super) fn pump(&mut self, state: &State, now: Instant, is_late: impl Fn() -> bool) -> Vec<Event> {
        let has_sent = self.display.pump(now, is_late);
        let mut events: Vec<Event> = self.display.take_report().map(Event::Frame).into_iter().collect();
        if self.drawn.is_old && self.advice(state, now) != PacingAdvice::Wait {
            events.extend(self.take_preview());
        }
        let is_new = |drawn: &mut DrawnPreview| !std::mem::replace(&mut drawn.is_shown, true);
        if self.drawn.picture.is_some() && has_sent && is_new(&mut self.drawn) {
            events.push(Event::Shown { generation: self.drawn.generation });
        }
        events
    }

    /// When to look again if nothing happens; `None`: not before something does.
    pub(super) fn wake(&mut self, state: &State, now: Instant) -> Option<Instant> {
        let due = self.drawn.at.filter(|_| self.drawn.is_old).and_then(|at| self.moment(state, now).due(at));
        let refine = self.has_room_to_refine(state).then_some(now);
        let due = due.into_iter().chain(refine);
        next_wake(state, self.next_frame).into_iter().chain(self.display.wake(now)).chain(due).min()
    }
}

/// Samples that a pixel has by now, in the mean.
fn samples(state: &State) -> f64 {
    state.work.progress.as_ref().map_or(0.0, |progress| progress.fraction * f64::from(progress.total_samples))
}

/// Whether the newest picture stays as it is.
fn is_still(state: &State) -> bool {
    state.work.paused || !state.work.is_running() && view::status_line::goes_on(state).is_none()
}

/// When the state is to be drawn or told of the time.
fn next_wake(state: &State, next_frame: Instant) -> Option<Instant> {
    let frame = state.dirty.then_some(if state.urgent { state.now } else { next_frame });
    [frame, state.next_tick()].into_iter().flatten().min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::state;

    #[test]
    fn an_idle_state_is_not_woken() {
        let now = Instant::now();
        let mut state = state(80, 24);
        state.dirty = true;
        assert_eq!(next_wake(&state, now), Some(now));
        state.dirty = false;
        assert!(next_wake(&state, now).is_some(), "the clock of a render runs");
        state.work.activity = crate::state::Activity::Done;
        assert_eq!(next_wake(&state, now), None);
    }
}
