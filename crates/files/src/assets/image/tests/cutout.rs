//! Tests for cutout textures and opacity masks.

use ::image::{DynamicImage, ImageBuffer, Rgba};

use super::*;
use crate::assets::image::convert;
use crate::assets::image::metadata::{AlphaInterpretation, ImageColorMetadata};
use crate::materials::Channel;
use crate::math::Vec4;

fn bytes(pixels: &[[u8; 4]]) -> DynamicImage {
    let samples = pixels.as_flattened().to_vec();
    ImageBuffer::from_raw(pixels.len() as u32, 1, samples).map(DynamicImage::ImageRgba8).expect("whole")
}

fn texels(image: DynamicImage, encoding: ColorEncoding, alpha: AlphaInterpretation) -> Texels {
    convert::image_to_texels(image, encoding, &ImageColorMetadata { alpha, ..ImageColorMetadata::default() })
}

#[test]
fn colors_are_alpha_weighted_unless_opaque() {
    let cut = [[255, 0, 0, 51], [0, 255, 0, 255]];
    let data = |pixels: &[[u8; 4]], curve| {
        texels(bytes(pixels), ColorEncoding::CutOut(curve), AlphaInterpretation::Straight).data
    };
    assert_eq!(data(&cut, ColorTransferFunction::Auto), TexelData::SrgbAlpha8(cut.to_vec()));
    assert_eq!(data(&cut, ColorTransferFunction::Linear), TexelData::LinearAlpha8(cut.to_vec()));
    assert_eq!(data(&[[1, 2, 3, 255]], ColorTransferFunction::Srgb), TexelData::Srgb8(vec![[1, 2, 3]]));
    let texels = Texels { width: 2, height: 1, data: data(&cut, ColorTransferFunction::Auto), unusable: 0 };
    assert_eq!([texels.get(0, 0), texels.get(1, 0)], [Vec3::X, Vec3::Y]);
    assert_eq!(texels.premultiplied_texel(0), Vec4::new(0.2, 0.0, 0.0, 0.2));
    assert!((texels.mean() - Vec3::new(1.0 / 6.0, 5.0 / 6.0, 0.0)).length() < 1e-6);
}

#[test]
fn premultiplied_colors_are_unmultiplied_once() {
    let image = || {
        let pixels = vec![0.5, 0.25, 0.0, 0.5, 3.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        ImageBuffer::<Rgba<f32>, _>::from_raw(3, 1, pixels).map(DynamicImage::ImageRgba32F).expect("whole")
    };
    let loaded = |curve| texels(image(), ColorEncoding::CutOut(curve), AlphaInterpretation::Premultiplied);
    for curve in [ColorTransferFunction::Auto, ColorTransferFunction::Linear] {
        let texels = loaded(curve);
        assert_eq!([0, 2].map(|x| texels.get(x, 0)), [Vec3::new(1.0, 0.5, 0.0), Vec3::ONE]);
        assert_eq!(texels.premultiplied_texel(0), Vec4::new(0.5, 0.25, 0.0, 0.5));
    }
    assert!((loaded(ColorTransferFunction::Srgb).get(0, 0).y - srgb_to_linear(0.5)).abs() < 1e-6);
    // Without a cutout, the color is composited over black.
    let plain = texels(image(), ColorEncoding::Color, AlphaInterpretation::Premultiplied);
    assert_eq!(plain.get(0, 0), Vec3::new(0.5, 0.25, 0.0));
}

#[test]
fn masks_without_alpha_use_the_luminance() {
    let number = |image: DynamicImage, of| {
        texels(image, ColorEncoding::Number { of, is_srgb: false }, AlphaInterpretation::Straight).get(0, 0).x
    };
    let mask = |of_any_color| ChannelSelector::Mask { of_any_color };
    let gray = || bytes(&[[51, 51, 51, 255], [0, 0, 0, 255]]);
    let red = || bytes(&[[255, 0, 0, 255]]);
    for (image, of, expected) in [
        (gray(), mask(false), 0.2),
        (gray(), mask(true), 0.2),
        (gray(), ChannelSelector::Opacity, 1.0),
        (gray(), ChannelSelector::Channel(Channel::Alpha), 1.0),
        (red(), mask(false), 1.0),
        (red(), mask(true), 0.2126),
        (bytes(&[[51, 51, 51, 102], [0, 0, 0, 255]]), mask(true), 0.4),
    ] {
        assert!((number(image, of) - expected).abs() < 1e-6, "{of:?} {expected}");
    }
    let warning = |image: DynamicImage, of| {
        let encoding = ColorEncoding::Number { of, is_srgb: false };
        convert::opacity_from_alpha_warning(&image, encoding, &ImageColorMetadata::default())
    };
    assert_eq!(warning(gray(), mask(false)), Some(convert::LUMINANCE_USED));
    assert_eq!(warning(red(), mask(false)), Some(convert::OPAQUE));
    assert_eq!(warning(bytes(&[[1, 2, 3, 0]]), ChannelSelector::Opacity), Some(convert::INVISIBLE));
    assert_eq!(warning(red(), ChannelSelector::Opacity), None);
    assert_eq!(warning(bytes(&[[1, 2, 3, 9], [1, 2, 3, 255]]), mask(false)), None);
}
