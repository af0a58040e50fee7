//! Colors of a surface whose opacity is the alpha of the same image.

use ::image::DynamicImage;

use super::{Sample, alpha, clean, is_everywhere, linear, rgb, with_samples};
use crate::assets::image::facts::{Alpha, Facts};
use crate::assets::image::space::ColorSpace;
use crate::assets::image::{ColorCurve, ImageEncoding};
use crate::materials::texels::{TexelData, Texels};
use crate::math::Vec3;
use crate::math::color::srgb_to_linear;

/// Texels that are weighted by alpha; plain ones if the image is opaque.
pub(super) fn texels(image: DynamicImage, curve: ColorCurve, facts: &Facts) -> Texels {
    let Some(alpha) = alpha(&image, facts).filter(|alpha| !is_everywhere(&image, *alpha, 1.0)) else {
        return super::texels(image, curve.encoding(), facts);
    };
    let (width, height) = (image.width(), image.height());
    let space = ImageEncoding::CutOut(curve).space(facts);
    let is_plain = space.is_usual() && facts.alpha != Alpha::Premultiplied;
    let mut unusable = 0;
    let data = match &image {
        DynamicImage::ImageLumaA8(pixels) if is_plain => bytes(pixels, alpha, curve),
        DynamicImage::ImageRgba8(pixels) if is_plain => bytes(pixels, alpha, curve),
        image => {
            let how = How { alpha, curve, space, is_premultiplied: facts.alpha == Alpha::Premultiplied };
            with_samples!(image, samples => floats(samples, &how, &mut unusable))
        }
    };
    Texels { width, height, data, unusable }
}

fn bytes(samples: &[u8], alpha: usize, curve: ColorCurve) -> TexelData {
    let texel = |pixel: &[u8]| {
        let [red, green, blue] = rgb(pixel);
        [red, green, blue, pixel[alpha]]
    };
    let texels = samples.chunks_exact(alpha + 1).map(texel).collect();
    match curve {
        ColorCurve::Auto | ColorCurve::Srgb => TexelData::SrgbAlpha8(texels),
        ColorCurve::Linear => TexelData::LinearAlpha8(texels),
    }
}

/// How samples become colors.
struct How {
    /// Place of alpha.
    alpha: usize,
    curve: ColorCurve,
    space: ColorSpace,
    is_premultiplied: bool,
}

/// How colors that are not multiplied by alpha become linear.
enum Decoding {
    /// They are.
    Linear,
    Srgb,
    Tables([Vec<f32>; 3]),
}

impl How {
    fn decoding<T: Sample>(&self) -> Decoding {
        match (self.curve, T::tables(&self.space)) {
            (ColorCurve::Linear, _) | (ColorCurve::Auto, None) => Decoding::Linear,
            (ColorCurve::Auto | ColorCurve::Srgb, Some(tables)) if !self.is_premultiplied => {
                Decoding::Tables(tables)
            }
            (ColorCurve::Srgb, None) | (ColorCurve::Auto | ColorCurve::Srgb, Some(_)) => Decoding::Srgb,
        }
    }
}

/// Linear colors, multiplied by alpha.
fn floats<T: Sample>(samples: &[T], how: &How, unusable: &mut u64) -> TexelData {
    let decoding = how.decoding::<T>();
    let texel = |pixel: &[T]| {
        let alpha = clean(pixel[how.alpha].unit()).min(1.0);
        let encoded = rgb(pixel).map(T::unit);
        *unusable += u64::from(encoded.map(clean) != encoded);
        let divisor = if how.is_premultiplied && alpha > 0.0 { alpha } else { 1.0 };
        let linear = match &decoding {
            Decoding::Linear => encoded.map(|value| value / divisor),
            Decoding::Srgb => encoded.map(|value| srgb_to_linear(clean(value / divisor))),
            Decoding::Tables(tables) => linear(pixel, Some(tables)),
        };
        let color = Vec3::from_array(how.space.converted(linear).map(clean));
        (color * alpha).extend(alpha)
    };
    TexelData::FloatAlpha(samples.chunks_exact(how.alpha + 1).map(texel).collect())
}
