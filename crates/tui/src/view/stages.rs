//! The stages. Each stage has its own line during a render, and all share a single line afterwards.

use super::text::{
    TextRole, format_count_with_noun, format_seconds, format_time_difference, text_columns, truncated_text,
    wrap_text,
};
use crate::messages;
use crate::pipeline::protocol::{Stage, StageReport, StageStatus};
use crate::scene::sanitize::escape_invisible_chars;
use crate::state::{AssetProgressBar, State};

/// A line of text pieces and their roles.
pub(super) type StyledLine = Vec<(String, TextRole)>;

/// Stages that took less than this fraction of the total time are omitted from the summary line.
const SMALL: f64 = 0.02;
/// Combined width of a stage's name and time, including the gap between them.
const TIME_ENDS: u16 = 16;
/// Minimum width of a stage's shortened reason.
const MIN_WHY: u16 = 12;

/// Formats a stage's symbol, name, time, time difference and reason. A reason that does not fit follows on
/// separate lines.
pub(super) fn lines_of_stage_with_full_reason(state: &State, stage: Stage, room: u16) -> Vec<StyledLine> {
    let mut line = stage_line(state, stage, room);
    let why = stage_reason(state, stage);
    if why.is_empty() {
        return vec![line];
    }
    if text_columns(&why) <= columns_left_for_reason(&line, room) {
        line.push((format!("  {why}"), TextRole::Faint));
        return vec![line];
    }
    let below = wrap_text(&why, usize::from(room.saturating_sub(2)));
    let below = below.into_iter().map(|words| vec![(format!("  {words}"), TextRole::Faint)]);
    std::iter::once(line).chain(below).collect()
}

/// Formats a stage's symbol, name, time, time difference, and as much of the reason as fits on the same line.
pub(super) fn stage_line_with_reason(state: &State, stage: Stage, room: u16) -> Vec<StyledLine> {
    let mut line = stage_line(state, stage, room);
    let (why, room) = (stage_reason(state, stage), columns_left_for_reason(&line, room));
    if !why.is_empty() && (room >= MIN_WHY || text_columns(&why) <= room) {
        line.push((format!("  {}", truncated_text(&why, room)), TextRole::Faint));
    }
    vec![line]
}

/// Number of columns available for a reason next to a stage.
fn columns_left_for_reason(line: &StyledLine, room: u16) -> u16 {
    room.saturating_sub(line_width(line) + 2)
}

fn line_width(line: &StyledLine) -> u16 {
    line.iter().map(|(text, _)| text_columns(text)).sum()
}

fn stage_reason(state: &State, stage: Stage) -> String {
    let report = state.work.stages.get(stage as usize).and_then(Option::as_ref);
    escape_invisible_chars(report.map_or("", |report| report.why.as_str())).into_owned()
}

/// A stage's symbol, name, time and, if it fits, the time difference.
fn stage_line(state: &State, stage: Stage, room: u16) -> StyledLine {
    let report = state.work.stages.get(stage as usize).and_then(Option::as_ref);
    let has_ended = !state.work.is_request_running();
    let (sign, tone, time) = match report.map(|report| (report.status, report.seconds)) {
        None => ("·", TextRole::Faint, String::new()),
        Some((StageStatus::Running, _)) if has_ended => ("✗", TextRole::Error, "stopped".to_owned()),
        Some((StageStatus::Running, _)) => (">", TextRole::Working, "…".to_owned()),
        Some((StageStatus::Done, time)) => ("✓", TextRole::Good, format_seconds(time)),
        Some((StageStatus::Reused, _)) => ("=", TextRole::Faint, "reused".to_owned()),
        Some((StageStatus::Skipped, _)) => ("-", TextRole::Faint, "skipped".to_owned()),
    };
    let text_tone =
        if tone == TextRole::Faint { TextRole::Faint } else { stage_role_marking_reruns(state, report) };
    let line = |gap: u16| {
        let (name, gap) = (stage.name(), usize::from(gap));
        vec![(sign.to_owned(), tone), (format!(" {name}{:gap$}{time}", ""), text_tone)]
    };
    // Align the times unless the gap is needed for the time difference.
    let used = text_columns(stage.name()) + text_columns(&time);
    let usual = TIME_ENDS.saturating_sub(used).max(1);
    let change = report.map_or(String::new(), |report| stage_time_change_text(state, report));
    let change = if change.is_empty() { change } else { format!(" {change}") };
    let least = 2 + used + 1 + text_columns(&change);
    if change.is_empty() || least > room {
        return line(usual);
    }
    let mut line = line(usual.min(1 + room - least));
    line.push((change, TextRole::Strong));
    line
}

