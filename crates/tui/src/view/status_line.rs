//! The line under the image: progress while a render runs, then its stages and files. A message takes the left part of it.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::extras::ViewExtras;
use super::layout::Layout;
use super::stages::{self, at_work};
use super::text::{
    Tone, about, bytes, columns, duration, gauge, percent, put, put_right, rest, running, share,
};
use crate::exit_summary;
use crate::pipeline::protocol::{NoiseProgress, OwnState, RenderProgress};
use crate::pipeline::words::samples_so_far;
use crate::preview_kind::PreviewKind;
use crate::scene::is_mesh;
use crate::scene::sanitize::visible;
use crate::state::{Activity, OwnImage, State, WrittenFile};

/// The hint in a narrow window.
const SHORT_HINT: &str = "save it to render again";
const SHORT_HINT_OF_MODEL: &str = "rendered again on changes";
/// A shorter bar says nothing.
const LEAST_BAR: u16 = 6;

/// Draws it in the part of the line that a message leaves.
pub(super) fn draw(state: &State, layout: &Layout, area: Rect, buffer: &mut Buffer, drawn: &mut ViewExtras) {
    match content(state) {
        StatusContent::Nothing => {}
        StatusContent::ProgressBar => bar(state, layout, area, buffer),
        StatusContent::Summary => summary(state, layout, area, buffer, drawn),
        StatusContent::Words(words) => {
            put(buffer, area, &[(&words, Tone::Faint)], state.display.depth);
        }
    }
}

/// Content of the line.
enum StatusContent {
    Nothing,
    ProgressBar,
    Summary,
    Words(String),
}

fn content(state: &State) -> StatusContent {
    // What the newest picture took says nothing of an older one.
    if state.picture.history.is_open() && !state.work.is_running() {
        return StatusContent::Nothing;
    }
    match state.work.activity {
        Activity::Running { .. } => StatusContent::ProgressBar,
        Activity::Done => StatusContent::Summary,
        Activity::Waiting | Activity::Cancelled => StatusContent::Nothing,
        Activity::Broken if let Some(progress) = goes_on(state) => {
            StatusContent::Words(format!("the last good scene goes on: {} %", percent(progress.fraction)))
        }
        Activity::Broken if state.picture.shown.is_some() => {
            let until =
                if state.overlays.is_scene_missing() { "the file is back" } else { "the errors are fixed" };
            StatusContent::Words(format!("the last good picture stays until {until}"))
        }
        Activity::Broken => StatusContent::Words(hint(state)),
    }
}

/// Columns that a message leaves for the rest of the line.
pub(super) fn least_columns(state: &State, layout: &Layout) -> u16 {
    match content(state) {
        StatusContent::Nothing => 0,
        StatusContent::ProgressBar => columns(&bar_words(state, layout).1),
        StatusContent::Summary => {
            file_pieces(state, layout).iter().flatten().map(|(text, _)| columns(text)).sum()
        }
        StatusContent::Words(words) => columns(&words),
    }
}

/// Progress of the last good scene, whose render goes on while the file is broken.
pub(crate) fn goes_on(state: &State) -> Option<&RenderProgress> {
    let is_broken = matches!(state.work.activity, Activity::Broken | Activity::Waiting);
    state.work.progress.as_ref().filter(|progress| is_broken && progress.fraction < 1.0)
}

/// Fraction and words of the loading asset or of the render.
fn bar_words(state: &State, layout: &Layout) -> (f64, String) {
    let time = state.work.rendering_for(state.now).map_or(String::new(), running);
    match (&state.work.progress, state.work.assets.last()) {
        (Some(progress), _) => {
            let samples = if progress.is_total_fixed {
                format!("{}/{} samples", samples_so_far(progress), progress.total_samples)
            } else {
                // The total is a guess.
                format!("about {:.0} samples per pixel", progress.mean_samples.floor())
            };
            (progress.fraction, format!("{samples} · {time}"))
        }
        (None, Some(asset)) if layout.panel.is_empty() => {
            (stages::fraction(asset), visible(&asset.progress.name).into_owned())
        }
        (None, asset) => (asset.map_or(0.0, stages::fraction), time),
    }
}

