//! Interpretations of the samples in an image file.

use super::metadata::ImageColorMetadata;
use super::space::ColorSpace;
use crate::materials::ChannelSelector;

/// Interpretation of the samples in an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorEncoding {
    /// As declared by the file. By default, integers are sRGB and floats are linear.
    Color,
    /// Always sRGB.
    Srgb,
    /// Always linear, as in normal maps.
    Linear,
    /// Like [`Self::Color`], but keeps negative and nonfinite floats. Used to compare images.
    Raw,
    /// One scalar per pixel, stored in all channels. Alpha is always linear.
    Number {
        /// Source of the scalar.
        of: ChannelSelector,
        /// Whether the color channels are sRGB.
        is_srgb: bool,
    },
    /// Straight surface colors, with the surface's opacity in the alpha channel. Filtering weights the colors
    /// by alpha.
    CutOut(ColorTransferFunction),
}

/// Transfer function for colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorTransferFunction {
    /// As in [`ColorEncoding::Color`].
    Auto,
    /// As in [`ColorEncoding::Srgb`].
    Srgb,
    /// As in [`ColorEncoding::Linear`].
    Linear,
}

impl ColorTransferFunction {
    /// Interpretation of an image that has this transfer function and no alpha.
    pub fn encoding_of_opaque_image(self) -> ColorEncoding {
        match self {
            Self::Auto => ColorEncoding::Color,
            Self::Srgb => ColorEncoding::Srgb,
            Self::Linear => ColorEncoding::Linear,
        }
    }
}

impl ColorEncoding {
    /// Unique index of this interpretation.
    pub fn index(self) -> usize {
        match self {
            Self::Color => 0,
            Self::Srgb => 1,
            Self::Linear => 2,
            Self::Raw => 3,
            Self::Number { of: value, is_srgb } => {
                let index = match value {
                    ChannelSelector::Luminance => 0,
                    ChannelSelector::Opacity => 1,
                    ChannelSelector::Channel(channel) => 2 + channel as usize,
                    ChannelSelector::Mask { of_any_color } => 6 + usize::from(of_any_color),
                };
                4 + 2 * index + usize::from(is_srgb)
            }
            Self::CutOut(curve) => 20 + curve as usize,
        }
    }

    /// Color space of a file's samples.
    pub(super) fn source_color_space(self, metadata: &ImageColorMetadata) -> ColorSpace {
        if self.uses_file_color_space() { metadata.space.clone() } else { ColorSpace::default() }
    }

    /// Whether the file rather than the scene determines the color space.
    pub(super) fn uses_file_color_space(self) -> bool {
        match self {
            Self::Color | Self::Raw | Self::CutOut(ColorTransferFunction::Auto) => true,
            Self::Srgb | Self::Linear | Self::Number { .. } | Self::CutOut(_) => false,
        }
    }
}
