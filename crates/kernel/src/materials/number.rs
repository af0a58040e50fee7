//! Numbers of surfaces, the same everywhere or by a texture.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::choice;

choice! {
    /// A channel of an image.
    pub enum Channel {
        /// Red.
        Red = "r",
        /// Green.
        Green = "g",
        /// Blue.
        Blue = "b",
        /// Alpha; 1 in an image without it.
        Alpha = "a",
    }
}

/// The number that a pixel of an image stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PixelNumber {
    /// Its luminance.
    Luminance,
    /// One of its channels.
    Channel(Channel),
    /// Its alpha, or its luminance in an image without alpha.
    Opacity,
    /// The same for an image that is not the surface's color: its luminance counts also if alpha is 1 everywhere and the image is gray,
    /// or of any color.
    Mask {
        /// Whether colors do not matter.
        of_any_color: bool,
    },
}

/// A number, or a texture of numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Number {
    /// The same everywhere.
    Constant(f32),
    /// A texture with the number in each of its channels, to be looked up.
    Texture(Arc<Texture>),
}

impl Number {
    /// The number, if it is the same everywhere.
    pub fn constant(&self) -> Option<f32> {
        match self {
            Self::Constant(number) => Some(*number),
            Self::Texture(_) => None,
        }
    }

    /// The texture. `None` if the number is the same everywhere.
    pub fn texture(&self) -> Option<&Arc<Texture>> {
        match self {
            Self::Constant(_) => None,
            Self::Texture(texture) => Some(texture),
        }
    }

    /// The number at texture coordinates; adds to `lookups`.
    #[inline]
    pub fn at(&self, at: &TexturePoint, lookups: &mut u64) -> f32 {
        match self {
            Self::Constant(number) => *number,
            Self::Texture(texture) => {
                *lookups += 1;
                texture.lookup(at).x
            }
        }
    }
}