/// Draws the bar of the loading asset or of the render.
fn bar(state: &State, layout: &Layout, area: Rect, buffer: &mut Buffer) {
    let name = at_work(state).unwrap_or_default();
    let (fraction, words) = bar_words(state, layout);
    let room = area.width.saturating_sub(columns(name) + columns(&words) + 2);
    let noise = state.work.progress.and_then(|progress| progress.noise);
    // A pause ends when somebody wants it to.
    let noise = noise.map(|noise| NoiseProgress { next: noise.next.filter(|_| !state.work.paused), ..noise });
    let fits = |noise: &String| room >= columns(noise) + 3 + LEAST_BAR;
    let noise = noise.and_then(|noise| noise_words(&noise).into_iter().find(fits));
    let words = noise.map_or(words.clone(), |noise| format!("{noise} · {words}"));
    let room = area.width.saturating_sub(columns(name) + columns(&words) + 2);
    if room < LEAST_BAR {
        put(buffer, area, &[(&words, Tone::Plain)], state.display.depth);
        return;
    }
    let (filled, empty) = gauge(fraction, room, state.display.kind == PreviewKind::Ascii);
    let (tone, gap) = (if state.work.paused { Tone::Warning } else { Tone::Working }, (" ", Tone::Plain));
    let pieces =
        [(name, Tone::Faint), gap, (&*filled, tone), (&*empty, Tone::Faint), gap, (&*words, Tone::Plain)];
    put(buffer, area, &pieces, state.display.depth);
}

/// `noise 2.1 %, 1 % in about 14 s`, or shorter: called noise, as what is free of it may still be far from right.
fn noise_words(noise: &NoiseProgress) -> [String; 2] {
    let now = format!("noise {}", share(noise.now));
    let next = noise.next.map(|(level, seconds)| format!("{now}, {} in {}", share(level), about(seconds)));
    [next.unwrap_or_else(|| now.clone()), now]
}

/// Draws the stages in one line, and the other facts that the panel does not show.
fn summary(state: &State, layout: &Layout, area: Rect, buffer: &mut Buffer, drawn: &mut ViewExtras) {
    let of_files = file_pieces(state, layout);
    // The files come first where there is not room for everything.
    let room = area.width.saturating_sub(least_columns(state, layout));
    let mut pieces = stages::in_one_line(state, room);
    let comma = if pieces.is_empty() { "" } else { ", " };
    let mut is_room = |more: Vec<(String, Tone)>| {
        let width: u16 = pieces.iter().chain(&more).map(|(text, _)| columns(text)).sum();
        if width <= area.width {
            pieces.extend(more);
        }
    };
    if layout.panel.is_empty() {
        let mut comma = comma;
        for words in not_saved(state) {
            is_room(vec![(format!("{comma}{words}"), Tone::Faint)]);
            comma = " · ";
        }
    }
    if layout.panel.is_empty() {
        for words in lost(state) {
            is_room(vec![(format!(" {words}"), Tone::Warning)]);
        }
    }
    for file in of_files {
        is_room(file);
    }
    let used = drawn.put(state, area, &pieces, buffer);
    let free = rest(area, used + 2);
    let short = if is_mesh(&state.request.scene) { SHORT_HINT_OF_MODEL } else { SHORT_HINT };
    let words = [hint(state), short.to_owned()];
    if layout.panel.is_empty() && state.saving.edits == 0 {
        let fitting = words.into_iter().find(|words| columns(words) <= free.width);
        put_right(buffer, free, &fitting.unwrap_or_default(), Tone::Faint, state.display.depth);
        return;
    }
    let fitting = frame(state).into_iter().find(|words| columns(words) <= free.width);
    let used = put_right(buffer, free, &fitting.unwrap_or_default(), Tone::Faint, state.display.depth);
    let free = Rect { width: free.width.saturating_sub(used + 2), ..free };
    let seen = seen(state).filter(|_| layout.panel.is_empty()).unwrap_or_default();
    put_right(buffer, free, &seen, Tone::Faint, state.display.depth);
}

