//! One JSON object a line. The key `event` says which other keys there are:
//!
//! | event | keys |
//! | --- | --- |
//! | `stage` | `stage`, `status` (`running`, `done`, `reused`, `skipped`), `seconds`, `why` |
//! | `asset` | `name`, `fraction` |
//! | `progress` | `stage` (`render`), `fraction`, `elapsed_seconds`, `eta_seconds` (or null), `samples`, `total_samples` |
//! | `written` | `path`, `bytes` |
//! | `done` | `unchanged`, `warnings`, `seconds`, `complete` |
//! | `failed` | `kind` (`scene`, `work`), `errors`, `warnings`, `messages` |
//! | `cancelled` | |

use std::io::Write;

use serde_json::{Value, json};

use super::Reporter;
use crate::pipeline::protocol::{Event, Failure};
use crate::scene::diagnostic::Severity;

pub(super) struct Json;

impl Reporter for Json {
    fn event(&mut self, event: &Event) {
        if let Some(value) = value(event) {
            // JSON escapes control characters by itself, C1 and the like are not shown by programs that read it.
            let _ = writeln!(std::io::stderr().lock(), "{value}");
        }
    }

    fn says_results(&self) -> bool {
        false
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
        }),
        Event::Written { path, bytes, .. } => {
            json!({ "event": "written", "path": path.to_string_lossy(), "bytes": bytes })
        }
        Event::Done { report, warnings, unchanged, .. } => json!({
            "event": "done", "unchanged": unchanged, "warnings": warnings.len(), "seconds": report.seconds,
            "complete": report.image.complete,
        }),
        Event::Failed { failure, .. } => failed(failure),
        Event::Cancelled { .. } => json!({ "event": "cancelled" }),
        _ => return None,
    })
}

fn failed(failure: &Failure) -> Value {
    match failure {
        Failure::Work(message) => json!({
            "event": "failed", "kind": "work", "errors": 1, "warnings": 0, "messages": [message],
        }),
        Failure::Scene(all) => {
            let errors = all.iter().filter(|one| one.severity == Severity::Error).count();
            let messages: Vec<&str> = all.iter().map(|one| one.message.as_str()).collect();
            json!({
                "event": "failed", "kind": "scene", "errors": errors, "warnings": all.len() - errors,
                "messages": messages,
            })
        }
    }
}
