//! Code shared by the tables of all shapes: the macro that defines them, the list of mesh files, and the key
//! `matrix`.

use std::collections::HashMap;
use std::path::PathBuf;

use super::super::description::{AffineMap, MeshFile, Shape, Spanned};
use super::super::keys::key::TableInfo;
use super::context::Issue;
use super::key::KeyInTable;
use super::table::TableReader;
use crate::math::DVec3;
use crate::math::limits::{SHORTEST, is_nonzero_but_too_short, robust_length};

/// The definition and the reader of a shape's table. Only meshes use the list of mesh files.
pub(crate) struct ShapeTable {
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
        $visibility const $const: $crate::document::shape_table::ShapeTable = {
            use $crate::document::shape_table::{ShapeTable, shape_table};
            use $crate::keys::key::{DefaultValue, TableInfo, TableSyntax, ValueKind, doc_text, keys};
            use $crate::keys::limits::Limits;

            let doc = doc_text(concat!($($doc),+));
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
            ShapeTable { info, read: $read }
        };
    };
}
pub(super) use shape_table;

/// The mesh files referenced so far. A file referenced through different paths is listed once.
#[derive(Default)]
pub(super) struct MeshFileRegistry {
    list: Vec<MeshFile>,
    indices: HashMap<(PathBuf, Option<u32>), usize>,
}

impl MeshFileRegistry {
    pub(super) fn add_file(&mut self, file: Spanned<PathBuf>, part: Option<u32>) -> usize {
        let identity = file.value.canonicalize().unwrap_or_else(|_| file.value.clone());
        *self.indices.entry((identity, part)).or_insert_with(|| {
            let Spanned { value, span } = file;
            self.list.push(MeshFile { value, span, part });
            self.list.len() - 1
        })
    }

    pub(super) fn into_list(self) -> Vec<MeshFile> {
        self.list
    }
}

/// Minimum ratio of a matrix's determinant to the product of its column lengths. A matrix with a smaller
/// ratio is singular up to rounding.
const MIN_VOLUME_RATIO: f64 = 1e-12;

/// Reads an invertible affine transform in row-major order.
pub(super) fn read_affine_matrix(key: &KeyInTable<'_>) -> Option<AffineMap> {
    let numbers: [f64; 16] = key.numbers("16 numbers, row by row")?;
    let [x, y, z, translate] =
        std::array::from_fn(|column| DVec3::from_array(std::array::from_fn(|row| numbers[4 * row + column])));
    let wrong = |message: &str, label: String| {
        key.context.report(Issue::error(key.value_span().unwrap_or_default(), message).with_label(label));
        None
    };
    if numbers[12..] != [0.0, 0.0, 0.0, 1.0] {
        let [a, b, c, d] = [12, 13, 14, 15].map(|place| numbers[place]);
        return wrong("the last row of `matrix` must be 0, 0, 0, 1", format!("it is {a}, {b}, {c}, {d}"));
    }
    let (volume, edges) = (x.cross(y).dot(z), x.length() * y.length() * z.length());
    if !(volume.abs() > MIN_VOLUME_RATIO * edges) {
        return wrong("`matrix` is not invertible", format!("its determinant is {volume:e}"));
    }
    if [x, y, z].iter().any(|axis| is_nonzero_but_too_short(robust_length(*axis))) {
        return wrong(
            "`matrix` makes the shape too small",
            format!("its columns must be more than {SHORTEST:e} long"),
        );
    }
    Some(AffineMap { linear: [x, y, z], translate })
}
