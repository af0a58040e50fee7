//! Reads shapes. Each kind has its own module.

mod boxes;
mod cone;
mod cylinder;
mod disk;
mod matrix;
mod mesh;
mod plane;
mod quad;
mod sphere;
mod torus;
mod triangle;

use std::path::Path;

use super::super::description::{MeshFile, Object, Shape};
use super::super::keys::endings::MESHES;
use super::context::Issue;
use super::limits::Limits;
use super::materials::MaterialList;
use super::table::TableReader;
use crate::math::DVec3;
use matrix::read_affine_matrix;
use mesh::MeshFileRegistry;

/// A function that reads a shape's table. Only meshes use the list of mesh files.
type ShapeReader = fn(&TableReader<'_>, &mut MeshFileRegistry) -> Option<Shape>;

/// Table name and reader for each kind of shape. [`read_objects`] sorts the objects into file order.
const KINDS: [(&str, ShapeReader); 10] = [
    ("sphere", |table, _| sphere::read(table)),
    ("quad", |table, _| quad::read(table)),
    ("plane", |table, _| plane::read(table)),
    ("box", |table, _| boxes::read(table)),
    ("triangle", |table, _| triangle::read(table)),
    ("disk", |table, _| disk::read(table)),
    ("cylinder", |table, _| cylinder::read(table)),
    ("cone", |table, _| cone::read(table)),
    ("torus", |table, _| torus::read(table)),
    ("mesh", mesh::read),
];

/// Whether `[[name]]` tables define shapes.
pub(super) fn is_shape_table_name(name: &str) -> bool {
    KINDS.iter().any(|(kind, _)| *kind == name)
}

/// Reads all shapes and collects the mesh files they reference. The list of shapes is `None` if any shape is
/// invalid.
pub(super) fn read_objects(
    root: &TableReader<'_>,
    materials: &MaterialList,
) -> (Option<Vec<Object>>, Vec<MeshFile>) {
    let mut files = MeshFileRegistry::default();
    let mut objects = Vec::new();
    let mut is_valid = true;
    for (kind, reader) in KINDS {
        for table in root.tables(kind) {
            match read_object(kind, &table, reader, materials, &mut files) {
                Some(object) => objects.push(object),
                None => is_valid = false,
            }
        }
    }
    objects.sort_by_key(|object| object.span.start);
    (is_valid.then_some(objects), files.into_list())
}

fn read_object(
    kind: &str,
    table: &TableReader<'_>,
    reader: ShapeReader,
    materials: &MaterialList,
    files: &mut MeshFileRegistry,
) -> Option<Object> {
    let shape = reader(table, files);
    let matrix = table.optional_key("matrix");
    // The mesh reader has already read the matrix.
    let matrix =
        if kind == "mesh" || !matrix.is_present() { None } else { Some(read_affine_matrix(&matrix)) };
    let key = match kind {
        "mesh" => table.optional_key("material"),
        _ => table.required_key("material", "\"name\""),
    };
    let material = key.index_by_name(&materials.names);
    let name = table.optional_key("name").optional_shape_name();
    table.report_unknown_and_missing_keys();
    if kind == "plane" && material.is_some_and(|index| materials.is_emissive(index)) {
        let issue = Issue::error(key.value_span()?, "an infinite plane cannot emit light")
            .with_label("this material has `emission`")
            .with_help("use a [[quad]] or a material without emission");
        table.context.report(issue);
        return None;
    }
    if key.is_present() && material.is_none() || kind != "mesh" && material.is_none() {
        return None;
    }
    let shape = match matrix {
        Some(matrix) => shape?.transformed(matrix?),
        None => shape?,
    };
    Some(Object { shape, material, name: name?, span: table.span.clone() })
}

/// Reads a direction of any nonzero length. Error messages call the shape or light `what`.
pub(super) fn read_unnormalized_direction(
    table: &TableReader<'_>,
    name: &'static str,
    what: &str,
    default: DVec3,
) -> Option<DVec3> {
    let key = table.optional_key(name);
    let direction = key.vector_or(Limits::Any, default)?;
    if !key.check_vector_zero_or_long_enough(direction) {
        return None;
    }
    if direction == DVec3::ZERO {
        let issue = Issue::error(key.value_span()?, format!("the {what} has no direction"))
            .with_label(format!("`{name}` has length 0"))
            .with_help("use any nonzero vector, such as [0, 1, 0] for up");
        table.context.report(issue);
        return None;
    }
    Some(direction)
}

/// Reads both ends of an axis. The defaults are (0, 0, 0) and (0, 1, 0).
fn read_axis_ends(table: &TableReader<'_>, names: [&'static str; 2], what: &str) -> Option<[DVec3; 2]> {
    let keys = names.map(|name| table.optional_key(name));
    let (first, second) =
        (keys[0].vector_or(Limits::Any, DVec3::ZERO), keys[1].vector_or(Limits::Any, DVec3::Y));
    let (first, second) = (first?, second?);
    if !keys[0].check_points_equal_or_far_apart(first, &keys[1], second) {
        return None;
    }
    if first == second {
        let span = keys[1].value_span().or_else(|| keys[0].value_span())?;
        let [from, to] = names;
        let issue = Issue::error(span, format!("the {what} has no length"))
            .with_label(format!("`{from}` and `{to}` are the same point"))
            .with_help(format!("the defaults are `{from} = [0, 0, 0]` and `{to} = [0, 1, 0]`"));
        table.context.report(issue);
        return None;
    }
    Some([first, second])
}

/// Reads a length, or returns the default if the key is absent.
fn read_length(table: &TableReader<'_>, name: &'static str, default: f64) -> Option<f64> {
    let key = table.optional_key(name);
    if key.is_present() { key.number(table.key_limits(name)) } else { Some(default) }
}

/// Whether two edges span an area: both are nonzero, and the sine of the angle between them is larger than
/// rounding errors.
fn edges_span_area(u: DVec3, v: DVec3) -> bool {
    const MIN_SINE: f64 = 1e-10;
    match (u.try_normalize(), v.try_normalize()) {
        (Some(u), Some(v)) => u.cross(v).length() > MIN_SINE,
        _ => false,
    }
}

/// Whether a file has a mesh extension.
pub(crate) fn has_mesh_extension(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    MESHES.iter().any(|known| *known == ending)
}
