//! The update function, which modifies the state and returns effects. It has no side effects of its own.

mod camera;
mod diagnostics;
mod edit_position;
mod history;
mod keys;
mod notices;
mod overlay;
mod pointer;
mod region;
mod replies;
mod request;
mod views;
mod worker;
mod written_files;

use std::time::{Duration, Instant};

pub(super) use self::notices::show_notice;
use self::notices::show_until_key;
use self::request::{request_render, request_resized_preview};
use super::ExitStatus;
use super::event::{Effect, Event, RequiredEventSource, Signal, WindowSize};
use super::messages;
use super::options::ContentChangeTime;
use super::preview_style::PreviewStyle;
use super::state::{Message, SceneImageRenderProgress, State, UndisplayedChange};
use super::view::layout::Layout;
use crate::film::Srgb8Image;
use crate::pipeline::protocol::{Command, PreviewUpdate, SavedSceneRenderStatus};

/// How long the window size must stay the same before a new preview is requested.
const RESIZE_QUIET: Duration = Duration::from_millis(60);

/// Creates the first render request.
pub(super) fn request_first_render(state: &mut State) -> Vec<Effect> {
    request_render(state, false)
}

/// Handles an event and returns its effects.
pub(super) fn update(state: &mut State, event: Event, now: Instant) -> Vec<Effect> {
    state.now = now;
    let was_paused = state.work.paused;
    let mut effects = handle_event(state, event);
    effects.extend(camera::try_render_waiting_step(state));
    let is_request = |effect: &Effect| matches!(effect, Effect::Send(Command::Render(_)));
    if was_paused && effects.iter().any(is_request) {
        let message = state.overlays.message.take();
        let rest = message.map_or(String::new(), |message| format!(" · {}", message.words));
        show_notice(state, format!("{}{rest}", messages::RESUMED));
    }
    effects
}

fn handle_event(state: &mut State, event: Event) -> Vec<Effect> {
    match event {
        Event::Key(key) => keys::handle_key(state, key),
        Event::Mouse(mouse) => pointer::handle_mouse(state, mouse),
        // Pasted text is ignored. The other events are handled by the event loop.
        Event::Paste | Event::Written { .. } | Event::Unwritable(_) => Vec::new(),
        Event::TerminalReply(answer) => replies::handle_reply(state, answer),
        Event::PreviewSent(report) => {
            state.dirty |= state.display.frame != Some(report);
            state.display.frame = Some(report);
            Vec::new()
        }
        Event::Resize(window) => handle_resize(state, window),
        Event::Worker(event) => worker::handle_worker_event(state, event),
        Event::Preview(shown) => show_image(state, shown),
        Event::FileChanged(ContentChangeTime { noticed }) => {
            // Keep the message if glimt made the change by writing the camera, or if glimt refused to write
            // the camera because of the change.
            const OWN: Duration = Duration::from_secs(1);
            let is_of = |said: Option<Instant>| said.is_some_and(|said| state.now <= said + OWN);
            let (is_own, is_known) = (is_of(state.saving.camera_kept), is_of(state.saving.camera_refused));
            (state.saving.camera_kept, state.saving.camera_refused) = (None, None);
            state.saving.is_settled = false;
            history::record_newest_image(state);
            if !is_own && !is_known {
                (state.overlays.message, state.selection.facts) = (None, None);
            }
            if !is_own {
                state.preview.history.record_scene_edit();
            }
            state.saving.edits += 1;
            let effects = request_render(state, false);
            state.saving.saved_at = state.request.generation;
            state.saving.own =
                SceneImageRenderProgress { state: SavedSceneRenderStatus::NotBegun, fraction: 0.0 };
            state.saving.last_edit = (!is_own).then_some(state.request.generation);
            // A change saved in the editor becomes visible only when the editor exits.
            let noticed = state.saving.editor_closed.map_or(noticed, |back| noticed.max(back));
            state.saving.change = Some(UndisplayedChange { generation: state.request.generation, noticed });
            effects
        }
        Event::Settled => {
            diagnostics::show_withheld_errors(state);
            Vec::new()
        }
        Event::OutputChanged(change) => written_files::handle_external_output_change(state, &change),
        Event::Signal(signal) => vec![signal_effect(signal)],
        Event::FirstPreviewSent { generation } => {
            // The preview has been sent, so the history can be updated now.
            history::record_newly_arrived_image(state);
            record_save_to_screen_time(state, generation)
        }
        Event::Tick => handle_tick(state),
        Event::SourceEnded(source) => handle_lost_event_source(state, source),
        Event::EditorExited => {
            state.saving.editor_closed = Some(state.now);
            Vec::new()
        }
        Event::EditorFailed(why) => {
            show_until_key(state, why);
            Vec::new()
        }
        Event::SuspendFailed => {
            show_notice(state, messages::NO_SHELL);
            Vec::new()
        }
    }
}

