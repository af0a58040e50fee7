//! The `[textures.NAME]` tables.

use std::path::PathBuf;

use super::super::description::{
    Channel, ChannelSelector, ImageSource, Material, Pattern, PixelInterpretation, Spanned, Texture,
    TextureEncoding, TextureFilter, TextureSource, UvSet, Wrap,
};
use super::super::keys::endings::{self, GLTF, MAPS};
use super::super::keys::key::DefaultValue::{Absent, Is, Required};
use super::super::keys::key::ValueKind::{File, Number, Numbers, Whole, Words};
use super::super::keys::key::{
    COLOR, COLOR_PAIR, MAX_INTEGER, TableInfo, TableSyntax, ValueKind, choice_values, keys, table_types,
};
use super::super::sanitize::escape_and_truncate;
use super::context::{FileContext, Issue};
use super::key::KeyInTable;
use super::limits::Limits::{Any, Length, NotZero};
use super::names::DefinedNames;
use super::table::TableReader;
use crate::materials::texture::{Bands, Checker, Noise, TextureMapping, UvTransform};
use crate::math::Vec2;

table_types! {
    /// Types of textures.
    enum TextureType, const TYPES;
    /// An image.
    Image = "image" {
        /// png, jpg, ppm (pgm, pbm), pfm, tga, bmp, hdr, exr or webp, or a glTF file with `image`; color or
        /// gray; up to 65,536 pixels per side and 2 GiB in memory.
        file: File(endings::TEXTURES), Required("\"picture.png\"");
        /// Index into the `images` of a glTF file.
        image: Whole(0, MAX_INTEGER), Absent;
        /// Addressing outside of [0, 1].
        wrap: Words(choice_values::<Wrap>), Is("\"repeat\"");
        /// Scale factors for the coordinates: tiling across (u) and up (v).
        repeat: REPEAT, Is("[1, 1]");
        /// Rotates the repeated coordinates about (0, 0), from u to v; the image rotates the other way.
        rotate: Number(Any), Is("0.0"), "degrees";
        /// Offset of the coordinates, added last.
        offset: OFFSET, Is("[0, 0]");
        /// Texture coordinate set: 1 is a mesh's second set, `TEXCOORD_1` in glTF, `u1` and `v1` in PLY.
        uv: Whole(0, 1), Is("0");
        /// `"auto"`: the color space specified in the file; by default sRGB for 8- and 16-bit colors, and
        /// linear for numbers, normal maps and floating-point files.
        encoding: Words(choice_values::<TextureEncoding>), Is("\"auto\"");
    }
    /// A checkerboard with 2 × 2 cells per repetition.
    Checker = "checker" {
        /// The colors. The first is at the corner (0, 0).
        colors: COLOR_PAIR, Is("[\"white\", \"black\"]");
        /// Repetitions across (u) and up (v).
        repeat: REPEAT, Is("[1, 1]");
        /// As for an image.
        rotate: Number(Any), Is("0.0"), "degrees";
        /// As for an image.
        offset: OFFSET, Is("[0, 0]");
        /// As for an image.
        uv: Whole(0, 1), Is("0");
    }
    /// Gradient noise in the shape's own coordinates, before its `matrix`.
    Noise = "noise" {
        /// The colors for −1 and 1.
        colors: COLOR_PAIR, Is("[\"white\", \"black\"]");
        /// Distance between the zeros of the first octave.
        size: Number(Length), Is("1.0"), "length";
        /// Number of octaves; each has half the size and half the weight of the previous one.
        octaves: Whole(1, 16), Is("4");
        /// Selects the pattern.
        seed: Whole(0, MAX_INTEGER), Is("0");
    }
    /// Equal stripes, two per repetition along u.
    Bands = "bands" {
        /// The colors. The first starts at u = 0.
        colors: COLOR_PAIR, Is("[\"white\", \"black\"]");
        /// Repetitions across (u); the second number matters only with `rotate`.
        repeat: REPEAT, Is("[1, 1]");
        /// As for an image.
        rotate: Number(Any), Is("0.0"), "degrees";
        /// As for an image.
        offset: OFFSET, Is("[0, 0]");
        /// As for an image.
        uv: Whole(0, 1), Is("0");
    }
}

/// Two numbers that are not 0.
const REPEAT: ValueKind = Numbers(2, "two numbers", NotZero);

/// Two numbers.
const OFFSET: ValueKind = Numbers(2, "two numbers", Any);

