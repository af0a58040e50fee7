//! Reads the `[textures.*]` tables.

use std::path::PathBuf;

use super::super::description::{
    Channel, ChannelSelector, Material, PixelInterpretation, Spanned, Texture, TextureEncoding,
    TextureFilter, UvSet, Wrap,
};
use super::super::keys::endings::{GLTF, MAPS};
use super::super::sanitize::escape_and_truncate;
use super::context::{FileContext, Issue};
use super::limits::Limits;
use super::names::DefinedNames;
use super::table::TableReader;
use crate::math::{Vec2, Vec3};

/// The textures defined in a file.
pub(super) struct DefinedTextures {
    /// Texture names.
    pub(super) names: DefinedNames,
    /// The textures, in the same order as the names, or `None` if any is invalid.
    pub(super) list: Option<Vec<Texture>>,
}

pub(super) fn read_textures(root: &TableReader<'_>) -> DefinedTextures {
    let tables = root.named_tables("textures");
    let names =
        DefinedNames::new("texture", tables.iter().map(|(name, span, _)| (name.clone(), span.clone())));
    let read: Vec<Option<Texture>> =
        tables.into_iter().map(|(name, _, table)| read_texture(name, &table?)).collect();
    DefinedTextures { names, list: read.into_iter().collect() }
}

fn read_texture(name: String, table: &TableReader<'_>) -> Option<Texture> {
    let (file, image) = read_file_and_image_index(table);
    let filter = table.optional_key("filter").choice().unwrap_or(TextureFilter::Bilinear);
    let wrap = table.optional_key("wrap").choice().unwrap_or(Wrap::Repeat);
    let repeat = table.optional_key("repeat").pair(table.key_limits("repeat")).unwrap_or(Vec2::ONE);
    let rotate = table.optional_key("rotate").number(Limits::Any).unwrap_or(0.0);
    let offset = table.optional_key("offset").pair(Limits::Any).unwrap_or(Vec2::ZERO);
    let encoding = table.optional_key("encoding").choice().unwrap_or(TextureEncoding::Auto);
    let uv = table.optional_key("uv").integer(table.integer_key_range("uv"));
    let uv = if uv == Some(1) { UvSet::Second } else { UvSet::First };
    let factor = table.optional_key("factor");
    let factor = if factor.is_present() { factor.color() } else { Some(Vec3::ONE) };
    table.report_unknown_and_missing_keys();
    let (file, image, factor) = (file?, image?, factor?);
    Some(Texture { name, file, image, filter, wrap, repeat, rotate, offset, uv, encoding, factor })
}

/// Reads the file and, for a glTF file, the index of the image.
fn read_file_and_image_index(table: &TableReader<'_>) -> (Option<Spanned<PathBuf>>, Option<Option<u32>>) {
    let (key, number) = (table.required_key("file", "\"picture.png\""), table.optional_key("image"));
    if !number.is_present() {
        return (key.existing_file(MAPS), Some(None));
    }
    (key.existing_file(GLTF), number.integer(table.integer_key_range("image")).map(Some))
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