/// Name and size of each written file, if the panel does not list them.
fn file_pieces(state: &State, layout: &Layout) -> Vec<Vec<(String, Tone)>> {
    let pieces = |written: &WrittenFile| {
        let name = visible(&written.path.to_string_lossy()).into_owned();
        let size = format!(" {}", bytes(written.bytes));
        vec![(" → ".to_owned(), Tone::Faint), (name, Tone::File), (size, Tone::Faint)]
    };
    files(state).filter(|_| layout.panel.is_empty()).map(pieces).collect()
}

/// The files that hold the picture at hand.
pub(super) fn files(state: &State) -> impl Iterator<Item = &WrittenFile> {
    // The scene's own image is in the files of the previous request if it has not changed.
    let is_own = state.request.is_own();
    let of_any_request = is_own && state.saving.unwritten.is_none();
    state
        .saving
        .written
        .iter()
        .filter(|written| !written.is_stale && written.lost.is_none())
        .filter(move |written| written.shows.is_none() == is_own)
        .filter(move |written| of_any_request || written.generation == state.request.generation)
}

/// Words about a picture that only a key writes and that no key has written, and about the scene's own image meanwhile.
pub(crate) fn not_saved(state: &State) -> Vec<String> {
    if state.request.is_own() || files(state).next().is_some() {
        return Vec::new();
    }
    let mut words = vec!["not saved · w saves it".to_owned()];
    if let Some(name) = exit_summary::image_name(state) {
        let OwnImage { state: own, fraction } = state.saving.own;
        match own {
            OwnState::Written => {}
            OwnState::Begun { .. } if state.saving.written.iter().any(|written| written.shows.is_some()) => {}
            OwnState::Begun { .. } => {
                words.push(format!("{name} at {} %: 0 continues it", percent(fraction)));
            }
            OwnState::NotBegun if state.saving.written.is_empty() => {}
            OwnState::NotBegun => words.push(format!("{name} is older than your last edit: 0 renders it")),
        }
    }
    words
}

/// Words about each written file that another program has changed.
pub(super) fn lost(state: &State) -> impl Iterator<Item = String> {
    let words = |written: &WrittenFile| {
        let name = visible(&written.path.to_string_lossy()).into_owned();
        written.lost.map(|lost| format!("{name} {} · w writes it again", lost.words()))
    };
    state.saving.written.iter().filter_map(words)
}

/// From the save to the first changed cell.
pub(super) fn seen(state: &State) -> Option<String> {
    state.saving.first_change.map(|time| format!("saved → seen {}", duration(time)))
}

/// A hint for a person who has not saved yet, unless there is nothing to save.
pub(super) fn hint(state: &State) -> String {
    if state.saving.edits > 0 || is_unreadable(state) {
        return String::new();
    }
    let name =
        state.request.scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let name = visible(&name);
    // A program writes a model, which the user does not save.
    if is_mesh(&state.request.scene) {
        return format!("rendered again when {name} changes");
    }
    let again = if state.picture.shown.is_some() || state.work.renders > 0 { " again" } else { "" };
    format!("save {name} to render{again}")
}

/// Whether what is wrong with the scene is no text in it: it is a folder, or it is not there.
fn is_unreadable(state: &State) -> bool {
    let overlays = &state.overlays;
    let found = overlays.problems.as_ref().filter(|problems| problems.work.is_none());
    let diagnostics = found.map(|problems| &problems.diagnostics).or(overlays.unconfirmed.as_ref());
    diagnostics.is_some_and(|all| all.iter().all(|one| one.place.is_none()))
}

/// Cost of the last picture on its way: the bytes since its render began, and the terminal's time to answer; then the bytes alone.
fn frame(state: &State) -> Vec<String> {
    let Some(frame) = state.display.frame else { return Vec::new() };
    let size = format!("{} kB sent", frame.bytes.div_ceil(1000));
    let time = frame.round_trip.map(|time| time.as_millis().max(1));
    let both = time.map(|time| format!("{size}, answered in {time} ms"));
    both.into_iter().chain([size]).collect()
}
