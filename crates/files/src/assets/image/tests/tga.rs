//! Tests for alpha in TGA and BMP files.

use super::*;

/// A file with one 32-bit pixel in BGRA order. `alpha_bits` is stored in the header, and `kind` in the
/// extension area.
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
    let encoding = ColorEncoding::Number { of: ChannelSelector::Opacity, is_srgb: false };
    load_bytes("a.tga", file, encoding).expect("a TGA").get(0, 0).x
}

#[test]
fn tga_alpha_is_set_by_header_or_extension() {
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
    // In cutouts, premultiplied colors are divided by alpha.
    let cut_out = |file: &[u8]| {
        let texels =
            load_bytes("a.tga", file, ColorEncoding::CutOut(ColorTransferFunction::Linear)).expect("a TGA");
        texels.get(0, 0)
    };
    assert!((cut_out(&file(8, [51, 0, 102, 102], Some(4))) - Vec3::new(1.0, 0.0, 0.5)).length() < 1e-6);
    assert!((cut_out(&file(8, [51, 0, 102, 102], None)) - Vec3::new(0.4, 0.0, 0.2)).length() < 1e-6);
    // A footer that points to an extension area past the end of the file.
    let mut broken = file(8, white, Some(3));
    broken.truncate(18 + 4);
    broken.extend([255, 255, 255, 127, 0, 0, 0, 0]);
    broken.extend(b"TRUEVISION-XFILE.\0");
    assert!((opacity(&broken) - 0.2).abs() < 1e-6);
}

/// A TGA file with one row of pixels and the specified image type, bits per pixel and alpha bits.
fn row([kind, bits, alpha_bits]: [u8; 3], pixels: &[u8]) -> Vec<u8> {
    let width = pixels.len() as u8 / bits.div_ceil(8).max(1);
    [&[0, 0, kind, 0, 0, 0, 0, 0, 0, 0, 0, 0, width, 0, 1, 0, bits, 0x20 | alpha_bits], pixels].concat()
}

#[test]
fn sixteen_bit_gray_has_alpha() {
    let pixels = [51, 255, 255, 102];
    let packed = [0x01, 51, 255, 255, 102];
    for alpha_bits in [0, 1, 8, 15] {
        for file in [row([3, 16, alpha_bits], &pixels), {
            let mut file = row([11, 16, alpha_bits], &packed);
            file[12] = 2;
            file
        }] {
            let texels = load_bytes("a.tga", &file, ColorEncoding::Linear).expect("a TGA");
            assert_eq!(texels.data, TexelData::Linear8(vec![[51; 3], [255; 3]]));
            // If the header declares no alpha bits, the luminance is the opacity.
            let expected = if alpha_bits == 0 { 0.2 } else { 1.0 };
            assert!((opacity(&file) - expected).abs() < 1e-6, "{alpha_bits}");
        }
    }
}

#[test]
fn ignored_alpha_bit_causes_a_warning() {
    let warnings = |file: &[u8], of: ChannelSelector| {
        warnings_of("a.tga", file, ColorEncoding::Number { of, is_srgb: false })
    };
    let pixels = [0x1f, 0x80, 0x1f, 0x00];
    let warned = warnings(&row([2, 16, 1], &pixels), ChannelSelector::Opacity);
    assert!(warned.len() == 1 && warned[0].contains("alpha bit"), "{warned:?}");
    assert_eq!(warnings(&row([2, 16, 0], &pixels), ChannelSelector::Opacity), [""; 0]);
    assert_eq!(warnings(&row([2, 16, 1], &pixels), ChannelSelector::Luminance), [""; 0]);
}

#[test]
fn impossible_alpha_bits_are_ignored() {
    for (kind, bits, pixels, expected) in [
        (2, 24, vec![10, 20, 30], [30, 20, 10]),
        (2, 32, vec![10, 20, 30, 40], [30, 20, 10]),
        (2, 16, vec![0x1f, 0x80], [0, 0, 255]),
        (3, 8, vec![7], [7; 3]),
    ] {
        for alpha_bits in [0, 1, 3, 8, 15] {
            let file = row([kind, bits, alpha_bits], &pixels);
            let texels = load_bytes("a.tga", &file, ColorEncoding::Linear).expect("a TGA");
            assert_eq!(texels.data, TexelData::Linear8(vec![expected]), "{kind} {bits} {alpha_bits}");
        }
    }
    for (kind, bits) in [(3, 24), (11, 32), (2, 8), (0, 8), (32, 8), (4, 24)] {
        let error = error("a.tga", &row([kind, bits, 0], &[0; 12]));
        let number = if kind == 3 || kind == 11 || kind == 2 { bits } else { kind };
        assert!(error.contains(&number.to_string()) && error.contains("PNG"), "{error}");
    }
}

#[test]
fn all_zero_bmp_alpha_is_ignored() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.bmp");
    let number = ColorEncoding::Number { of: ChannelSelector::Opacity, is_srgb: false };
    for (alpha, expected) in [([0, 0], [1.0, 1.0]), ([0, 51], [0.0, 0.2])] {
        let pixels = [255, 255, 255, alpha[0], 255, 255, 255, alpha[1]];
        save_buffer(&path, &pixels, 2, 1, ExtendedColorType::Rgba8).expect("written");
        let texels = load_with(&path, number).expect("a BMP");
        let found = [texels.get(0, 0).x, texels.get(1, 0).x];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{alpha:?} {found:?}");
    }
}
