use std::fs;
use std::sync::Mutex;

use ::image::{ExtendedColorType, save_buffer};

use super::messages::{
    EMPTY_FILE, empty_image_message, implausible_size_message, memory_limit_message, side_too_long_message,
    undecodable_image_message, unknown_format_message,
};
use super::metadata::profile_ignored_warning;
use super::*;
use crate::assets::expect_rejection;
use crate::materials::scalar::ChannelSelector;
use crate::materials::texels::TexelData;
use crate::math::Vec3;
use crate::math::color::srgb_to_linear;

mod colors;
mod cutout;
mod exr;
mod hdr;
mod png;
mod tga;
mod webp;

fn load_with(path: &Path, encoding: ColorEncoding) -> Result<Texels, AssetError> {
    Ok(load(path, encoding, ImageLimits::default(), &ignore_progress, &CancelToken::new())?.texels)
}

fn load_bytes(name: &str, bytes: &[u8], encoding: ColorEncoding) -> Result<Texels, AssetError> {
    load_bytes_in(tempfile::tempdir().expect("a folder").path(), name, bytes, encoding)
}

fn load_bytes_in(
    folder: &Path,
    name: &str,
    bytes: &[u8],
    encoding: ColorEncoding,
) -> Result<Texels, AssetError> {
    let path = folder.join(name);
    fs::write(&path, bytes).expect("written");
    load_with(&path, encoding)
}

/// Returns the warnings about a file, with the directory stripped from its path.
fn warnings_of(name: &str, bytes: &[u8], encoding: ColorEncoding) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    let loaded =
        load(&path, encoding, ImageLimits::default(), &ignore_progress, &CancelToken::new()).expect("read");
    let folder = format!("{}/", folder.path().display());
    loaded.warnings.iter().map(|warning| warning.replace(&folder, "")).collect()
}

/// Returns the reason why an image is rejected.
fn error(name: &str, bytes: &[u8]) -> String {
    expect_rejection(load_bytes(name, bytes, ColorEncoding::Color)).1
}

const PIXELS: [u8; 12] = [255, 0, 0, 0, 255, 0, 0, 0, 255, 10, 20, 30];

fn small_png() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    save_buffer(&path, &PIXELS, 2, 2, ExtendedColorType::Rgb8).expect("written");
    fs::read(&path).expect("read")
}

#[test]
fn lossless_formats_decode_to_the_same_texels() {
    let folder = tempfile::tempdir().expect("a folder");
    for extension in ["png", "ppm", "tga", "bmp", "webp"] {
        let path = folder.path().join(format!("a.{extension}"));
        save_buffer(&path, &PIXELS, 2, 2, ExtendedColorType::Rgb8).expect("written");
        let texels = load_with(&path, ColorEncoding::Color).expect(extension);
        assert_eq!((texels.width, texels.height), (2, 2));
        let expected = vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [10, 20, 30]];
        assert_eq!(texels.data, TexelData::Srgb8(expected.clone()), "{extension}");
        assert_eq!(
            load_with(&path, ColorEncoding::Linear).expect(extension).data,
            TexelData::Linear8(expected)
        );
    }
}

#[test]
fn content_takes_precedence_over_extension() {
    assert!(load_bytes("a.jpg", &small_png(), ColorEncoding::Color).is_ok());
    assert!(load_bytes("none", &small_png(), ColorEncoding::Color).is_ok());
    assert_eq!(error("a.txt", b"some words"), unknown_format_message());
    assert!(error("a.gif", b"GIF89a\x01\0\x01\0\0\0\0;").starts_with(&unknown_format_message()));
}

#[test]
fn all_ppm_variants_are_read() {
    let srgb = |bytes: Vec<[u8; 3]>| TexelData::Srgb8(bytes);
    let color = |bytes: &[u8]| load_bytes("a.ppm", bytes, ColorEncoding::Color).expect("a PPM").data;
    let both = vec![[1, 2, 3], [255, 254, 9]];
    let header = b"P6\n# a comment, 100%\n2 1\n255\n";
    assert_eq!(color(&[header.as_slice(), &[1, 2, 3, 255, 254, 9]].concat()), srgb(both.clone()));
    assert_eq!(color(b"P3\n# a comment\n2 # width\n1\n255\n1 2 3\n255 254 9\n"), srgb(both));
    assert_eq!(color(b"P5 2 1 255\n\x07\xff"), srgb(vec![[7; 3], [255; 3]]));
    assert_eq!(color(b"P2\n2 1\n5\n5\n1\n"), srgb(vec![[255; 3], [51; 3]]));
}

