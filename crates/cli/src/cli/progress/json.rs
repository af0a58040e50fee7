//! One JSON object a line. The key `event` says which other keys there are:
//!
//! | event | keys |
//! | --- | --- |
//! | `stage` | `stage`, `status` (`running`, `done`, `reused`, `skipped`), `seconds`, `why` |
//! | `asset` | `name`, `fraction` |
//! | `progress` | `stage` (`render`), `fraction`, `elapsed_seconds`, `eta_seconds` (or null), `samples`, `total_samples`, `noise` (or null: `now`, and `next` with `level`, `seconds`, or null) |
//! | `written` | `path`, `bytes` |
//! | `checkpoint` | `status` (`written`, `failed`, `resumed`, `absent`, `ignored`, `set_aside`), `path`, `message`, `samples`, or null |
//! | `write_failed` | `message`: the report, or one of several pictures, could not be written |
//! | `done` | `unchanged`, `seconds`, `complete`, `diagnostics` |
//! | `failed` | `kind` (`scene`, `work`), `message`, `diagnostics` |
//! | `cancelled` | |
//!
//! A diagnostic has `severity` (`error`, `warning`), `message`, `path`, `line` and `column` (from 1), `help`; a
//! path, line, column or help that it does not have is null.

use std::borrow::Cow;
use std::io::Write;

use serde_json::{Value, json};

use super::Reporter;
use crate::output::json::in_a_line;
use crate::pipeline::protocol::{CheckpointNews, Event, Failure};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::report::line_and_column;

pub(super) struct Json;

impl Reporter for Json {
    fn event(&mut self, event: &Event) {
        if let Some(value) = value(event) {
            line(&value);
        }
    }

    fn says_results(&self) -> bool {
        false
    }

    fn says_diagnostics(&self) -> bool {
        true
    }
}

/// A line on stderr; nothing can be done where nobody reads it.
pub(in crate::cli) fn line(value: &Value) {
    if let Ok(text) = in_a_line(value) {
        let _ = writeln!(std::io::stderr().lock(), "{text}");
    }
}

fn value(event: &Event) -> Option<Value> {
    Some(match event {
        Event::Stage { stage, .. } => json!({
            "event": "stage", "stage": stage.name, "status": stage.status, "seconds": stage.seconds,
            "why": stage.why,
        }),
        Event::Asset { progress, .. } => json!({
            "event": "asset", "name": progress.name,
            "fraction": progress.done as f64 / progress.total.max(1) as f64,
        }),
        Event::Progress { progress, .. } => json!({
            "event": "progress", "stage": "render", "fraction": progress.fraction,
            "elapsed_seconds": progress.elapsed_seconds, "eta_seconds": progress.eta_seconds,
            "samples": progress.samples, "total_samples": progress.total_samples,
            "noise": progress.noise.map(|noise| json!({
                "now": noise.now,
                "next": noise.next.map(|(level, seconds)| json!({ "level": level, "seconds": seconds })),
            })),
        }),
        Event::Written { path, bytes, .. } => {
            json!({ "event": "written", "path": path.to_string_lossy(), "bytes": bytes })
        }
        Event::Done { report, warnings, unchanged, .. } => json!({
            "event": "done", "unchanged": unchanged, "seconds": report.seconds,
            "complete": report.image.complete, "diagnostics": diagnostics(warnings),
        }),
        Event::Checkpoint { news, .. } => checkpoint(news),
        Event::WriteFailed { message, .. } => json!({ "event": "write_failed", "message": message }),
        Event::Failed { failure, .. } => failed(failure),
        Event::Cancelled { .. } => json!({ "event": "cancelled" }),
        Event::Started { .. }
        | Event::Files { .. }
        | Event::Warnings { .. }
        | Event::Settings { .. }
        | Event::Preview { .. }
        // Among the diagnostics at the end.
        | Event::NotKept { .. }
        | Event::Refused { .. }
        | Event::WritePostponed { .. }
        | Event::WriteDone { .. }
        | Event::LastGoodEnded { .. }
        | Event::Text { .. }
        | Event::CameraKept { .. }
        | Event::CameraUndone { .. }
        | Event::Picked { .. } => return None,
    })
}

fn checkpoint(news: &CheckpointNews) -> Value {
    let (status, path, message, samples) = match news {
        CheckpointNews::Written { path } => ("written", Some(path), None, None),
        CheckpointNews::Failed { message } => ("failed", None, Some(message), None),
        CheckpointNews::Resumed { path, samples } => ("resumed", Some(path), None, Some(samples)),
        CheckpointNews::Absent { path } => ("absent", Some(path), None, None),
        CheckpointNews::Ignored { path } => ("ignored", Some(path), None, None),
        CheckpointNews::Unused { path, why } => ("unused", Some(path), Some(why), None),
        CheckpointNews::Finished { path } => ("finished", Some(path), None, None),
        CheckpointNews::SetAside { path } => ("set_aside", Some(path), None, None),
    };
    let path = path.map(|path| path.to_string_lossy());
    json!({ "event": "checkpoint", "status": status, "path": path, "message": message, "samples": samples })
}

fn failed(failure: &Failure) -> Value {
    match failure {
        Failure::Work(message) => {
            json!({ "event": "failed", "kind": "work", "message": message, "diagnostics": [] })
        }
        Failure::Scene(all) => json!({
            "event": "failed", "kind": "scene", "message": "the scene or the call is wrong", "diagnostics": diagnostics(all),
        }),
    }
}

fn diagnostics(all: &[Diagnostic]) -> Vec<Value> {
    all.iter()
        .map(|one| {
            let place = one.place.as_ref().map(|place| line_and_column(&place.source, place.span.start));
            json!({
                "severity": if one.severity == Severity::Error { "error" } else { "warning" },
                "message": one.message, "path": path(one),
                "line": place.map(|(line, _)| line), "column": place.map(|(_, column)| column),
                "help": one.help,
            })
        })
        .collect()
}

fn path(diagnostic: &Diagnostic) -> Option<Cow<'_, str>> {
    Some(diagnostic.path.to_string_lossy()).filter(|path| !path.is_empty())
}
