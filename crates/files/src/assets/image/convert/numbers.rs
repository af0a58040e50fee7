//! Numbers of pixels: a channel, alpha or the luminance.

use ::image::DynamicImage;

use super::{Sample, alpha, channels, clean, is_everywhere, rgb, with_samples};
use crate::assets::image::facts::Facts;
use crate::materials::texels::{TexelData, Texels};
use crate::materials::{Channel, PixelValue};
use crate::math::Vec3;
use crate::math::color::{luminance, srgb_to_linear};

/// Samples of a pixel that make its number.
#[derive(Clone, Copy)]
enum Samples {
    /// One sample, which may be sRGB.
    One(usize, bool),
    /// Red, green and blue.
    Luminance,
    /// None: the number is 1.
    Nothing,
}

/// The samples that make a number.
fn samples_of(image: &DynamicImage, (of, is_srgb): (PixelValue, bool), facts: &Facts) -> Samples {
    let is_gray = channels(image) < 3;
    let alpha = alpha(image, facts);
    let of_color = |place: usize| Samples::One(if is_gray { 0 } else { place }, is_srgb);
    let luminance = if is_gray { of_color(0) } else { Samples::Luminance };
    let of_alpha = |alpha| Samples::One(alpha, false);
    match of {
        PixelValue::Luminance => luminance,
        PixelValue::Opacity => alpha.map_or(luminance, of_alpha),
        PixelValue::Mask { of_any_color } => {
            let is_alpha =
                |alpha: &usize| !is_everywhere(image, *alpha, 1.0) || !is_gray_mask(image, of_any_color);
            alpha.filter(is_alpha).map_or(luminance, of_alpha)
        }
        PixelValue::Channel(Channel::Red) => of_color(0),
        PixelValue::Channel(Channel::Green) => of_color(1),
        PixelValue::Channel(Channel::Blue) => of_color(2),
        PixelValue::Channel(Channel::Alpha) => alpha.map_or(Samples::Nothing, of_alpha),
    }
}

/// Whether the luminance of an opaque image is an opacity.
pub(super) fn is_gray_mask(image: &DynamicImage, of_any_color: bool) -> bool {
    of_any_color || has_gray_pixels(image)
}

/// Whether red, green and blue are equal in all pixels.
fn has_gray_pixels(image: &DynamicImage) -> bool {
    fn all<T: Sample>(samples: &[T], channels: usize) -> bool {
        samples.chunks_exact(channels).map(rgb).all(|[r, g, b]| r == g && g == b)
    }
    with_samples!(image, samples => all(samples, channels(image)))
}

/// One number of each pixel, in all channels of a texel.
pub(super) fn texels(image: &DynamicImage, of: (PixelValue, bool), facts: &Facts) -> Texels {
    let (width, height) = (image.width(), image.height());
    let (channels, samples) = (channels(image), samples_of(image, of, facts));
    let mut unusable = 0;
    let data = match (image, samples) {
        (_, Samples::Nothing) => TexelData::Linear8(vec![[u8::MAX; 3]; width as usize * height as usize]),
        (DynamicImage::ImageLuma8(pixels), Samples::One(place, is_srgb)) => {
            one(pixels, (channels, place), is_srgb)
        }
        (DynamicImage::ImageLumaA8(pixels), Samples::One(place, is_srgb)) => {
            one(pixels, (channels, place), is_srgb)
        }
        (DynamicImage::ImageRgb8(pixels), Samples::One(place, is_srgb)) => {
            one(pixels, (channels, place), is_srgb)
        }
        (DynamicImage::ImageRgba8(pixels), Samples::One(place, is_srgb)) => {
            one(pixels, (channels, place), is_srgb)
        }
        (image, samples) => {
            let is_srgb = of.1;
            with_samples!(image, pixels => {
                unusable = unusable_pixels(pixels, channels, samples);
                floating(pixels, channels, samples, is_srgb)
            })
        }
    };
    Texels { width, height, data, unusable }
}

/// Number of the pixels of which some sample that counts is not usable.
fn unusable_pixels<T: Sample>(pixels: &[T], channels: usize, samples: Samples) -> u64 {
    let counted = match samples {
        Samples::One(place, _) => place..place + 1,
        Samples::Luminance => 0..3,
        Samples::Nothing => 0..0,
    };
    let is_broken =
        |pixel: &&[T]| !pixel[counted.clone()].iter().all(|value| clean(value.unit()) == value.unit());
    pixels.chunks_exact(channels).filter(is_broken).count() as u64
}

