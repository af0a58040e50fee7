//! The shapes: `[[sphere]]` and others.

use super::endings::MESHES;
use super::key::Default::{Absent, By, Is, Required};
use super::key::Kind::{File, Flag, Material, Number, Numbers, Scale, Text, Whole};
use super::key::{Form, KeyInfo, MOST_WHOLE, TableInfo, key};
use super::limits::Limits::{Any, Length, NotZero};

macro_rules! shapes {
    ($($name:literal, $doc:literal: [$($own:expr),* $(,)?];)*) => {
        /// The shapes, each with its own keys and then those of every shape.
        pub(super) const SHAPES: &[TableInfo] = &[$(TableInfo {
            name: $name,
            form: Form::List,
            doc: $doc,
            keys: &[$($own,)* material($name), NAME],
            types: &[],
        }),*];
    };
}

const NAME: KeyInfo = key("name", Text, "", Absent, "A name for messages, clicks and `--set`");

/// The material of a shape. A mesh may have its own.
const fn material(shape: &str) -> KeyInfo {
    // `==` of texts is not for constants.
    let default = match shape.as_bytes() {
        b"mesh" => By("the file's"),
        _ => Required("\"name\""),
    };
    key("material", Material, "", default, "The material; a mesh may leave it out if its file has materials")
}

shapes! {
    "sphere", "A sphere": [
        key("center", Numbers(3, "point", Any), "length", Required("[0, 0.5, 0]"), "The centre"),
        key("radius", Number(Length), "length", Required("0.5"), "The radius"),
    ];
    "quad", "A parallelogram: all points `corner` + s·`u` + t·`v` with s and t from 0 to 1; its front is on the side of `u` × `v`": [
        key("corner", Numbers(3, "point", Any), "length", Is("[-1, 0, 1]"), "The corner"),
        key("u", Numbers(3, "edge", Any), "length", Is("[2, 0, 0]"), "The first edge"),
        key("v", Numbers(3, "edge", Any), "length", Is("[0, 0, -2]"), "The second edge, not parallel to the first"),
    ];
    "plane", "A plane without end; it cannot be an area light": [
        key("point", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "A point of the plane"),
        key("normal", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "Away from its front"),
    ];
    "box", "A box, which `rotate` turns about its centre": [
        key("center", Numbers(3, "point", Any), "length", Is("[0, 0.5, 0]"), "The centre"),
        key("size", Numbers(3, "three numbers", Length), "length", Is("[1, 1, 1]"), "The lengths of its edges"),
        key("rotate", Numbers(3, "three numbers", Any), "degrees", Is("[0, 0, 0]"), "Rotation about x, then y, then z"),
    ];
    "triangle", "A triangle; its front is on the side of (`b` − `a`) × (`c` − `a`)": [
        key("a", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The first corner"),
        key("b", Numbers(3, "point", Any), "length", Is("[1, 0, 0]"), "The second corner"),
        key("c", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "The third corner, not on a line with the others"),
    ];
    "disk", "A disk": [
        key("center", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The centre"),
        key("normal", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "Away from its front"),
        key("radius", Number(Length), "length", Is("0.5"), "The radius"),
    ];
    "cylinder", "A cylinder": [
        key("a", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The middle of one end"),
        key("b", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "The middle of the other end"),
        key("radius", Number(Length), "length", Is("0.5"), "The radius"),
        key("caps", Flag, "", Is("true"), "Whether the ends are closed"),
    ];
    "cone", "A cone": [
        key("base", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The middle of the base"),
        key("tip", Numbers(3, "point", Any), "length", Is("[0, 1, 0]"), "The tip"),
        key("radius", Number(Length), "length", Is("0.5"), "The radius of the base"),
        key("cap", Flag, "", Is("true"), "Whether the base is closed"),
    ];
    "torus", "A torus": [
        key("center", Numbers(3, "point", Any), "length", Is("[0, 0, 0]"), "The centre"),
        key("axis", Numbers(3, "direction", Any), "", Is("[0, 1, 0]"), "The axis around which it goes"),
        key("radius", Number(Length), "length", Is("0.5"), "From the centre to the middle of the tube"),
        key("tube", Number(Length), "length", By("a quarter of `radius`"), "The radius of the tube, below `radius`"),
    ];
    "mesh", "A mesh of triangles from a file": [
        key("file", File(MESHES), "", Required("\"mesh.obj\""), "OBJ (with MTL), OFF, PLY, STL or glTF (.glb, .gltf); the ending chooses"),
        key("part", Whole(0, MOST_WHOLE), "", Absent, "One primitive of a glTF file, counted over all its meshes; without it the file's whole scene"),
        key("scale", Scale(NotZero), "", Is("1.0"), "Scale, applied first"),
        key("rotate", Numbers(3, "three numbers", Any), "degrees", Is("[0, 0, 0]"), "Rotation about x, then y, then z"),
        key("translate", Numbers(3, "three numbers", Any), "length", Is("[0, 0, 0]"), "Translation, applied last"),
        key("matrix", Numbers(16, "16 numbers", Any), "", Absent, "An affine map row by row, the last row 0, 0, 0, 1, in place of `scale`, `rotate` and `translate`"),
        key("smooth", Flag, "", Is("true"), "Whether vertex normals are interpolated; glimt makes them if the file has none"),
        key("vertex_colors", Flag, "", Is("false"), "Whether the file's vertex colours multiply the material's colour"),
    ];
}
