//! Decoded pixels of any kind → texels.

mod cutout;
mod numbers;

use ::image::{ColorType, DynamicImage};

use super::ImageEncoding;
use super::facts::{Alpha, Facts};
use super::space::ColorSpace;
use crate::materials::PixelValue;
use crate::materials::texels::{TexelData, Texels};
use crate::math::Vec3;
use crate::math::color::srgb_to_linear;
use crate::math::limits::LARGEST;

/// Gives the samples of an image of a known kind to an expression.
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
            // Kinds that a later `image` may add become this one.
            other => {
                let $samples = &other.to_rgba32f();
                $body
            }
        }
    };
}
use with_samples;

/// A sample of a file.
trait Sample: Copy + PartialEq {
    /// The sample, with 1 for the largest whole number.
    fn unit(self) -> f32;

    /// Linear values of whole numbers in this space. Floats are linear.
    fn tables(_: &ColorSpace) -> Option<[Vec<f32>; 3]> {
        None
    }

    /// Place in a table of whole numbers.
    fn index(self) -> usize {
        0
    }
}

impl Sample for u8 {
    fn unit(self) -> f32 {
        f32::from(self) / f32::from(Self::MAX)
    }

    fn tables(space: &ColorSpace) -> Option<[Vec<f32>; 3]> {
        Some(space.tables(u16::from(Self::MAX)))
    }

    fn index(self) -> usize {
        usize::from(self)
    }
}

impl Sample for u16 {
    fn unit(self) -> f32 {
        f32::from(self) / f32::from(Self::MAX)
    }

    fn tables(space: &ColorSpace) -> Option<[Vec<f32>; 3]> {
        Some(space.tables(Self::MAX))
    }

    fn index(self) -> usize {
        usize::from(self)
    }
}

impl Sample for f32 {
    fn unit(self) -> f32 {
        self
    }
}

/// Number of samples of a pixel, as [`with_samples`] gives them.
fn channels(image: &DynamicImage) -> usize {
    usize::from(image.color().channel_count())
}

/// The place of alpha among the samples of a pixel. `None` without alpha.
fn alpha(image: &DynamicImage, facts: &Facts) -> Option<usize> {
    let place = match channels(image) {
        2 => 1,
        4 => 3,
        _ => return None,
    };
    match facts.alpha {
        Alpha::Straight | Alpha::Premultiplied => Some(place),
        Alpha::Unused => None,
        Alpha::Unsure => (!is_everywhere(image, place, 0.0)).then_some(place),
    }
}

/// Whether a sample has this value in all pixels.
fn is_everywhere(image: &DynamicImage, place: usize, value: f32) -> bool {
    fn all<T: Sample>(samples: &[T], (channels, place): (usize, usize), value: f32) -> bool {
        samples.chunks_exact(channels).all(|pixel| pixel[place].unit() == value)
    }
    with_samples!(image, samples => all(samples, (channels(image), place), value))
}

/// A warning about the alpha that an opacity is taken from, if it is the same in all pixels.
pub(super) fn constant_alpha(
    image: &DynamicImage,
    encoding: ImageEncoding,
    facts: &Facts,
) -> Option<&'static str> {
    let ImageEncoding::Number { of: PixelValue::Opacity | PixelValue::Mask { .. }, .. } = encoding else {
        return None;
    };
    let alpha = alpha(image, facts)?;
    if is_everywhere(image, alpha, 0.0) {
        return Some("its alpha is 0 everywhere: the surface is invisible");
    }
    match encoding {
        ImageEncoding::Number { of: PixelValue::Mask { of_any_color }, .. }
            if is_everywhere(image, alpha, 1.0) =>
        {
            Some(if numbers::is_gray_mask(image, of_any_color) {
                "its alpha is 1 everywhere: its luminance is the opacity"
            } else {
                "its alpha is 1 everywhere: the surface is opaque; `channel` takes the opacity from a color"
            })
        }
        _ => None,
    }
}

/// Texels of an image.
pub(super) fn texels(image: DynamicImage, encoding: ImageEncoding, facts: &Facts) -> Texels {
    // Kinds that a later `image` may add.
    let image = match image.color() {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => image,
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => image,
        ColorType::Rgb32F | ColorType::Rgba32F => image,
        _ => image.into_rgba32f().into(),
    };
    match encoding {
        ImageEncoding::Number { of, is_srgb } => return numbers::texels(&image, (of, is_srgb), facts),
        ImageEncoding::CutOut(curve) => return cutout::texels(image, curve, facts),
        ImageEncoding::Color | ImageEncoding::Srgb | ImageEncoding::Linear | ImageEncoding::Raw => {}
    }
    let (width, height) = (image.width(), image.height());
    let channels = channels(&image);
    let mut unusable = 0;
    if !encoding.space(facts).is_usual() {
        let data = converted(&image, encoding, facts, &mut unusable);
        return Texels { width, height, data, unusable };
    }
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
        ImageEncoding::Linear | ImageEncoding::Number { .. } | ImageEncoding::CutOut(_) => {
            (0..=u16::MAX).map(value).collect()
        }
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
        ImageEncoding::Color
        | ImageEncoding::Linear
        | ImageEncoding::Number { .. }
        | ImageEncoding::CutOut(_) => clean(value),
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

/// Colors of another space than the usual one. Those beyond Rec. 709 are clipped, but for [`ImageEncoding::Raw`].
fn converted(image: &DynamicImage, encoding: ImageEncoding, facts: &Facts, unusable: &mut u64) -> TexelData {
    fn each<T: Sample>(
        samples: &[T],
        channels: usize,
        (space, is_raw): (&ColorSpace, bool),
        unusable: &mut u64,
    ) -> TexelData {
        let tables = T::tables(space);
        let mut texel = |pixel| {
            let linear = linear(pixel, tables.as_ref());
            let color = space.converted(linear);
            if is_raw {
                return Vec3::from_array(color);
            }
            *unusable += u64::from(!linear.iter().all(|value| value.abs() <= LARGEST as f32));
            Vec3::from_array(color.map(clean))
        };
        TexelData::Float(samples.chunks_exact(channels).map(&mut texel).collect())
    }
    let space = encoding.space(facts);
    let how = (&space, encoding == ImageEncoding::Raw);
    with_samples!(image, samples => each(samples, channels(image), how, unusable))
}

/// Linear light of a pixel, by tables for whole numbers.
fn linear<T: Sample>(pixel: &[T], tables: Option<&[Vec<f32>; 3]>) -> [f32; 3] {
    let rgb = rgb(pixel);
    match tables {
        Some(tables) => std::array::from_fn(|i| tables[i][rgb[i].index()]),
        None => rgb.map(T::unit),
    }
}

/// A value that light can have; the others become 0.
fn clean(value: f32) -> f32 {
    if (0.0..=LARGEST as f32).contains(&value) { value } else { 0.0 }
}
