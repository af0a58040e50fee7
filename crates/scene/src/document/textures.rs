//! Reads the `[textures.*]` tables.

use std::path::PathBuf;

use super::super::description::{
    Channel, Encoding, Located, Material, PixelValue, Texture, TextureFilter, TextureUse, UvSet, Wrap,
};
use super::super::keys::endings::{GLTF, MAPS};
use super::super::sanitize::shortened;
use super::context::{FileContext, Issue};
use super::limits::Limits;
use super::names::DefinedNames;
use super::table::TableReader;
use crate::math::{Vec2, Vec3};

/// The textures defined in a file.
pub(super) struct TextureList {
    /// Texture names.
    pub(super) names: DefinedNames,
    /// The textures, in the same order as the names. `None` if any is invalid.
    pub(super) list: Option<Vec<Texture>>,
}

pub(super) fn read_textures(root: &TableReader<'_>) -> TextureList {
    let tables = root.named_tables("textures");
    let names =
        DefinedNames::new("texture", tables.iter().map(|(name, span, _)| (name.clone(), span.clone())));
    let read: Vec<Option<Texture>> =
        tables.into_iter().map(|(name, _, table)| read_texture(name, &table?)).collect();
    TextureList { names, list: read.into_iter().collect() }
}

fn read_texture(name: String, table: &TableReader<'_>) -> Option<Texture> {
    let (file, image) = read_image_reference(table);
    let filter = table.optional("filter").choice().unwrap_or(TextureFilter::Bilinear);
    let wrap = table.optional("wrap").choice().unwrap_or(Wrap::Repeat);
    let repeat = table.optional("repeat").pair(table.limits("repeat")).unwrap_or(Vec2::ONE);
    let rotate = table.optional("rotate").number(Limits::Any).unwrap_or(0.0);
    let offset = table.optional("offset").pair(Limits::Any).unwrap_or(Vec2::ZERO);
    let encoding = table.optional("encoding").choice().unwrap_or(Encoding::Auto);
    let uv = table.optional("uv").integer(table.range("uv"));
    let uv = if uv == Some(1) { UvSet::Second } else { UvSet::First };
    let factor = table.optional("factor");
    let factor = if factor.is_present() { factor.color() } else { Some(Vec3::ONE) };
    table.finish();
    let (file, image, factor) = (file?, image?, factor?);
    Some(Texture { name, file, image, filter, wrap, repeat, rotate, offset, uv, encoding, factor })
}

/// Reads the file and, for a glTF file, the index of the image.
fn read_image_reference(table: &TableReader<'_>) -> (Option<Located<PathBuf>>, Option<Option<u32>>) {
    let (key, number) = (table.required("file", "\"picture.png\""), table.optional("image"));
    if !number.is_present() {
        return (key.file(MAPS), Some(None));
    }
    (key.file(GLTF), number.integer(table.range("image")).map(Some))
}

/// Reports textures without `encoding` that are used for both colors and numbers. Ignores uses of the alpha
/// channel, because it has no encoding.
pub(super) fn check_encodings(context: &FileContext<'_>, textures: &TextureList, materials: &[Material]) {
    let Some(list) = &textures.list else { return };
    let (mut colors, mut numbers) = (vec![false; list.len()], vec![false; list.len()]);
    for (texture, role) in materials.iter().flat_map(Material::textures) {
        match role.texture_use() {
            TextureUse::Color | TextureUse::CutOut => colors[texture] = true,
            TextureUse::Normal | TextureUse::Number(PixelValue::Channel(Channel::Alpha)) => {}
            TextureUse::Number(_) => numbers[texture] = true,
        }
    }
    let is_unclear = |texture: &usize| colors[*texture] && numbers[*texture];
    for texture in (0..list.len()).filter(is_unclear).filter(|&index| list[index].encoding == Encoding::Auto)
    {
        let name = shortened(&list[texture].name, 40);
        let message = format!("the texture \"{name}\" is used for colors and for numbers");
        let issue = Issue::error(textures.names.span(texture), message)
            .label("it needs `encoding`")
            .help("write `encoding = \"srgb\"` or `\"linear\"`, or take numbers from `channel = \"a\"`");
        context.report(issue);
    }
}
