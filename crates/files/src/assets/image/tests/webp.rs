//! Tests for Exif data and animations in WebP files.

use ::image_webp::{ColorType, WebPEncoder};

use super::*;

/// A chunk in a RIFF file.
fn chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let padding = vec![0; data.len() % 2];
    [name.as_slice(), &(data.len() as u32).to_le_bytes(), data, &padding].concat()
}

/// An animation with frames of 1 × 1 pixels.
fn animation(colors: &[[u8; 3]]) -> Vec<u8> {
    // Animation flag; width and height minus 1.
    let mut chunks = chunk(b"VP8X", &[0x02, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    chunks.extend(chunk(b"ANIM", &[0; 6]));
    for color in colors {
        let mut still = Vec::new();
        WebPEncoder::new(&mut still).encode(color, 1, 1, ColorType::Rgb8).expect("written");
        // Position, size, duration and the no-blending flag, followed by the image chunk.
        let mut frame = vec![0; 12];
        frame.extend([100, 0, 0, 0x02]);
        frame.extend(&still[12..]);
        chunks.extend(chunk(b"ANMF", &frame));
    }
    chunk(b"RIFF", &[b"WEBP".as_slice(), &chunks].concat())
}

#[test]
fn exif_data_may_have_the_jpeg_prefix() {
    let (red, blue) = ([255, 0, 0], [0, 0, 255]);
    let mut still = Vec::new();
    WebPEncoder::new(&mut still).encode(&[red, blue].concat(), 2, 1, ColorType::Rgb8).expect("written");
    // One entry: Orientation (0x0112), type SHORT, value 3 (a half turn).
    let exif = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0".as_slice();
    for exif in [exif.to_vec(), [b"Exif\0\0", exif].concat()] {
        // Exif flag; width and height minus 1.
        let mut chunks = chunk(b"VP8X", &[0x08, 0, 0, 0, 1, 0, 0, 0, 0, 0]);
        chunks.extend(&still[12..]);
        chunks.extend(chunk(b"EXIF", &exif));
        let file = chunk(b"RIFF", &[b"WEBP".as_slice(), &chunks].concat());
        let texels = load_bytes("a.webp", &file, ColorEncoding::Color).expect("a WebP");
        assert_eq!(texels.data, TexelData::Srgb8(vec![blue, red]));
    }
}

#[test]
fn animations_cause_a_warning() {
    let (red, blue) = ([255, 0, 0], [0, 0, 255]);
    for (frames, warnings) in [(vec![red, blue, blue], 1), (vec![red], 0)] {
        let file = animation(&frames);
        let texels = load_bytes("a.webp", &file, ColorEncoding::Color).expect("a WebP");
        assert_eq!(texels.data, TexelData::Srgb8(vec![red]));
        let found = warnings_of("a.webp", &file, ColorEncoding::Color);
        assert_eq!(found.len(), warnings, "{found:?}");
        assert!(found.iter().all(|warning| warning.contains(" 3 ")), "{found:?}");
    }
}
