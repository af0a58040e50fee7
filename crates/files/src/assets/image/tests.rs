use std::fs;
use std::sync::Mutex;

use ::image::{ExtendedColorType, save_buffer};

use super::*;
use crate::materials::scalar::PixelValue;
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

fn load_with(path: &Path, encoding: ImageEncoding) -> Result<Texels, AssetError> {
    Ok(load(path, encoding, ImageLimits::default(), &ignore_progress, &CancelToken::new())?.texels)
}

fn load_bytes(name: &str, bytes: &[u8], encoding: ImageEncoding) -> Result<Texels, AssetError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    load_with(&path, encoding)
}

/// Warnings about a file, without its folder.
fn warned(name: &str, bytes: &[u8], encoding: ImageEncoding) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    let loaded =
        load(&path, encoding, ImageLimits::default(), &ignore_progress, &CancelToken::new()).expect("read");
    let folder = format!("{}/", folder.path().display());
    loaded.warnings.iter().map(|warning| warning.replace(&folder, "")).collect()
}

fn says(name: &str, bytes: &[u8]) -> String {
    load_bytes(name, bytes, ImageEncoding::Color).expect_err("refused").to_string()
}

const PIXELS: [u8; 12] = [255, 0, 0, 0, 255, 0, 0, 0, 255, 10, 20, 30];

fn small_png() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    save_buffer(&path, &PIXELS, 2, 2, ExtendedColorType::Rgb8).expect("written");
    fs::read(&path).expect("read")
}

#[test]
fn every_lossless_format_gives_the_same_texels() {
    let folder = tempfile::tempdir().expect("a folder");
    for ending in ["png", "ppm", "tga", "bmp", "webp"] {
        let path = folder.path().join(format!("a.{ending}"));
        save_buffer(&path, &PIXELS, 2, 2, ExtendedColorType::Rgb8).expect("written");
        let texels = load_with(&path, ImageEncoding::Color).expect(ending);
        assert_eq!((texels.width, texels.height), (2, 2));
        let expected = vec![[255, 0, 0], [0, 255, 0], [0, 0, 255], [10, 20, 30]];
        assert_eq!(texels.data, TexelData::Srgb8(expected.clone()), "{ending}");
        assert_eq!(load_with(&path, ImageEncoding::Linear).expect(ending).data, TexelData::Linear8(expected));
    }
}

#[test]
fn the_content_counts_before_the_ending() {
    assert!(load_bytes("a.jpg", &small_png(), ImageEncoding::Color).is_ok());
    assert!(load_bytes("none", &small_png(), ImageEncoding::Color).is_ok());
    assert!(
        says("a.txt", b"some words that are no image")
            .contains("a.txt: its content is no image that can be read")
    );
    assert!(says("a.gif", b"GIF89a\x01\0\x01\0\0\0\0;").contains("no image that can be read"));
}

#[test]
fn ppm_of_all_kinds() {
    let srgb = |bytes: Vec<[u8; 3]>| TexelData::Srgb8(bytes);
    let color = |bytes: &[u8]| load_bytes("a.ppm", bytes, ImageEncoding::Color).expect("a PPM").data;
    let both = vec![[1, 2, 3], [255, 254, 9]];
    let header = b"P6\n# made by hand, 100% of it\n2 1\n255\n";
    assert_eq!(color(&[header.as_slice(), &[1, 2, 3, 255, 254, 9]].concat()), srgb(both.clone()));
    assert_eq!(color(b"P3\n# a comment\n2 # width\n1\n255\n1 2 3\n255 254 9\n"), srgb(both));
    assert_eq!(color(b"P5 2 1 255\n\x07\xff"), srgb(vec![[7; 3], [255; 3]]));
    assert_eq!(color(b"P2\n2 1\n5\n5\n1\n"), srgb(vec![[255; 3], [51; 3]]));
}

