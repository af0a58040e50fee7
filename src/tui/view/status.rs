//! The lines around the picture: name, render bar, toggles, messages.

use std::time::Duration;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::layout::Layout;
use super::text::{Tone, columns, duration, gauge, percent, put, put_right, seconds};
use crate::choice::Choice;
use crate::scene::description::Integrator;
use crate::scene::sanitize::visible;
use crate::tui::action::Action;
use crate::tui::keymap::{self, Binding, KEYMAP};
use crate::tui::state::{Activity, PreviewKind, State};

/// The scene's name and size on the left, what is going on on the right.
pub(super) fn header(state: &State, area: Rect, buffer: &mut Buffer) {
    let (word, tone) = activity(state);
    let used = put_right(buffer, area, word, tone, state.depth);
    let name = state.scene.to_string_lossy();
    let size =
        state.effective.as_ref().map_or(String::new(), |it| format!("  {}×{} px", it.width, it.height));
    let room = Rect { width: area.width.saturating_sub(used + 1), ..area };
    let pieces = [("glimt  ", Tone::Faint), (&*visible(&name), Tone::Strong), (&size, Tone::Faint)];
    put(buffer, room, &pieces, state.depth);
}

fn activity(state: &State) -> (&'static str, Tone) {
    match state.activity {
        _ if state.paused => ("paused", Tone::Warning),
        Activity::Running { .. } => ("rendering", Tone::Strong),
        Activity::Done => ("done", Tone::Good),
        Activity::Waiting => ("waiting for the file", Tone::Warning),
        Activity::Broken if !state.pane.open => ("broken (e shows why)", Tone::Error),
        Activity::Broken => ("broken", Tone::Error),
        Activity::Cancelled => ("stopped", Tone::Warning),
    }
}

/// The render bar: a gauge that takes the room that the words leave.
pub(super) fn bar(state: &State, area: Rect, buffer: &mut Buffer) {
    let words = bar_words(state);
    let fraction = match (state.activity, state.progress) {
        (Activity::Done, _) => 1.0,
        (_, Some(progress)) => progress.fraction,
        (_, None) => 0.0,
    };
    let label = "render ";
    let room = area.width.saturating_sub(columns(label) + columns(&words) + 1);
    if room < 4 {
        put(buffer, area, &[(&words, Tone::Plain)], state.depth);
        return;
    }
    let gauge = gauge(fraction, usize::from(room), state.preview == PreviewKind::Ascii);
    let tone =
        if matches!(state.activity, Activity::Broken | Activity::Waiting) { Tone::Faint } else { Tone::Good };
    put(
        buffer,
        area,
        &[(label, Tone::Faint), (&gauge, tone), (" ", Tone::Plain), (&words, Tone::Plain)],
        state.depth,
    );
}

fn bar_words(state: &State) -> String {
    let mut words = Vec::new();
    match (state.activity, state.progress) {
        (Activity::Done, progress) => {
            words.push("100%".to_owned());
            words.extend(progress.map(|it| format!("samples {}/{}", it.samples, it.total_samples)));
            words.extend(state.report.as_ref().map(|report| format!("total {}", seconds(report.seconds))));
            if state.unchanged {
                words.push("unchanged".to_owned());
            }
        }
        (Activity::Waiting | Activity::Broken | Activity::Cancelled, _) => {
            words.push(activity(state).0.to_owned());
        }
        (Activity::Running { .. }, Some(progress)) => {
            words.push(format!("{}%", percent(progress.fraction)));
            words.push(format!("samples {}/{}", progress.samples, progress.total_samples));
            words.extend(state.running_for().map(duration_to_tenths));
            let eta = progress.eta_seconds.and_then(|eta| Duration::try_from_secs_f64(eta).ok());
            let eta = eta.map_or("…".to_owned(), duration_to_tenths);
            words.push(if state.paused { "paused".to_owned() } else { format!("ETA {eta}") });
        }
        (Activity::Running { .. }, None) => {
            words.push("0%".to_owned());
            words.extend(state.running_for().map(duration_to_tenths));
        }
    }
    words.join(" · ")
}

