//! Decoded pixels of any kind → texels.

use ::image::DynamicImage;

use super::ImageEncoding;
use crate::materials::texels::{TexelData, Texels};
use crate::materials::{Channel, PixelNumber};
use crate::math::Vec3;
use crate::math::color::{luminance, srgb_to_linear};
use crate::math::limits::LARGEST;

pub(super) fn texels(image: DynamicImage, encoding: ImageEncoding) -> Texels {
    let (width, height) = (image.width(), image.height());
    let channels = usize::from(image.color().channel_count());
    if let ImageEncoding::Number { of, is_srgb } = encoding {
        return numbers(image, channels, (of, is_srgb));
    }
    let mut unusable = 0;
    let data = match image {
        DynamicImage::ImageLuma8(pixels) => bytes(&pixels, channels, encoding),
        DynamicImage::ImageLumaA8(pixels) => bytes(&pixels, channels, encoding),
        DynamicImage::ImageRgb8(pixels) => bytes(&pixels, channels, encoding),
        DynamicImage::ImageRgba8(pixels) => bytes(&pixels, channels, encoding),
        DynamicImage::ImageLuma16(pixels) => words(&pixels, channels, encoding),
        DynamicImage::ImageLumaA16(pixels) => words(&pixels, channels, encoding),
        DynamicImage::ImageRgb16(pixels) => words(&pixels, channels, encoding),
        DynamicImage::ImageRgba16(pixels) => words(&pixels, channels, encoding),
        DynamicImage::ImageRgb32F(pixels) => floats(&pixels, channels, encoding, &mut unusable),
        DynamicImage::ImageRgba32F(pixels) => floats(&pixels, channels, encoding, &mut unusable),
        // Kinds that a later `image` may add.
        other => floats(&other.into_rgb32f(), 3, encoding, &mut unusable),
    };
    Texels { width, height, data, unusable }
}

/// Red, green and blue of a pixel of 1 (grey), 2 (grey, alpha), 3 or 4 samples.
fn rgb<T: Copy>(pixel: &[T]) -> [T; 3] {
    match *pixel {
        [red, green, blue, ..] => [red, green, blue],
        _ => [pixel[0]; 3],
    }
}

fn bytes(samples: &[u8], channels: usize, encoding: ImageEncoding) -> TexelData {
    let texels = samples.chunks_exact(channels).map(rgb).collect();
    if encoding == ImageEncoding::Linear { TexelData::Linear8(texels) } else { TexelData::Srgb8(texels) }
}

fn words(samples: &[u16], channels: usize, encoding: ImageEncoding) -> TexelData {
    let value = |word: u16| f32::from(word) / f32::from(u16::MAX);
    let linear: Vec<f32> = match encoding {
        ImageEncoding::Linear | ImageEncoding::Number { .. } => (0..=u16::MAX).map(value).collect(),
        ImageEncoding::Color | ImageEncoding::Srgb | ImageEncoding::Raw => {
            (0..=u16::MAX).map(|word| srgb_to_linear(value(word))).collect()
        }
    };
    let texel = |pixel| Vec3::from_array(rgb(pixel).map(|word| linear[usize::from(word)]));
    TexelData::Float(samples.chunks_exact(channels).map(texel).collect())
}

fn floats(samples: &[f32], channels: usize, encoding: ImageEncoding, unusable: &mut u64) -> TexelData {
    let clean = |value: f32| if value <= LARGEST as f32 { value.max(0.0) } else { 0.0 };
    let decode = |value: f32| match encoding {
        ImageEncoding::Srgb => clean(srgb_to_linear(clean(value))),
        ImageEncoding::Color | ImageEncoding::Linear | ImageEncoding::Number { .. } => clean(value),
        ImageEncoding::Raw => value,
    };
    let mut texel = |pixel| {
        let rgb = rgb(pixel);
        if encoding != ImageEncoding::Raw {
            *unusable += u64::from(!rgb.iter().all(|value| (0.0..=LARGEST as f32).contains(value)));
        }
        Vec3::from_array(rgb.map(decode))
    };
    TexelData::Float(samples.chunks_exact(channels).map(&mut texel).collect())
}

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

