//! Converts decoded pixels of any type to texels.

mod cutout;
mod scalars;

use ::image::{ColorType, DynamicImage};

use super::ColorEncoding;
use super::metadata::{AlphaInterpretation, ImageColorMetadata};
use super::space::ColorSpace;
use crate::materials::ChannelSelector;
use crate::materials::texels::{TexelData, Texels};
use crate::math::Vec3;
use crate::math::color::srgb_to_linear;
use crate::math::limits::MAX_MAGNITUDE;

/// Evaluates an expression on an image's samples, whatever their type.
macro_rules! with_samples {
    ($image:expr, $samples:ident => $body:expr) => {
        match $image {
            DynamicImage::ImageLuma8($samples) => $body,
            DynamicImage::ImageLumaA8($samples) => $body,
            DynamicImage::ImageRgb8($samples) => $body,
            DynamicImage::ImageRgba8($samples) => $body,
            DynamicImage::ImageLuma16($samples) => $body,
            DynamicImage::ImageLumaA16($samples) => $body,
            DynamicImage::ImageRgb16($samples) => $body,
            DynamicImage::ImageRgba16($samples) => $body,
            DynamicImage::ImageRgb32F($samples) => $body,
            DynamicImage::ImageRgba32F($samples) => $body,
            // Formats added in later versions of `image`.
            other => {
                let $samples = &other.to_rgba32f();
                $body
            }
        }
    };
}
use with_samples;

/// Sample type of an image.
trait Sample: Copy + PartialEq {
    /// Converts the sample to a float. The largest integer becomes 1.
    fn to_normalized_f32(self) -> f32;

    /// Tables that map every integer to its linear value, or `None` for floats, which are already linear.
    fn linearization_tables(_: &ColorSpace) -> Option<[Vec<f32>; 3]> {
        None
    }

    /// Index of an integer sample in the table.
    fn table_index(self) -> usize {
        0
    }
}

impl Sample for u8 {
    fn to_normalized_f32(self) -> f32 {
        f32::from(self) / f32::from(Self::MAX)
    }

    fn linearization_tables(space: &ColorSpace) -> Option<[Vec<f32>; 3]> {
        Some(space.linearization_tables(u16::from(Self::MAX)))
    }

    fn table_index(self) -> usize {
        usize::from(self)
    }
}

impl Sample for u16 {
    fn to_normalized_f32(self) -> f32 {
        f32::from(self) / f32::from(Self::MAX)
    }

    fn linearization_tables(space: &ColorSpace) -> Option<[Vec<f32>; 3]> {
        Some(space.linearization_tables(Self::MAX))
    }

    fn table_index(self) -> usize {
        usize::from(self)
    }
}

impl Sample for f32 {
    fn to_normalized_f32(self) -> f32 {
        self
    }
}

/// Number of samples per pixel.
fn channel_count(image: &DynamicImage) -> usize {
    usize::from(image.color().channel_count())
}

/// Index of the alpha sample, if the image has alpha.
fn alpha_sample_index(image: &DynamicImage, metadata: &ImageColorMetadata) -> Option<usize> {
    let index = match channel_count(image) {
        2 => 1,
        4 => 3,
        _ => return None,
    };
    match metadata.alpha {
        AlphaInterpretation::Straight | AlphaInterpretation::Premultiplied => Some(index),
        AlphaInterpretation::Unused | AlphaInterpretation::Dropped => None,
        AlphaInterpretation::UnusedIfZero => (!is_channel_filled_with(image, index, 0.0)).then_some(index),
    }
}

/// Whether channel `index` equals `value` in every pixel.
fn is_channel_filled_with(image: &DynamicImage, index: usize, value: f32) -> bool {
    fn channel_has_only_value<T: Sample>(samples: &[T], channels: usize, index: usize, value: f32) -> bool {
        samples.chunks_exact(channels).all(|pixel| pixel[index].to_normalized_f32() == value)
    }
    with_samples!(image, samples => channel_has_only_value(samples, channel_count(image), index, value))
}

