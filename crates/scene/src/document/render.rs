//! Reads the `[render]` table.

use std::path::PathBuf;

use super::super::description::{MAX_BOUNCES, RenderOptions, render_keys};
use super::super::keys::endings::IMAGES;
use super::context::Issue;
use super::limits::Limits;
use super::table::TableReader;

const MAX_PIXELS: u64 = 1 << 30;

macro_rules! read {
    ($key:expr, whole($least:expr, $most:expr)) => {
        $key.integer(i128::from($least)..=i128::from($most))
    };
    ($key:expr, at_least($least:expr)) => {
        $key.number_f32(Limits::AtLeast($least))
    };
    ($key:expr, between($least:expr, $most:expr)) => {
        $key.number_f32(Limits::Between($least, $most))
    };
    ($key:expr, choice) => {
        $key.choice()
    };
    ($key:expr, color) => {
        $key.color()
    };
}

macro_rules! reader {
    ($(
        $(#[doc = $doc:literal])* $name:ident: $type:ty = $default:expr, $range:ident $(($($limit:expr),*))?, $unit:literal, $change:ident;
    )*) => {
        /// Reads all keys. Absent and invalid keys have their default values.
        fn read_render_options(table: &TableReader<'_>) -> RenderOptions {
            let key = |name| table.optional_key(name);
            RenderOptions {
                $($name: read!(key(stringify!($name)), $range $(($($limit),*))?).unwrap_or(RenderOptions::DEFAULT.$name),)*
            }
        }
    };
}

render_keys!(reader);

/// Reads the settings and the optional output path.
pub(super) fn read_render_table(root: &TableReader<'_>) -> (Option<RenderOptions>, Option<PathBuf>) {
    let Some(table) = root.table("render") else { return (Some(RenderOptions::DEFAULT), None) };
    let render = read_render_options(&table);
    let output = read_output_path(&table);
    check_image_size(&table, &render);
    table.report_unknown_and_missing_keys();
    (Some(render), output)
}

fn read_output_path(table: &TableReader<'_>) -> Option<PathBuf> {
    let key = table.optional_key("output");
    let text = key.string("an image path, such as \"image.png\"")?;
    key.check_extension(text, IMAGES).then(|| table.context.resolve_path(text))
}

fn check_image_size(table: &TableReader<'_>, render: &RenderOptions) {
    let RenderOptions { width, height, .. } = *render;
    let spans = || table.optional_key("width").value_span().or(table.optional_key("height").value_span());
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        let issue =
            Issue::error(spans().unwrap_or_default(), format!("{width} × {height} pixels are too many"))
                .with_help(format!("the limit is {MAX_PIXELS} pixels"));
        table.context.report(issue);
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::super::description::{KeyRange, RenderOptions};
    use super::super::super::{ParseOutcome, parse, starter_scene};

    /// Parses a scene with `line` in `[render]`. Returns the settings or the error messages.
    fn read(line: &str) -> Result<RenderOptions, Vec<String>> {
        let camera = "[camera]\nposition = [0, 0, 4]\nlook_at = [0, 0, 0]\n";
        let ParseOutcome { scene, diagnostics, .. } =
            parse(format!("[render]\n{line}\n{camera}").into(), Path::new("a.toml"));
        scene.map(|scene| scene.render).ok_or(diagnostics.into_iter().map(|one| one.message).collect())
    }

    #[test]
    fn every_key_accepts_its_default() {
        assert_eq!(read(""), Ok(RenderOptions::DEFAULT));
        for key in RenderOptions::key_specs() {
            let line = format!("{} = {}", key.name, key.default);
            assert_eq!(read(&line), Ok(RenderOptions::DEFAULT), "{line}");
        }
    }

    #[test]
    fn every_key_accepts_exactly_its_range() {
        for key in RenderOptions::key_specs() {
            let (name, mut accepted, mut refused) = (key.name, Vec::new(), Vec::new());
            match key.range {
                KeyRange::Whole(range) => {
                    accepted.extend([range.start().to_string(), range.end().to_string()]);
                    refused.push((i64::from(*range.start()) - 1).to_string());
                    refused.push((i64::from(*range.end()) + 1).to_string());
                }
                KeyRange::Number(range) => {
                    accepted.extend([range.start(), range.end()].map(|end| format!("{end:?}")));
                    refused.push(format!("{:?}", range.start() - 0.001));
                    refused.push(format!("{:?}", range.end() * 1.001));
                }
                KeyRange::Names(names) => {
                    accepted.extend(names.into_iter().map(|name| format!("\"{name}\"")));
                    refused.push("\"another\"".to_owned());
                }
                KeyRange::Color => {
                    accepted.push("[0.5, 2, 0]".to_owned());
                    refused.push("[0.5, -2, 0]".to_owned());
                }
            }
            for value in accepted {
                // Keep the number of pixels within the limit.
                let other = match name {
                    "width" => "height = 1\n",
                    "height" => "width = 1\n",
                    _ => "",
                };
                assert!(read(&format!("{other}{name} = {value}")).is_ok(), "{name} = {value}");
            }
            for value in refused {
                assert!(read(&format!("{name} = {value}")).is_err(), "{name} = {value}");
            }
        }
    }

    #[test]
    fn starter_scene_shows_every_key_and_choice() {
        let table = starter_scene().split("[camera]").next().unwrap_or_default();
        for key in RenderOptions::key_specs() {
            let shown = |line: &&str| line.trim_start_matches("# ").starts_with(&format!("{} = ", key.name));
            let line = table.lines().find(shown).unwrap_or_else(|| panic!("no line for `{}`", key.name));
            if let KeyRange::Names(names) = key.range {
                for name in names {
                    assert!(line.contains(&format!("\"{name}\"")), "{name}: {line}");
                }
            }
        }
    }
}
