//! Tests for color spaces declared by files.

use std::borrow::Cow;

use ::png::{BitDepth, ColorType, Encoder, Info, ScaledFloat, SourceChromaticities, SrgbRenderingIntent};

use super::*;
use crate::assets::image::space::TransferFunction;

/// A PNG with a single pixel.
fn png(change: impl FnOnce(&mut Info<'static>)) -> Vec<u8> {
    let mut info = Info::with_size(1, 1);
    (info.color_type, info.bit_depth) = (ColorType::Rgb, BitDepth::Eight);
    change(&mut info);
    let mut file = Vec::new();
    let mut writer = Encoder::with_info(&mut file, info).and_then(Encoder::write_header).expect("a header");
    writer.write_image_data(&[188, 128, 64]).expect("written");
    writer.finish().expect("written");
    file
}

fn gamma(value: f32) -> impl Fn(&mut Info<'static>) {
    move |info| info.source_gamma = Some(ScaledFloat::new(value))
}

fn profile(bytes: Vec<u8>) -> impl FnOnce(&mut Info<'static>) {
    move |info| info.icc_profile = Some(Cow::Owned(bytes))
}

/// An ICC profile with the specified tags.
fn icc(space: &[u8; 4], connection: &[u8; 4], tags: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let mut header = vec![0; 128];
    header[16..20].copy_from_slice(space);
    header[20..24].copy_from_slice(connection);
    header[36..40].copy_from_slice(b"acsp");
    let mut table = (tags.len() as u32).to_be_bytes().to_vec();
    let mut data = Vec::new();
    for (name, content) in tags {
        let start = 132 + 12 * tags.len() + data.len();
        table.extend(*name);
        table.extend((start as u32).to_be_bytes());
        table.extend((content.len() as u32).to_be_bytes());
        data.extend(content);
    }
    [header, table, data].concat()
}

fn fixed(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|number| ((number * 65536.0).round() as i32).to_be_bytes()).collect()
}

fn xyz(numbers: [f64; 3]) -> Vec<u8> {
    [b"XYZ \0\0\0\0".to_vec(), fixed(&numbers)].concat()
}

fn curv(values: &[u16]) -> Vec<u8> {
    let values: Vec<u8> = values.iter().flat_map(|value| value.to_be_bytes()).collect();
    [b"curv\0\0\0\0".to_vec(), ((values.len() / 2) as u32).to_be_bytes().to_vec(), values].concat()
}

fn para(kind: u16, numbers: &[f64]) -> Vec<u8> {
    [b"para\0\0\0\0".to_vec(), kind.to_be_bytes().to_vec(), vec![0; 2], fixed(numbers)].concat()
}

const SRGB: [[f64; 3]; 3] =
    [[0.43607, 0.22249, 0.01392], [0.38515, 0.71687, 0.09708], [0.14307, 0.06061, 0.71410]];
const SRGB_CURVE: [f64; 5] = [2.4, 1.0 / 1.055, 0.055 / 1.055, 1.0 / 12.92, 0.04045];

fn rgb_profile(colorants: [[f64; 3]; 3], curve: Vec<u8>) -> Vec<u8> {
    let [red, green, blue] = colorants.map(xyz);
    icc(
        b"RGB ",
        b"XYZ ",
        &[
            (b"rXYZ", red),
            (b"gXYZ", green),
            (b"bXYZ", blue),
            (b"rTRC", curve.clone()),
            (b"gTRC", curve.clone()),
            (b"bTRC", curve),
        ],
    )
}

#[track_caller]
fn color(file: &[u8]) -> Vec3 {
    load_bytes("a.png", file, ColorEncoding::Color).expect("a PNG").get(0, 0)
}

fn is_plain(file: &[u8]) -> bool {
    load_bytes("a.png", file, ColorEncoding::Color).expect("a PNG").data
        == TexelData::Srgb8(vec![[188, 128, 64]])
}

fn power(exponent: f64) -> Vec3 {
    Vec3::from_array([188.0_f64, 128.0, 64.0].map(|byte| (byte / 255.0).powf(exponent) as f32))
}

fn is_near(a: Vec3, b: Vec3) -> bool {
    (a - b).abs().max_element() < 2e-3
}

fn p3() -> SourceChromaticities {
    SourceChromaticities::new((0.3127, 0.329), (0.68, 0.32), (0.265, 0.69), (0.15, 0.06))
}

/// Linear Rec. 709 color of the pixel, if its stored values are Display P3.
const P3: Vec3 = Vec3::new(0.5675, 0.2038, 0.0294);

