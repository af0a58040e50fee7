//! Alpha of TGA files.

use super::*;

/// A pixel of 32 bits, blue first, with these alpha bits in the header and a type of alpha in an extension area.
fn file(alpha_bits: u8, pixel: [u8; 4], kind: Option<u8>) -> Vec<u8> {
    let mut file = vec![0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 32, 0x20 | alpha_bits];
    file.extend(pixel);
    if let Some(kind) = kind {
        let offset = file.len() as u32;
        file.extend([0; 494]);
        file.push(kind);
        file.extend(offset.to_le_bytes());
        file.extend([0; 4]);
        file.extend(b"TRUEVISION-XFILE.\0");
    }
    file
}

fn opacity(file: &[u8]) -> f32 {
    let encoding = ImageEncoding::Number { of: PixelValue::Opacity, is_srgb: false };
    load_bytes("a.tga", file, encoding).expect("a TGA").get(0, 0).x
}

#[test]
fn the_header_or_the_extension_says_what_the_fourth_byte_is() {
    let white = [255, 255, 255, 51];
    for (bits, kind, expected) in [
        (0, None, 1.0),
        (8, None, 0.2),
        (8, Some(0), 1.0),
        (8, Some(1), 1.0),
        (8, Some(2), 1.0),
        (8, Some(3), 0.2),
        (8, Some(4), 0.2),
        (0, Some(3), 0.2),
    ] {
        assert!((opacity(&file(bits, white, kind)) - expected).abs() < 1e-6, "{bits} {kind:?}");
    }
    // Colors that are multiplied by alpha are divided where alpha is the opacity.
    let cut_out = |file: &[u8]| {
        let texels = load_bytes("a.tga", file, ImageEncoding::CutOut(ColorCurve::Linear)).expect("a TGA");
        texels.get(0, 0)
    };
    assert!((cut_out(&file(8, [51, 0, 102, 102], Some(4))) - Vec3::new(1.0, 0.0, 0.5)).length() < 1e-6);
    assert!((cut_out(&file(8, [51, 0, 102, 102], None)) - Vec3::new(0.4, 0.0, 0.2)).length() < 1e-6);
    // An area beyond the end, or a footer without one.
    let mut broken = file(8, white, Some(3));
    broken.truncate(18 + 4);
    broken.extend([255, 255, 255, 127, 0, 0, 0, 0]);
    broken.extend(b"TRUEVISION-XFILE.\0");
    assert!((opacity(&broken) - 0.2).abs() < 1e-6);
}

#[test]
fn a_bitmap_whose_alpha_is_unused_is_opaque() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.bmp");
    let number = ImageEncoding::Number { of: PixelValue::Opacity, is_srgb: false };
    for (alpha, expected) in [([0, 0], [1.0, 1.0]), ([0, 51], [0.0, 0.2])] {
        let pixels = [255, 255, 255, alpha[0], 255, 255, 255, alpha[1]];
        save_buffer(&path, &pixels, 2, 1, ExtendedColorType::Rgba8).expect("written");
        let texels = load_with(&path, number).expect("a BMP");
        let found = [texels.get(0, 0).x, texels.get(1, 0).x];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{alpha:?} {found:?}");
    }
}
