//! Definitions of the keys of all shapes, such as `[[sphere]]`.

use super::endings::MESHES;
use super::key::DefaultValue::{Absent, By, Is, Required};
use super::key::ValueKind::{File, Flag, Material, Number, Numbers, Scale, Text, Whole};
use super::key::{KeyInfo, MOST_WHOLE, TableInfo, TableSyntax, define_key};
use super::limits::Limits::{Any, Length, NotZero};

macro_rules! shapes {
    ($($name:literal, $doc:literal: [$($own:expr),* $(,)?];)*) => {
        /// Definitions of all shape tables. Each lists its own keys, followed by the common keys.
        pub(super) const SHAPES: &[TableInfo] = &[$(TableInfo {
            name: $name,
            form: TableSyntax::List,
            doc: $doc,
            keys: &[$($own,)* material_key($name), NAME, MATRIX],
            types: &[],
        }),*];
    };
}

const NAME: KeyInfo =
    define_key("name", Text, "", Absent, "Name used in messages, for clicks and by `--set`");

const MATRIX: KeyInfo = define_key(
    "matrix",
    Numbers(16, "16 numbers", Any),
    "",
    Absent,
    "An affine transform in row-major order, with 0, 0, 0, 1 as the last row; applied after the other keys of the shape, instead of a mesh's `scale`, `rotate` and `translate`",
);

/// Defines the key `material`. It is optional for meshes, because their files may contain materials.
const fn material_key(shape: &str) -> KeyInfo {
    // String comparison is not const, so match bytes.
    let default = match shape.as_bytes() {
        b"mesh" => By("the file's"),
        _ => Required("\"name\""),
    };
    define_key(
        "material",
        Material,
        "",
        default,
        "The material; optional for meshes whose file has materials",
    )
}

shapes! {
    "sphere", "A sphere": [
        define_key("center", Numbers(3, "point", Any), "length", Required("[0, 0.5, 0]"), "The center"),
        define_key("radius", Number(Length), "length", Required("0.5"), "The radius"),
    ];
    "quad", "A parallelogram: `corner` + s·`u` + t·`v` with s and t from 0 to 1. The front faces along `u` × `v`": [
        define_key("corner", Numbers(3, "point", Any), "length", Is("[-1, 0, 1]"), "The corner"),
        define_key("u", Numbers(3, "edge", Any), "length", Is("[2, 0, 0]"), "The first edge"),
        define_key("v", Numbers(3, "edge", Any), "length", Is("[0, 0, -2]"), "The second edge, not parallel to the first"),
    ];
    "plane", "An infinite plane; it cannot be an area light": [
        define_key("point", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "A point on the plane"),
        define_key("normal", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "Direction that the front faces"),
    ];
    "box", "A box, rotated about its center by `rotate`": [
        define_key("center", Numbers(3, "point", Any), "length", Is("[0, 0.5, 0]"), "The center"),
        define_key("size", Numbers(3, "three numbers", Length), "length", Is("[1, 1, 1]"), "Edge lengths"),
        define_key("rotate", Numbers(3, "three numbers", Any), "degrees", Is("[0, 0, 0]"), "Rotation about x, then y, then z"),
    ];
    "triangle", "A triangle. The front faces along (`b` − `a`) × (`c` − `a`)": [
        define_key("a", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The first corner"),
        define_key("b", Numbers(3, "point", Any), "length", Is("[1, 0, 0]"), "The second corner"),
        define_key("c", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "The third corner, not collinear with the others"),
    ];
    "disk", "A disk": [
        define_key("center", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The center"),
        define_key("normal", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "Direction that the front faces"),
        define_key("radius", Number(Length), "length", Is("0.5"), "The radius"),
    ];
    "cylinder", "A cylinder": [
        define_key("a", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "Center of one end"),
        define_key("b", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "Center of the other end"),
        define_key("radius", Number(Length), "length", Is("0.5"), "The radius"),
        define_key("caps", Flag, "", Is("true"), "Whether the ends are closed"),
    ];
    "cone", "A cone": [
        define_key("base", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "Center of the base"),
        define_key("tip", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "The tip"),
        define_key("radius", Number(Length), "length", Is("0.5"), "The radius of the base"),
        define_key("cap", Flag, "", Is("true"), "Whether the base is closed"),
    ];
    "torus", "A torus": [
        define_key("center", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The center"),
        define_key("axis", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "The axis of symmetry"),
        define_key("radius", Number(Length), "length", Is("0.5"), "Distance from the center to the middle of the tube"),
        define_key("tube", Number(Length), "length", By("a quarter of `radius`"), "The radius of the tube, less than `radius`"),
    ];
    "mesh", "A triangle mesh from a file": [
        define_key("file", File(MESHES), "", Required("\"mesh.obj\""), "An OBJ (with MTL), OFF, PLY, STL or glTF (.glb, .gltf) file; the extension determines the format"),
        define_key("part", Whole(0, MOST_WHOLE), "", Absent, "Index of a primitive in a glTF file, counted across all meshes. Without this key, the mesh is the file's whole scene"),
        define_key("scale", Scale(NotZero), "", Is("1.0"), "Scale, applied first"),
        define_key("rotate", Numbers(3, "three numbers", Any), "degrees", Is("[0, 0, 0]"), "Rotation about x, then y, then z"),
        define_key("translate", Numbers(3, "three numbers", Any), "length", Is("[0, 0, 0]"), "Translation, applied last"),
        define_key("smooth", Flag, "", Is("true"), "Whether vertex normals are interpolated; glimt computes them if the file has none"),
        define_key("vertex_colors", Flag, "", Is("false"), "Whether vertex colors multiply the material's color"),
    ];
}
