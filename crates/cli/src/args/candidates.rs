//! Completion candidates for arguments: files by extension, and keys for `--set`.

use std::ffi::{OsStr, OsString};
use std::path::PathBuf;
use std::sync::OnceLock;

use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter};

use crate::pipeline::{has_foreign_extension, has_importable_extension, has_model_extension};
use crate::scene::keys::key::{KeyInfo, TableSyntax, ValueKind};
use crate::scene::keys::{all_paths_with_descriptions, all_tables, color_names};
use crate::scene::outline::{OutlineTable, document_outline};
use crate::scene::{has_toml_extension, read_scene_file_text};

/// The command line being completed, split into words, if the shell script does not pass it as arguments.
static WORDS: OnceLock<Vec<OsString>> = OnceLock::new();

/// Stores the words of the command line for completers that depend on other arguments.
pub(crate) fn store_command_line(words: &[OsString]) {
    WORDS.get_or_init(|| words.to_vec());
}

/// Returns the words of the command line being completed.
fn command_line_words() -> Vec<OsString> {
    WORDS.get().cloned().unwrap_or_else(|| std::env::args_os().collect())
}

/// Completes scenes.
pub(crate) fn scene_completer() -> ArgValueCompleter {
    ArgValueCompleter::new(PathCompleter::file().filter(has_toml_extension))
}

/// Completes glimt scenes and scenes from other renderers.
pub(crate) fn any_scene_completer() -> ArgValueCompleter {
    let is_scene = |path: &std::path::Path| {
        has_toml_extension(path) || has_foreign_extension(path) && !has_model_extension(path)
    };
    ArgValueCompleter::new(PathCompleter::file().filter(is_scene))
}

/// Completes glimt scenes, scenes of other renderers, and models.
pub(crate) fn scene_or_model_completer() -> ArgValueCompleter {
    ArgValueCompleter::new(
        PathCompleter::file().filter(|path| has_toml_extension(path) || has_foreign_extension(path)),
    )
}

/// Completes files that `import` accepts.
pub(crate) fn import_completer() -> ArgValueCompleter {
    ArgValueCompleter::new(PathCompleter::file().filter(has_importable_extension))
}

/// Completes `TABLE.KEY=VALUE` with keys from the scene on the command line. Without a scene, completes keys
/// from the tables that every scene has.
pub(crate) fn key_assignment_completer() -> ArgValueCompleter {
    ArgValueCompleter::new(|current: &OsStr| {
        let Some(current) = current.to_str() else { return Vec::new() };
        let scene = command_line_words().into_iter().map(PathBuf::from).find(|word| has_toml_extension(word));
        let text = scene.and_then(|scene| read_scene_file_text(&scene).ok());
        key_assignment_candidates(text.as_deref().unwrap_or_default(), current)
    })
}

/// Completes key paths for `glimt explain`.
pub(crate) fn explain_path_completer() -> ArgValueCompleter {
    ArgValueCompleter::new(|current: &OsStr| {
        let Some(current) = current.to_str() else { return Vec::new() };
        let all = all_paths_with_descriptions().into_iter().filter(|(path, _)| path.starts_with(current));
        all.map(|(path, doc)| CompletionCandidate::new(path).help(Some(doc.replace('`', "").into())))
            .collect()
    })
}

/// Returns candidates that start with `typed`, for a scene whose source is `text`.
fn key_assignment_candidates(text: &str, typed: &str) -> Vec<CompletionCandidate> {
    /// Maximum number of candidates.
    const MAX_CANDIDATES: usize = 2000;
    let outline = document_outline(text);
    let singles = all_tables().iter().filter(|table| table.form == TableSyntax::Single);
    let absent = singles.filter(|info| !outline.iter().any(|table| table.info.name == info.name));
    let of_absent = absent.flat_map(|info| info.keys.iter().map(|key| (info.name.to_owned(), key)));
    let of = |table: &OutlineTable| {
        let paths = table.override_key_prefixes();
        let known = table.keys_allowed_for_type();
        paths.into_iter().flat_map(move |path| known.clone().into_iter().map(move |key| (path.clone(), key)))
    };
    let with_inner_keys = |(path, key): (String, &'static KeyInfo)| {
        let inner_path = format!("{path}.{}", key.name);
        let inner = key.kind.inner_keys().iter().map(move |inner| (inner_path.clone(), inner));
        std::iter::once((path, key)).chain(inner)
    };
    let keys = outline.iter().flat_map(of).chain(of_absent).flat_map(with_inner_keys);
    let of_key = |(path, key): (String, &'static KeyInfo)| {
        key_or_value_candidates(&format!("{path}.{}=", key.name), key.doc, typed, || {
            completion_values_for_kind(key.kind, &outline)
        })
    };
    let of_type = |table: &OutlineTable| {
        let types = table.info.types.iter().map(|kind| (kind.name.to_owned(), kind.doc));
        let types: Vec<DescribedValue> = types.collect();
        let paths = if types.is_empty() { Vec::new() } else { table.override_key_prefixes() };
        let of_path = |path: String| {
            key_or_value_candidates(&format!("{path}.type="), "The type", typed, || types.clone())
        };
        paths.into_iter().flat_map(of_path).collect::<Vec<_>>()
    };
    keys.flat_map(of_key).chain(outline.iter().flat_map(of_type)).take(MAX_CANDIDATES).collect()
}

