//! The status line below the image. It shows progress during a render, and stages and files afterwards.
//! Messages are shown on the left.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::extras::FileLinksAndDelayedText;
use super::layout::Layout;
use super::stages::{self, running_stage_name};
use super::text::{
    TextRole, floor_percent, format_approximate_time, format_bytes, format_duration,
    format_running_time_with_tenths, format_two_digit_percent, progress_bar_parts, put_text, put_text_right,
    remaining_row_area, text_columns,
};
use crate::exit_summary;
use crate::messages;
use crate::pipeline::protocol::{NoiseAndTimeToNextLevel, RenderProgress, SavedSceneRenderStatus};
use crate::pipeline::words::format_mean_samples;
use crate::preview_style::PreviewStyle;
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{RequestStatus, SceneImageRenderProgress, State, WrittenImageFile};

/// Short save hints, for narrow windows.
const SHORT_HINT: &str = "save it to re-render";
const SHORT_HINT_OF_MODEL: &str = "re-renders on changes";
/// Minimum width of a progress bar.
const MIN_BAR: u16 = 6;

/// Draws the status line in the space that no message uses.
pub(super) fn draw(
    state: &State,
    layout: &Layout,
    area: Rect,
    buffer: &mut Buffer,
    drawn: &mut FileLinksAndDelayedText,
) {
    match status_content(state) {
        StatusContent::Nothing => {}
        StatusContent::ProgressBar => draw_progress_bar(state, layout, area, buffer),
        StatusContent::Summary => draw_summary(state, layout, area, buffer, drawn),
        StatusContent::Words(words) => {
            put_text(buffer, area, &[(&words, TextRole::Faint)], state.display.depth);
        }
    }
}

/// Content of the status line.
enum StatusContent {
    Nothing,
    ProgressBar,
    Summary,
    Words(String),
}

fn status_content(state: &State) -> StatusContent {
    // The results belong to the newest render.
    if state.preview.history.is_viewing_older() && !state.work.is_request_running() {
        return StatusContent::Nothing;
    }
    match state.work.activity {
        RequestStatus::Running { .. } => StatusContent::ProgressBar,
        RequestStatus::Done => StatusContent::Summary,
        RequestStatus::Waiting | RequestStatus::Canceled => StatusContent::Nothing,
        RequestStatus::Broken if let Some(progress) = last_valid_render_progress(state) => {
            StatusContent::Words(format!(
                "{}: {} %",
                messages::LAST_GOOD_SCENE,
                floor_percent(progress.fraction)
            ))
        }
        RequestStatus::Broken if state.preview.shown.is_some() => {
            StatusContent::Words(messages::LAST_GOOD_RENDER.to_owned())
        }
        RequestStatus::Broken => StatusContent::Words(save_scene_hint(state)),
    }
}

/// Number of columns in the status line that a message must not use.
pub(super) fn columns_reserved_for_status(state: &State, layout: &Layout) -> u16 {
    match status_content(state) {
        StatusContent::Nothing => 0,
        StatusContent::ProgressBar => text_columns(&progress_fraction_and_text(state, layout).1),
        StatusContent::Summary => {
            written_file_pieces(state, layout).iter().flatten().map(|(text, _)| text_columns(text)).sum()
        }
        StatusContent::Words(words) => text_columns(&words),
    }
}

/// Progress of the last valid scene's render, which continues while the file is broken.
pub(crate) fn last_valid_render_progress(state: &State) -> Option<&RenderProgress> {
    let is_broken = matches!(state.work.activity, RequestStatus::Broken | RequestStatus::Waiting);
    state.work.progress.as_ref().filter(|progress| is_broken && progress.fraction < 1.0)
}

/// Progress bar fraction and text for the asset being loaded or for the render.
fn progress_fraction_and_text(state: &State, layout: &Layout) -> (f64, String) {
    let time =
        state.work.total_rendering_time(state.now).map_or(String::new(), format_running_time_with_tenths);
    match (&state.work.progress, state.work.assets.last()) {
        (Some(progress), _) => {
            let samples = if progress.is_total_fixed {
                format!("{}/{} samples", format_mean_samples(progress), progress.total_samples)
            } else {
                // The total is only an estimate.
                format!("about {:.0} samples per pixel", progress.mean_samples.floor())
            };
            (progress.fraction, format!("{samples} · {time}"))
        }
        (None, Some(asset)) if layout.panel.is_empty() => {
            (stages::asset_loaded_fraction(asset), escape_invisible_chars(&asset.progress.name).into_owned())
        }
        (None, asset) => (asset.map_or(0.0, stages::asset_loaded_fraction), time),
    }
}