#[test]
fn pfm_supports_color_gray_and_both_endians() {
    let color = [[0.5, 2.0, 0.0], [1.0, 0.25, 8.0]];
    for (head, order) in [("PF\n1 2\n-1.0\n", true), ("PF 1\n2 1\n", false), ("PF\r\n1 2 2e0 ", false)] {
        let scale = if head.contains('e') { 2.0 } else { 1.0 };
        // Rows are stored from bottom to top.
        let values = color.iter().rev().flatten().map(|value: &f32| value / scale);
        let bytes = values.flat_map(|value| if order { value.to_le_bytes() } else { value.to_be_bytes() });
        let file: Vec<u8> = head.bytes().chain(bytes).collect();
        let expected = TexelData::Float(color.map(Vec3::from_array).to_vec());
        assert_eq!(
            load_bytes("a.pfm", &file, ColorEncoding::Color).expect("a PFM").data,
            expected,
            "{head:?}"
        );
        for length in 0..file.len() {
            assert!(load_bytes("a.pfm", &file[..length], ColorEncoding::Color).is_err(), "{head:?} {length}");
        }
    }
    let gray = [b"Pf 2 1 -1\n".as_slice(), &3.0_f32.to_le_bytes(), &(-1.0_f32).to_le_bytes()].concat();
    let expected = TexelData::Float(vec![Vec3::splat(3.0), Vec3::ZERO]);
    assert_eq!(load_bytes("any", &gray, ColorEncoding::Color).expect("a PFM").data, expected);
    for wrong in [
        "PF 0 1 1 ",
        "PF 1 -1 1 ",
        "PF 1 1 0 ",
        "PF 1 1 nan ",
        "PF 1 x 1 ",
        "PF 70000 1 1 ",
        "PF 60000 60000 1 ",
    ] {
        assert!(load_bytes("a.pfm", wrong.as_bytes(), ColorEncoding::Color).is_err(), "{wrong}");
    }
}

#[test]
fn sixteen_bit_samples_keep_their_precision() {
    let file = b"P6 1 1 65535\n\x80\x01\x00\x00\xff\xff";
    let value = 32769.0 / 65535.0;
    let data = |encoding| load_bytes("a.ppm", file, encoding).expect("a PPM").data;
    let expected = Vec3::new(srgb_to_linear(value), 0.0, 1.0);
    assert_eq!(data(ColorEncoding::Color), TexelData::Float(vec![expected]));
    assert_eq!(data(ColorEncoding::Linear), TexelData::Float(vec![Vec3::new(value, 0.0, 1.0)]));
}

#[test]
fn floats_are_linear_and_invalid_floats_are_zero() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    let values = [0.5_f32, 7.0, -1.0, f32::NAN, f32::INFINITY, 0.25];
    let raw: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    save_buffer(&path, &raw, 2, 1, ExtendedColorType::Rgb32F).expect("written");
    let expected = vec![Vec3::new(0.5, 7.0, 0.0), Vec3::new(0.0, 0.0, 0.25)];
    assert_eq!(load_with(&path, ColorEncoding::Color).expect("an EXR").data, TexelData::Float(expected));
    let decoded = load_with(&path, ColorEncoding::Srgb).expect("an EXR").get(0, 0);
    assert!((decoded.x - srgb_to_linear(0.5)).abs() < 1e-6);
}

#[test]
fn exr_alpha_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    let values = [1.0_f32, 0.5, 0.25, 0.125, 0.0, 3.0, 2.0, 0.75];
    let raw: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    save_buffer(&path, &raw, 2, 1, ExtendedColorType::Rgba32F).expect("written");
    let color = load_with(&path, ColorEncoding::Color).expect("an EXR").data;
    assert_eq!(color, TexelData::Float(vec![Vec3::new(1.0, 0.5, 0.25), Vec3::new(0.0, 3.0, 2.0)]));
    let alpha = ColorEncoding::Number { of: ChannelSelector::Opacity, is_srgb: false };
    let opacity = load_with(&path, alpha).expect("an EXR");
    assert_eq!([opacity.get(0, 0).x, opacity.get(1, 0).x], [0.125, 0.75]);
}

#[test]
fn gray_is_expanded_and_alpha_is_dropped() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    save_buffer(&path, &[9, 0, 200, 128], 2, 1, ExtendedColorType::La8).expect("written");
    let data = load_with(&path, ColorEncoding::Color).expect("a PNG").data;
    assert_eq!(data, TexelData::Srgb8(vec![[9; 3], [200; 3]]));
    save_buffer(&path, &[1, 2, 3, 0], 1, 1, ExtendedColorType::Rgba8).expect("written");
    let data = load_with(&path, ColorEncoding::Color).expect("a PNG").data;
    assert_eq!(data, TexelData::Srgb8(vec![[1, 2, 3]]));
}