/// A value and its description.
type DescribedValue = (String, &'static str);

/// Returns candidates for `path`, which ends with `=`: the path itself or, once it is fully typed, its
/// values.
fn key_or_value_candidates(
    path: &str,
    doc: &str,
    typed: &str,
    values: impl FnOnce() -> Vec<DescribedValue>,
) -> Vec<CompletionCandidate> {
    let help = |text: &str| Some(text.replace('`', "").into());
    if path.starts_with(typed) && path != typed {
        return vec![CompletionCandidate::new(path).help(help(doc))];
    }
    let Some(begun) = typed.strip_prefix(path) else { return Vec::new() };
    let fitting = values().into_iter().filter(|(value, _)| value.starts_with(begun));
    fitting.map(|(value, doc)| CompletionCandidate::new(format!("{path}{value}")).help(help(doc))).collect()
}

/// Returns the named values for a key of type `kind`: keywords, colors, or names of tables in `outline`.
fn completion_values_for_kind(kind: ValueKind, outline: &[OutlineTable]) -> Vec<DescribedValue> {
    let plain = |value: &str| (value.to_owned(), "");
    match kind {
        ValueKind::Words(list) => list().iter().map(|word| (word.name.to_owned(), word.meaning)).collect(),
        ValueKind::Flag => ["true", "false"].map(plain).to_vec(),
        ValueKind::Color(_) | ValueKind::ColorOrTexture(_) | ValueKind::Emission(_) => {
            color_names().map(plain).collect()
        }
        ValueKind::Texture | ValueKind::Heights | ValueKind::Material | ValueKind::Group => {
            let named = outline.iter().filter(|table| Some(table.info.name) == kind.defining_table());
            named.filter_map(|table| table.name.as_ref()).map(|name| plain(&name.text)).collect()
        }
        ValueKind::Whole(..)
        | ValueKind::Number(_)
        | ValueKind::Text
        | ValueKind::File(_)
        | ValueKind::ColorPair(_)
        | ValueKind::NumberOrTexture(_)
        | ValueKind::Numbers(..)
        | ValueKind::Scale(_)
        | ValueKind::Rotation
        | ValueKind::InlineTable(_)
        | ValueKind::MaterialPair => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offered(text: &str, typed: &str) -> Vec<String> {
        let all = key_assignment_candidates(text, typed);
        all.iter().map(|one| one.get_value().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn set_completes_scene_keys() {
        let text = "[materials.wall]\ntype = \"mirror\"\n[[sphere]]\nname = \"ball\"\n";
        let mirror = offered(text, "materials.wall.ref");
        assert_eq!(mirror, ["materials.wall.reflectance="]);
        assert_eq!(offered(text, "materials.wall.diff"), [""; 0]);
        assert_eq!(offered(text, "sphere.1.r"), ["sphere.1.radius="]);
        assert_eq!(
            offered(text, "sphere.b"),
            ["center", "radius", "material", "name", "matrix"].map(|key| format!("sphere.ball.{key}="))
        );
        let text = "[[groups.bar.instance]]\n[groups.stool]\n";
        assert_eq!(offered(text, "groups.bar.instance.1.tr"), ["groups.bar.instance.1.translate="]);
        assert_eq!(offered(text, "groups.bar.instance.1.group=s"), ["groups.bar.instance.1.group=stool"]);
        assert_eq!(offered("", "render.sam"), ["render.samples="]);
        assert_eq!(offered("", "sphere"), [""; 0]);
    }

    #[test]
    fn set_completes_key_values() {
        assert_eq!(
            offered("", "render.integrator="),
            ["render.integrator=whitted", "render.integrator=path"]
        );
        assert_eq!(offered("", "photons.enabled=t"), ["photons.enabled=true"]);
        assert_eq!(offered("", "render.width="), [""; 0]);
        let text = "[materials.wall]\n[materials.floor]\n[[sphere]]\n";
        assert_eq!(offered(text, "sphere.1.material=w"), ["sphere.1.material=wall"]);
        assert_eq!(offered(text, "materials.wall.diffuse=tom"), ["materials.wall.diffuse=tomato"]);
        assert_eq!(offered(text, "materials.wall.t"), ["materials.wall.type="]);
        assert_eq!(offered(text, "materials.wall.type=mi"), ["materials.wall.type=mirror"]);
    }
}
