//! Tests for PNG files with all pixel types.

use std::borrow::Cow;

use ::png::{BitDepth, ColorType, Encoder, Info};

use super::*;

fn encoded(info: Info<'static>, samples: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut writer = Encoder::with_info(&mut file, info).and_then(Encoder::write_header).expect("a header");
    writer.write_image_data(samples).expect("written");
    writer.finish().expect("written");
    file
}

fn info(color_type: ColorType, bit_depth: BitDepth, width: u32, height: u32) -> Info<'static> {
    let mut info = Info::with_size(width, height);
    (info.color_type, info.bit_depth) = (color_type, bit_depth);
    info
}

fn texels(file: &[u8]) -> TexelData {
    load_bytes("a.png", file, ColorEncoding::Linear).expect("a PNG").data
}

#[test]
fn all_pixel_types_are_read() {
    let gray = |bytes: &[u8]| TexelData::Linear8(bytes.iter().map(|&byte| [byte; 3]).collect());
    let file = encoded(info(ColorType::Grayscale, BitDepth::One, 8, 1), &[0b1010_0000]);
    assert_eq!(texels(&file), gray(&[255, 0, 255, 0, 0, 0, 0, 0]));
    let file = encoded(info(ColorType::Grayscale, BitDepth::Four, 2, 1), &[0x3f]);
    assert_eq!(texels(&file), gray(&[0x33, 255]));
    let mut transparent = info(ColorType::Grayscale, BitDepth::Eight, 2, 1);
    transparent.trns = Some(Cow::Borrowed(&[0, 9]));
    assert_eq!(texels(&encoded(transparent, &[9, 8])), gray(&[9, 8]));
    let mut indexed = info(ColorType::Indexed, BitDepth::Two, 4, 1);
    indexed.palette = Some(Cow::Borrowed(&[1, 2, 3, 4, 5, 6]));
    indexed.trns = Some(Cow::Borrowed(&[255, 0]));
    assert_eq!(
        texels(&encoded(indexed, &[0b0001_0100])),
        TexelData::Linear8(vec![[1, 2, 3], [4, 5, 6], [4, 5, 6], [1, 2, 3]])
    );
    let float = |word: u16| f32::from(word) / 65535.0;
    let file = encoded(info(ColorType::GrayscaleAlpha, BitDepth::Sixteen, 1, 1), &[0x12, 0x34, 0, 0]);
    assert_eq!(texels(&file), TexelData::Float(vec![Vec3::splat(float(0x1234))]));
    let file = encoded(info(ColorType::Rgba, BitDepth::Sixteen, 1, 1), &[0x12, 0x34, 0, 1, 0xff, 0xff, 0, 0]);
    assert_eq!(texels(&file), TexelData::Float(vec![Vec3::new(float(0x1234), float(1), 1.0)]));
}

#[test]
fn exif_orientation_is_applied() {
    let mut turned = info(ColorType::Grayscale, BitDepth::Eight, 3, 1);
    // One entry: Orientation (0x0112), type SHORT, value 6 (rotated clockwise by 90°).
    let exif = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    turned.exif_metadata = Some(Cow::Borrowed(exif));
    let texels = load_bytes("a.png", &encoded(turned, &[1, 2, 3]), ColorEncoding::Linear).expect("a PNG");
    assert_eq!((texels.width, texels.height), (1, 3));
    assert_eq!(texels.data, TexelData::Linear8(vec![[1; 3], [2; 3], [3; 3]]));
}