/// Draws the progress bar for the asset being loaded or the render.
fn draw_progress_bar(state: &State, layout: &Layout, area: Rect, buffer: &mut Buffer) {
    let name = running_stage_name(state).unwrap_or_default();
    let (fraction, words) = progress_fraction_and_text(state, layout);
    let room = area.width.saturating_sub(text_columns(name) + text_columns(&words) + 2);
    let noise = state.work.progress.and_then(|progress| progress.noise);
    // While paused, the remaining time is unknown.
    let noise = noise
        .map(|noise| NoiseAndTimeToNextLevel { next: noise.next.filter(|_| !state.work.paused), ..noise });
    let fits = |noise: &String| room >= text_columns(noise) + 3 + MIN_BAR;
    let noise = noise.and_then(|noise| noise_texts(&noise).into_iter().find(fits));
    let words = noise.map_or(words.clone(), |noise| format!("{noise} · {words}"));
    let room = area.width.saturating_sub(text_columns(name) + text_columns(&words) + 2);
    if room < MIN_BAR {
        put_text(buffer, area, &[(&words, TextRole::Plain)], state.display.depth);
        return;
    }
    let (filled_squares, empty) =
        progress_bar_parts(fraction, room, state.display.kind == PreviewStyle::Ascii);
    let (tone, gap) =
        (if state.work.paused { TextRole::Warning } else { TextRole::Working }, (" ", TextRole::Plain));
    let pieces = [
        (name, TextRole::Faint),
        gap,
        (&*filled_squares, tone),
        (&*empty, TextRole::Faint),
        gap,
        (&*words, TextRole::Plain),
    ];
    put_text(buffer, area, &pieces, state.display.depth);
}

/// Formats the noise as `noise 2.1 % → 1 % in about 14 s` and in a shorter variant. It is called noise rather
/// than error because a noise-free image may still be biased.
fn noise_texts(noise: &NoiseAndTimeToNextLevel) -> [String; 2] {
    let now = format!("noise {}", format_two_digit_percent(noise.now));
    let next = noise.next.map(|(level, seconds)| {
        format!("{now} → {} in {}", format_two_digit_percent(level), format_approximate_time(seconds))
    });
    [next.unwrap_or_else(|| now.clone()), now]
}

/// Draws the stages on one line, followed by other information that the panel does not show.
fn draw_summary(
    state: &State,
    layout: &Layout,
    area: Rect,
    buffer: &mut Buffer,
    drawn: &mut FileLinksAndDelayedText,
) {
    let of_files = written_file_pieces(state, layout);
    // Files take precedence if there is not enough space.
    let room = area.width.saturating_sub(columns_reserved_for_status(state, layout));
    let mut pieces = stages::slowest_stages_line(state, room);
    let comma = if pieces.is_empty() { "" } else { ", " };
    let mut is_room = |more: Vec<(String, TextRole)>| {
        let width: u16 = pieces.iter().chain(&more).map(|(text, _)| text_columns(text)).sum();
        if width <= area.width {
            pieces.extend(more);
        }
    };
    if layout.panel.is_empty() {
        let mut comma = comma;
        for words in unsaved_image_messages(state) {
            is_room(vec![(format!("{comma}{words}"), TextRole::Faint)]);
            comma = " · ";
        }
    }
    if layout.panel.is_empty() {
        for words in externally_changed_output_messages(state) {
            is_room(vec![(format!(" {words}"), TextRole::Warning)]);
        }
    }
    for file in of_files {
        is_room(file);
    }
    let used = drawn.put_line_with_links(state, area, &pieces, buffer);
    let free = remaining_row_area(area, used + 2);
    let short = if state.request.is_model() { SHORT_HINT_OF_MODEL } else { SHORT_HINT };
    let words = [save_scene_hint(state), short.to_owned()];
    if layout.panel.is_empty() && state.saving.edits == 0 {
        let fitting = words.into_iter().find(|words| text_columns(words) <= free.width);
        put_text_right(buffer, free, &fitting.unwrap_or_default(), TextRole::Faint, state.display.depth);
        return;
    }
    let fitting = preview_cost_variants(state).into_iter().find(|words| text_columns(words) <= free.width);
    let used =
        put_text_right(buffer, free, &fitting.unwrap_or_default(), TextRole::Faint, state.display.depth);
    let free = Rect { width: free.width.saturating_sub(used + 2), ..free };
    let seen = save_to_screen_text(state).filter(|_| layout.panel.is_empty()).unwrap_or_default();
    put_text_right(buffer, free, &seen, TextRole::Faint, state.display.depth);
}

/// Name and size of each written file, or nothing if the panel lists the files.
fn written_file_pieces(state: &State, layout: &Layout) -> Vec<Vec<(String, TextRole)>> {
    let pieces = |written: &WrittenImageFile| {
        let name = written.escaped_path();
        let size = format!(" {}", format_bytes(written.bytes));
        vec![(" → ".to_owned(), TextRole::Faint), (name, TextRole::File), (size, TextRole::Faint)]
    };
    files_containing_current_image(state).filter(|_| layout.panel.is_empty()).map(pieces).collect()
}

