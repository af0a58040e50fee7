//! The stages. Each stage has its own line during a render, and all share a single line afterwards.

use super::text::{
    Tone, format_count, format_time_difference, seconds, text_columns, truncated_text, wrapped,
};
use crate::messages;
use crate::pipeline::protocol::{Stage, StageReport, Status};
use crate::scene::sanitize::visible;
use crate::state::{AssetBar, State};

/// A line of text pieces and their tones.
pub(super) type StyledLine = Vec<(String, Tone)>;

/// Stages that took less than this fraction of the total time are omitted from the summary line.
const SMALL: f64 = 0.02;
/// Combined width of a stage's name and time, including the gap between them.
const TIME_ENDS: u16 = 16;
/// Minimum width of a stage's shortened reason.
const MIN_WHY: u16 = 12;

/// Formats a stage's symbol, name, time, time difference and reason. A reason that does not fit follows on
/// separate lines.
pub(super) fn stage_lines(state: &State, stage: Stage, room: u16) -> Vec<StyledLine> {
    let mut line = stage_line(state, stage, room);
    let why = stage_reason(state, stage);
    if why.is_empty() {
        return vec![line];
    }
    if text_columns(&why) <= reason_columns(&line, room) {
        line.push((format!("  {why}"), Tone::Faint));
        return vec![line];
    }
    let below = wrapped(&why, usize::from(room.saturating_sub(2)));
    let below = below.into_iter().map(|words| vec![(format!("  {words}"), Tone::Faint)]);
    std::iter::once(line).chain(below).collect()
}

/// Formats a stage's symbol, name, time, time difference, and as much of the reason as fits on the same line.
pub(super) fn stage_line_with_reason(state: &State, stage: Stage, room: u16) -> Vec<StyledLine> {
    let mut line = stage_line(state, stage, room);
    let (why, room) = (stage_reason(state, stage), reason_columns(&line, room));
    if !why.is_empty() && (room >= MIN_WHY || text_columns(&why) <= room) {
        line.push((format!("  {}", truncated_text(&why, room)), Tone::Faint));
    }
    vec![line]
}

/// Number of columns available for a reason next to a stage.
fn reason_columns(line: &StyledLine, room: u16) -> u16 {
    room.saturating_sub(line_width(line) + 2)
}

fn line_width(line: &StyledLine) -> u16 {
    line.iter().map(|(text, _)| text_columns(text)).sum()
}

fn stage_reason(state: &State, stage: Stage) -> String {
    let report = state.work.stages.get(stage as usize).and_then(Option::as_ref);
    visible(report.map_or("", |report| report.why.as_str())).into_owned()
}

/// A stage's symbol, name, time and, if it fits, the time difference.
fn stage_line(state: &State, stage: Stage, room: u16) -> StyledLine {
    let report = state.work.stages.get(stage as usize).and_then(Option::as_ref);
    let has_ended = !state.work.is_running();
    let (sign, tone, time) = match report.map(|report| (report.status, report.seconds)) {
        None => ("·", Tone::Faint, String::new()),
        Some((Status::Running, _)) if has_ended => ("✗", Tone::Error, "stopped".to_owned()),
        Some((Status::Running, _)) => (">", Tone::Working, "…".to_owned()),
        Some((Status::Done, time)) => ("✓", Tone::Good, seconds(time)),
        Some((Status::Reused, _)) => ("=", Tone::Faint, "reused".to_owned()),
        Some((Status::Skipped, _)) => ("-", Tone::Faint, "skipped".to_owned()),
    };
    let text_tone = if tone == Tone::Faint { Tone::Faint } else { tone_of_stage(state, report) };
    let line = |gap: u16| {
        let (name, gap) = (stage.name(), usize::from(gap));
        vec![(sign.to_owned(), tone), (format!(" {name}{:gap$}{time}", ""), text_tone)]
    };
    // Align the times unless the gap is needed for the time difference.
    let used = text_columns(stage.name()) + text_columns(&time);
    let usual = TIME_ENDS.saturating_sub(used).max(1);
    let change = report.map_or(String::new(), |report| time_change(state, report));
    let change = if change.is_empty() { change } else { format!(" {change}") };
    let least = 2 + used + 1 + text_columns(&change);
    if change.is_empty() || least > room {
        return line(usual);
    }
    let mut line = line(usual.min(1 + room - least));
    line.push((change, Tone::Strong));
    line
}

/// Tone of a stage's text. Bold if an edit caused the stage to run again.
fn tone_of_stage(state: &State, report: Option<&StageReport>) -> Tone {
    let is_again = report.is_some_and(|it| it.status == Status::Done && state.work.renders > 0);
    if is_again && state.saving.edits > 0 { Tone::Strong } else { Tone::Plain }
}

/// Difference between the stage's time and its previous time.
fn time_change(state: &State, report: &StageReport) -> String {
    match report.status {
        Status::Done => format_time_difference(
            report.seconds,
            state.work.last_seconds.get(report.name as usize).copied().flatten(),
        ),
        Status::Running | Status::Reused | Status::Skipped => String::new(),
    }
}

/// Lists the stages that took a significant part of the time on one line, followed by the number of cached
/// stages. The line is shortened to fit, and empty if even the longest stage does not fit.
pub(super) fn summary_line(state: &State, room: u16) -> StyledLine {
    let done = || state.work.stages.iter().flatten().filter(|it| it.status == Status::Done);
    let total: f64 = done().map(|it| it.seconds).sum();
    let longest = done().map(|it| it.seconds).fold(0.0, f64::max);
    let first = done().find(|it| it.seconds >= longest).map(|it| it.name);
    let counts = |it: &StageReport| it.seconds >= SMALL * total;
    let forms = [
        summary_line_with(state, true, counts),
        summary_line_with(state, false, counts),
        summary_line_with(state, false, |it| Some(it.name) == first),
    ];
    forms.into_iter().find(|line| line_width(line) <= room).unwrap_or_default()
}

fn summary_line_with(state: &State, is_long: bool, counts: impl Fn(&StageReport) -> bool) -> StyledLine {
    let mut line = StyledLine::new();
    let mut reused = 0;
    for report in state.work.stages.iter().flatten() {
        reused += usize::from(report.status == Status::Reused);
        if report.status == Status::Done && counts(report) {
            let comma = if line.is_empty() { "" } else { ", " };
            line.push((
                format!("{comma}{} {}", report.name.name(), seconds(report.seconds)),
                tone_of_stage(state, Some(report)),
            ));
            let change = time_change(state, report);
            if !change.is_empty() {
                line.push((format!(" {change}"), Tone::Strong));
            }
        }
    }
    if reused > 0 {
        let comma = if line.is_empty() { "" } else { ", " };
        let stages = if is_long { format_count(reused, "stage") } else { reused.to_string() };
        line.push((comma.to_owned() + &messages::cached_stages(&stages), Tone::Faint));
    }
    line
}

/// Name of the running stage.
pub(super) fn running_stage(state: &State) -> Option<&'static str> {
    let mut stages = state.work.stages.iter().flatten();
    stages.find(|stage| stage.status == Status::Running).map(|stage| stage.name.name())
}

/// Loaded fraction of an asset.
pub(super) fn loaded_fraction(asset: &AssetBar) -> f64 {
    let progress = &asset.progress;
    if progress.total == 0 { 1.0 } else { progress.done as f64 / progress.total as f64 }
}
