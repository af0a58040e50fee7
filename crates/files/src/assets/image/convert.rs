//! Decoded pixels of any kind → texels.

use ::image::DynamicImage;

use super::ImageEncoding;
use crate::materials::texels::{TexelData, Texels};
use crate::math::Vec3;
use crate::math::color::srgb_to_linear;
use crate::math::limits::LARGEST;

pub(super) fn texels(image: DynamicImage, encoding: ImageEncoding) -> Texels {
    let (width, height) = (image.width(), image.height());
    let channels = usize::from(image.color().channel_count());
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
        ImageEncoding::Linear => (0..=u16::MAX).map(value).collect(),
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
        ImageEncoding::Color | ImageEncoding::Linear => clean(value),
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