#[test]
fn pfm_of_both_kinds_and_byte_orders() {
    let color = [[0.5, 2.0, 0.0], [1.0, 0.25, 8.0]];
    for (head, order) in [("PF\n1 2\n-1.0\n", true), ("PF 1\n2 1\n", false), ("PF\r\n1 2 2e0 ", false)] {
        let scale = if head.contains('e') { 2.0 } else { 1.0 };
        // Rows begin at the bottom.
        let values = color.iter().rev().flatten().map(|value: &f32| value / scale);
        let bytes = values.flat_map(|value| if order { value.to_le_bytes() } else { value.to_be_bytes() });
        let file: Vec<u8> = head.bytes().chain(bytes).collect();
        let expected = TexelData::Float(color.map(Vec3::from_array).to_vec());
        assert_eq!(
            load_bytes("a.pfm", &file, ImageEncoding::Color).expect("a PFM").data,
            expected,
            "{head:?}"
        );
        for length in 0..file.len() {
            assert!(load_bytes("a.pfm", &file[..length], ImageEncoding::Color).is_err(), "{head:?} {length}");
        }
    }
    let gray = [b"Pf 2 1 -1\n".as_slice(), &3.0_f32.to_le_bytes(), &(-1.0_f32).to_le_bytes()].concat();
    let expected = TexelData::Float(vec![Vec3::splat(3.0), Vec3::ZERO]);
    assert_eq!(load_bytes("any", &gray, ImageEncoding::Color).expect("a PFM").data, expected);
    for wrong in [
        "PF 0 1 1 ",
        "PF 1 -1 1 ",
        "PF 1 1 0 ",
        "PF 1 1 nan ",
        "PF 1 x 1 ",
        "PF 70000 1 1 ",
        "PF 60000 60000 1 ",
    ] {
        assert!(load_bytes("a.pfm", wrong.as_bytes(), ImageEncoding::Color).is_err(), "{wrong}");
    }
}

#[test]
fn sixteen_bits_keep_their_precision() {
    let file = b"P6 1 1 65535\n\x80\x01\x00\x00\xff\xff";
    let value = 32769.0 / 65535.0;
    let data = |encoding| load_bytes("a.ppm", file, encoding).expect("a PPM").data;
    let expected = Vec3::new(srgb_to_linear(value), 0.0, 1.0);
    assert_eq!(data(ImageEncoding::Color), TexelData::Float(vec![expected]));
    assert_eq!(data(ImageEncoding::Linear), TexelData::Float(vec![Vec3::new(value, 0.0, 1.0)]));
}

#[test]
fn floats_are_linear_and_cleaned() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    let values = [0.5_f32, 7.0, -1.0, f32::NAN, f32::INFINITY, 0.25];
    let raw: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    save_buffer(&path, &raw, 2, 1, ExtendedColorType::Rgb32F).expect("written");
    let expected = vec![Vec3::new(0.5, 7.0, 0.0), Vec3::new(0.0, 0.0, 0.25)];
    assert_eq!(load_with(&path, ImageEncoding::Color).expect("an EXR").data, TexelData::Float(expected));
    let decoded = load_with(&path, ImageEncoding::Srgb).expect("an EXR").get(0, 0);
    assert!((decoded.x - srgb_to_linear(0.5)).abs() < 1e-6);
}

#[test]
fn the_alpha_of_an_exr_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.exr");
    let values = [1.0_f32, 0.5, 0.25, 0.125, 0.0, 3.0, 2.0, 0.75];
    let raw: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    save_buffer(&path, &raw, 2, 1, ExtendedColorType::Rgba32F).expect("written");
    let color = load_with(&path, ImageEncoding::Color).expect("an EXR").data;
    assert_eq!(color, TexelData::Float(vec![Vec3::new(1.0, 0.5, 0.25), Vec3::new(0.0, 3.0, 2.0)]));
    let alpha = ImageEncoding::Number { of: PixelValue::Opacity, is_srgb: false };
    let opacity = load_with(&path, alpha).expect("an EXR");
    assert_eq!([opacity.get(0, 0).x, opacity.get(1, 0).x], [0.125, 0.75]);
}

#[test]
fn grey_and_alpha_become_rgb() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    save_buffer(&path, &[9, 0, 200, 128], 2, 1, ExtendedColorType::La8).expect("written");
    let data = load_with(&path, ImageEncoding::Color).expect("a PNG").data;
    assert_eq!(data, TexelData::Srgb8(vec![[9; 3], [200; 3]]));
    save_buffer(&path, &[1, 2, 3, 0], 1, 1, ExtendedColorType::Rgba8).expect("written");
    let data = load_with(&path, ImageEncoding::Color).expect("a PNG").data;
    assert_eq!(data, TexelData::Srgb8(vec![[1, 2, 3]]));
}

