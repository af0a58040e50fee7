//! Definitions of the keys of all shapes, such as `[[sphere]]`.

use super::endings::MESHES;
use super::key::Default::{Absent, By, Is, Required};
use super::key::ValueKind::{File, Flag, Material, Number, Numbers, Scale, Text, Whole};
use super::key::{KeyInfo, MOST_WHOLE, TableInfo, TableSyntax, key};
use super::limits::Limits::{Any, Length, NotZero};

macro_rules! shapes {
    ($($name:literal, $doc:literal: [$($own:expr),* $(,)?];)*) => {
        /// Definitions of all shape tables. Each lists its own keys, followed by the common keys.
        pub(super) const SHAPES: &[TableInfo] = &[$(TableInfo {
            name: $name,
            form: TableSyntax::List,
            doc: $doc,
            keys: &[$($own,)* material_key($name), NAME],
            types: &[],
        }),*];
    };
}

const NAME: KeyInfo = key("name", Text, "", Absent, "Name used in messages, for clicks and by `--set`");

/// Defines the key `material`. It is optional for meshes, because their files may contain materials.
const fn material_key(shape: &str) -> KeyInfo {
    // String comparison is not const, so match bytes.
    let default = match shape.as_bytes() {
        b"mesh" => By("the file's"),
        _ => Required("\"name\""),
    };
    key("material", Material, "", default, "The material; optional for meshes whose file has materials")
}

shapes! {
    "sphere", "A sphere": [
        key("center", Numbers(3, "point", Any), "length", Required("[0, 0.5, 0]"), "The center"),
        key("radius", Number(Length), "length", Required("0.5"), "The radius"),
    ];
    "quad", "A parallelogram: `corner` + s·`u` + t·`v` with s and t from 0 to 1. The front faces along `u` × `v`": [
        key("corner", Numbers(3, "point", Any), "length", Is("[-1, 0, 1]"), "The corner"),
        key("u", Numbers(3, "edge", Any), "length", Is("[2, 0, 0]"), "The first edge"),
        key("v", Numbers(3, "edge", Any), "length", Is("[0, 0, -2]"), "The second edge, not parallel to the first"),
    ];
    "plane", "An infinite plane; it cannot be an area light": [
        key("point", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "A point on the plane"),
        key("normal", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "Direction that the front faces"),
    ];
    "box", "A box, rotated about its center by `rotate`": [
        key("center", Numbers(3, "point", Any), "length", Is("[0, 0.5, 0]"), "The center"),
        key("size", Numbers(3, "three numbers", Length), "length", Is("[1, 1, 1]"), "Edge lengths"),
        key("rotate", Numbers(3, "three numbers", Any), "degrees", Is("[0, 0, 0]"), "Rotation about x, then y, then z"),
    ];
    "triangle", "A triangle. The front faces along (`b` − `a`) × (`c` − `a`)": [
        key("a", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The first corner"),
        key("b", Numbers(3, "point", Any), "length", Is("[1, 0, 0]"), "The second corner"),
        key("c", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "The third corner, not collinear with the others"),
    ];
    "disk", "A disk": [
        key("center", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The center"),
        key("normal", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "Direction that the front faces"),
        key("radius", Number(Length), "length", Is("0.5"), "The radius"),
    ];
    "cylinder", "A cylinder": [
        key("a", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "Center of one end"),
        key("b", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "Center of the other end"),
        key("radius", Number(Length), "length", Is("0.5"), "The radius"),
        key("caps", Flag, "", Is("true"), "Whether the ends are closed"),
    ];
    "cone", "A cone": [
        key("base", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "Center of the base"),
        key("tip", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "The tip"),
        key("radius", Number(Length), "length", Is("0.5"), "The radius of the base"),
        key("cap", Flag, "", Is("true"), "Whether the base is closed"),
    ];
    "torus", "A torus": [
        key("center", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The center"),
        key("axis", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "The axis of symmetry"),
        key("radius", Number(Length), "length", Is("0.5"), "Distance from the center to the middle of the tube"),
        key("tube", Number(Length), "length", By("a quarter of `radius`"), "The radius of the tube, less than `radius`"),
    ];
    "mesh", "A triangle mesh from a file": [
        key("file", File(MESHES), "", Required("\"mesh.obj\""), "An OBJ (with MTL), OFF, PLY, STL or glTF (.glb, .gltf) file; the extension determines the format"),
        key("part", Whole(0, MOST_WHOLE), "", Absent, "Index of a primitive in a glTF file, counted across all meshes. Without this key, the mesh is the file's whole scene"),
        key("scale", Scale(NotZero), "", Is("1.0"), "Scale, applied first"),
        key("rotate", Numbers(3, "three numbers", Any), "degrees", Is("[0, 0, 0]"), "Rotation about x, then y, then z"),
        key("translate", Numbers(3, "three numbers", Any), "length", Is("[0, 0, 0]"), "Translation, applied last"),
        key("matrix", Numbers(16, "16 numbers", Any), "", Absent, "An affine transform in row-major order, with 0, 0, 0, 1 as the last row; replaces `scale`, `rotate` and `translate`"),
        key("smooth", Flag, "", Is("true"), "Whether vertex normals are interpolated; glimt computes them if the file has none"),
        key("vertex_colors", Flag, "", Is("false"), "Whether vertex colors multiply the material's color"),
    ];
}
