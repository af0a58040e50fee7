//! Values that shells offer for arguments: files by their endings, and the keys of `--set`.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use clap_complete::engine::{ArgValueCompleter, CompletionCandidate, PathCompleter};

use crate::scene::keys::key::{Form, KeyInfo, Kind};
use crate::scene::keys::{paths, tables};
use crate::scene::outline::{OutlineTable, outline};
use crate::scene::{is_mesh, text_now};

/// Completes scenes.
pub(in crate::cli) fn scenes() -> ArgValueCompleter {
    ArgValueCompleter::new(PathCompleter::file().filter(is_scene))
}

/// Completes scenes and models.
pub(in crate::cli) fn scenes_and_models() -> ArgValueCompleter {
    ArgValueCompleter::new(PathCompleter::file().filter(|path| is_scene(path) || is_mesh(path)))
}

/// Completes glTF files.
pub(in crate::cli) fn importable() -> ArgValueCompleter {
    let has = |path: &Path, ending: &str| path.extension().is_some_and(|is| is.eq_ignore_ascii_case(ending));
    ArgValueCompleter::new(PathCompleter::file().filter(move |path| has(path, "glb") || has(path, "gltf")))
}

fn is_scene(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// Completes `TABLE.KEY=VALUE`: the keys of the scene that is named before it, else of every table that each scene may have.
pub(in crate::cli) fn sets() -> ArgValueCompleter {
    ArgValueCompleter::new(|current: &OsStr| {
        let Some(current) = current.to_str() else { return Vec::new() };
        let scene = std::env::args_os().map(PathBuf::from).find(|word| is_scene(word));
        let text = scene.and_then(|scene| text_now(&scene).ok());
        candidates(text.as_deref().unwrap_or_default(), current)
    })
}

/// Completes the paths of keys, as `glimt explain` takes them.
pub(in crate::cli) fn keys() -> ArgValueCompleter {
    ArgValueCompleter::new(|current: &OsStr| {
        let Some(current) = current.to_str() else { return Vec::new() };
        let all = paths().into_iter().filter(|(path, _)| path.starts_with(current));
        all.map(|(path, doc)| CompletionCandidate::new(path).help(Some(doc.replace('`', "").into())))
            .collect()
    })
}

/// The candidates for what is typed so far, in a scene of this text.
fn candidates(text: &str, typed: &str) -> Vec<CompletionCandidate> {
    /// Nobody reads on from here.
    const MOST: usize = 2000;
    let outline = outline(text);
    let singles = tables().iter().filter(|table| table.form == Form::Single);
    let absent = singles.filter(|info| !outline.iter().any(|table| table.info.name == info.name));
    let of_absent = absent.flat_map(|info| info.keys.iter().map(|key| (info.name.to_owned(), key)));
    let of = |table: &OutlineTable| {
        let paths = table.paths();
        let known = table.known();
        paths.into_iter().flat_map(move |path| known.clone().into_iter().map(move |key| (path.clone(), key)))
    };
    let keys = outline.iter().flat_map(of).chain(of_absent);
    keys.flat_map(|(path, key)| of_key(&format!("{path}.{}=", key.name), key, typed)).take(MOST).collect()
}

/// The candidates for one key: itself, or once its `=` is there, its values as far as they are few.
fn of_key(path: &str, key: &KeyInfo, typed: &str) -> Vec<CompletionCandidate> {
    let help = |text: &str| Some(text.replace('`', "").into());
    if path.starts_with(typed) && path != typed {
        return vec![CompletionCandidate::new(path).help(help(key.doc))];
    }
    let Some(begun) = typed.strip_prefix(path) else { return Vec::new() };
    let values: Vec<(String, String)> = match key.kind {
        Kind::Words(list) => {
            list().iter().map(|word| (word.name.to_owned(), word.meaning.to_owned())).collect()
        }
        Kind::Flag => ["true", "false"].map(|flag| (flag.to_owned(), String::new())).to_vec(),
        Kind::Whole(..)
        | Kind::Number(_)
        | Kind::Text
        | Kind::File(_)
        | Kind::Color(_)
        | Kind::ColorOrTexture(_)
        | Kind::Emission(_)
        | Kind::NumberOrTexture(_)
        | Kind::Numbers(..)
        | Kind::Scale(_)
        | Kind::Texture
        | Kind::Heights
        | Kind::Material => Vec::new(),
    };
    let fitting = values.into_iter().filter(|(value, _)| value.starts_with(begun));
    fitting.map(|(value, doc)| CompletionCandidate::new(format!("{path}{value}")).help(help(&doc))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(text: &str, typed: &str) -> Vec<String> {
        let all = candidates(text, typed);
        all.iter().map(|one| one.get_value().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn keys_are_those_of_the_scene() {
        let text = "[materials.wall]\ntype = \"mirror\"\n[[sphere]]\nname = \"ball\"\n";
        let mirror = values(text, "materials.wall.ref");
        assert_eq!(mirror, ["materials.wall.reflectance="]);
        assert_eq!(values(text, "materials.wall.diff"), [""; 0]);
        assert_eq!(values(text, "sphere.1.r"), ["sphere.1.radius="]);
        assert_eq!(
            values(text, "sphere.b"),
            ["center", "radius", "material", "name"].map(|key| format!("sphere.ball.{key}="))
        );
        assert_eq!(values("", "render.sam"), ["render.samples="]);
        assert_eq!(values("", "sphere"), [""; 0]);
    }

    #[test]
    fn values_are_offered_once_the_key_is_there() {
        assert_eq!(values("", "render.integrator="), ["render.integrator=whitted", "render.integrator=path"]);
        assert_eq!(values("", "photons.enabled=t"), ["photons.enabled=true"]);
        assert_eq!(values("", "render.width="), [""; 0]);
    }
}