/// CRC-32 (ISO 3309) of the type and the data of a PNG chunk.
fn checksum(bytes: &[u8]) -> [u8; 4] {
    let crc = bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    });
    (!crc).to_be_bytes()
}

/// A PNG whose header claims another size; its checksum is right.
fn lying_png(width: u32, height: u32) -> Vec<u8> {
    let mut file = small_png();
    file[16..20].copy_from_slice(&width.to_be_bytes());
    file[20..24].copy_from_slice(&height.to_be_bytes());
    let checksum = checksum(&file[12..29]);
    file[29..33].copy_from_slice(&checksum);
    file
}

/// A BMP of runs that end at once, which is a whole image of one colour.
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

/// A few bytes take no gigabytes, whatever their name says that they are.
#[test]
fn short_files_take_little_memory() {
    assert!(load_bytes("a.bmp", &empty_bmp(600, 400), ImageEncoding::Color).is_ok());
    for name in ["a.bmp", "a.tga"] {
        let said = says(name, &empty_bmp(16_000, 16_000));
        assert!(said.ends_with("MiB of memory, more than a file of 1080 bytes stands for"), "{said}");
    }
}

#[test]
fn lies_about_the_size_are_errors_that_name_the_file() {
    assert!(load_bytes("a.png", &lying_png(2, 2), ImageEncoding::Color).is_ok());
    assert!(says("a.png", &lying_png(16000, 16000)).contains("a.png: it claims 16000 × 16000 pixels"));
    assert!(says("a.png", &lying_png(20000, 2)).contains("a.png: it claims 20000 × 2 pixels"));
    assert!(
        says("a.ppm", b"P6 5000 5000 255\n123")
            .contains("a.ppm: it claims 5000 × 5000 pixels: the file ends")
    );
    assert!(says("a.ppm", b"P6 4000000000 4000000000 255\n123").contains("a.ppm: "));
    assert!(says("a.ppm", b"P6 0 0 255\n").contains("a.ppm: "));
    assert!(says("a.png", b"").contains("empty"));
}

#[test]
fn a_side_of_many_pixels_is_read_and_too_many_are_named() {
    let wide = [b"P5 16385 1 255\n".as_slice(), &[7; 16385]].concat();
    assert_eq!(load_bytes("a.ppm", &wide, ImageEncoding::Color).expect("read").width, 16385);
    let widest = [b"P5 1 65536 255\n".as_slice(), &[7; 65536]].concat();
    assert_eq!(load_bytes("a.ppm", &widest, ImageEncoding::Color).expect("read").height, 65536);
    let bmp =
        [b"BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x01\0\x01\0\x01\0\0\0\x01\0\x18\0".as_slice(), &[0; 24]]
            .concat();
    for (name, bytes) in [
        ("a.png", lying_png(65537, 1)),
        ("a.ppm", b"P6 65537 1 255\n123".to_vec()),
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 65537\nabc".to_vec()),
    ] {
        let said = says(name, &bytes);
        assert!(
            said.ends_with(&format!("{name}: it has 65537 × 1 pixels, more than 65536 a side")),
            "{said}"
        );
    }
    // The decoder's own limit comes first.
    assert!(
        says("a.bmp", &bmp).ends_with("one of (65537, 1) > soft limit of 65535)"),
        "{}",
        says("a.bmp", &bmp)
    );
    let said = says("a.ppm", b"P6 60000 60000 255\n123");
    let reason = "it has 60000 × 60000 pixels, which take 20600 MiB of memory, more than the 2048 MiB that one image may take";
    assert!(said.ends_with(reason), "{said}");
}