/// CRC-32 (ISO 3309) of the type and data of a PNG chunk.
fn checksum(bytes: &[u8]) -> [u8; 4] {
    let crc = bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    });
    (!crc).to_be_bytes()
}

/// A PNG whose header has a false image size but a valid checksum.
fn png_claiming(width: u32, height: u32) -> Vec<u8> {
    let mut file = small_png();
    file[16..20].copy_from_slice(&width.to_be_bytes());
    file[20..24].copy_from_slice(&height.to_be_bytes());
    let checksum = checksum(&file[12..29]);
    file[29..33].copy_from_slice(&checksum);
    file
}

/// A run-length encoded BMP without runs, which decodes to a single color.
fn empty_bmp(width: u32, height: u32) -> Vec<u8> {
    let palette = [[16, 32, 48, 0]; 256].concat();
    let runs = [0, 1];
    let start = 54 + palette.len() as u32;
    let mut file = b"BM".to_vec();
    for word in [start + 2, 0, start, 40, width, height, 1 | 8 << 16, 1, 2, 0, 0, 256, 256] {
        file.extend_from_slice(&word.to_le_bytes());
    }
    [file, palette, runs.to_vec()].concat()
}

/// Short files must not use gigabytes of memory, regardless of their extension.
#[test]
fn short_files_take_little_memory() {
    assert!(load_bytes("a.bmp", &empty_bmp(600, 400), ColorEncoding::Color).is_ok());
    for name in ["a.bmp", "a.tga"] {
        let length = empty_bmp(16_000, 16_000).len() as u64;
        let reason = error(name, &empty_bmp(16_000, 16_000));
        let decoded = 16_000_u64 * 16_000 * 3;
        assert_eq!(reason, implausible_size_message(16_000, 16_000, 2 * decoded, length));
    }
}

#[test]
fn false_sizes_are_rejected() {
    assert!(load_bytes("a.png", &png_claiming(2, 2), ColorEncoding::Color).is_ok());
    assert!(error("a.png", &png_claiming(16000, 16000)).contains("16000 × 16000"));
    assert!(error("a.png", &png_claiming(20000, 2)).contains("20000 × 2"));
    let truncated = error("a.ppm", b"P6 5000 5000 255\n123");
    assert_eq!(truncated, undecodable_image_message(5000, 5000, jpeg::TRUNCATED));
    assert!(load_bytes("a.ppm", b"P6 4000000000 4000000000 255\n123", ColorEncoding::Color).is_err());
    assert!(load_bytes("a.ppm", b"P6 0 0 255\n", ColorEncoding::Color).is_err());
    assert_eq!(error("a.png", b""), EMPTY_FILE);
}

#[test]
fn sides_are_limited_to_65536_pixels() {
    let wide = [b"P5 16385 1 255\n".as_slice(), &[7; 16385]].concat();
    assert_eq!(load_bytes("a.ppm", &wide, ColorEncoding::Color).expect("read").width, 16385);
    let widest = [b"P5 1 65536 255\n".as_slice(), &[7; 65536]].concat();
    assert_eq!(load_bytes("a.ppm", &widest, ColorEncoding::Color).expect("read").height, 65536);
    let bmp =
        [b"BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x01\0\x01\0\x01\0\0\0\x01\0\x18\0".as_slice(), &[0; 24]]
            .concat();
    for (name, bytes) in [
        ("a.png", png_claiming(65537, 1)),
        ("a.ppm", b"P6 65537 1 255\n123".to_vec()),
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 65537\nabc".to_vec()),
    ] {
        assert_eq!(error(name, &bytes), side_too_long_message(65537, 1, 65536));
    }
    // The decoder's own limit is checked first.
    assert!(error("a.bmp", &bmp).contains("65537"));
    let needed = 60_000 * 60_000 * 6;
    assert_eq!(
        error("a.ppm", b"P6 60000 60000 255\n123"),
        memory_limit_message(60_000, 60_000, needed, 2 << 30)
    );
}

#[test]
fn long_headers_produce_short_errors() {
    let header = |line: &str| format!("P7\n{line} {}\n", "x".repeat(100_000));
    for line in ["WIDTH", "FOO", "TUPLTYPE"] {
        let reason = error("a.ppm", header(line).as_bytes());
        assert!(reason.len() < 500, "{line}: {} bytes", reason.len());
    }
    let hdr = format!("#?RADIANCE\nFORMAT={}\n\n-Y 1 +X 1\nabcd", "x".repeat(100_000));
    assert!(error("a.hdr", hdr.as_bytes()).len() < 500);
    assert!(error("a.hdr", hdr.replace('\n', "").as_bytes()).len() < 500);
}