/// Role of a stage's text: strong if an edit caused the stage to run again, otherwise plain.
fn stage_role_marking_reruns(state: &State, report: Option<&StageReport>) -> TextRole {
    let has_run_again = report.is_some_and(|it| it.status == StageStatus::Done && state.work.renders > 0);
    if has_run_again && state.saving.edits > 0 { TextRole::Strong } else { TextRole::Plain }
}

/// Difference between the stage's time and its previous time.
fn stage_time_change_text(state: &State, report: &StageReport) -> String {
    match report.status {
        StageStatus::Done => format_time_difference(
            report.seconds,
            state.work.last_seconds.get(report.name as usize).copied().flatten(),
        ),
        StageStatus::Running | StageStatus::Reused | StageStatus::Skipped => String::new(),
    }
}

/// Lists the stages that took a significant part of the time on one line, followed by the number of cached
/// stages. The line is shortened to fit, and empty if even the longest stage does not fit.
pub(super) fn slowest_stages_line(state: &State, room: u16) -> StyledLine {
    let done = || state.work.stages.iter().flatten().filter(|it| it.status == StageStatus::Done);
    let total: f64 = done().map(|it| it.seconds).sum();
    let longest = done().map(|it| it.seconds).fold(0.0, f64::max);
    let first = done().find(|it| it.seconds >= longest).map(|it| it.name);
    let counts = |it: &StageReport| it.seconds >= SMALL * total;
    let forms = [
        list_stage_times_and_cached_count(state, true, counts),
        list_stage_times_and_cached_count(state, false, counts),
        list_stage_times_and_cached_count(state, false, |it| Some(it.name) == first),
    ];
    forms.into_iter().find(|line| line_width(line) <= room).unwrap_or_default()
}

fn list_stage_times_and_cached_count(
    state: &State,
    is_long: bool,
    counts: impl Fn(&StageReport) -> bool,
) -> StyledLine {
    let mut line = StyledLine::new();
    let mut reused = 0;
    for report in state.work.stages.iter().flatten() {
        reused += usize::from(report.status == StageStatus::Reused);
        if report.status == StageStatus::Done && counts(report) {
            let comma = if line.is_empty() { "" } else { ", " };
            line.push((
                format!("{comma}{} {}", report.name.name(), format_seconds(report.seconds)),
                stage_role_marking_reruns(state, Some(report)),
            ));
            let change = stage_time_change_text(state, report);
            if !change.is_empty() {
                line.push((format!(" {change}"), TextRole::Strong));
            }
        }
    }
    if reused > 0 {
        let comma = if line.is_empty() { "" } else { ", " };
        let stages = if is_long { format_count_with_noun(reused, "stage") } else { reused.to_string() };
        line.push((comma.to_owned() + &messages::cached_stage_count(&stages), TextRole::Faint));
    }
    line
}

/// Name of the running stage.
pub(super) fn running_stage_name(state: &State) -> Option<&'static str> {
    let mut stages = state.work.stages.iter().flatten();
    stages.find(|stage| stage.status == StageStatus::Running).map(|stage| stage.name.name())
}

/// Loaded fraction of an asset.
pub(super) fn asset_loaded_fraction(asset: &AssetProgressBar) -> f64 {
    let progress = &asset.progress;
    if progress.total == 0 { 1.0 } else { progress.done as f64 / progress.total as f64 }
}
