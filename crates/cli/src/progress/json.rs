//! Reports progress as one JSON object per line. The first key, `event`, determines the other keys:
//!
//! | event | keys |
//! | --- | --- |
//! | `stage` | `stage`, `status` (`running`, `done`, `reused`, `skipped`), `seconds`, `why` |
//! | `asset` | `name`, `fraction` |
//! | `progress` | `stage` (`render`), `fraction`, `elapsed_seconds`, `eta_seconds` (or null), `samples`, `total_samples`, `noise` (null, or an object with `now` and `next`, which is null or has `level` and `seconds`) |
//! | `written` | `path`, `bytes` |
//! | `checkpoint` | `status` (`written`, `failed`, `resumed`, `absent`, `ignored`, `unused`, `finished`, `set_aside`), `path`, `message`, `samples` (each may be null) |
//! | `write_failed` | `message`: the report or one of several images could not be written |
//! | `done` | `unchanged`, `seconds`, `complete`, `diagnostics` |
//! | `failed` | `kind` (`scene`, `work`), `message`, `diagnostics` |
//! | `cancelled` | |
//!
//! A diagnostic has the keys of `check --json` ([`diagnostic_json`](crate::diagnostic_json)), and `path`.

use std::io::Write;

use serde_json::{Value, json};

use super::Reporter;
use crate::diagnostic_json::diagnostic_to_json;
use crate::output::json::to_line_without_newline;
use crate::pipeline::protocol::{CheckpointUpdate, Event, Failure};
use crate::scene::diagnostic::Diagnostic;
use crate::scene::report::LineColumnLocator;

pub(super) struct JsonReporter;

impl Reporter for JsonReporter {
    fn handle_event(&mut self, event: &Event) {
        if let Some(value) = event_to_json(event) {
            print_json_line_to_stderr(&value);
        }
    }

    fn allows_text_results(&self) -> bool {
        false
    }

    fn reports_diagnostics(&self) -> bool {
        true
    }
}

/// Prints a JSON line to stderr, ignoring errors.
pub(crate) fn print_json_line_to_stderr(value: &Value) {
    if let Ok(text) = format_json_line_event_first(value) {
        let _ = writeln!(std::io::stderr().lock(), "{text}");
    }
}

/// Formats an object on one line, starting with `event`. The other keys are sorted.
fn format_json_line_event_first(value: &Value) -> serde_json::Result<String> {
    let mut rest = value.clone();
    let Some(event) = rest.as_object_mut().and_then(|keys| keys.remove("event")) else {
        return to_line_without_newline(value);
    };
    let (first, rest) =
        (to_line_without_newline(&json!({ "event": event }))?, to_line_without_newline(&rest)?);
    let comma = if rest == "{}" { "" } else { "," };
    Ok(format!("{}{comma}{}", &first[..first.len() - 1], &rest[1..]))
}

fn event_to_json(event: &Event) -> Option<Value> {
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
            "complete": report.image.complete, "diagnostics": diagnostics_to_json(warnings),
        }),
        Event::Checkpoint { news, .. } => checkpoint_to_json(news),
        Event::WriteFailed { message, .. } => json!({ "event": "write_failed", "message": message }),
        Event::Failed { failure, .. } => failure_to_json(failure),
        Event::Canceled { .. } => json!({ "event": "cancelled" }),
        Event::Started { .. }
        | Event::Files { .. }
        | Event::Warnings { .. }
        | Event::Settings { .. }
        | Event::Preview { .. }
        // Reported at the end with the other diagnostics.
        | Event::WriteWarning { .. }
        | Event::Refused { .. }
        | Event::OwnImage { .. }
        | Event::WritePostponed { .. }
        | Event::WriteDone { .. }
        | Event::LastGoodEnded { .. }
        | Event::Text { .. }
        | Event::CameraKept { .. }
        | Event::CameraUndone { .. }
        | Event::Picked { .. } => return None,
    })
}

fn checkpoint_to_json(news: &CheckpointUpdate) -> Value {
    let (status, path, message, samples) = match news {
        CheckpointUpdate::Written { path } => ("written", Some(path), None, None),
        CheckpointUpdate::Failed { message } => ("failed", None, Some(message), None),
        CheckpointUpdate::Resumed { path, samples } => ("resumed", Some(path), None, Some(samples)),
        CheckpointUpdate::Absent { path } => ("absent", Some(path), None, None),
        CheckpointUpdate::Ignored { path } => ("ignored", Some(path), None, None),
        CheckpointUpdate::Unused { path, why } => ("unused", Some(path), Some(why), None),
        CheckpointUpdate::Finished { path } => ("finished", Some(path), None, None),
        CheckpointUpdate::SetAside { path } => ("set_aside", Some(path), None, None),
    };
    let path = path.map(|path| path.to_string_lossy());
    json!({ "event": "checkpoint", "status": status, "path": path, "message": message, "samples": samples })
}

pub(crate) fn failure_to_json(failure: &Failure) -> Value {
    match failure {
        Failure::Work(message) => {
            json!({ "event": "failed", "kind": "work", "message": message, "diagnostics": [] })
        }
        Failure::Scene(all) => json!({
            "event": "failed", "kind": "scene", "message": "the scene or the arguments are invalid", "diagnostics": diagnostics_to_json(all),
        }),
    }
}

/// Converts diagnostics as in `check --json`, and adds the key `path`, which equals `file` but is null if
/// `file` is empty.
fn diagnostics_to_json(all: &[Diagnostic]) -> Vec<Value> {
    let mut places = LineColumnLocator::default();
    let with_path = |one: &Diagnostic| {
        let mut value = diagnostic_to_json(one, &mut places);
        value["path"] = json!(Some(one.path.to_string_lossy()).filter(|path| !path.is_empty()));
        value
    };
    all.iter().map(with_path).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn event_is_the_first_key() {
        let value = json!({ "a": 1, "event": "stage", "z": [2] });
        assert_eq!(format_json_line_event_first(&value).expect("JSON"), r#"{"event":"stage","a":1,"z":[2]}"#);
        assert_eq!(
            format_json_line_event_first(&json!({ "event": "cancelled" })).expect("JSON"),
            r#"{"event":"cancelled"}"#
        );
        assert_eq!(format_json_line_event_first(&json!({ "a": 1 })).expect("JSON"), r#"{"a":1}"#);
    }

    #[test]
    fn diagnostics_have_the_keys_of_check() {
        let text = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 0, 0]\n[materials.a]\ntype = \"metl\"\n";
        let outcome = crate::scene::parse(text.into(), std::path::Path::new("a.toml"));
        let failed = failure_to_json(&Failure::Scene(outcome.diagnostics));
        let one = &failed["diagnostics"][0];
        assert_eq!(one["path"], one["file"]);
        for key in ["severity", "message", "line", "column", "end_line", "end_column", "label"] {
            assert!(!one[key].is_null(), "{key}: {one}");
        }
    }
}