#[test]
fn truncated_and_fake_jpegs_are_rejected() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jpg");
    save_buffer(&path, &[90; 32 * 32 * 3], 32, 32, ExtendedColorType::Rgb8).expect("written");
    let whole = fs::read(&path).expect("read");
    let texels = load_with(&path, ColorEncoding::Color).expect("whole");
    assert_eq!((texels.width, texels.height), (32, 32));
    assert_eq!(error("a.jpg", &whole[..whole.len() - 2]), jpeg::TRUNCATED);
    // Height and width start 5 bytes after the start-of-frame marker.
    let frame = whole.windows(2).position(|pair| pair == [0xff, 0xc0]).expect("a baseline JPEG");
    let mut altered = whole;
    altered[frame + 5..frame + 9].copy_from_slice(&[0x3e, 0x80, 0x3e, 0x80]);
    assert!(error("a.jpg", &altered).contains("16000 × 16000"));
}

#[test]
fn the_memory_limit_is_enforced() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    fs::write(&path, small_png()).expect("written");
    let limits = ImageLimits { side: 16384, memory_bytes: 23 };
    let result = load(&path, ColorEncoding::Color, limits, &ignore_progress, &CancelToken::new());
    assert!(matches!(result, Err(AssetError::Malformed { .. })), "24 bytes: {result:?}");
}

#[test]
fn truncated_pngs_do_not_panic() {
    let whole = small_png();
    for length in 0..whole.len() {
        let _ = load_bytes("a.png", &whole[..length], ColorEncoding::Color);
    }
    assert!(load_bytes("a.png", &whole[..whole.len() / 2], ColorEncoding::Color).is_err());
}

#[test]
fn progress_ends_at_the_file_length() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.ppm");
    let mut file = b"P6 400 400 255\n".to_vec();
    file.extend(vec![7; 480_000]);
    fs::write(&path, &file).expect("written");
    let seen = Mutex::new(Vec::new());
    let note = |done, total| seen.lock().expect("no panic").push((done, total));
    let token = CancelToken::new();
    load(&path, ColorEncoding::Color, ImageLimits::default(), &note, &token).expect("read");
    let seen = seen.into_inner().expect("no panic");
    assert!(seen.is_sorted() && seen.iter().any(|(done, total)| *done > total / 4 && *done < total * 3 / 4));
    assert_eq!(seen.last(), Some(&(file.len() as u64, file.len() as u64)));
    let stop = |done, _| {
        if done > 100_000 {
            token.cancel();
        }
    };
    let result = load(&path, ColorEncoding::Color, ImageLimits::default(), &stop, &token);
    assert!(matches!(result, Err(AssetError::Canceled(_))));
}

proptest::proptest! {
    #[test]
    fn fuzzed_images_never_panic(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..300)) {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, start) in [
            ("a.png", &small_png()[..33]),
            ("a.ppm", b"P6 2 2 255\n"),
            ("a.ppm", b"P3 2 2 "),
            ("a.tga", b"\0\0\x02"),
            ("a.bmp", b"BM"),
            ("a.hdr", b"#?RADIANCE\n"),
            ("a.exr", b"\x76\x2f\x31\x01\x02\0\0\0"),
            ("a.webp", b"RIFF\x40\0\0\0WEBPVP8L"),
            ("a.jpg", b"\xff\xd8\xff\xe0"),
        ] {
            let _ = load_bytes_in(folder.path(), name, &[start, &bytes].concat(), ColorEncoding::Color);
        }
    }
}

#[test]
fn hdr_header_size_is_limited() {
    let is_too_long = |bytes: &[u8]| error("a.hdr", bytes).ends_with(&super::hdr::header_too_long_message());
    let lines = |count: usize| ["#?RADIANCE\n", &"x=1\n".repeat(count), "\n-Y 1 +X 1\n"].concat();
    let pixel = [128, 128, 128, 129];
    assert!(is_too_long(lines(1 << 18).as_bytes()));
    assert!(is_too_long(format!("#?RADIANCE\n\n{}", "x".repeat(1 << 20)).as_bytes()));
    let long = [lines(1 << 17).as_bytes(), &pixel].concat();
    assert!(load_bytes("a.hdr", &long, ColorEncoding::Color).is_ok());
    assert!(!is_too_long(b"#?RADIANCE\nx=1\n"));
}
