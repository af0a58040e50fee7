//! The one definition of the keys of a scene file: names, values, units, defaults, descriptions. The reader takes its ranges and
//! words from here; the schema, `glimt explain`, completions and the pages are made from it or compared with it.

mod colors;
pub mod endings;
pub mod key;
mod lights;
pub mod limits;
mod materials;
mod render;
mod shapes;
mod singles;
mod textures;

use std::sync::LazyLock;

pub use colors::{color_bytes, color_names};
pub use key::{Default, Form, KeyInfo, Kind, TableInfo, TypeInfo, Word, WordList, words};

/// All tables, in the order in which the pages have them.
pub fn tables() -> &'static [TableInfo] {
    static TABLES: LazyLock<Vec<TableInfo>> = LazyLock::new(|| {
        let before = [render::table(), singles::CAMERA, singles::PHOTONS];
        let named = [textures::TEXTURES, materials::MATERIALS];
        let shapes = shapes::SHAPES.iter().cloned();
        let lights = [lights::LIGHT, singles::ENVIRONMENT];
        before.into_iter().chain(named).chain(shapes).chain(lights).collect()
    });
    &TABLES
}

/// The paths of all tables, types and keys, with their descriptions: `materials`, `materials.metal`, `materials.metal.roughness`.
pub fn paths() -> Vec<(String, &'static str)> {
    let mut all = Vec::new();
    for table in tables() {
        all.push((table.name.to_owned(), table.doc));
        for key in table.keys {
            all.push((format!("{}.{}", table.name, key.name), key.doc));
        }
        for kind in table.types {
            let path = format!("{}.{}", table.name, kind.name);
            all.extend(kind.keys.iter().map(|key| (format!("{path}.{}", key.name), key.doc)));
            all.push((path, kind.doc));
        }
    }
    all
}

/// The table of this name.
pub fn table(name: &str) -> Option<&'static TableInfo> {
    tables().iter().find(|table| table.name == name)
}
