//! Code shared by the tables of all shapes: the macro that defines them, and the list of mesh files.

use std::collections::HashMap;
use std::path::PathBuf;

use super::super::description::{MeshFile, Shape, Spanned};
use super::super::keys::key::TableInfo;
use super::table::TableReader;

/// The definition and the reader of a shape's table. Only meshes use the list of mesh files.
pub(crate) struct ShapeTableDefinition {
    pub(crate) info: TableInfo,
    pub(super) read: fn(&TableReader<'_>, &mut MeshFileRegistry) -> Option<Shape>,
}

/// Defines a shape's table: documentation, name, reader, and keys. The key `material` is required unless its
/// default follows the reader.
macro_rules! shape_table {
    (@material) => {
        $crate::keys::key::DefaultValue::Required("\"name\"")
    };
    (@material $default:expr) => {
        $default
    };
    (
        $(#[doc = $doc:literal])+
        $visibility:vis const $const:ident = $name:literal, $read:expr $(, material: $material:expr)?;
        $($keys:tt)*
    ) => {
        $visibility const $const: $crate::document::shape_table::ShapeTableDefinition = {
            use $crate::document::shape_table::{ShapeTableDefinition, shape_table};
            use $crate::keys::key::{
                DefaultValue, TableInfo, TableSyntax, ValueKind, doc_without_final_period, keys,
            };
            use $crate::keys::limits::Limits;

            let doc = doc_without_final_period(concat!($($doc),+));
            let info = TableInfo::new($name, TableSyntax::List, doc, keys! {
                $($keys)*
                /// The material; optional for meshes whose file has materials.
                material: ValueKind::Material, shape_table!(@material $($material)?);
                /// Name used in messages, for clicks and by `--set`.
                name: ValueKind::Text, DefaultValue::Absent;
                /// An affine transform in row-major order, with 0, 0, 0, 1 as the last row; applied after the
                /// other keys of the shape, instead of a mesh's `scale`, `rotate` and `translate`.
                matrix: ValueKind::Numbers(16, "16 numbers", Limits::Any), DefaultValue::Absent;
            });
            ShapeTableDefinition { info, read: $read }
        };
    };
}
pub(super) use shape_table;

/// The mesh files referenced so far. A file referenced through different paths is listed once per part and
/// subdivision level.
#[derive(Default)]
pub(super) struct MeshFileRegistry {
    list: Vec<MeshFile>,
    indices: HashMap<(PathBuf, Option<u32>, u32), usize>,
}

impl MeshFileRegistry {
    pub(super) fn add_file(&mut self, file: Spanned<PathBuf>, part: Option<u32>, subdivide: u32) -> usize {
        let identity = file.value.canonicalize().unwrap_or_else(|_| file.value.clone());
        *self.indices.entry((identity, part, subdivide)).or_insert_with(|| {
            let Spanned { value, span } = file;
            self.list.push(MeshFile { value, span, part, subdivide });
            self.list.len() - 1
        })
    }

    pub(super) fn into_list(self) -> Vec<MeshFile> {
        self.list
    }
}