#[test]
fn png_gamma_and_primaries_are_applied() {
    assert!(is_near(color(&png(gamma(1.0))), power(1.0)));
    assert!(is_near(color(&png(gamma(0.5))), power(2.0)));
    assert!(is_near(color(&png(gamma(1.0 / 1.8))), power(1.8)));
    let wide = png(|info| info.source_chromaticities = Some(p3()));
    assert!(is_near(color(&wide), P3), "{}", color(&wide));
    // The values commonly found in sRGB files do not change the texels.
    let usual = SourceChromaticities::new((0.3127, 0.329), (0.64, 0.33), (0.3, 0.6), (0.15, 0.06));
    assert!(
        is_plain(&png(gamma(0.45455))) && is_plain(&png(|info| info.source_chromaticities = Some(usual)))
    );
}

#[test]
fn color_chunks_have_a_fixed_precedence() {
    let linear = || rgb_profile(SRGB, curv(&[]));
    let all = |info: &mut Info<'static>| {
        gamma(0.5)(info);
        info.source_chromaticities = Some(p3());
    };
    assert!(is_near(
        color(&png(|info| {
            all(info);
            profile(linear())(info);
        })),
        power(1.0)
    ));
    let srgb = png(|info| {
        info.srgb = Some(SrgbRenderingIntent::Perceptual);
    });
    assert!(is_plain(&srgb));
    // The encoder writes only an sRGB chunk. Insert other chunks, including their checksums, before it.
    let at = srgb.windows(4).position(|name| name == b"sRGB").expect("a chunk") - 4;
    let wide = |info: &mut Info<'static>| info.source_chromaticities = Some(p3());
    let others = [(png(gamma(1.0)), b"gAMA"), (png(wide), b"cHRM"), (png(profile(linear())), b"iCCP")];
    for (other, name) in others {
        let from = other.windows(4).position(|found| found == name).expect("a chunk") - 4;
        let length = u32::from_be_bytes(*other[from..].first_chunk().expect("a length")) as usize;
        let both = [&srgb[..at], &other[from..from + 12 + length], &srgb[at..]].concat();
        assert!(is_plain(&both), "{}", String::from_utf8_lossy(name));
    }
}

#[test]
fn matrix_profiles_are_converted() {
    assert!(is_plain(&png(profile(rgb_profile(SRGB, para(3, &SRGB_CURVE))))));
    let table: Vec<u16> = (0..1024).map(|i| (srgb_to_linear(i as f32 / 1023.0) * 65535.0) as u16).collect();
    assert!(is_plain(&png(profile(rgb_profile(SRGB, curv(&table))))));
    assert!(is_near(color(&png(profile(rgb_profile(SRGB, curv(&[512]))))), power(2.0)));
    assert!(is_near(color(&png(profile(rgb_profile(SRGB, para(0, &[1.8]))))), power(1.8)));
    let colorants = [[0.51512, 0.2412, -0.00105], [0.29198, 0.69225, 0.04189], [0.1571, 0.06657, 0.78407]];
    let wide = png(profile(rgb_profile(colorants, para(3, &SRGB_CURVE))));
    assert!(is_near(color(&wide), P3), "{}", color(&wide));
    // Gray.
    let mut gray = Vec::new();
    let mut info = Info::with_size(1, 1);
    (info.color_type, info.bit_depth) = (ColorType::Grayscale, BitDepth::Eight);
    info.icc_profile = Some(Cow::Owned(icc(b"GRAY", b"XYZ ", &[(b"kTRC", curv(&[256]))])));
    let mut writer = Encoder::with_info(&mut gray, info).and_then(Encoder::write_header).expect("a header");
    writer.write_image_data(&[51]).expect("written");
    writer.finish().expect("written");
    assert!(is_near(color(&gray), Vec3::splat(0.2)));
}

#[test]
fn unsupported_profiles_cause_warnings() {
    let cmyk = icc(b"CMYK", b"Lab ", &[(b"A2B0", vec![0; 40])]);
    let tables = icc(b"RGB ", b"Lab ", &[(b"A2B0", vec![0; 40])]);
    let flat = rgb_profile([SRGB[0]; 3], curv(&[]));
    for (bytes, reason) in [
        (cmyk, icc::wrong_color_space_message("CMYK", false)),
        (tables, icc::LOOKUP_TABLES.to_owned()),
        (flat, icc::DEGENERATE_PRIMARIES.to_owned()),
        (b"no profile".to_vec(), icc::MALFORMED.to_owned()),
        (rgb_profile(SRGB, b"sf32\0\0\0\0".to_vec()), icc::UNSUPPORTED_CURVES.to_owned()),
    ] {
        let file = png(profile(bytes));
        assert!(is_plain(&file), "{reason}");
        let warnings = warnings_of("a.png", &file, ColorEncoding::Color);
        assert_eq!(warnings, [format!("a.png: {}", profile_ignored_warning(&reason))]);
        assert_eq!(warnings_of("a.png", &file, ColorEncoding::Srgb), warnings);
    }
    let whole = rgb_profile(SRGB, para(3, &SRGB_CURVE));
    for length in 0..whole.len() {
        let _ = color(&png(profile(whole[..length].to_vec())));
    }
}