fn show_image(state: &mut State, shown: PreviewUpdate) -> Vec<Effect> {
    if shown.generation == state.request.generation
        && has_consistent_pixel_count(&shown.picture)
        && state.display.kind != PreviewStyle::None
    {
        if state.preview.history.store_newest_if_viewing_older(&shown) {
            history::record_newly_arrived_image(state);
            return Vec::new();
        }
        state.urgent |= state.preview.shown.as_ref().is_none_or(|last| last.generation != shown.generation);
        let is_same_image =
            |last: &PreviewUpdate| last.generation == shown.generation || last.shows_same_image(&shown);
        let last = state.preview.shown.take().filter(is_same_image);
        state.preview.shown = Some(match last {
            Some(last) if state.display.dithers_colors() => keep_nearly_unchanged_pixels(shown, &last),
            Some(_) | None => shown,
        });
        state.dirty = true;
    }
    Vec::new()
}

/// Keeps the previous color of each pixel that has changed by at most one code value since the last preview,
/// because even such a small difference could change the dither pattern.
fn keep_nearly_unchanged_pixels(mut shown: PreviewUpdate, last: &PreviewUpdate) -> PreviewUpdate {
    const MAX_DIFFERENCE: u8 = 1;
    let what = |shown: &PreviewUpdate| (shown.picture.width, shown.picture.height, shown.section);
    if what(&shown) == what(last) {
        let mut picture = (*shown.picture).clone();
        for (new, old) in picture.pixels.iter_mut().zip(&last.picture.pixels) {
            if new.iter().zip(old).all(|(new, old)| new.abs_diff(*old) <= MAX_DIFFERENCE) {
                *new = *old;
            }
        }
        shown.picture = picture.into();
    }
    shown
}

fn has_consistent_pixel_count(picture: &Srgb8Image) -> bool {
    picture.width > 0
        && picture.height > 0
        && u64::try_from(picture.pixels.len())
            .is_ok_and(|pixels| pixels == u64::from(picture.width) * u64::from(picture.height))
}

fn record_save_to_screen_time(state: &mut State, generation: u64) -> Vec<Effect> {
    if let Some(change) = state.saving.change.take_if(|change| change.generation == generation) {
        state.saving.first_change = Some(state.now.saturating_duration_since(change.noticed));
        state.dirty = true;
    }
    Vec::new()
}

fn handle_resize(state: &mut State, window: WindowSize) -> Vec<Effect> {
    state.display.window = window;
    state.dirty = true;
    state.request.resize_due =
        (Layout::max_preview_size(state) != state.request.preview_size).then(|| state.now + RESIZE_QUIET);
    Vec::new()
}

fn handle_tick(state: &mut State) -> Vec<Effect> {
    state.dirty |=
        state.work.is_request_running() && !state.work.paused || state.preview.history.is_viewing_older();
    let (now, bars) = (state.now, state.work.assets.len());
    state.work.assets.retain(|asset| asset.disappears_at().is_none_or(|end| now < end));
    state.dirty |= state.work.assets.len() != bars;
    state.dirty |= state.overlays.views.take_if(|views| now >= views.until).is_some();
    let is_over = |message: &mut Message| message.until.is_some_and(|until| now >= until);
    state.dirty |= state.overlays.message.take_if(is_over).is_some();
    if state.display.pixels_until.is_some_and(|until| now >= until) {
        replies::report_unsupported_graphics(state);
    }
    if state.request.resize_due.is_none_or(|due| state.now < due) {
        return Vec::new();
    }
    state.request.resize_due = None;
    request_resized_preview(state)
}

fn signal_effect(signal: Signal) -> Effect {
    match signal {
        Signal::Interrupt => Effect::Quit(ExitStatus::INTERRUPTED),
        Signal::Terminate => Effect::Quit(ExitStatus::TERMINATED),
        Signal::Quit => Effect::Quit(ExitStatus::ABORTED),
        Signal::Hangup => Effect::Quit(ExitStatus::HANGUP),
        Signal::Other(number) => Effect::Quit(ExitStatus::from_signal(number)),
        Signal::Suspend => Effect::Suspend,
        Signal::Continue => Effect::Redraw,
        Signal::Resize => Effect::Measure,
    }
}

fn handle_lost_event_source(state: &mut State, source: RequiredEventSource) -> Vec<Effect> {
    match source {
        RequiredEventSource::Worker => vec![Effect::GiveUp],
        RequiredEventSource::Watcher => {
            diagnostics::show_withheld_errors(state);
            show_until_key(state, messages::NOT_WATCHING);
            Vec::new()
        }
        RequiredEventSource::Keys => vec![Effect::Quit(ExitStatus::HANGUP)],
    }
}