/// The samples that make a number, in pixels of so many.
fn samples_of(channels: usize, (of, is_srgb): (PixelNumber, bool)) -> Samples {
    let alpha = match channels {
        2 => Some(1),
        4 => Some(3),
        _ => None,
    };
    let of_color = |place: usize| Samples::One(if channels < 3 { 0 } else { place }, is_srgb);
    let luminance = if channels < 3 { of_color(0) } else { Samples::Luminance };
    let of_alpha = |alpha| Samples::One(alpha, false);
    match of {
        PixelNumber::Luminance => luminance,
        PixelNumber::Opacity => alpha.map_or(luminance, of_alpha),
        PixelNumber::Channel(Channel::Red) => of_color(0),
        PixelNumber::Channel(Channel::Green) => of_color(1),
        PixelNumber::Channel(Channel::Blue) => of_color(2),
        PixelNumber::Channel(Channel::Alpha) => alpha.map_or(Samples::Nothing, of_alpha),
    }
}

/// One number of each pixel, in all channels of a texel.
fn numbers(image: DynamicImage, channels: usize, of: (PixelNumber, bool)) -> Texels {
    let (width, height) = (image.width(), image.height());
    let (samples, is_srgb) = (samples_of(channels, of), of.1);
    let byte = |byte: u8| f32::from(byte) / f32::from(u8::MAX);
    let word = |word: u16| f32::from(word) / f32::from(u16::MAX);
    let mut unusable = 0;
    let data = match (image, samples) {
        (DynamicImage::ImageLuma8(pixels), Samples::One(place, is_srgb)) => {
            one(&pixels, (channels, place), is_srgb)
        }
        (DynamicImage::ImageLumaA8(pixels), Samples::One(place, is_srgb)) => {
            one(&pixels, (channels, place), is_srgb)
        }
        (DynamicImage::ImageRgb8(pixels), Samples::One(place, is_srgb)) => {
            one(&pixels, (channels, place), is_srgb)
        }
        (DynamicImage::ImageRgba8(pixels), Samples::One(place, is_srgb)) => {
            one(&pixels, (channels, place), is_srgb)
        }
        (_, Samples::Nothing) => TexelData::Linear8(vec![[u8::MAX; 3]; width as usize * height as usize]),
        (DynamicImage::ImageRgb8(pixels), Samples::Luminance) => {
            floating(&pixels, channels, samples, is_srgb, byte)
        }
        (DynamicImage::ImageRgba8(pixels), Samples::Luminance) => {
            floating(&pixels, channels, samples, is_srgb, byte)
        }
        (DynamicImage::ImageLuma16(pixels), _) => floating(&pixels, channels, samples, is_srgb, word),
        (DynamicImage::ImageLumaA16(pixels), _) => floating(&pixels, channels, samples, is_srgb, word),
        (DynamicImage::ImageRgb16(pixels), _) => floating(&pixels, channels, samples, is_srgb, word),
        (DynamicImage::ImageRgba16(pixels), _) => floating(&pixels, channels, samples, is_srgb, word),
        (DynamicImage::ImageRgb32F(pixels), _) => {
            unusable = unusable_pixels(&pixels, channels, samples);
            floating(&pixels, channels, samples, is_srgb, clean)
        }
        (DynamicImage::ImageRgba32F(pixels), _) => {
            unusable = unusable_pixels(&pixels, channels, samples);
            floating(&pixels, channels, samples, is_srgb, clean)
        }
        // Kinds that a later `image` may add.
        (other, _) => {
            let (pixels, samples) = (other.into_rgba32f(), samples_of(4, of));
            unusable = unusable_pixels(&pixels, 4, samples);
            floating(&pixels, 4, samples, is_srgb, clean)
        }
    };
    Texels { width, height, data, unusable }
}

fn is_usable(value: f32) -> bool {
    (0.0..=LARGEST as f32).contains(&value)
}

/// A usable number; the others become 0.
fn clean(value: f32) -> f32 {
    if is_usable(value) { value } else { 0.0 }
}

