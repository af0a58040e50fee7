//! Converts cutout textures: images whose alpha channel is the opacity of the surface they color.

use ::image::DynamicImage;

use super::{
    Sample, alpha_sample_index, apply_transfer_curves_to_pixel, is_channel_filled_with, pixel_rgb, sanitize,
    with_samples,
};
use crate::assets::image::metadata::{AlphaInterpretation, ImageColorMetadata};
use crate::assets::image::space::ColorSpace;
use crate::assets::image::{ColorEncoding, ColorTransferFunction};
use crate::materials::texels::{TexelData, Texels};
use crate::math::Vec3;
use crate::math::color::srgb_to_linear;

/// Converts an image to alpha-weighted texels, or to plain texels if it is opaque.
pub(super) fn cutout_texels(
    image: DynamicImage,
    curve: ColorTransferFunction,
    metadata: &ImageColorMetadata,
) -> Texels {
    let Some(alpha) =
        alpha_sample_index(&image, metadata).filter(|alpha| !is_channel_filled_with(&image, *alpha, 1.0))
    else {
        return super::image_to_texels(image, curve.encoding_of_opaque_image(), metadata);
    };
    let (width, height) = (image.width(), image.height());
    let space = ColorEncoding::CutOut(curve).source_color_space(metadata);
    let is_direct = space.is_default() && metadata.alpha != AlphaInterpretation::Premultiplied;
    let mut unusable = 0;
    let data = match &image {
        DynamicImage::ImageLumaA8(pixels) if is_direct => pack_straight_alpha_texels(pixels, alpha, curve),
        DynamicImage::ImageRgba8(pixels) if is_direct => pack_straight_alpha_texels(pixels, alpha, curve),
        image => {
            let options = AlphaWeightingOptions {
                alpha,
                curve,
                space,
                is_premultiplied: metadata.alpha == AlphaInterpretation::Premultiplied,
            };
            with_samples!(image, samples => premultiplied_floats(samples, &options, &mut unusable))
        }
    };
    Texels { width, height, data, unusable }
}

fn pack_straight_alpha_texels(samples: &[u8], alpha: usize, curve: ColorTransferFunction) -> TexelData {
    let texel = |pixel: &[u8]| {
        let [red, green, blue] = pixel_rgb(pixel);
        [red, green, blue, pixel[alpha]]
    };
    let texels = samples.chunks_exact(alpha + 1).map(texel).collect();
    match curve {
        ColorTransferFunction::Auto | ColorTransferFunction::Srgb => TexelData::SrgbAlpha8(texels),
        ColorTransferFunction::Linear => TexelData::LinearAlpha8(texels),
    }
}

/// Settings for converting samples to alpha-weighted colors.
struct AlphaWeightingOptions {
    /// Index of the alpha sample in a pixel.
    alpha: usize,
    curve: ColorTransferFunction,
    space: ColorSpace,
    is_premultiplied: bool,
}

/// Linearization of straight-alpha colors.
enum Linearization {
    /// Colors are already linear.
    Linear,
    Srgb,
    Tables([Vec<f32>; 3]),
}

impl AlphaWeightingOptions {
    fn linearization<T: Sample>(&self) -> Linearization {
        match (self.curve, T::linearization_tables(&self.space)) {
            (ColorTransferFunction::Linear, _) | (ColorTransferFunction::Auto, None) => Linearization::Linear,
            (ColorTransferFunction::Auto | ColorTransferFunction::Srgb, Some(tables))
                if !self.is_premultiplied =>
            {
                Linearization::Tables(tables)
            }
            (ColorTransferFunction::Srgb, None)
            | (ColorTransferFunction::Auto | ColorTransferFunction::Srgb, Some(_)) => Linearization::Srgb,
        }
    }
}

/// Converts samples to linear colors multiplied by alpha.
fn premultiplied_floats<T: Sample>(
    samples: &[T],
    options: &AlphaWeightingOptions,
    unusable: &mut u64,
) -> TexelData {
    let decoding = options.linearization::<T>();
    let texel = |pixel: &[T]| {
        let alpha = sanitize(pixel[options.alpha].to_normalized_f32()).min(1.0);
        let encoded = pixel_rgb(pixel).map(T::to_normalized_f32);
        *unusable += u64::from(encoded.map(sanitize) != encoded);
        let divisor = if options.is_premultiplied && alpha > 0.0 { alpha } else { 1.0 };
        let linear = match &decoding {
            Linearization::Linear => encoded.map(|value| value / divisor),
            Linearization::Srgb => encoded.map(|value| srgb_to_linear(sanitize(value / divisor))),
            Linearization::Tables(tables) => apply_transfer_curves_to_pixel(pixel, Some(tables)),
        };
        let color = Vec3::from_array(options.space.convert_linear_to_rec_709(linear).map(sanitize));
        (color * alpha).extend(alpha)
    };
    TexelData::FloatAlpha(samples.chunks_exact(options.alpha + 1).map(texel).collect())
}