/// The files that contain the current image.
pub(super) fn files_containing_current_image(state: &State) -> impl Iterator<Item = &WrittenImageFile> {
    // If the scene's own image has not changed, it may have been written by an earlier request.
    let is_own = state.request.has_no_keyboard_overrides();
    let of_any_request = is_own && state.saving.unwritten.is_none();
    state
        .saving
        .written
        .iter()
        .filter(|written| !written.is_stale && written.lost.is_none() && !written.is_unfinished)
        .filter(move |written| written.shows.is_none() == is_own)
        .filter(move |written| of_any_request || written.generation == state.request.generation)
}

/// Returns messages about a displayed image that has not been written, and about the images that have.
pub(crate) fn unsaved_image_messages(state: &State) -> Vec<String> {
    let saving = &state.saving;
    if files_containing_current_image(state).next().is_some() {
        return Vec::new();
    }
    let by_hand = saving.find_file_with_key_changes();
    if state.request.has_no_keyboard_overrides() {
        let by_hand = by_hand.filter(|_| saving.unwritten.is_none());
        let words = |file: &WrittenImageFile| {
            messages::written_image_differs(
                &file.escaped_path(),
                &file.describe_included_keyboard_changes().join(", "),
            )
        };
        return by_hand.map(words).into_iter().collect();
    }
    if let Some(file) = by_hand.filter(|file| file.generation == state.request.generation) {
        return vec![messages::written_image_unfinished(&file.escaped_path())];
    }
    if !state.can_overwrite_outputs() {
        return vec![messages::NOT_SAVED_WITH_CONFLICT.to_owned()];
    }
    let image_name = exit_summary::output_file_names(state);
    let other = match (saving.own, by_hand, image_name) {
        (_, Some(file), _) => Some(messages::image_written_with_changes(
            &file.escaped_path(),
            &file.describe_included_keyboard_changes().join(", "),
        )),
        (SceneImageRenderProgress { state: SavedSceneRenderStatus::Written, .. }, None, _)
        | (_, None, None) => None,
        (
            SceneImageRenderProgress { state: SavedSceneRenderStatus::Begun { .. }, fraction },
            None,
            Some(name),
        ) => Some(messages::scene_image_render_interrupted(&name, floor_percent(fraction))),
        (SceneImageRenderProgress { state: SavedSceneRenderStatus::NotBegun, .. }, None, Some(name)) => {
            let is_older = !saving.written.is_empty() && saving.are_images_older_than_scene();
            is_older.then(|| messages::scene_image_file_outdated(&name))
        }
    };
    [messages::NOT_SAVED.to_owned()].into_iter().chain(other).collect()
}

/// Returns a message for each written file that another program has changed.
pub(super) fn externally_changed_output_messages(state: &State) -> impl Iterator<Item = String> {
    state.saving.written.iter().filter_map(WrittenImageFile::describe_external_change)
}

/// Time between saving the file and drawing the first changed cell.
pub(super) fn save_to_screen_text(state: &State) -> Option<String> {
    state.saving.first_change.map(|time| messages::save_to_screen_text(&format_duration(time)))
}

/// A hint for users who have not saved yet, or an empty string if there is nothing to save.
pub(super) fn save_scene_hint(state: &State) -> String {
    if state.saving.edits > 0 || is_scene_unreadable(state) {
        return String::new();
    }
    let name =
        state.request.scene.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let name = escape_invisible_chars(&name);
    // Models are usually exported by a program rather than saved by the user.
    if state.request.is_model() {
        return messages::renders_on_changes_hint(&name);
    }
    messages::saving_starts_render_hint(&name, state.preview.shown.is_some() || state.work.renders > 0)
}

/// Whether the scene cannot be read at all, for example because the file does not exist.
fn is_scene_unreadable(state: &State) -> bool {
    let overlays = &state.overlays;
    let found = overlays.problems.as_ref().filter(|problems| problems.work.is_none());
    let diagnostics = found.map(|problems| &problems.diagnostics).or(overlays.unconfirmed.as_ref());
    diagnostics.is_some_and(|all| all.iter().all(|one| one.place.is_none()))
}

/// Describes the cost of the last preview in two variants: bytes sent with and without the round-trip time.
fn preview_cost_variants(state: &State) -> Vec<String> {
    let Some(frame) = state.display.frame else { return Vec::new() };
    let cost = |time| messages::preview_bytes_and_round_trip(frame.bytes.div_ceil(1000), time);
    let time = frame.round_trip.map(|time| time.as_millis().max(1));
    time.map(|time| cost(Some(time))).into_iter().chain([cost(None)]).collect()
}
