//! The table of stages, the bars of loading assets, and what came out.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::text::{Tone, bytes, columns, duration, gauge, percent, put, put_right, row, seconds};
use crate::pipeline::protocol::{Stage, StageReport, Status};
use crate::scene::report::summary;
use crate::scene::sanitize::visible;
use crate::tui::state::{AssetBar, PreviewKind, State};

/// From the top: stages, assets, results. What does not fit is cut at the bottom.
pub(super) fn draw(state: &State, area: Rect, buffer: &mut Buffer) {
    let mut next = 0;
    let mut line = || {
        next += 1;
        row(area, next - 1)
    };
    for (stage, report) in Stage::ALL.iter().zip(&state.stages) {
        stage_line(state, *stage, report.as_ref(), line(), buffer);
    }
    line();
    for asset in &state.assets {
        asset_line(state, asset, line(), buffer);
    }
    for (text, tone) in results(state) {
        put(buffer, line(), &[(&text, tone)], state.depth);
    }
}

/// Mark, name, seconds, why.
fn stage_line(state: &State, stage: Stage, report: Option<&StageReport>, area: Rect, buffer: &mut Buffer) {
    let has_ended = !state.is_running();
    let (mark, tone) = match report.map(|report| report.status) {
        Some(Status::Running) if has_ended => ("✗", Tone::Error),
        None => ("·", Tone::Faint),
        Some(Status::Running) => (">", Tone::Strong),
        Some(Status::Done) => ("✓", Tone::Good),
        Some(Status::Reused) => ("=", Tone::Faint),
        Some(Status::Skipped) => ("-", Tone::Faint),
    };
    let time = match report {
        Some(StageReport { status: Status::Done, seconds: time, .. }) => seconds(*time),
        Some(StageReport { status: Status::Running, .. }) if has_ended => "stopped".to_owned(),
        Some(StageReport { status: Status::Running, .. }) => "…".to_owned(),
        Some(StageReport { status: Status::Reused, .. }) => "reused".to_owned(),
        Some(StageReport { status: Status::Skipped, .. }) => "skipped".to_owned(),
        None => String::new(),
    };
    let why = report.map_or("", |report| report.why.as_str());
    let line = format!(" {:<8} {time:>8}", stage.name());
    let tone_of_text = if tone == Tone::Faint { Tone::Faint } else { Tone::Plain };
    let why = shortened(&visible(why), area.width.saturating_sub(columns(&line) + 3));
    put(
        buffer,
        area,
        &[(mark, tone), (&line, tone_of_text), ("  ", Tone::Faint), (&why, Tone::Faint)],
        state.depth,
    );
}

/// What fits of a text, with an ellipsis where it is cut; nothing where so little fits that it says nothing.
fn shortened(text: &str, room: u16) -> String {
    const LEAST: u16 = 12;
    if columns(text) <= room {
        return text.to_owned();
    }
    if room < LEAST {
        return String::new();
    }
    let mut short = text.to_owned();
    while columns(&short) >= room && short.pop().is_some() {}
    format!("{}…", short.trim_end())
}

fn asset_line(state: &State, asset: &AssetBar, area: Rect, buffer: &mut Buffer) {
    let progress = &asset.progress;
    let fraction = if progress.total == 0 { 1.0 } else { progress.done as f64 / progress.total as f64 };
    let ascii = state.preview == PreviewKind::Ascii;
    let bar = format!(" {} {:3}%", gauge(fraction, 8, ascii), percent(fraction));
    let room = area.width.saturating_sub(columns(&bar));
    let name = Rect { width: room, ..area };
    put(buffer, name, &[(&visible(&progress.name), Tone::Plain)], state.depth);
    put_right(buffer, area, &bar, Tone::Good, state.depth);
}

fn results(state: &State) -> Vec<(String, Tone)> {
    let mut lines = Vec::new();
    if let Some(report) = &state.report {
        let what = if state.unchanged { "unchanged".to_owned() } else { format!("render {}", state.renders) };
        lines.push((format!("total {} · {what}", seconds(report.seconds)), Tone::Strong));
    }
    if let Some(time) = state.first_change {
        lines.push((format!("first change after {}", duration(time)), Tone::Plain));
    }
    for written in &state.written {
        lines.push((format!("image {}", visible(&written.path.to_string_lossy())), Tone::Plain));
        let size = state.effective.as_ref().map(|it| format!("{}×{} px, ", it.width, it.height));
        lines.push((format!("  {}{}", size.unwrap_or_default(), bytes(written.bytes)), Tone::Faint));
    }
    match state.warnings.len() {
        0 => {}
        1 => lines.push((format!("{} (e shows it)", summary(&state.warnings)), Tone::Warning)),
        _ => lines.push((format!("{} (e shows them)", summary(&state.warnings)), Tone::Warning)),
    }
    lines
}
