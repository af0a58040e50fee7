//! `[textures.NAME]`.

use super::endings::TEXTURES as FILES;
use super::key::Default::{Absent, Is, Required};
use super::key::Kind::{Color, File, Number, Numbers, Whole, Words};
use super::key::{Form, MOST_WHOLE, TableInfo, key, words};
use super::limits::Limits::{Any, AtLeast, NotZero};
use crate::description::{Encoding, TextureFilter, Wrap};

pub(super) const TEXTURES: TableInfo = TableInfo {
    name: "textures",
    form: Form::Named,
    doc: "An image, which materials look up as `{ texture = \"NAME\" }`",
    keys: &[
        key(
            "file",
            File(FILES),
            "",
            Required("\"picture.png\""),
            "png, jpg, ppm (pgm, pbm), tga, bmp, hdr, exr or webp, or a glTF file with `image`; colour or grey; up to 65,536 pixels a side, 2 GiB in memory",
        ),
        key(
            "image",
            Whole(0, MOST_WHOLE),
            "",
            Absent,
            "The image of a glTF file, in the order of its `images`",
        ),
        key(
            "filter",
            Words(words::<TextureFilter>),
            "",
            Is("\"bilinear\""),
            "Look-up; `\"mipmap\"` takes smaller levels by how much of the texture a pixel sees, so that nothing flickers far away",
        ),
        key("wrap", Words(words::<Wrap>), "", Is("\"repeat\""), "What is beyond the edges"),
        key(
            "repeat",
            Numbers(2, "two numbers", NotZero),
            "",
            Is("[1, 1]"),
            "How often the texture fits across (u) and up (v): a factor on its coordinates",
        ),
        key(
            "rotate",
            Number(Any),
            "degrees",
            Is("0.0"),
            "Turns the repeated coordinates about (0, 0), from u to v; the image turns the other way",
        ),
        key(
            "offset",
            Numbers(2, "two numbers", Any),
            "",
            Is("[0, 0]"),
            "Added to the coordinates after that",
        ),
        key(
            "factor",
            Color(AtLeast(0.0)),
            "",
            Is("[1, 1, 1]"),
            "Multiplies the linear colours that are looked up; a number takes its red, normal maps and heights do not take it",
        ),
        key(
            "uv",
            Whole(0, 1),
            "",
            Is("0"),
            "The set of texture coordinates: 1 is the second one of a mesh, as glTF files have it (`TEXCOORD_1`), and PLY files with `u1` and `v1`",
        ),
        key(
            "encoding",
            Words(words::<Encoding>),
            "",
            Is("\"auto\""),
            "`\"auto\"`: the color space that the file states, else sRGB for colors in 8 and 16 bits, linear for numbers, normal maps and float files",
        ),
    ],
    types: &[],
};
