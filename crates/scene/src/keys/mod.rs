//! The vocabulary of scene key definitions: names, types, units, ranges, defaults and descriptions.
//!
//! Each table is defined once, next to its reader in `document/`. The reader takes ranges and defaults from
//! the definition, and the schema, `glimt explain` and completions are generated from it. A test compares the
//! documentation with the definitions.

pub(crate) mod colors;
pub mod endings;
pub mod key;
pub mod limits;

use std::sync::LazyLock;

use super::document::camera::CAMERA;
use super::document::environment::ENVIRONMENT;
use super::document::groups::{GROUPS, object_table_infos};
use super::document::lights::LIGHT;
use super::document::materials::MATERIALS;
use super::document::photons::PHOTONS;
use super::document::render::RENDER;
use super::document::textures::TEXTURES;
pub use colors::{color_names, parse_hex_or_named_srgb8};
pub use key::{
    ChoiceValue, ChoiceValuesFn, DefaultValue, KeyInfo, TableInfo, TableSyntax, TableTypeInfo, ValueKind,
    choice_values,
};

/// Returns all tables, in the same order as in the documentation.
pub fn all_tables() -> &'static [TableInfo] {
    static TABLES: LazyLock<Vec<TableInfo>> = LazyLock::new(|| {
        let before = [&RENDER, &CAMERA, &PHOTONS, &TEXTURES, &MATERIALS];
        let after = [&GROUPS, &LIGHT, &ENVIRONMENT];
        before.into_iter().chain(object_table_infos()).chain(after).cloned().collect()
    });
    &TABLES
}

/// Returns the paths and descriptions of all tables, types and keys, such as `materials`, `materials.metal`
/// and `materials.metal.roughness`.
pub fn all_paths_with_descriptions() -> Vec<(String, &'static str)> {
    let mut all = Vec::new();
    for table in all_tables() {
        all.push((table.name.to_owned(), table.doc));
        for key in table.keys {
            let path = format!("{}.{}", table.name, key.name);
            let inner = key.kind.inner_keys().iter();
            all.extend(inner.map(|inner| (format!("{path}.{}", inner.name), inner.doc)));
            all.push((path, key.doc));
        }
        for kind in table.types {
            let path = format!("{}.{}", table.name, kind.name);
            all.extend(kind.keys.iter().map(|key| (format!("{path}.{}", key.name), key.doc)));
            all.push((path, kind.doc));
        }
    }
    all
}

/// Returns the table with this name.
pub fn find_table(name: &str) -> Option<&'static TableInfo> {
    all_tables().iter().find(|table| table.name == name)
}

/// Returns the key `name` of a table without types.
pub fn find_key_in_table(table: &str, name: &str) -> Option<&'static KeyInfo> {
    find_table(table)?.keys.iter().find(|key| key.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostic::Severity;
    use crate::parse;

    /// Returns the keys and values that a table needs in addition to `key`.
    fn other_keys(table: &str, kind: &str, key: &str) -> Vec<(String, String)> {
        let fixed: &[(&str, &str)] = match (table, kind, key) {
            ("materials", "metal", "color" | "element") => &[],
            ("materials", "metal", "eta") => &[("k", "[3, 2, 1]")],
            ("materials", "metal", "k") => &[("eta", "[0.2, 0.9, 1.1]")],
            ("materials", "metal", _) => &[("element", "\"gold\"")],
            ("camera", _, "orbiter") => &[],
            ("camera", _, "view_height") => {
                &[("position", "[0, 1, 4]"), ("look_at", "[0, 1, 0]"), ("projection", "\"orthographic\"")]
            }
            ("camera", ..) => &[("position", "[0, 1, 4]"), ("look_at", "[0, 1, 0]")],
            ("textures", _, "image") | ("mesh", _, "part") => &[("file", "\"model.glb\"")],
            _ => &[],
        };
        let pair = |(name, value): (&str, &str)| (name.to_owned(), value.to_owned());
        let required = super::find_table(table)
            .into_iter()
            .flat_map(|info| info.keys_for_type(info.find_type_or_default(Some(kind))));
        let required =
            required.filter(|info| table != "camera" && matches!(info.default, DefaultValue::Required(_)));
        let required = required.map(|info| (info.name.to_owned(), info.default_or_example()));
        let fixed: Vec<_> = fixed.iter().copied().map(pair).collect();
        let is_other =
            |all: &[(String, String)], name: &str| name != key && all.iter().all(|(one, _)| one != name);
        let required: Vec<_> = required.filter(|(name, _)| is_other(&fixed, name)).collect();
        fixed.into_iter().filter(|(name, _)| name != key).chain(required).collect()
    }

    /// Returns a scene in which a key is set to its example value.
    fn with_example(info: &TableInfo, kind: Option<&TableTypeInfo>, key: &KeyInfo) -> String {
        let mut text = String::new();
        for (table, body) in [
            ("camera", "[camera]\nposition = [0, 1, 4]\nlook_at = [0, 1, 0]\n"),
            ("", "[textures.name]\nfile = \"a.png\"\n[groups.name]\n"),
            ("", "[materials.name]\n[materials.paint]\n[materials.rust]\n"),
        ] {
            if table != info.name {
                text.push_str(body);
            }
        }
        text.push_str(&info.header().replace("NAME", "other"));
        if let Some(kind) = kind {
            text.push_str(&format!("\ntype = \"{}\"", kind.name));
        }
        text.push_str(&format!("\n{} = {}\n", key.name, key.default_or_example()));
        for (name, value) in other_keys(info.name, kind.map_or("", |kind| kind.name), key.name) {
            text.push_str(&format!("{name} = {value}\n"));
        }
        text
    }

    #[test]
    fn every_example_is_accepted() {
        let (mut refused, folder) = (Vec::new(), tempfile::tempdir().expect("a folder"));
        for info in all_tables() {
            let kinds: Vec<_> = match info.types {
                [] => vec![None],
                types => types.iter().map(Some).collect(),
            };
            for kind in kinds {
                for key in info.keys_for_type(kind) {
                    // Solid glass has no opacity and no coat. A blend has only its own keys.
                    let is_refused = match kind.map(|kind| (kind.name, kind.keys)) {
                        Some(("glass", _)) => ["opacity", "coat"].iter().any(|one| key.name.starts_with(one)),
                        Some(("blend", own)) => own.iter().all(|one| one.name != key.name),
                        Some(_) | None => false,
                    };
                    if is_refused {
                        continue;
                    }
                    let text = with_example(info, kind, key);
                    for name in text.split('"').skip(1).step_by(2).filter(|name| name.contains('.')) {
                        std::fs::write(folder.path().join(name), "").expect("a file");
                    }
                    let found = parse(text.as_str().into(), &folder.path().join("a.toml")).diagnostics;
                    refused.extend(
                        found
                            .iter()
                            .filter(|one| one.severity == Severity::Error)
                            .map(|one| format!("{}\n{text}", one.message)),
                    );
                }
            }
        }
        assert!(refused.is_empty(), "{}", refused.join("\n"));
    }
}