#[test]
fn code_points_have_the_highest_precedence() {
    // The `png` encoder does not write this chunk.
    let points = |codes: [u8; 4]| {
        let mut file = png(gamma(0.5));
        let chunk = [b"cICP".as_slice(), &codes].concat();
        let whole = [[0, 0, 0, 4].as_slice(), &chunk, &checksum(&chunk)].concat();
        file.splice(HEADER_END..HEADER_END, whole);
        file
    };
    let of = |primaries, transfer| color(&points([primaries, transfer, 0, 1]));
    assert!(is_near(of(12, 13), P3));
    assert!(is_near(of(1, 8), power(1.0)));
    let of_curve = |curve: TransferFunction| {
        Vec3::from_array([188.0, 128.0, 64.0].map(|x| curve.decode(x / 255.0) as f32))
    };
    for (transfer, curve) in [
        (16, TransferFunction::Pq),
        (18, TransferFunction::Hlg),
        (7, TransferFunction::SMPTE_240M),
        (11, TransferFunction::REC_709),
    ] {
        assert!(is_near(of(1, transfer), of_curve(curve)), "{transfer}");
    }
    for primaries in [1, 4, 5, 6, 7, 8, 9, 10, 11, 12, 22] {
        let file = points([primaries, 13, 0, 1]);
        assert!(warnings_of("a.png", &file, ColorEncoding::Color).is_empty(), "{primaries}");
    }
    // Undefined codes, a logarithmic curve, and video range.
    for codes in [[3, 13, 0, 1], [2, 2, 0, 1], [1, 9, 0, 1], [9, 16, 0, 0]] {
        let warnings = warnings_of("a.png", &points(codes), ColorEncoding::Color);
        assert_eq!(warnings.len(), 1, "{codes:?}");
        assert!(codes[..2].iter().all(|code| warnings[0].contains(&format!(" {code}"))), "{warnings:?}");
        assert!(is_near(color(&points(codes)), color(&png(|_| {}))), "{codes:?}");
    }
}

/// Offset at which a PNG's first chunk ends.
const HEADER_END: usize = 33;

#[test]
fn scene_encoding_overrides_the_file() {
    let chunks = png(|info| {
        gamma(1.0)(info);
        info.source_chromaticities = Some(p3());
    });
    for file in [chunks, png(profile(rgb_profile(SRGB, curv(&[]))))] {
        assert!(!is_plain(&file));
        // Normal maps are read as linear.
        for (encoding, data) in [
            (ColorEncoding::Srgb, TexelData::Srgb8(vec![[188, 128, 64]])),
            (ColorEncoding::Linear, TexelData::Linear8(vec![[188, 128, 64]])),
        ] {
            assert_eq!(load_bytes("a.png", &file, encoding).expect("a PNG").data, data);
        }
        let number = ColorEncoding::Number { of: ChannelSelector::Luminance, is_srgb: false };
        let scalar = |file: &[u8]| load_bytes("a.png", file, number).expect("a PNG").data;
        assert_eq!(scalar(&file), scalar(&png(|_| {})));
    }
}

#[test]
fn jpeg_and_webp_profiles_are_applied() {
    let linear = rgb_profile(SRGB, curv(&[]));
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jpg");
    save_buffer(&path, &[128; 8 * 8 * 3], 8, 8, ExtendedColorType::Rgb8).expect("written");
    let jpeg = fs::read(&path).expect("read");
    let content = [b"ICC_PROFILE\0\x01\x01".as_slice(), &linear].concat();
    let segment = [&[0xff, 0xe2], ((content.len() + 2) as u16).to_be_bytes().as_slice(), &content].concat();
    let with = [&jpeg[..2], &segment, &jpeg[2..]].concat();
    let value = load_bytes("a.jpg", &with, ColorEncoding::Color).expect("a JPEG").get(3, 3).x;
    assert!((value - 128.0 / 255.0).abs() < 5e-3, "{value}");
    let mut webp = Vec::new();
    let mut encoder = image_webp::WebPEncoder::new(&mut webp);
    encoder.set_icc_profile(linear);
    encoder.encode(&[51, 102, 204], 1, 1, image_webp::ColorType::Rgb8).expect("written");
    let value = load_bytes("a.webp", &webp, ColorEncoding::Color).expect("a WebP").get(0, 0);
    assert!(is_near(value, Vec3::new(0.2, 0.4, 0.8)), "{value}");
}
