//! Textures: the `[textures.*]` tables.

use std::path::PathBuf;

use super::super::fingerprint::{FingerprintContext, FingerprintHasher, Fingerprinted};
use super::Spanned;
use crate::choice;
pub use crate::materials::UvSet;
use crate::materials::texture::TextureMapping;
pub use crate::materials::texture::{Pattern, TextureFilter, Wrap};
use crate::math::{Vec2, Vec3};

/// A texture used by materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Name of the texture in the scene file.
    pub name: String,
    /// Interpolation between texels. [`TextureFilter::Mipmap`] also averages patterns over the footprint;
    /// other filters evaluate patterns at a point.
    pub filter: TextureFilter,
    /// Scale factor for linear colors and numbers. Normals and heights ignore it.
    pub factor: Vec3,
    /// The image or the pattern.
    pub content: TextureSource,
}

/// The source of a texture's values.
#[derive(Clone, Debug, PartialEq)]
pub enum TextureSource {
    /// An image.
    Image(ImageSource),
    /// Two colors, mixed by a pattern.
    Pattern {
        /// The colors, linear.
        colors: [Vec3; 2],
        /// Where each color is.
        pattern: Pattern,
    },
}

/// An image file, and how it is mapped.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageSource {
    /// Path to the image or glTF file, resolved against the scene's folder.
    pub file: Spanned<PathBuf>,
    /// Index of the image within a glTF file. `None` if the file is itself an image.
    pub image: Option<u32>,
    /// Addressing mode for coordinates outside [0, 1].
    pub wrap: Wrap,
    /// Tiling factors for u and v. Neither is 0.
    pub repeat: Vec2,
    /// Rotation of the repeated coordinates, in degrees from u to v.
    pub rotate: f64,
    /// Offset of the texture coordinates, added last.
    pub offset: Vec2,
    /// Texture coordinate set.
    pub uv: UvSet,
    /// Encoding of the pixels.
    pub encoding: TextureEncoding,
}

choice! {
    /// Texture encodings.
    pub enum TextureEncoding {
        /// sRGB for 8- and 16-bit colors, linear for numbers, normal maps and floating-point files.
        Auto = "auto",
        /// sRGB, decoded.
        Srgb = "srgb",
        /// Linear, used unchanged.
        Linear = "linear",
    }
}

impl Texture {
    /// Returns the image, or `None` for a pattern.
    pub fn as_image(&self) -> Option<&ImageSource> {
        match &self.content {
            TextureSource::Image(image) => Some(image),
            TextureSource::Pattern { .. } => None,
        }
    }

    /// Returns the image, or `None` for a pattern.
    pub fn as_image_mut(&mut self) -> Option<&mut ImageSource> {
        match &mut self.content {
            TextureSource::Image(image) => Some(image),
            TextureSource::Pattern { .. } => None,
        }
    }

    /// Returns the set of texture coordinates that the texture uses, or `None` if it uses the shape's own
    /// coordinates.
    pub fn uv_set(&self) -> Option<UvSet> {
        match &self.content {
            TextureSource::Image(image) => Some(image.uv),
            TextureSource::Pattern { pattern, .. } => pattern.mapping().map(TextureMapping::uv_set),
        }
    }
}

/// Covers only the lookup parameters. The texels have separate fingerprints.
impl Fingerprinted for Texture {
    fn add_to_fingerprint(&self, key: &mut FingerprintHasher, _: &FingerprintContext<'_>) {
        let Self { name: _, filter, factor, content } = self;
        key.add_choice_name(*filter).add_vec3(*factor);
        match content {
            TextureSource::Image(ImageSource { file, image, wrap, repeat, rotate, offset, uv, encoding }) => {
                key.add_path_bytes(&file.value)
                    .add_choice_name(*wrap)
                    .add_choice_name(*encoding)
                    .add_f32(repeat.x)
                    .add_f32(repeat.y);
                key.add_f64(*rotate).add_f32(offset.x).add_f32(offset.y).add_bool(*uv == UvSet::Second);
                key.add_usize(image.map_or(0, |image| image as usize + 1));
            }
            TextureSource::Pattern { colors, pattern } => {
                // The debug form has all parameters, and its numbers are exact.
                key.add_vec3(colors[0]).add_vec3(colors[1]).add_str(&format!("{pattern:?}"));
            }
        }
    }
}
