//! Definitions of the `[textures.NAME]` keys.

use super::endings::TEXTURES as FILES;
use super::key::DefaultValue::{Absent, Is, Required};
use super::key::ValueKind::{Color, File, Number, Numbers, Whole, Words};
use super::key::{MOST_WHOLE, TableInfo, TableSyntax, choice_values, define_key};
use super::limits::Limits::{Any, AtLeast, NotZero};
use crate::description::{TextureEncoding, TextureFilter, Wrap};

pub(super) const TEXTURES: TableInfo = TableInfo {
    name: "textures",
    form: TableSyntax::Named,
    doc: "An image, which materials use as `{ texture = \"NAME\" }`",
    keys: &[
        define_key(
            "file",
            File(FILES),
            "",
            Required("\"picture.png\""),
            "png, jpg, ppm (pgm, pbm), pfm, tga, bmp, hdr, exr or webp, or a glTF file with `image`; color or gray; up to 65,536 pixels per side and 2 GiB in memory",
        ),
        define_key("image", Whole(0, MOST_WHOLE), "", Absent, "Index into the `images` of a glTF file"),
        define_key(
            "filter",
            Words(choice_values::<TextureFilter>),
            "",
            Is("\"bilinear\""),
            "Interpolation; `\"mipmap\"` also avoids flicker in the distance by choosing the mip level from the pixel footprint",
        ),
        define_key(
            "wrap",
            Words(choice_values::<Wrap>),
            "",
            Is("\"repeat\""),
            "Addressing outside of [0, 1]",
        ),
        define_key(
            "repeat",
            Numbers(2, "two numbers", NotZero),
            "",
            Is("[1, 1]"),
            "Scale factors for the coordinates: tiling across (u) and up (v)",
        ),
        define_key(
            "rotate",
            Number(Any),
            "degrees",
            Is("0.0"),
            "Rotates the repeated coordinates about (0, 0), from u to v; the image rotates the other way",
        ),
        define_key(
            "offset",
            Numbers(2, "two numbers", Any),
            "",
            Is("[0, 0]"),
            "Offset of the coordinates, added last",
        ),
        define_key(
            "factor",
            Color(AtLeast(0.0)),
            "",
            Is("[1, 1, 1]"),
            "Scale factor for linear colors; numbers use the red component, and normal maps and heights ignore the factor",
        ),
        define_key(
            "uv",
            Whole(0, 1),
            "",
            Is("0"),
            "Texture coordinate set: 1 is a mesh's second set, `TEXCOORD_1` in glTF, `u1` and `v1` in PLY",
        ),
        define_key(
            "encoding",
            Words(choice_values::<TextureEncoding>),
            "",
            Is("\"auto\""),
            "`\"auto\"`: the color space specified in the file; by default sRGB for 8- and 16-bit colors, and linear for numbers, normal maps and floating-point files",
        ),
    ],
    types: &[],
};
