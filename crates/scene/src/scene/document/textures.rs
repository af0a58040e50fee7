//! `[textures.*]`.

use super::super::description::{Encoding, Texture, TextureFilter, Wrap};
use super::limits::Limits;
use super::names::Names;
use super::table::Table;
use crate::math::Vec2;

/// Endings of pictures that can be read.
pub(super) const PICTURES: [&str; 12] =
    ["png", "jpg", "jpeg", "ppm", "pgm", "pbm", "pnm", "tga", "bmp", "hdr", "exr", "webp"];

/// The textures of a file.
pub(super) struct Textures {
    /// Names of the textures.
    pub(super) names: Names,
    /// In the order of the names; none if one of them is wrong.
    pub(super) list: Option<Vec<Texture>>,
}

pub(super) fn read(root: &Table<'_>) -> Textures {
    let tables = root.named_tables("textures");
    let names = Names::new("texture", tables.iter().map(|(name, span, _)| (name.clone(), span.clone())));
    let read: Vec<Option<Texture>> =
        tables.into_iter().map(|(name, _, table)| texture(name, &table?)).collect();
    Textures { names, list: read.into_iter().collect() }
}

fn texture(name: String, table: &Table<'_>) -> Option<Texture> {
    let file = table.required("file", "\"picture.png\"").file(&PICTURES, &[]);
    let filter = table.optional("filter").choice().unwrap_or(TextureFilter::Bilinear);
    let wrap = table.optional("wrap").choice().unwrap_or(Wrap::Repeat);
    let repeat = table.optional("repeat").pair(Limits::NotZero).unwrap_or(Vec2::ONE);
    let encoding = table.optional("encoding").choice().unwrap_or(Encoding::Auto);
    table.finish();
    Some(Texture { name, file: file?, filter, wrap, repeat, encoding })
}