#[test]
fn a_reason_is_short_whatever_the_file_says() {
    let header = |line: &str| format!("P7\n{line} {}\n", "x".repeat(100_000));
    for line in ["WIDTH", "FOO", "TUPLTYPE"] {
        let said = says("a.ppm", header(line).as_bytes());
        assert!(said.len() < 500, "{line}: {} bytes", said.len());
    }
    let hdr = format!("#?RADIANCE\nFORMAT={}\n\n-Y 1 +X 1\nabcd", "x".repeat(100_000));
    assert!(says("a.hdr", hdr.as_bytes()).len() < 500);
    assert!(says("a.hdr", hdr.replace('\n', "").as_bytes()).len() < 500);
}

#[test]
fn a_jpeg_that_is_cut_or_lies_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.jpg");
    save_buffer(&path, &[90; 32 * 32 * 3], 32, 32, ExtendedColorType::Rgb8).expect("written");
    let whole = fs::read(&path).expect("read");
    let texels = load_with(&path, ImageEncoding::Color).expect("whole");
    assert_eq!((texels.width, texels.height), (32, 32));
    assert!(says("a.jpg", &whole[..whole.len() - 2]).contains("a.jpg: the file ends before the image does"));
    // Height and width follow the start of the frame by 5 bytes.
    let frame = whole.windows(2).position(|pair| pair == [0xff, 0xc0]).expect("a baseline JPEG");
    let mut lying = whole;
    lying[frame + 5..frame + 9].copy_from_slice(&[0x3e, 0x80, 0x3e, 0x80]);
    assert!(says("a.jpg", &lying).contains("a.jpg: it claims 16000 × 16000 pixels, which"));
}

#[test]
fn the_memory_limit_holds() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.png");
    fs::write(&path, small_png()).expect("written");
    let limits = ImageLimits { side: 16384, memory_bytes: 23 };
    let error = load(&path, ImageEncoding::Color, limits, &ignore_progress, &CancelToken::new())
        .expect_err("24 bytes");
    assert!(error.to_string().contains("a.png: "), "{error}");
}

#[test]
fn every_truncation_is_an_error_or_an_image_and_no_panic() {
    let whole = small_png();
    for length in 0..whole.len() {
        let _ = load_bytes("a.png", &whole[..length], ImageEncoding::Color);
    }
    assert!(load_bytes("a.png", &whole[..whole.len() / 2], ImageEncoding::Color).is_err());
}

#[test]
fn progress_moves_and_ends_at_the_length() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.ppm");
    let mut file = b"P6 400 400 255\n".to_vec();
    file.extend(vec![7; 480_000]);
    fs::write(&path, &file).expect("written");
    let seen = Mutex::new(Vec::new());
    let note = |done, total| seen.lock().expect("no panic").push((done, total));
    let token = CancelToken::new();
    load(&path, ImageEncoding::Color, ImageLimits::default(), &note, &token).expect("read");
    let seen = seen.into_inner().expect("no panic");
    assert!(seen.is_sorted() && seen.iter().any(|(done, total)| *done > total / 4 && *done < total * 3 / 4));
    assert_eq!(seen.last(), Some(&(file.len() as u64, file.len() as u64)));
    let stop = |done, _| {
        if done > 100_000 {
            token.cancel();
        }
    };
    let result = load(&path, ImageEncoding::Color, ImageLimits::default(), &stop, &token);
    assert!(matches!(result, Err(AssetError::Cancelled(_))));
}

proptest::proptest! {
    #[test]
    fn garbage_never_panics(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..300)) {
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
            let _ = load_bytes(name, &[start, &bytes].concat(), ImageEncoding::Color);
        }
    }
}

#[test]
fn the_header_of_an_hdr_image_is_bounded() {
    let refused = "its header does not end within 1 MiB";
    let lines = |count: usize| ["#?RADIANCE\n", &"x=1\n".repeat(count), "\n-Y 1 +X 1\n"].concat();
    let pixel = [128, 128, 128, 129];
    assert!(says("a.hdr", lines(1 << 18).as_bytes()).contains(refused));
    assert!(says("a.hdr", format!("#?RADIANCE\n\n{}", "x".repeat(1 << 20)).as_bytes()).contains(refused));
    let long = [lines(1 << 17).as_bytes(), &pixel].concat();
    assert!(load_bytes("a.hdr", &long, ImageEncoding::Color).is_ok());
    assert!(!says("a.hdr", b"#?RADIANCE\nx=1\n").contains(refused));
}
