//! Errors and warnings as JSON objects, for `check --json` and `--progress json`.

use serde_json::{Value, json};

use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::report::LineColumnLocator;

/// Converts a diagnostic. Lines and columns start at 1. Columns are counted in characters, ends are
/// exclusive, and missing values are null.
pub(super) fn diagnostic_to_json(one: &Diagnostic, places: &mut LineColumnLocator) -> Value {
    let severity = match one.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    let mut at = |offset| one.place.as_ref().map(|place| places.locate(&place.source, offset));
    let span = one.place.as_ref().map(|place| place.span.clone());
    let (start, end) = (span.clone().and_then(|span| at(span.start)), span.and_then(|span| at(span.end)));
    let label = one.place.as_ref().map(|place| place.label.as_str()).filter(|label| !label.is_empty());
    json!({
        "file": one.path.to_string_lossy(),
        "line": start.map(|(line, _)| line),
        "column": start.map(|(_, column)| column),
        "end_line": end.map(|(line, _)| line),
        "end_column": end.map(|(_, column)| column),
        "severity": severity,
        "message": one.message,
        "label": label,
        "help": one.help,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn spans_have_an_end_and_a_label() {
        let text = "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 0, 0]\n[materials.a]\ntype = \"metl\"\n";
        let outcome = crate::scene::parse(text.into(), Path::new("a.toml"));
        let error = outcome.diagnostics.iter().find(|one| one.severity == Severity::Error).expect("an error");
        let value = diagnostic_to_json(error, &mut LineColumnLocator::default());
        let places = ["line", "column", "end_line", "end_column"].map(|key| value[key].as_u64());
        assert_eq!(places, [Some(5), Some(8), Some(5), Some(14)], "{value}");
        assert_eq!((&value["file"], &value["severity"]), (&json!("a.toml"), &json!("error")));
        assert!(value["label"].as_str().is_some_and(|label| label.contains("metal")), "{value}");
    }
}
