//! Shapes: a file for each kind of table.

mod boxes;
mod mesh;
mod plane;
mod quad;
mod sphere;
mod triangle;

use std::path::PathBuf;

use super::super::description::{Located, Object, Shape};
use super::context::Issue;
use super::materials::Materials;
use super::table::Table;
use crate::math::DVec3;
use mesh::MeshFiles;

/// What reads the table of a shape; only meshes touch the list of files.
type Reader = fn(&Table<'_>, &mut MeshFiles) -> Option<Shape>;

/// The kinds in the order in which the description lists them.
const KINDS: [(&str, Reader); 6] = [
    ("sphere", |table, _| sphere::read(table)),
    ("quad", |table, _| quad::read(table)),
    ("plane", |table, _| plane::read(table)),
    ("box", |table, _| boxes::read(table)),
    ("triangle", |table, _| triangle::read(table)),
    ("mesh", mesh::read),
];

/// Kinds that other versions have, and what comes near.
const UNAVAILABLE: [(&str, &str); 4] = [
    ("disk", "[[disk]] is not available in this version"),
    ("cylinder", "[[cylinder]] is not available in this version"),
    ("cone", "[[cone]] is not available in this version"),
    ("torus", "[[torus]] is not available in this version"),
];

/// Every shape of the file, and the mesh files they name; no shapes if one of them is wrong.
pub(super) fn read(root: &Table<'_>, materials: &Materials) -> (Option<Vec<Object>>, Vec<Located<PathBuf>>) {
    let mut files = MeshFiles::default();
    let mut objects = Vec::new();
    for (kind, reader) in KINDS {
        for table in root.tables(kind) {
            objects.push(object(kind, &table, reader, materials, &mut files));
        }
    }
    for (kind, message) in UNAVAILABLE {
        root.unavailable(kind, message, Some("a [[mesh]] of that form can stand in for it"));
    }
    (objects.into_iter().collect(), files.into_list())
}

fn object(
    kind: &str,
    table: &Table<'_>,
    reader: Reader,
    materials: &Materials,
    files: &mut MeshFiles,
) -> Option<Object> {
    let shape = reader(table, files);
    let key = match kind {
        "mesh" => table.optional("material"),
        _ => table.required("material", "\"name\""),
    };
    let material = key.name_in(&materials.names);
    table.finish();
    if kind == "plane" && material.is_some_and(|index| materials.is_emissive(index)) {
        let issue = Issue::error(key.span()?, "an infinite plane cannot be a light")
            .label("this material has `emission`")
            .help("use a [[quad]], which has an area, or a material without emission");
        table.context.report(issue);
        return None;
    }
    if key.is_given() && material.is_none() || kind != "mesh" && material.is_none() {
        return None;
    }
    Some(Object { shape: shape?, material, span: table.span.clone() })
}

/// Whether two edges span an area: neither is 0, and the sine of the angle between them is not lost to rounding.
fn span_area(u: DVec3, v: DVec3) -> bool {
    const PARALLEL: f64 = 1e-10;
    match (u.try_normalize(), v.try_normalize()) {
        (Some(u), Some(v)) => u.cross(v).length() > PARALLEL,
        _ => false,
    }
}