/// Numbers that are bytes, by the number of samples of a pixel and the place of the one that counts.
fn one(samples: &[u8], (channels, place): (usize, usize), is_srgb: bool) -> TexelData {
    let texels = samples.chunks_exact(channels).map(|pixel| [pixel[place]; 3]).collect();
    if is_srgb { TexelData::Srgb8(texels) } else { TexelData::Linear8(texels) }
}

/// Numbers in floats.
fn floating<T: Sample>(all: &[T], channels: usize, samples: Samples, is_srgb: bool) -> TexelData {
    let decoded = |sample: T, is_srgb: bool| {
        let value = clean(sample.unit());
        if is_srgb { srgb_to_linear(value) } else { value }
    };
    let number = |pixel: &[T]| match samples {
        Samples::One(place, is_srgb) => decoded(pixel[place], is_srgb),
        Samples::Luminance => luminance(Vec3::from_array(rgb(pixel).map(|sample| decoded(sample, is_srgb)))),
        Samples::Nothing => 1.0,
    };
    TexelData::Float(all.chunks_exact(channels).map(number).map(Vec3::splat).collect())
}

#[cfg(test)]
mod tests {
    use super::super::texels;
    use super::*;
    use crate::assets::image::ImageEncoding;
    use ::image::ImageBuffer;

    fn number(image: DynamicImage, of: PixelValue, is_srgb: bool) -> f32 {
        let texels = texels(image, ImageEncoding::Number { of, is_srgb }, &Facts::default());
        let value = texels.get(0, 0);
        assert!(value.x == value.y && value.y == value.z, "{value}");
        value.x
    }

    #[test]
    fn a_pixel_stands_for_a_number() {
        let color =
            || DynamicImage::ImageRgba8(ImageBuffer::from_pixel(1, 1, ::image::Rgba([51, 102, 204, 25])));
        let of = |channel| PixelValue::Channel(channel);
        for (which, exact) in [
            (of(Channel::Red), 0.2),
            (of(Channel::Green), 0.4),
            (of(Channel::Blue), 0.8),
            (of(Channel::Alpha), 25.0 / 255.0),
            (PixelValue::Opacity, 25.0 / 255.0),
            (PixelValue::Luminance, 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.8),
        ] {
            assert!((number(color(), which, false) - exact).abs() < 1e-4, "{which:?}");
        }
        // Alpha has no encoding; the other channels are decoded.
        assert!((number(color(), PixelValue::Opacity, true) - 25.0 / 255.0).abs() < 1e-6);
        assert!((number(color(), of(Channel::Blue), true) - srgb_to_linear(0.8)).abs() < 1e-6);
        // An image without alpha is opaque, or its luminance counts.
        let grey = || DynamicImage::ImageLuma8(ImageBuffer::from_pixel(1, 1, ::image::Luma([51])));
        assert_eq!(number(grey(), of(Channel::Alpha), false), 1.0);
        for which in [PixelValue::Opacity, PixelValue::Luminance, of(Channel::Green)] {
            assert!((number(grey(), which, false) - 0.2).abs() < 1e-6, "{which:?}");
        }
        let deep =
            || DynamicImage::ImageLumaA16(ImageBuffer::from_pixel(1, 1, ::image::LumaA([13107, 52428])));
        assert!((number(deep(), PixelValue::Opacity, true) - 0.8).abs() < 1e-6);
        assert!((number(deep(), PixelValue::Luminance, false) - 0.2).abs() < 1e-6);
        let float =
            || DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(1, 1, ::image::Rgb([2.0, f32::NAN, -1.0])));
        assert_eq!(number(float(), of(Channel::Red), false), 2.0);
        let broken = texels(
            float(),
            ImageEncoding::Number { of: of(Channel::Green), is_srgb: false },
            &Facts::default(),
        );
        assert_eq!((broken.get(0, 0).x, broken.unusable), (0.0, 1));
        // A pixel counts once, however many of its samples are broken.
        let broken = texels(
            float(),
            ImageEncoding::Number { of: PixelValue::Luminance, is_srgb: false },
            &Facts::default(),
        );
        assert_eq!(broken.unusable, 1);
    }
}