/// Number of the pixels of which some sample that counts is not usable.
fn unusable_pixels(pixels: &[f32], channels: usize, samples: Samples) -> u64 {
    let counted = match samples {
        Samples::One(place, _) => place..place + 1,
        Samples::Luminance => 0..3,
        Samples::Nothing => 0..0,
    };
    let is_broken = |pixel: &&[f32]| !pixel[counted.clone()].iter().all(|value| is_usable(*value));
    pixels.chunks_exact(channels).filter(is_broken).count() as u64
}

/// Numbers that are bytes, by the number of samples of a pixel and the place of the one that counts.
fn one(samples: &[u8], (channels, place): (usize, usize), is_srgb: bool) -> TexelData {
    let texels = samples.chunks_exact(channels).map(|pixel| [pixel[place]; 3]).collect();
    if is_srgb { TexelData::Srgb8(texels) } else { TexelData::Linear8(texels) }
}

/// Numbers in floats; `value` makes a number of a sample.
fn floating<T: Copy>(
    all: &[T],
    channels: usize,
    samples: Samples,
    is_srgb: bool,
    mut value: impl FnMut(T) -> f32,
) -> TexelData {
    let mut decoded = |sample: T, is_srgb: bool| {
        let value = value(sample);
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
    use super::*;
    use ::image::{DynamicImage, ImageBuffer};

    fn number(image: DynamicImage, of: PixelNumber, is_srgb: bool) -> f32 {
        let texels = texels(image, ImageEncoding::Number { of, is_srgb });
        let value = texels.get(0, 0);
        assert!(value.x == value.y && value.y == value.z, "{value}");
        value.x
    }

    #[test]
    fn a_pixel_stands_for_a_number() {
        let color =
            || DynamicImage::ImageRgba8(ImageBuffer::from_pixel(1, 1, ::image::Rgba([51, 102, 204, 25])));
        let of = |channel| PixelNumber::Channel(channel);
        for (which, exact) in [
            (of(Channel::Red), 0.2),
            (of(Channel::Green), 0.4),
            (of(Channel::Blue), 0.8),
            (of(Channel::Alpha), 25.0 / 255.0),
            (PixelNumber::Opacity, 25.0 / 255.0),
            (PixelNumber::Luminance, 0.2126 * 0.2 + 0.7152 * 0.4 + 0.0722 * 0.8),
        ] {
            assert!((number(color(), which, false) - exact).abs() < 1e-4, "{which:?}");
        }
        // Alpha has no encoding; the other channels are decoded.
        assert!((number(color(), PixelNumber::Opacity, true) - 25.0 / 255.0).abs() < 1e-6);
        assert!((number(color(), of(Channel::Blue), true) - srgb_to_linear(0.8)).abs() < 1e-6);
        // An image without alpha is opaque, or its luminance counts.
        let grey = || DynamicImage::ImageLuma8(ImageBuffer::from_pixel(1, 1, ::image::Luma([51])));
        assert_eq!(number(grey(), of(Channel::Alpha), false), 1.0);
        for which in [PixelNumber::Opacity, PixelNumber::Luminance, of(Channel::Green)] {
            assert!((number(grey(), which, false) - 0.2).abs() < 1e-6, "{which:?}");
        }
        let deep =
            || DynamicImage::ImageLumaA16(ImageBuffer::from_pixel(1, 1, ::image::LumaA([13107, 52428])));
        assert!((number(deep(), PixelNumber::Opacity, true) - 0.8).abs() < 1e-6);
        assert!((number(deep(), PixelNumber::Luminance, false) - 0.2).abs() < 1e-6);
        let float =
            || DynamicImage::ImageRgb32F(ImageBuffer::from_pixel(1, 1, ::image::Rgb([2.0, f32::NAN, -1.0])));
        assert_eq!(number(float(), of(Channel::Red), false), 2.0);
        let broken = texels(float(), ImageEncoding::Number { of: of(Channel::Green), is_srgb: false });
        assert_eq!((broken.get(0, 0).x, broken.unusable), (0.0, 1));
        // A pixel counts once, however many of its samples are broken.
        let broken = texels(float(), ImageEncoding::Number { of: PixelNumber::Luminance, is_srgb: false });
        assert_eq!(broken.unusable, 1);
    }
}
