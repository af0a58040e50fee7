//! The one definition of the keys of a scene file: names, values, units, defaults, descriptions. The reader takes its ranges and
//! words from here; the schema, `glimt explain`, completions and the pages are made from it or compared with it.

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

/// The table of this name.
pub fn table(name: &str) -> Option<&'static TableInfo> {
    tables().iter().find(|table| table.name == name)
}