pub(crate) static TEXTURES: TableInfo = TableInfo {
    types: TYPES,
    ..TableInfo::new(
        "textures",
        TableSyntax::Named,
        "A texture, which materials use as `{ texture = \"NAME\" }`",
        keys! {
            /// Interpolation; `"mipmap"` also avoids flicker in the distance by choosing the mip level from
            /// the pixel footprint, or by averaging the pattern over it.
            filter: Words(choice_values::<TextureFilter>), Is("\"bilinear\"");
            /// Scale factor for linear colors; numbers use the red component, and normal maps and heights
            /// ignore the factor.
            factor: COLOR, Is("[1, 1, 1]");
        },
    )
};

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
        tables.into_iter().map(|(name, _, table)| read_texture(name, table?)).collect();
    DefinedTextures { names, list: read.into_iter().collect() }
}

fn read_texture(name: String, mut table: TableReader<'_>) -> Option<Texture> {
    // Without a valid type, keys cannot be checked.
    let kind = table.read_type()?;
    let table = &table;
    let content = match kind {
        TextureType::Image => read_image(table).map(TextureSource::Image),
        TextureType::Checker => {
            read_pattern(table, || Some(Pattern::Checker(Checker { mapping: read_mapping(table) })))
        }
        TextureType::Noise => read_pattern(table, || read_noise(table).map(Pattern::Noise)),
        TextureType::Bands => {
            read_pattern(table, || Some(Pattern::Bands(Bands { mapping: read_mapping(table) })))
        }
    };
    let filter = table.key("filter").read_or_default(KeyInTable::choice);
    let factor = table.key("factor").color();
    table.report_unknown_and_missing_keys();
    Some(Texture { name, filter, factor: factor?, content: content? })
}

fn read_image(table: &TableReader<'_>) -> Option<ImageSource> {
    let (file, image) = read_file_and_image_index(table);
    let wrap = table.key("wrap").read_or_default(KeyInTable::choice);
    let (repeat, rotate, offset, uv) = read_mapping_keys(table);
    let encoding = table.key("encoding").read_or_default(KeyInTable::choice);
    Some(ImageSource { file: file?, image: image?, wrap, repeat, rotate, offset, uv, encoding })
}

/// Reads a pattern and its colors.
fn read_pattern(table: &TableReader<'_>, read: impl FnOnce() -> Option<Pattern>) -> Option<TextureSource> {
    let (colors, pattern) = (table.key("colors").color_pair(), read());
    Some(TextureSource::Pattern { colors: colors?, pattern: pattern? })
}

fn read_noise(table: &TableReader<'_>) -> Option<Noise> {
    let (size, octaves, seed) =
        (table.key("size").number(), table.key("octaves").integer(), table.key("seed").integer());
    Some(Noise { size: size?, octaves: octaves?, seed: seed? })
}

/// Reads the keys that map texture coordinates.
fn read_mapping(table: &TableReader<'_>) -> TextureMapping {
    let (repeat, rotate, offset, uv) = read_mapping_keys(table);
    TextureMapping { repeat, moved: UvTransform::new(uv, rotate, offset.as_dvec2()).map(Box::new) }
}

/// Reads `repeat`, `rotate`, `offset` and `uv`.
fn read_mapping_keys(table: &TableReader<'_>) -> (Vec2, f64, Vec2, UvSet) {
    let repeat = table.key("repeat").read_or_default(KeyInTable::number_pair);
    let rotate = table.key("rotate").read_or_default(KeyInTable::number);
    let offset = table.key("offset").read_or_default(KeyInTable::number_pair);
    let uv = table.key("uv").integer();
    (repeat, rotate, offset, if uv == Some(1) { UvSet::Second } else { UvSet::First })
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
    for (texture, role) in materials.iter().flat_map(Material::own_textures_with_roles) {
        match role.pixel_interpretation() {
            PixelInterpretation::Color | PixelInterpretation::CutOut => colors[texture] = true,
            PixelInterpretation::Normal
            | PixelInterpretation::Number(ChannelSelector::Channel(Channel::Alpha)) => {}
            PixelInterpretation::Number(_) => numbers[texture] = true,
        }
    }
    let is_unclear = |texture: &usize| colors[*texture] && numbers[*texture];
    let is_auto =
        |index: &usize| list[*index].as_image().is_some_and(|image| image.encoding == TextureEncoding::Auto);
    for texture in (0..list.len()).filter(is_unclear).filter(is_auto) {
        let name = escape_and_truncate(&list[texture].name, 40);
        let message = format!("the texture \"{name}\" is used for colors and for numbers");
        let issue = Issue::error(textures.names.span(texture), message)
            .with_label("it needs `encoding`")
            .with_help("write `encoding = \"srgb\"` or `\"linear\"`, or take numbers from `channel = \"a\"`");
        context.report(issue);
    }
}
