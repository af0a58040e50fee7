//! Textures: colors and numbers that vary over a surface.
//!
//! [`Texture`] is the interface between materials and the kinds of textures. A new kind of pattern needs a
//! file, a variant of [`Pattern`] in `pattern.rs`, and its keys in the scene module's `document/textures.rs`.

pub mod image;
pub mod mapping;
pub mod noise;
pub mod pattern;
pub mod stripes;
pub mod wrap;

use std::sync::Arc;

pub use image::{ImageTexture, TextureFilter, ValueScaleAndOffset};
pub use mapping::{TextureMapping, UvTransform};
pub use noise::Noise;
pub use pattern::{HeightGradient, Pattern, PatternTexture};
pub use stripes::{Bands, Checker};
pub use wrap::Wrap;

use super::footprint::{TexturePoint, UvSet};
use crate::math::Vec3;
use crate::math::lanes::{PACKET_SIZE, Vec3x16};

/// A texture of any kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Texture {
    /// An image.
    Image(ImageTexture),
    /// A pattern that is computed instead of stored.
    Pattern(PatternTexture),
}

impl Texture {
    /// The linear value at a point. Non-finite coordinates are treated as 0.
    #[inline]
    pub fn lookup(&self, at: &TexturePoint) -> Vec3 {
        match self {
            Self::Image(image) => image.lookup(at),
            Self::Pattern(pattern) => pattern.lookup(at),
        }
    }

    /// Packet version of [`Texture::lookup`], for textures that support it.
    #[inline(always)]
    pub fn lookup_packet(&self, uv: &[[f64; PACKET_SIZE]; 2]) -> Vec3x16 {
        match self {
            Self::Image(image) => image.lookup_packet(uv),
            Self::Pattern(pattern) => pattern.lookup_packet(uv),
        }
    }

    /// Whether [`Texture::lookup_packet`] returns the same values as [`Texture::lookup`].
    pub fn supports_packets(&self) -> bool {
        !self.uses_footprint() && !self.uses_object_point()
    }

    /// Whether lookups depend on the footprint.
    pub fn uses_footprint(&self) -> bool {
        match self {
            Self::Image(image) => image.mipmaps.is_some(),
            Self::Pattern(pattern) => pattern.is_filtered,
        }
    }

    /// Whether lookups depend on [`TexturePoint::object_point`].
    pub fn uses_object_point(&self) -> bool {
        match self {
            Self::Image(_) => false,
            Self::Pattern(pattern) => pattern.pattern.uses_object_point(),
        }
    }

    /// Maps texture coordinates to the texture, or `None` if the texture does not use them.
    #[inline]
    fn mapping(&self) -> Option<&TextureMapping> {
        match self {
            Self::Image(image) => Some(&image.mapping),
            Self::Pattern(pattern) => pattern.pattern.mapping(),
        }
    }

    /// The UV set used for lookups.
    #[inline]
    pub fn uv_set(&self) -> UvSet {
        self.mapping().map_or(UvSet::First, TextureMapping::uv_set)
    }

    /// Slopes of the red channel, along u and v of [`Texture::untransformed_tangents`] or in world
    /// coordinates.
    pub fn slopes(&self, at: &TexturePoint) -> HeightGradient {
        match self {
            Self::Image(image) => HeightGradient::AlongUv(image.slopes(at)),
            Self::Pattern(pattern) => pattern.slopes(at),
        }
    }

    /// Tangents ∂p/∂u and ∂p/∂v of the UV set used for lookups. `first` contains the tangents of the first
    /// set.
    #[inline]
    pub fn untransformed_tangents(&self, at: &TexturePoint, first: [Vec3; 2]) -> [Vec3; 2] {
        self.mapping().map_or(first, |mapping| mapping.untransformed_tangents(at, first))
    }

    /// Whether [`Texture::coverage_above_cutoff`] is known for any footprint.
    #[inline]
    pub fn has_coverage_above_cutoff(&self) -> bool {
        match self {
            Self::Image(image) => image.mipmaps.is_some(),
            Self::Pattern(_) => true,
        }
    }

    /// The fraction of the footprint where the red channel is at least `cutoff`. The mip levels of an image
    /// must be computed from [`Texels::threshold_red_channel`](super::texels::Texels::threshold_red_channel).
    pub fn coverage_above_cutoff(&self, at: &TexturePoint, cutoff: f32) -> f32 {
        match self {
            Self::Image(image) => image.coverage_above_cutoff(at, cutoff),
            Self::Pattern(pattern) => pattern.coverage_above_cutoff(at, cutoff),
        }
    }

    /// Whether the texture is 0 everywhere.
    pub fn is_black(&self) -> bool {
        match self {
            Self::Image(image) => image.is_black(),
            Self::Pattern(pattern) => pattern.is_black(),
        }
    }

    /// Mean of the texture. For an image, this is exact if a whole number of tiles fits into [0, 1]².
    pub fn mean(&self) -> Vec3 {
        match self {
            Self::Image(image) => image.mean(),
            Self::Pattern(pattern) => pattern.mean(),
        }
    }

    /// Number of texels or cells per unit of u and v.
    pub fn texels_per_unit(&self) -> [f64; 2] {
        match self {
            Self::Image(image) => image.texels_per_unit(),
            Self::Pattern(pattern) => pattern.cells_per_uv_unit(),
        }
    }

    /// The image, or `None` for other textures.
    #[inline]
    pub fn as_image(&self) -> Option<&ImageTexture> {
        match self {
            Self::Image(image) => Some(image),
            Self::Pattern(_) => None,
        }
    }

    /// The texture with other settings for its values, if it is an image. Patterns have their colors instead.
    #[must_use]
    pub fn map_image_factor(
        mut self,
        factor: impl FnOnce(Option<ValueScaleAndOffset>) -> Option<ValueScaleAndOffset>,
    ) -> Self {
        if let Self::Image(image) = &mut self {
            image.factor = factor(image.factor);
        }
        self
    }
}

/// A color parameter, constant or textured.
#[derive(Clone, Debug, PartialEq)]
pub enum ColorOrTexture {
    /// A constant color.
    Constant(Vec3),
    /// A color texture.
    Texture(Arc<Texture>),
}

impl ColorOrTexture {
    /// The constant color, or `None` for a texture.
    pub fn as_untextured(&self) -> Option<Vec3> {
        match self {
            Self::Constant(color) => Some(*color),
            Self::Texture(_) => None,
        }
    }

    /// The texture, or `None` for a constant.
    pub fn texture(&self) -> Option<&Arc<Texture>> {
        match self {
            Self::Constant(_) => None,
            Self::Texture(texture) => Some(texture),
        }
    }

    /// The color at the given texture coordinates. Counts texture lookups in `lookups`.
    pub fn evaluate(&self, at: &TexturePoint, lookups: &mut u64) -> Vec3 {
        match self {
            Self::Constant(color) => *color,
            Self::Texture(texture) => {
                *lookups += 1;
                texture.lookup(at)
            }
        }
    }
}
