//! Reads `[[mesh]]` tables.

use std::collections::HashMap;
use std::path::PathBuf;

use super::super::super::description::{MeshFile, MeshReference, MeshTransform, Shape, Spanned};
use super::super::super::keys::endings::{GLTF, MESHES};
use super::super::context::Issue;
use super::super::key::TableKey;
use super::super::limits::Limits;
use super::super::table::TableReader;
use crate::math::DVec3;
use crate::math::limits::{SHORTEST, is_nonzero_but_too_short, robust_length};

/// The mesh files referenced so far. A file referenced through different paths is listed once.
#[derive(Default)]
pub(super) struct MeshFileRegistry {
    list: Vec<MeshFile>,
    indices: HashMap<(PathBuf, Option<u32>), usize>,
}

impl MeshFileRegistry {
    fn add_file(&mut self, file: Spanned<PathBuf>, part: Option<u32>) -> usize {
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

pub(super) fn read(table: &TableReader<'_>, files: &mut MeshFileRegistry) -> Option<Shape> {
    let file = table.required_key("file", "\"mesh.obj\"").existing_file(MESHES);
    let part = read_part_index(table, file.as_ref());
    let placed = read_placement(table);
    let smooth = table.optional_key("smooth").boolean().unwrap_or(true);
    let vertex_colors = table.optional_key("vertex_colors").boolean().unwrap_or(false);
    Some(Shape::Mesh(MeshReference {
        file: files.add_file(file?, part?),
        placed: placed?,
        smooth,
        vertex_colors,
    }))
}

/// Reads the index of a glTF part.
fn read_part_index(table: &TableReader<'_>, file: Option<&Spanned<PathBuf>>) -> Option<Option<u32>> {
    let key = table.optional_key("part");
    let Some(span) = key.value_span() else { return Some(None) };
    let number = key.integer(table.integer_key_range("part")).map(Some);
    let ending = file.and_then(|file| file.value.extension()).unwrap_or_default().to_ascii_lowercase();
    if file.is_some() && !GLTF.iter().any(|known| ending == *known) {
        key.context.report(Issue::error(span, "`part` needs a .glb or .gltf file"));
        return None;
    }
    number
}

/// Reads either `matrix`, or `scale`, `rotate` and `translate`.
fn read_placement(table: &TableReader<'_>) -> Option<MeshTransform> {
    let (matrix, steps) =
        (table.optional_key("matrix"), ["scale", "rotate", "translate"].map(|name| table.optional_key(name)));
    if matrix.is_present() {
        for key in &steps {
            if let Some(span) = key.key_span() {
                let message = format!("`{}` conflicts with `matrix`", key.name);
                key.context.report(Issue::error(span, message));
            }
        }
        return read_affine_matrix(&matrix);
    }
    let [scale, rotate, translate] = steps;
    Some(MeshTransform::Steps {
        scale: scale.scale_factors(table.key_limits("scale")).unwrap_or(DVec3::ONE),
        rotate: rotate.vector(Limits::Any).unwrap_or(DVec3::ZERO),
        translate: translate.vector(Limits::Any).unwrap_or(DVec3::ZERO),
    })
}

/// Minimum ratio of a matrix's determinant to the product of its column lengths. A matrix with a smaller
/// ratio is singular up to rounding.
const MIN_VOLUME_RATIO: f64 = 1e-12;

/// Reads an invertible affine transform in row-major order.
fn read_affine_matrix(key: &TableKey<'_>) -> Option<MeshTransform> {
    let numbers: [f64; 16] = key.numbers(Limits::Any, "16 numbers, row by row")?;
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
            "`matrix` makes the mesh too small",
            format!("its columns must be more than {SHORTEST:e} long"),
        );
    }
    Some(MeshTransform::Matrix { linear: [x, y, z], translate })
}
