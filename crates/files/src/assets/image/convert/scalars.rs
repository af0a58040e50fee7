//! Converts pixels to scalars: a color channel, alpha or luminance.

use ::image::DynamicImage;

use super::{
    Sample, alpha_sample_index, channel_count, is_channel_filled_with, pixel_rgb, sanitize, with_samples,
};
use crate::assets::image::metadata::ImageColorMetadata;
use crate::materials::texels::{TexelData, Texels};
use crate::materials::{Channel, ChannelSelector};
use crate::math::Vec3;
use crate::math::color::{luminance, srgb_to_linear};

/// Samples from which a pixel's scalar is computed.
#[derive(Clone, Copy)]
enum ScalarSource {
    /// One sample: its index, and whether it is sRGB.
    Sample(usize, bool),
    /// Luminance of red, green and blue.
    Luminance,
    /// No sample: the scalar is 1.
    One,
}

/// Selects the samples from which the scalar is computed.
fn choose_scalar_source(
    image: &DynamicImage,
    of: ChannelSelector,
    is_srgb: bool,
    metadata: &ImageColorMetadata,
) -> ScalarSource {
    let is_gray = channel_count(image) < 3;
    let alpha = alpha_sample_index(image, metadata);
    let of_color = |place: usize| ScalarSource::Sample(if is_gray { 0 } else { place }, is_srgb);
    let luminance = if is_gray { of_color(0) } else { ScalarSource::Luminance };
    let of_alpha = |alpha| ScalarSource::Sample(alpha, false);
    match of {
        ChannelSelector::Luminance => luminance,
        ChannelSelector::Opacity => alpha.map_or(luminance, of_alpha),
        ChannelSelector::Mask { of_any_color } => {
            let is_alpha = |alpha: &usize| {
                !is_channel_filled_with(image, *alpha, 1.0)
                    || !uses_luminance_opacity_if_opaque(image, of_any_color)
            };
            alpha.filter(is_alpha).map_or(luminance, of_alpha)
        }
        ChannelSelector::Channel(Channel::Red) => of_color(0),
        ChannelSelector::Channel(Channel::Green) => of_color(1),
        ChannelSelector::Channel(Channel::Blue) => of_color(2),
        ChannelSelector::Channel(Channel::Alpha) => alpha.map_or(ScalarSource::One, of_alpha),
    }
}

/// Whether to use an opaque image's luminance as its opacity.
pub(super) fn uses_luminance_opacity_if_opaque(image: &DynamicImage, of_any_color: bool) -> bool {
    of_any_color || has_only_gray_pixels(image)
}

/// Whether red, green and blue are equal in all pixels.
fn has_only_gray_pixels(image: &DynamicImage) -> bool {
    fn all_pixels_gray<T: Sample>(samples: &[T], channels: usize) -> bool {
        samples.chunks_exact(channels).map(pixel_rgb).all(|[r, g, b]| r == g && g == b)
    }
    with_samples!(image, samples => all_pixels_gray(samples, channel_count(image)))
}

/// Converts an image to texels that contain the scalar in all channels.
pub(super) fn scalar_texels(
    image: &DynamicImage,
    of: ChannelSelector,
    is_srgb: bool,
    metadata: &ImageColorMetadata,
) -> Texels {
    let (width, height) = (image.width(), image.height());
    let (channels, samples) = (channel_count(image), choose_scalar_source(image, of, is_srgb, metadata));
    let mut unusable = 0;
    let data = match (image, samples) {
        (_, ScalarSource::One) => TexelData::Linear8(vec![[u8::MAX; 3]; width as usize * height as usize]),
        (DynamicImage::ImageLuma8(pixels), ScalarSource::Sample(place, is_srgb)) => {
            scalar_texels_from_bytes(pixels, channels, place, is_srgb)
        }
        (DynamicImage::ImageLumaA8(pixels), ScalarSource::Sample(place, is_srgb)) => {
            scalar_texels_from_bytes(pixels, channels, place, is_srgb)
        }
        (DynamicImage::ImageRgb8(pixels), ScalarSource::Sample(place, is_srgb)) => {
            scalar_texels_from_bytes(pixels, channels, place, is_srgb)
        }
        (DynamicImage::ImageRgba8(pixels), ScalarSource::Sample(place, is_srgb)) => {
            scalar_texels_from_bytes(pixels, channels, place, is_srgb)
        }
        (image, samples) => with_samples!(image, pixels => {
            unusable = count_unusable_pixels(pixels, channels, samples);
            scalar_texels_from_samples(pixels, channels, samples, is_srgb)
        }),
    };
    Texels { width, height, data, unusable }
}