/// Returns the warning, if any, about an opacity read from an alpha channel that is constant or not decoded.
pub(super) fn opacity_from_alpha_warning(
    image: &DynamicImage,
    encoding: ColorEncoding,
    metadata: &ImageColorMetadata,
) -> Option<&'static str> {
    let ColorEncoding::Number { of: ChannelSelector::Opacity | ChannelSelector::Mask { .. }, .. } = encoding
    else {
        return None;
    };
    if metadata.alpha == AlphaInterpretation::Dropped {
        return Some(ALPHA_BIT_IGNORED);
    }
    let alpha = alpha_sample_index(image, metadata)?;
    if is_channel_filled_with(image, alpha, 0.0) {
        return Some(INVISIBLE);
    }
    match encoding {
        ColorEncoding::Number { of: ChannelSelector::Mask { of_any_color }, .. }
            if is_channel_filled_with(image, alpha, 1.0) =>
        {
            Some(if scalars::uses_luminance_opacity_if_opaque(image, of_any_color) {
                LUMINANCE_USED
            } else {
                OPAQUE
            })
        }
        _ => None,
    }
}

/// Warnings about alpha.
pub(super) const ALPHA_BIT_IGNORED: &str =
    "the alpha bit of 16-bit TGA pixels is ignored; save the image as PNG or as a 32-bit TGA";
pub(super) const INVISIBLE: &str = "alpha is 0 everywhere; the surface is invisible";
pub(super) const LUMINANCE_USED: &str = "alpha is 1 everywhere; luminance is used as the opacity";
pub(super) const OPAQUE: &str =
    "alpha is 1 everywhere, so the surface is opaque; set `channel` to use a color channel as the opacity";

/// Converts an image to texels.
pub(super) fn image_to_texels(
    image: DynamicImage,
    encoding: ColorEncoding,
    metadata: &ImageColorMetadata,
) -> Texels {
    // Convert formats added in later versions of `image`.
    let image = match image.color() {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => image,
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => image,
        ColorType::Rgb32F | ColorType::Rgba32F => image,
        _ => image.into_rgba32f().into(),
    };
    match encoding {
        ColorEncoding::Number { of, is_srgb } => {
            return scalars::scalar_texels(&image, of, is_srgb, metadata);
        }
        ColorEncoding::CutOut(curve) => return cutout::cutout_texels(image, curve, metadata),
        ColorEncoding::Color | ColorEncoding::Srgb | ColorEncoding::Linear | ColorEncoding::Raw => {}
    }
    let (width, height) = (image.width(), image.height());
    let channels = channel_count(&image);
    let mut unusable = 0;
    if !encoding.source_color_space(metadata).is_default() {
        let data = convert_color_space(&image, encoding, metadata, &mut unusable);
        return Texels { width, height, data, unusable };
    }
    let data = match image {
        DynamicImage::ImageLuma8(pixels) => texels_from_bytes(&pixels, channels, encoding),
        DynamicImage::ImageLumaA8(pixels) => texels_from_bytes(&pixels, channels, encoding),
        DynamicImage::ImageRgb8(pixels) => texels_from_bytes(&pixels, channels, encoding),
        DynamicImage::ImageRgba8(pixels) => texels_from_bytes(&pixels, channels, encoding),
        DynamicImage::ImageLuma16(pixels) => texels_from_u16(&pixels, channels, encoding),
        DynamicImage::ImageLumaA16(pixels) => texels_from_u16(&pixels, channels, encoding),
        DynamicImage::ImageRgb16(pixels) => texels_from_u16(&pixels, channels, encoding),
        DynamicImage::ImageRgba16(pixels) => texels_from_u16(&pixels, channels, encoding),
        DynamicImage::ImageRgb32F(pixels) => texels_from_floats(&pixels, channels, encoding, &mut unusable),
        DynamicImage::ImageRgba32F(pixels) => texels_from_floats(&pixels, channels, encoding, &mut unusable),
        // Formats added in later versions of `image`.
        other => texels_from_floats(&other.into_rgb32f(), 3, encoding, &mut unusable),
    };
    Texels { width, height, data, unusable }
}

/// Returns a pixel's red, green and blue. A pixel has 1 (gray), 2 (gray and alpha), 3 or 4 samples.
fn pixel_rgb<T: Copy>(pixel: &[T]) -> [T; 3] {
    match *pixel {
        [red, green, blue, ..] => [red, green, blue],
        _ => [pixel[0]; 3],
    }
}

