//! `glimt info`: shows how an image was rendered.

use std::path::Path;

use serde_json::{Map, Value, json};

use crate::args::InfoArgs;
use crate::console::Console;
use crate::exit::Exit;
use crate::output::json::to_pretty_text;
use crate::output::settings::{ImageFileInfo, ImageInfoReadError, read_image_info};
use crate::pipeline::protocol::Failure;
use crate::progress::{failure_to_json, json_line};
use crate::scene::detect_image_or_part_file;
use crate::scene::sanitize::escape_invisible_chars;

pub(crate) fn run(args: &InfoArgs, console: &Console) -> Exit {
    let info = match read_image_info_or_format(&args.image) {
        Ok(info) => info,
        Err(error) => return console.print_error(Exit::WRONG, &error.to_string()),
    };
    if args.json {
        match to_pretty_text(&image_info_to_json(&args.image, &info)) {
            Ok(text) => console.print_trusted_text(&text),
            Err(error) => return console.print_error(Exit::FAILED, &error.to_string()),
        }
    } else {
        console.print_trusted_text(&image_info_to_text(&args.image, &info));
    }
    if info.is_written_by_glimt() { Exit::DONE } else { Exit::FAILED }
}

/// Reads how a file was rendered, or only the file's format if this format cannot store settings.
///
/// # Errors
/// Returns the same errors as [`read_image_info`].
fn read_image_info_or_format(path: &Path) -> Result<ImageFileInfo, ImageInfoReadError> {
    read_image_info(path).or_else(|error| match (&error, detect_image_or_part_file(path)) {
        (ImageInfoReadError::NotAnImage { .. }, Some((format, _))) => {
            Ok(ImageFileInfo { format: format.to_owned(), ..ImageFileInfo::default() })
        }
        _ => Err(error),
    })
}

/// If the file is an image, part or checkpoint instead of a scene, reports this along with how the file was
/// rendered, as one JSON line or as text. Returns `None` for other files.
pub(crate) fn report_image_instead_of_scene(path: &Path, is_json: bool, console: &Console) -> Option<Exit> {
    let (_, problem) = detect_image_or_part_file(path)?;
    let info = read_image_info_or_format(path);
    if is_json {
        let mut value = failure_to_json(&Failure::Scene(vec![*problem]));
        value["image"] = info.map_or(Value::Null, |info| image_info_to_json(path, &info));
        json_line(&value);
    } else {
        console.print_diagnostics(&[*problem]);
        console.print_lines_to_stderr(
            &info.map_or_else(|error| format!("{error}\n"), |info| image_info_to_text(path, &info)),
        );
    }
    Some(Exit::WRONG)
}

fn image_info_to_json(path: &Path, info: &ImageFileInfo) -> Value {
    let settings: Map<String, Value> =
        info.settings.iter().map(|(name, value)| (name.clone(), Value::from(value.as_str()))).collect();
    json!({
        "path": path.to_string_lossy(),
        "format": info.format,
        "width": info.size.map(|(width, _)| width),
        "height": info.size.map(|(_, height)| height),
        "frames": info.frames,
        "program": info.program,
        "is_by_glimt": info.is_written_by_glimt(),
        "settings": settings,
        "channels": info.channels,
    })
}

/// Maximum width of the name column. A longer name shifts its value to the right.
const MAX_NAME_COLUMNS: usize = 40;

/// Formats one line about the file, followed by one line per setting.
fn image_info_to_text(path: &Path, info: &ImageFileInfo) -> String {
    let name = path.to_string_lossy();
    let size = info.size.map_or(String::new(), |(width, height)| format!(", {width}×{height}"));
    let frames = info.frames.map_or(String::new(), |frames| format!(", {frames} frames"));
    let mut text = format!("{}: {}{size}{frames}\n", escape_invisible_chars(&name), info.format);
    let program = info.program.as_deref().unwrap_or("unknown (not stored in the file)");
    let mut lines = vec![("program", program)];
    lines.extend(info.settings.iter().map(|(name, value)| (name.as_str(), value.as_str())));
    let channels = info.channels.join(" ");
    if !channels.is_empty() {
        lines.push(("channels", &channels));
    }
    // Limit the width: names may be as long as the file, but format widths are limited to 65,535.
    let width = lines.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0).min(MAX_NAME_COLUMNS);
    for (name, value) in lines {
        text += &format!("  {:width$}  {}\n", escape_invisible_chars(name), escape_invisible_chars(value));
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
            let info = ImageFileInfo {
                settings: vec![(name.clone(), "value".to_owned())],
                ..ImageFileInfo::default()
            };
            let text = image_info_to_text(Path::new("a.png"), &info);
            assert!(text.contains(&format!("{name}  value\n")) || length < 40, "{length}");
            assert!(text.contains("value"), "{length}");
        }
    }
}
