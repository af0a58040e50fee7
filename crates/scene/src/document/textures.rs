//! The `[textures.NAME]` tables.

use std::path::PathBuf;

use super::super::description::{
    Channel, ChannelSelector, Material, PixelInterpretation, Spanned, Texture, TextureEncoding,
    TextureFilter, UvSet, Wrap,
};
use super::super::keys::endings::{self, GLTF, MAPS};
use super::super::keys::key::DefaultValue::{Absent, Is, Required};
use super::super::keys::key::ValueKind::{File, Number, Numbers, Whole, Words};
use super::super::keys::key::{COLOR, MAX_INTEGER, TableInfo, TableSyntax, choice_values, keys};
use super::super::sanitize::escape_and_truncate;
use super::context::{FileContext, Issue};
use super::key::KeyInTable;
use super::limits::Limits::{Any, NotZero};
use super::names::DefinedNames;
use super::table::TableReader;

pub(crate) static TEXTURES: TableInfo = TableInfo::new(
    "textures",
    TableSyntax::Named,
    "An image, which materials use as `{ texture = \"NAME\" }`",
    keys! {
        /// png, jpg, ppm (pgm, pbm), pfm, tga, bmp, hdr, exr or webp, or a glTF file with `image`; color or
        /// gray; up to 65,536 pixels per side and 2 GiB in memory.
        file: File(endings::TEXTURES), Required("\"picture.png\"");
        /// Index into the `images` of a glTF file.
        image: Whole(0, MAX_INTEGER), Absent;
        /// Interpolation; `"mipmap"` also avoids flicker in the distance by choosing the mip level from the
        /// pixel footprint.
        filter: Words(choice_values::<TextureFilter>), Is("\"bilinear\"");
        /// Addressing outside of [0, 1].
        wrap: Words(choice_values::<Wrap>), Is("\"repeat\"");
        /// Scale factors for the coordinates: tiling across (u) and up (v).
        repeat: Numbers(2, "two numbers", NotZero), Is("[1, 1]");
        /// Rotates the repeated coordinates about (0, 0), from u to v; the image rotates the other way.
        rotate: Number(Any), Is("0.0"), "degrees";
        /// Offset of the coordinates, added last.
        offset: Numbers(2, "two numbers", Any), Is("[0, 0]");
        /// Scale factor for linear colors; numbers use the red component, and normal maps and heights ignore
        /// the factor.
        factor: COLOR, Is("[1, 1, 1]");
        /// Texture coordinate set: 1 is a mesh's second set, `TEXCOORD_1` in glTF, `u1` and `v1` in PLY.
        uv: Whole(0, 1), Is("0");
        /// `"auto"`: the color space specified in the file; by default sRGB for 8- and 16-bit colors, and
        /// linear for numbers, normal maps and floating-point files.
        encoding: Words(choice_values::<TextureEncoding>), Is("\"auto\"");
    },
);

/// The textures defined in a file.
pub(super) struct DefinedTextures {
    /// Texture names.
    pub(super) names: DefinedNames,
    /// The textures, in the same order as the names, or `None` if any is invalid.
    pub(super) list: Option<Vec<Texture>>,
}

pub(super) fn read_textures(root: &TableReader<'_>) -> DefinedTextures {
    let tables = root.named_tables(&TEXTURES);
    let names =
        DefinedNames::new("texture", tables.iter().map(|(name, span, _)| (name.clone(), span.clone())));
    let read: Vec<Option<Texture>> =
        tables.into_iter().map(|(name, _, table)| read_texture(name, &table?)).collect();
    DefinedTextures { names, list: read.into_iter().collect() }
}

fn read_texture(name: String, table: &TableReader<'_>) -> Option<Texture> {
    let (file, image) = read_file_and_image_index(table);
    let filter = table.key("filter").or_default(KeyInTable::choice);
    let wrap = table.key("wrap").or_default(KeyInTable::choice);
    let repeat = table.key("repeat").or_default(KeyInTable::pair);
    let rotate = table.key("rotate").or_default(KeyInTable::number);
    let offset = table.key("offset").or_default(KeyInTable::pair);
    let encoding = table.key("encoding").or_default(KeyInTable::choice);
    let uv = table.key("uv").integer();
    let uv = if uv == Some(1) { UvSet::Second } else { UvSet::First };
    let factor = table.key("factor").color();
    table.report_unknown_and_missing_keys();
    let (file, image, factor) = (file?, image?, factor?);
    Some(Texture { name, file, image, filter, wrap, repeat, rotate, offset, uv, encoding, factor })
}

/// Reads the file and, for a glTF file, the index of the image.
fn read_file_and_image_index(table: &TableReader<'_>) -> (Option<Spanned<PathBuf>>, Option<Option<u32>>) {
    let (key, number) = (table.key("file"), table.key("image"));
    if !number.is_present() {
        return (key.existing_file_with_extension(MAPS), Some(None));
    }
    (key.existing_file_with_extension(GLTF), number.integer().map(Some))
}

/// Reports textures without `encoding` that are used for both colors and numbers. Ignores uses of the alpha
/// channel, because it has no encoding.
pub(super) fn report_ambiguous_encodings(
    context: &FileContext<'_>,
    textures: &DefinedTextures,
    materials: &[Material],
) {
    let Some(list) = &textures.list else { return };
    let (mut colors, mut numbers) = (vec![false; list.len()], vec![false; list.len()]);
    for (texture, role) in materials.iter().flat_map(Material::textures) {
        match role.pixel_interpretation() {
            PixelInterpretation::Color | PixelInterpretation::CutOut => colors[texture] = true,
            PixelInterpretation::Normal
            | PixelInterpretation::Number(ChannelSelector::Channel(Channel::Alpha)) => {}
            PixelInterpretation::Number(_) => numbers[texture] = true,
        }
    }
    let is_unclear = |texture: &usize| colors[*texture] && numbers[*texture];
    for texture in
        (0..list.len()).filter(is_unclear).filter(|&index| list[index].encoding == TextureEncoding::Auto)
    {
        let name = escape_and_truncate(&list[texture].name, 40);
        let message = format!("the texture \"{name}\" is used for colors and for numbers");
        let issue = Issue::error(textures.names.span(texture), message)
            .with_label("it needs `encoding`")
            .with_help("write `encoding = \"srgb\"` or `\"linear\"`, or take numbers from `channel = \"a\"`");
        context.report(issue);
    }
}