fn texels_from_bytes(samples: &[u8], channels: usize, encoding: ColorEncoding) -> TexelData {
    let texels = samples.chunks_exact(channels).map(pixel_rgb).collect();
    if encoding == ColorEncoding::Linear { TexelData::Linear8(texels) } else { TexelData::Srgb8(texels) }
}

fn texels_from_u16(samples: &[u16], channels: usize, encoding: ColorEncoding) -> TexelData {
    let value = |word: u16| f32::from(word) / f32::from(u16::MAX);
    let linear: Vec<f32> = match encoding {
        ColorEncoding::Linear | ColorEncoding::Number { .. } | ColorEncoding::CutOut(_) => {
            (0..=u16::MAX).map(value).collect()
        }
        ColorEncoding::Color | ColorEncoding::Srgb | ColorEncoding::Raw => {
            (0..=u16::MAX).map(|word| srgb_to_linear(value(word))).collect()
        }
    };
    let texel = |pixel| Vec3::from_array(pixel_rgb(pixel).map(|word| linear[usize::from(word)]));
    TexelData::Float(samples.chunks_exact(channels).map(texel).collect())
}

fn texels_from_floats(
    samples: &[f32],
    channels: usize,
    encoding: ColorEncoding,
    unusable: &mut u64,
) -> TexelData {
    let clean = |value: f32| if value <= MAX_MAGNITUDE as f32 { value.max(0.0) } else { 0.0 };
    let decode = |value: f32| match encoding {
        ColorEncoding::Srgb => clean(srgb_to_linear(clean(value))),
        ColorEncoding::Color
        | ColorEncoding::Linear
        | ColorEncoding::Number { .. }
        | ColorEncoding::CutOut(_) => clean(value),
        ColorEncoding::Raw => value,
    };
    let mut texel = |pixel| {
        let rgb = pixel_rgb(pixel);
        if encoding != ColorEncoding::Raw {
            *unusable += u64::from(!rgb.iter().all(|value| (0.0..=MAX_MAGNITUDE as f32).contains(value)));
        }
        Vec3::from_array(rgb.map(decode))
    };
    TexelData::Float(samples.chunks_exact(channels).map(&mut texel).collect())
}

/// Converts colors from a nonstandard color space. Colors outside Rec. 709 are clipped, except for
/// [`ColorEncoding::Raw`].
fn convert_color_space(
    image: &DynamicImage,
    encoding: ColorEncoding,
    metadata: &ImageColorMetadata,
    unusable: &mut u64,
) -> TexelData {
    fn convert_samples_color_space<T: Sample>(
        samples: &[T],
        channels: usize,
        space: &ColorSpace,
        is_raw: bool,
        unusable: &mut u64,
    ) -> TexelData {
        let tables = T::linearization_tables(space);
        let mut texel = |pixel| {
            let linear = apply_transfer_curves_to_pixel(pixel, tables.as_ref());
            let color = space.convert_linear_to_rec_709(linear);
            if is_raw {
                return Vec3::from_array(color);
            }
            *unusable += u64::from(!linear.iter().all(|value| value.abs() <= MAX_MAGNITUDE as f32));
            Vec3::from_array(color.map(sanitize))
        };
        TexelData::Float(samples.chunks_exact(channels).map(&mut texel).collect())
    }
    let space = encoding.source_color_space(metadata);
    let is_raw = encoding == ColorEncoding::Raw;
    with_samples!(image, samples => {
        convert_samples_color_space(samples, channel_count(image), &space, is_raw, unusable)
    })
}

/// Linearizes a pixel, using tables for integers.
fn apply_transfer_curves_to_pixel<T: Sample>(pixel: &[T], tables: Option<&[Vec<f32>; 3]>) -> [f32; 3] {
    let rgb = pixel_rgb(pixel);
    match tables {
        Some(tables) => std::array::from_fn(|i| tables[i][rgb[i].table_index()]),
        None => rgb.map(T::to_normalized_f32),
    }
}

/// Replaces negative, excessively large and non-finite values with 0.
fn sanitize(value: f32) -> f32 {
    if (0.0..=MAX_MAGNITUDE as f32).contains(&value) { value } else { 0.0 }
}