/// Counts the pixels in which any used sample is negative, too large or not finite.
fn count_unusable_pixels<T: Sample>(pixels: &[T], channels: usize, samples: ScalarSource) -> u64 {
    let used = match samples {
        ScalarSource::Sample(place, _) => place..place + 1,
        ScalarSource::Luminance => 0..3,
        ScalarSource::One => 0..0,
    };
    let is_broken = |pixel: &&[T]| {
        !pixel[used.clone()]
            .iter()
            .all(|value| sanitize(value.to_normalized_f32()) == value.to_normalized_f32())
    };
    pixels.chunks_exact(channels).filter(is_broken).count() as u64
}

/// Converts 8-bit samples to texels. `channels` is the number of samples per pixel, and `index` selects the
/// sample to use.
fn scalar_texels_from_bytes(samples: &[u8], channels: usize, index: usize, is_srgb: bool) -> TexelData {
    let texels = samples.chunks_exact(channels).map(|pixel| [pixel[index]; 3]).collect();
    if is_srgb { TexelData::Srgb8(texels) } else { TexelData::Linear8(texels) }
}

/// Converts samples of any type to texels.
fn scalar_texels_from_samples<T: Sample>(
    all: &[T],
    channels: usize,
    samples: ScalarSource,
    is_srgb: bool,
) -> TexelData {
    let decoded = |sample: T, is_srgb: bool| {
        let value = sanitize(sample.to_normalized_f32());
        if is_srgb { srgb_to_linear(value) } else { value }
    };
    let number = |pixel: &[T]| match samples {
        ScalarSource::Sample(place, is_srgb) => decoded(pixel[place], is_srgb),
        ScalarSource::Luminance => {
            luminance(Vec3::from_array(pixel_rgb(pixel).map(|sample| decoded(sample, is_srgb))))
        }
        ScalarSource::One => 1.0,
    };
    TexelData::Float(all.chunks_exact(channels).map(number).map(Vec3::splat).collect())
}

#[cfg(test)]
mod tests {
    use super::super::image_to_texels;
    use super::*;
    use crate::assets::image::ColorEncoding;
    use ::image::ImageBuffer;

    fn number(image: DynamicImage, of: ChannelSelector, is_srgb: bool) -> f32 {
        let texels =
            image_to_texels(image, ColorEncoding::Number { of, is_srgb }, &ImageColorMetadata::default());
        let value = texels.get(0, 0);
        assert!(value.x == value.y && value.y == value.z, "{value}");
        value.x
    }

    #[test]
    fn selected_channel_determines_the_scalar() {
        let color =
            || DynamicImage::ImageRgba8(ImageBuffer::from_pixel(1, 1, ::image::Rgba([51, 102, 204, 25])));
        let of = |channel| ChannelSelector::Channel(channel);
        for (which, exact) in [
            (of(Channel::Red), 0.2),
            (of(Channel::Green), 0.4),
            (of(Channel::Blue), 0.8),
            (of(Channel::Alpha), 25.0 / 255.0),
            (ChannelSelector::Opacity, 25.0 / 255.0),
            (ChannelSelector::Luminance, 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.8),
        ] {
            assert!((number(color(), which, false) - exact).abs() < 1e-4, "{which:?}");
        }
        // Alpha is always linear; the other channels are decoded from sRGB.
        assert!((number(color(), ChannelSelector::Opacity, true) - 25.0 / 255.0).abs() < 1e-6);
        assert!((number(color(), of(Channel::Blue), true) - srgb_to_linear(0.8)).abs() < 1e-6);
        // Without an alpha channel, alpha is 1, and the opacity is the luminance.
        let gray = || DynamicImage::ImageLuma8(ImageBuffer::from_pixel(1, 1, ::image::Luma([51])));
        assert_eq!(number(gray(), of(Channel::Alpha), false), 1.0);
        for which in [ChannelSelector::Opacity, ChannelSelector::Luminance, of(Channel::Green)] {
            assert!((number(gray(), which, false) - 0.2).abs() < 1e-6, "{which:?}");
        }
        let deep =
            || DynamicImage::ImageLumaA16(ImageBuffer::from_pixel(1, 1, ::image::LumaA([13107, 52428])));
        assert!((number(deep(), ChannelSelector::Opacity, true) - 0.8).abs() < 1e-6);
        assert!((number(deep(), ChannelSelector::Luminance, false) - 0.2).abs() < 1e-6);
        let float =
            || DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(1, 1, ::image::Rgb([2.0, f32::NAN, -1.0])));
        assert_eq!(number(float(), of(Channel::Red), false), 2.0);
        let broken = image_to_texels(
            float(),
            ColorEncoding::Number { of: of(Channel::Green), is_srgb: false },
            &ImageColorMetadata::default(),
        );
        assert_eq!((broken.get(0, 0).x, broken.unusable), (0.0, 1));
        // A pixel with several unusable samples is counted once.
        let broken = image_to_texels(
            float(),
            ColorEncoding::Number { of: ChannelSelector::Luminance, is_srgb: false },
            &ImageColorMetadata::default(),
        );
        assert_eq!(broken.unusable, 1);
    }
}
