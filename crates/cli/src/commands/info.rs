//! `glimt info`: shows how an image was rendered.

use std::path::Path;

use serde_json::{Map, Value, json};

use crate::args::InfoArgs;
use crate::console::Console;
use crate::exit::Exit;
use crate::output::json::file;
use crate::output::settings::{Made, MadeError, made};
use crate::pipeline::protocol::Failure;
use crate::progress::{failed, json_line};
use crate::scene::other_content;
use crate::scene::sanitize::visible;

pub(crate) fn run(args: &InfoArgs, console: &Console) -> Exit {
    let made = match describe(&args.image) {
        Ok(made) => made,
        Err(error) => return console.fail(Exit::WRONG, &error.to_string()),
    };
    if args.json {
        match file(&as_json(&args.image, &made)) {
            Ok(text) => console.text(&text),
            Err(error) => return console.fail(Exit::FAILED, &error.to_string()),
        }
    } else {
        console.text(&as_text(&args.image, &made));
    }
    if made.is_own() { Exit::DONE } else { Exit::FAILED }
}

/// Describes how a file was made. For an image in a format without settings, only the format is known.
///
/// # Errors
/// Those of [`made`].
fn describe(path: &Path) -> Result<Made, MadeError> {
    made(path).or_else(|error| match (&error, other_content(path)) {
        (MadeError::NoPicture { .. }, Some((format, _))) => {
            Ok(Made { format: format.to_owned(), ..Made::default() })
        }
        _ => Err(error),
    })
}

/// If the file is an image, part or checkpoint instead of a scene, reports that and how it was rendered, as one JSON line or as text.
/// `None` for other files.
pub(crate) fn instead_of_scene(path: &Path, is_json: bool, console: &Console) -> Option<Exit> {
    let (_, problem) = other_content(path)?;
    let made = describe(path);
    if is_json {
        let mut value = failed(&Failure::Scene(vec![*problem]));
        value["image"] = made.map_or(Value::Null, |made| as_json(path, &made));
        json_line(&value);
    } else {
        console.diagnostics(&[*problem]);
        console.say_lines(&made.map_or_else(|error| format!("{error}\n"), |made| as_text(path, &made)));
    }
    Some(Exit::WRONG)
}

fn as_json(path: &Path, made: &Made) -> Value {
    let settings: Map<String, Value> =
        made.settings.iter().map(|(name, value)| (name.clone(), Value::from(value.as_str()))).collect();
    json!({
        "path": path.to_string_lossy(),
        "format": made.format,
        "width": made.size.map(|(width, _)| width),
        "height": made.size.map(|(_, height)| height),
        "frames": made.frames,
        "program": made.program,
        "is_by_glimt": made.is_own(),
        "settings": settings,
        "channels": made.channels,
    })
}

/// Most columns of the name column. Longer names move their values to the right.
const MAX_NAME_COLUMNS: usize = 40;

/// A line about the file, followed by one for each setting.
fn as_text(path: &Path, made: &Made) -> String {
    let name = path.to_string_lossy();
    let size = made.size.map_or(String::new(), |(width, height)| format!(", {width}×{height}"));
    let frames = made.frames.map_or(String::new(), |frames| format!(", {frames} frames"));
    let mut text = format!("{}: {}{size}{frames}\n", visible(&name), made.format);
    let program = made.program.as_deref().unwrap_or("unknown (not stored in the file)");
    let mut lines = vec![("program", program)];
    lines.extend(made.settings.iter().map(|(name, value)| (name.as_str(), value.as_str())));
    let channels = made.channels.join(" ");
    if !channels.is_empty() {
        lines.push(("channels", &channels));
    }
    // Limit the width: names may be as long as the file, and format widths end at 65,535.
    let width = lines.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0).min(MAX_NAME_COLUMNS);
    for (name, value) in lines {
        text += &format!("  {:width$}  {}\n", visible(name), visible(value));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn very_long_names_are_shown() {
        for length in [39, 41, 65_535, 65_536, 200_000] {
            let name = "n".repeat(length);
            let made = Made { settings: vec![(name.clone(), "value".to_owned())], ..Made::default() };
            let text = as_text(Path::new("a.png"), &made);
            assert!(text.contains(&format!("{name}  value\n")) || length < 40, "{length}");
            assert!(text.contains("value"), "{length}");
        }
    }
}
