//! The header: state, scene and progress. After `tab` is pressed, it is the only text besides the image.

use std::time::Duration;

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::layout::{Layout, STATE_BLOCK_WIDTH};
use super::message;
use super::stages::running_stage_name;
use super::text::{
    TextRole, floor_percent, format_count_with_noun, format_number_to_three_digits,
    format_running_time_with_tenths, format_seconds, put_text, put_text_right, remaining_row_area,
    text_columns,
};
use crate::action::Action;
use crate::choice::Choice;
use crate::history::age_in_words;
use crate::keymap;
use crate::messages;
use crate::pipeline::protocol::RenderProgress;
use crate::pipeline::settings::ViewMode;
use crate::pipeline::words::Eta;
use crate::scene::diagnostic::Severity;
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{RequestStatus, State};

/// Minimum header width at which the state block has a fixed width.
const MIN_FIXED_BLOCK_WIDTH: u16 = 60;
/// Minimum width of a shortened scene name.
const MIN_NAME: u16 = 6;

pub(super) fn draw(state: &State, layout: &Layout, buffer: &mut Buffer) {
    let area = layout.header;
    let used = draw_activity_block(state, area, buffer);
    let mut room = remaining_row_area(area, used + 1);
    // If there is no other line, a message takes the whole header.
    if layout.keys.is_empty() && message::has_message_to_show(state, layout) {
        return;
    }
    if state.preview.is_image_only {
        let back = keymap::binding_for_action(Action::ShowImageOnly)
            .map_or(String::new(), |it| format!("  {} back", it.label));
        room.width -= put_text_right(buffer, room, &back, TextRole::Faint, state.display.depth);
    }
    let figures = progress_or_result_variants(state);
    // Choose a variant that leaves some space for the name, if possible.
    let fitting = [MIN_NAME + 1, 0]
        .into_iter()
        .find_map(|name| figures.iter().find(|words| text_columns(words) + name <= room.width));
    room.width -= put_text_right(
        buffer,
        room,
        fitting.map_or("", String::as_str),
        TextRole::Strong,
        state.display.depth,
    );
    room.width = room.width.saturating_sub(1);
    if room.width >= MIN_NAME {
        draw_scene_info(state, room, buffer);
    }
}

/// Draws the state block. Returns the number of columns used.
fn draw_activity_block(state: &State, area: Rect, buffer: &mut Buffer) -> u16 {
    let (sign, word, tone) = state_symbol_word_and_role(state);
    let mut text = format!(" {sign} {word} ");
    if area.width >= MIN_FIXED_BLOCK_WIDTH {
        text = format!("{text:<STATE_BLOCK_WIDTH$}");
    }
    let area = area.intersection(buffer.area);
    if area.is_empty() {
        return 0;
    }
    let width = usize::from(area.width);
    let end = buffer.set_stringn(area.x, area.y, text, width, tone.block_style(state.display.depth)).0;
    end - area.x
}

/// Symbol, word and color for the state. Each identifies the state on its own.
pub(super) fn state_symbol_word_and_role(state: &State) -> (&'static str, &'static str, TextRole) {
    if state.preview.history.is_viewing_older() {
        ("◂", "older", TextRole::Warning)
    } else {
        worker_symbol_word_and_role(state)
    }
}

fn worker_symbol_word_and_role(state: &State) -> (&'static str, &'static str, TextRole) {
    match state.work.activity {
        _ if state.work.paused => ("‖", "paused", TextRole::Warning),
        RequestStatus::Running { .. } => ("●", "rendering", TextRole::Working),
        RequestStatus::Done if state.saving.unwritten.is_some() => ("!", "unwritten", TextRole::Error),
        RequestStatus::Done => ("✓", "done", TextRole::Good),
        RequestStatus::Waiting => ("…", "waiting", TextRole::Warning),
        RequestStatus::Broken if state.overlays.is_scene_missing() => ("✗", "missing", TextRole::Error),
        RequestStatus::Broken => ("✗", "broken", TextRole::Error),
        RequestStatus::Canceled => ("■", "stopped", TextRole::Warning),
    }
}

/// Returns a word for the worker's state, regardless of the displayed image.
pub(crate) fn worker_activity_word(state: &State) -> &'static str {
    worker_symbol_word_and_role(state).1
}

/// Draws the scene path, the view and the image size.
fn draw_scene_info(state: &State, area: Rect, buffer: &mut Buffer) {
    let path = state.request.scene.to_string_lossy();
    let (folder, file) = path.rsplit_once('/').map_or(("", &*path), |(folder, file)| (folder, file));
    let (folder, file) = (escape_invisible_chars(folder), escape_invisible_chars(file));
    // The image size of older renders is unknown.
    let effective = state.request.effective.as_ref().filter(|_| !state.preview.history.is_viewing_older());
    let size = effective.map_or(String::new(), |it| format!("  {}×{}", it.width, it.height));
    let folder = if folder.is_empty() { String::new() } else { format!("{folder}/") };
    let view = actual_pixels_label(state) + &view_mode_label(state);
    let view = (&*view, TextRole::Strong);
    let mut pieces =
        vec![(&*folder, TextRole::Faint), (&*file, TextRole::Strong), view, (&*size, TextRole::Faint)];
    // Omit parts before truncating the name.
    let width = |pieces: &[(&str, TextRole)]| pieces.iter().map(|(text, _)| text_columns(text)).sum::<u16>();
    if width(&pieces) > area.width {
        pieces.remove(0);
    }
    while pieces.len() > 1 && width(&pieces) > area.width {
        pieces.pop();
    }
    put_text(buffer, area, &pieces, state.display.depth);
}

