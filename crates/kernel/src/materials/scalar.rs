//! Scalar material parameters, constant or textured.

use std::sync::Arc;

use super::footprint::TexturePoint;
use super::texture::Texture;
use crate::choice;
use crate::math::Vec3;
use crate::math::color::luminance;

choice! {
    /// A channel of an image.
    pub enum Channel {
        /// Red.
        Red = "r",
        /// Green.
        Green = "g",
        /// Blue.
        Blue = "b",
        /// Alpha, or 1 for images without an alpha channel.
        Alpha = "a",
    }
}

/// Selects the value that a scalar texture reads from each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ChannelSelector {
    /// The luminance of the pixel.
    Luminance,
    /// One channel.
    Channel(Channel),
    /// The alpha, or the luminance for images without an alpha channel.
    Opacity,
    /// Like [`ChannelSelector::Opacity`], but for an image that the material does not also use as a color. If
    /// alpha is 1 everywhere and all pixels are gray, the luminance is used as the opacity.
    Mask {
        /// Whether the luminance is also used if some pixels are not gray.
        of_any_color: bool,
    },
}

impl ChannelSelector {
    /// The value of an opaque linear color.
    pub fn value_of_opaque_color(self, color: Vec3) -> f32 {
        match self {
            Self::Luminance | Self::Opacity | Self::Mask { of_any_color: _ } => luminance(color),
            Self::Channel(Channel::Red) => color.x,
            Self::Channel(Channel::Green) => color.y,
            Self::Channel(Channel::Blue) => color.z,
            Self::Channel(Channel::Alpha) => 1.0,
        }
    }
}

/// A scalar parameter, constant or textured.
#[derive(Clone, Debug, PartialEq)]
pub enum ScalarParameter {
    /// A constant value.
    Constant(f32),
    /// A texture that contains the value in each of its channels.
    Texture(Arc<Texture>),
}

impl ScalarParameter {
    /// The constant value, or `None` for a texture.
    pub fn as_untextured(&self) -> Option<f32> {
        match self {
            Self::Constant(number) => Some(*number),
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

    /// The value at the given texture coordinates. Counts texture lookups in `lookups`.
    #[inline]
    pub fn evaluate(&self, at: &TexturePoint, lookups: &mut u64) -> f32 {
        match self {
            Self::Constant(number) => *number,
            Self::Texture(texture) => {
                *lookups += 1;
                texture.lookup(at).x
            }
        }
    }
}