/// Elapsed time that does not flicker: tenths of seconds until a minute.
fn duration_to_tenths(time: Duration) -> String {
    if time.as_secs() < 60 { format!("{:.1} s", time.as_secs_f64()) } else { duration(time) }
}

/// The toggles, what is hidden, and the key of the help.
pub(super) fn status(state: &State, layout: &Layout, buffer: &mut Buffer) {
    let area = layout.status;
    let help = keymap::of(Action::ToggleHelp).map_or(String::new(), |it| format!("{} {}", it.label, it.hint));
    let mut words = vec![
        match state.integrator() {
            Integrator::Whitted => format!("shadows {}", state.shadows().name()),
            Integrator::Path => "shadows as they are".to_owned(),
        },
        format!("photons {}", on_off(state.effective.as_ref().is_some_and(|it| it.photons))),
        format!("dof {}", on_off(depth_of_field(state))),
        format!("view {}{}", state.view().name(), range(state)),
    ];
    words.push(state.integrator().name().to_owned());
    words.splice(0..0, state.changes());
    if !layout.hidden.is_empty() {
        words.insert(0, format!("{} (too small: {} hidden)", activity(state).0, layout.hidden.join(", ")));
    }
    // In a window without a bottom line the message comes here.
    if layout.bottom.is_empty() {
        words.splice(0..0, state.message.clone());
    }
    let used = put_right(buffer, area, &help, Tone::Strong, state.depth);
    let mut room = Rect { width: area.width.saturating_sub(used + 1), ..area };
    let words = words.join(" · ");
    let frame = format!("{} ", frame(state));
    // The toggles come first where there is not enough room.
    if columns(&words) + 1 + columns(&frame) <= room.width {
        room.width -= put_right(buffer, room, &frame, Tone::Faint, state.depth);
    }
    put(buffer, room, &[(&words, Tone::Plain)], state.depth);
}

/// What a picture is stretched to that is.
fn range(state: &State) -> String {
    let shown = state.picture.as_ref().filter(|shown| shown.generation == state.generation);
    let ends = shown.and_then(|shown| shown.range);
    ends.map_or(String::new(), |[least, greatest]| format!(" {} to {}", number(least), number(greatest)))
}

/// Three digits or more.
fn number(x: f32) -> String {
    let digits = match x.abs() {
        x if x >= 100.0 => 0,
        x if x >= 10.0 => 1,
        x if x >= 1.0 => 2,
        x if x >= 1e-3 || x == 0.0 => 4,
        _ => return format!("{x:.1e}"),
    };
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// What the last picture took on its way: its size, and how long the terminal takes to answer.
fn frame(state: &State) -> String {
    let Some(frame) = state.frame else { return String::new() };
    let size = format!("{} kB", frame.bytes.div_ceil(1000));
    let answer = frame.round_trip.map_or(String::new(), |time| format!(" {} ms", time.as_millis().max(1)));
    size + &answer
}

fn depth_of_field(state: &State) -> bool {
    state.effective.as_ref().is_some_and(|it| it.dof) && state.overrides().dof != Some(false)
}

fn on_off(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}

/// The message, or the keys.
pub(super) fn bottom(state: &State, area: Rect, buffer: &mut Buffer) {
    if let Some(message) = &state.message {
        put(buffer, area, &[(&visible(message), Tone::Strong)], state.depth);
        return;
    }
    let mut rest = area;
    // The key of the help stands in the line above.
    let of_pane = |it: &&Binding| matches!(it.action, Action::Close | Action::ScrollUp | Action::ScrollDown);
    let hinted = || KEYMAP.iter().filter(|it| !it.hint.is_empty() && it.action != Action::ToggleHelp);
    let first = hinted().filter(|it| state.pane.open && of_pane(it));
    let hinted = first.chain(hinted().filter(|it| !of_pane(it)));
    for binding in hinted {
        let hint = format!("{}  ", binding.hint);
        if columns(binding.label) + 1 + columns(binding.hint) > rest.width {
            return;
        }
        let pieces = [(binding.label, Tone::Strong), (" ", Tone::Plain), (&hint, Tone::Faint)];
        let used = put(buffer, rest, &pieces, state.depth);
        rest.x += used;
        rest.width -= used;
    }
}
