//! `glimt check`: validates a scene and its files.

use std::path::Path;

use serde_json::{Value, json};

use crate::commands::info::report_image_instead_of_scene;
use crate::console::Console;
use crate::control::CancelToken;
use crate::diagnostic_json::diagnostic_to_json;
use crate::exit::Exit;
use crate::output::json::to_line_without_newline;
use crate::pipeline::protocol::Failure;
use crate::pipeline::settings::ForeignOptions;
use crate::pipeline::{SceneSummary, check_scene_with_options};
use crate::scene::report::LineColumnLocator;

pub(crate) fn run(
    scene: &Path,
    sets: &[String],
    foreign: &ForeignOptions,
    is_json: bool,
    console: &Console,
) -> Exit {
    if is_json {
        return check_and_print_json(scene, sets, foreign, console);
    }
    if let Some(exit) = report_image_instead_of_scene(scene, false, console) {
        return exit;
    }
    match check_scene_with_options(scene, sets, foreign, &CancelToken::new()) {
        Ok(checked) => {
            console.print_diagnostics(&checked.warnings);
            console.print_line(&format_scene_counts(scene, &checked));
            Exit::DONE
        }
        Err(Failure::Scene(diagnostics)) => {
            console.print_diagnostics(&diagnostics);
            Exit::WRONG
        }
        Err(Failure::Work(message)) => console.print_error(Exit::FAILED, &message),
    }
}

/// Reports the result as one JSON object on stdout.
fn check_and_print_json(scene: &Path, sets: &[String], foreign: &ForeignOptions, console: &Console) -> Exit {
    let (exit, diagnostics) = match check_scene_with_options(scene, sets, foreign, &CancelToken::new()) {
        Ok(checked) => (Exit::DONE, checked.warnings),
        Err(Failure::Scene(diagnostics)) => (Exit::WRONG, diagnostics),
        Err(Failure::Work(message)) => return console.print_error(Exit::FAILED, &message),
    };
    let mut places = LineColumnLocator::default();
    let all: Vec<Value> = diagnostics.iter().map(|one| diagnostic_to_json(one, &mut places)).collect();
    let scene = scene.to_string_lossy();
    let report = json!({ "scene": scene, "ok": exit == Exit::DONE, "diagnostics": all });
    match to_line_without_newline(&report) {
        Ok(line) => console.print_trusted_text(&format!("{line}\n")),
        Err(error) => return console.print_error(Exit::FAILED, &format!("cannot write JSON: {error}")),
    }
    exit
}

fn format_scene_counts(scene: &Path, checked: &SceneSummary) -> String {
    let parts = [
        format_count(checked.objects, "object"),
        format_count(checked.triangles, "triangle"),
        format_count(checked.textures, "texture"),
        format_count(checked.lights, "light"),
    ];
    let warnings = match checked.warnings.len() as u64 {
        0 => String::new(),
        some => format!("; {}", format_count(some, "warning")),
    };
    format!("ok: {}: {}{warnings}", scene.display(), parts.join(", "))
}

/// Formats a count with a singular or plural noun.
pub(crate) fn format_count(number: u64, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summary_uses_singular_and_plural() {
        let checked = SceneSummary { objects: 1, triangles: 0, textures: 2, lights: 3, warnings: Vec::new() };
        let text = format_scene_counts(Path::new("a.toml"), &checked);
        assert_eq!(text, "ok: a.toml: 1 object, 0 triangles, 2 textures, 3 lights");
    }
}
