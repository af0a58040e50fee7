//! The `[[mesh]]` tables.

use std::path::PathBuf;

use super::super::description::{MeshReference, Shape, Spanned};
use super::super::keys::endings::{MESHES, PARTS};
use super::super::keys::key::DefaultValue::{Absent, By, Is, Required};
use super::super::keys::key::ValueKind::{File, Flag, Numbers, Scale, Whole};
use super::super::keys::key::{ANGLES, MAX_INTEGER};
use super::context::Issue;
use super::limits::Limits::{Any, NotZero};
use super::shape_table::{MeshFileRegistry, shape_table};
use super::table::TableReader;
use super::transform::read_transform;

shape_table! {
    /// A triangle mesh from a file.
    pub(super) const MESH = "mesh", read_mesh, material: By("the file's");
    /// An OBJ (with MTL), OFF, PLY, STL, Mitsuba (.serialized) or glTF (.glb, .gltf) file; the extension
    /// determines the format.
    file: File(MESHES), Required("\"mesh.obj\"");
    /// Index of a primitive in a glTF file, counted across all meshes, or of a mesh in a .serialized file.
    /// Without this key, the mesh is the file's whole scene.
    part: Whole(0, MAX_INTEGER), Absent;
    /// Number of levels of Loop subdivision. Each level splits every triangle into four; vertices are moved
    /// to the smooth limit surface.
    subdivide: Whole(0, 6), Is("0");
    /// Scale, applied first.
    scale: Scale(NotZero), Is("1.0");
    /// Rotation about x, then y, then z.
    rotate: ANGLES, Is("[0, 0, 0]"), "degrees";
    /// Translation, applied last.
    translate: Numbers(3, "three numbers", Any), Is("[0, 0, 0]"), "length";
    /// Whether vertex normals are interpolated; glimt computes them if the file has none.
    smooth: Flag, Is("true");
    /// Whether vertex colors multiply the material's color.
    vertex_colors: Flag, Is("false");
}

fn read_mesh(table: &TableReader<'_>, files: &mut MeshFileRegistry) -> Option<Shape> {
    let file = table.key("file").existing_file();
    let part = read_part_index(table, file.as_ref());
    let subdivide = table.key("subdivide").integer();
    let placed = read_transform(table);
    let (smooth, vertex_colors) = (table.key("smooth").boolean(), table.key("vertex_colors").boolean());
    let (file, placed) = (files.add_file(file?, part?, subdivide?), placed?);
    Some(Shape::Mesh(MeshReference { file, placed, smooth: smooth?, vertex_colors: vertex_colors? }))
}

/// Reads the index of a glTF part.
fn read_part_index(table: &TableReader<'_>, file: Option<&Spanned<PathBuf>>) -> Option<Option<u32>> {
    let key = table.key("part");
    let Some(span) = key.value_span() else { return Some(None) };
    let number = key.integer().map(Some);
    let ending = file.and_then(|file| file.value.extension()).unwrap_or_default().to_ascii_lowercase();
    if file.is_some() && !PARTS.iter().any(|known| ending == *known) {
        key.context.report(Issue::error(span, "`part` needs a .serialized, .glb or .gltf file"));
        return None;
    }
    number
}