/// The view and its range of values, or an empty string for the beauty view.
fn view_mode_label(state: &State) -> String {
    let open = state.preview.history.viewed_older_scene_and_settings();
    let of_open = open.map(|origin| origin.toggles.view.unwrap_or_else(|| state.request.base_view_mode()));
    let view = of_open.unwrap_or_else(|| state.request.view_mode());
    if view == ViewMode::Beauty {
        return String::new();
    }
    let is_at_hand = |generation: u64| open.is_some() || generation == state.request.generation;
    let shown = state.preview.shown.as_ref().filter(|shown| is_at_hand(shown.generation));
    let range = shown.and_then(|shown| shown.range);
    let range = range.map_or(String::new(), |[least, most]| {
        format!(" {} to {}", format_number_to_three_digits(least), format_number_to_three_digits(most))
    });
    format!("  view {}{range}", view.name())
}

/// Whether light from photons is missing from the current preview.
fn preview_lacks_photons(state: &State) -> bool {
    state
        .preview
        .shown
        .as_ref()
        .is_some_and(|shown| shown.lacks_photons && shown.generation == state.request.generation)
}

/// Label for a preview that shows actual pixels.
fn actual_pixels_label(state: &State) -> String {
    let is_close = state.preview.shown.as_ref().is_some_and(|shown| shown.section.is_some());
    if is_close { "  1:1".to_owned() } else { String::new() }
}

/// Progress or result in several variants, from longest to shortest.
fn progress_or_result_variants(state: &State) -> Vec<String> {
    if let Some((run, time)) = state.preview.history.viewed_render_number_and_time() {
        let is_unfinished = state
            .preview
            .history
            .viewed_older_scene_and_settings()
            .is_some_and(|origin| origin.is_unfinished);
        let (place, words) = match run {
            Some(run) => {
                let place = format!("{run} of {}", newest_render_number(state));
                (place, messages::render_number_of_count(run, newest_render_number(state)))
            }
            None => {
                let place = if is_unfinished { messages::STOPPED } else { messages::OLDER };
                (place.to_owned(), messages::unnumbered_render_label(place))
            }
        };
        let age = age_in_words(state.now.saturating_duration_since(time));
        let mut figures = vec![format!("{words}, {age}"), place.clone()];
        // The newest render is still running in the background.
        if let Some(progress) = state.work.progress.as_ref().filter(|_| state.work.is_rendering()) {
            let done = format!("newest {} %", floor_percent(progress.fraction));
            let eta = format_eta(state, progress);
            figures = [
                format!("{words}, {age}  {done}{eta}"),
                format!("{place}  {done}{eta}"),
                format!("{place}  {done}"),
                place,
            ]
            .into();
        }
        return figures;
    }
    if state.work.is_request_running() && preview_lacks_photons(state) {
        return [messages::WITHOUT_PHOTONS, "no photons yet"].map(str::to_owned).to_vec();
    }
    match (state.work.activity, &state.work.report, &state.work.progress) {
        (RequestStatus::Running { .. }, _, Some(progress)) => {
            let done = format!("{} %", floor_percent(progress.fraction));
            vec![format!("{done}{}", format_eta(state, progress)), done]
        }
        (RequestStatus::Running { .. }, _, None) => {
            running_stage_name(state).map(|name| format!("{name}…")).into_iter().collect()
        }
        (RequestStatus::Done, _, _) if state.work.unchanged => {
            vec![
                format!("unchanged · {}", messages::numbered_render(state.work.renders)),
                "unchanged".to_owned(),
            ]
        }
        (RequestStatus::Done, Some(report), _) => {
            let time = format_seconds(report.seconds);
            vec![format!("{time} · {}", messages::numbered_render(state.work.renders)), time]
        }
        (RequestStatus::Waiting, _, _) => vec![messages::INCOMPLETE_FILE.to_owned()],
        (RequestStatus::Broken, _, _) if state.overlays.is_scene_missing() => {
            vec![messages::WAITING_FOR_FILE.to_owned()]
        }
        (RequestStatus::Broken, _, _) => vec![format_problem_count(state)],
        (RequestStatus::Done | RequestStatus::Canceled, _, _) => Vec::new(),
    }
}

/// Number of the newest render. A running render counts if it has an image.
fn newest_render_number(state: &State) -> u64 {
    let history = &state.preview.history;
    let is_under_way = state.work.is_rendering()
        && history.newest_is_from_request(state.request.generation)
        && history.is_newest_unfinished();
    state.work.renders + u64::from(is_under_way)
}

/// Formats the remaining time, or returns an empty string if the render is paused.
fn format_eta(state: &State, progress: &RenderProgress) -> String {
    /// Minimum time shown, in seconds. Shorter times would round to zero.
    const MIN_SHOWN_SECONDS: f64 = 0.05;
    let eta = match Eta::from_progress(progress) {
        None => "…".to_owned(),
        Some(Eta::OverADay) => Eta::OverADay.format(),
        Some(Eta::Seconds(eta)) if eta < MIN_SHOWN_SECONDS => "under 1 s".to_owned(),
        Some(Eta::Seconds(eta)) => {
            format_running_time_with_tenths(Duration::try_from_secs_f64(eta).unwrap_or_default())
        }
    };
    if state.work.paused { String::new() } else { format!("  ETA {eta}") }
}

/// Formats the number of errors and warnings.
pub(super) fn format_problem_count(state: &State) -> String {
    let Some(problems) = &state.overlays.problems else { return String::new() };
    let count = |severity| problems.diagnostics.iter().filter(|it| it.severity == severity).count();
    let errors =
        format_count_with_noun(count(Severity::Error) + usize::from(problems.work.is_some()), "error");
    match count(Severity::Warning) {
        0 => errors,
        warnings => format!("{errors}, {}", format_count_with_noun(warnings, "warning")),
    }
}
