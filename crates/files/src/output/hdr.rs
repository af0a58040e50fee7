//! Radiance HDR (G. Ward, *Real Pixels*, Graphics Gems II, 1991): three mantissas and a shared exponent per
//! pixel, with run-length encoded scanlines. Negative values are clamped to 0.

use super::{EncodeOptions, OutputError, SOFTWARE, one_line, to_finite};
use crate::control::CancelToken;
use crate::film::RadianceImage;
use crate::math::Vec3;

/// Widths of scanlines that may be compressed. Scanlines of other widths must not be compressed.
const COMPRESSED_WIDTHS: std::ops::Range<usize> = 8..32768;
const MAX_RUN: usize = 127;
const MAX_LITERAL: usize = 128;
/// Minimum length of a run. Shorter runs would not save space compared with literals.
const MIN_RUN: usize = 4;

pub(super) fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let mut header = format!("#?RADIANCE\nSOFTWARE={SOFTWARE}\n");
    for (name, value) in &options.metadata {
        header += &format!("# {}: {}\n", one_line(name), one_line(value));
    }
    header += &format!("FORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", image.height, image.width);
    let mut bytes = header.into_bytes();
    for line in image.pixels.chunks_exact(image.width as usize) {
        token.check_pause_and_cancel()?;
        encode_scanline(line, &mut bytes);
    }
    Ok(bytes)
}

fn encode_scanline(line: &[Vec3], bytes: &mut Vec<u8>) {
    let pixels: Vec<[u8; 4]> = line.iter().map(|&color| rgbe(color)).collect();
    if !COMPRESSED_WIDTHS.contains(&line.len()) {
        bytes.extend_from_slice(pixels.as_flattened());
        return;
    }
    bytes.extend([2, 2, (line.len() >> 8) as u8, line.len() as u8]);
    for component in 0..4 {
        let plane: Vec<u8> = pixels.iter().map(|pixel| pixel[component]).collect();
        run_length_encode(&plane, bytes);
    }
}

/// Encodes a color. Mantissas are rounded to nearest, which keeps decoded values unbiased.
fn rgbe(color: Vec3) -> [u8; 4] {
    let color = color.to_array().map(|component| f64::from(to_finite(component).max(0.0)));
    let brightest = color[0].max(color[1]).max(color[2]);
    // 2^(exponent − 1) ≤ brightest < 2^exponent. Increase the exponent by 1 if the mantissa would round up to
    // 256.
    let mut exponent = libm::log2(brightest).floor() + 1.0;
    if (brightest / libm::exp2(exponent) * 256.0).round() >= 256.0 {
        exponent += 1.0;
    }
    // The exponent byte is in 1 … 255. 0 means black.
    if brightest == 0.0 || exponent < -127.0 {
        return [0; 4];
    }
    let exponent = exponent.min(127.0);
    let mantissa = |component: f64| (component / libm::exp2(exponent) * 256.0).round().min(255.0) as u8;
    [mantissa(color[0]), mantissa(color[1]), mantissa(color[2]), (exponent as i32 + 128) as u8]
}

/// Encodes runs as (128 + length, byte) and other bytes as (length, bytes).
fn run_length_encode(mut plane: &[u8], bytes: &mut Vec<u8>) {
    let run_length = |plane: &[u8]| {
        let same = plane.iter().take_while(|&&byte| byte == plane[0]).count();
        same.min(MAX_RUN)
    };
    while !plane.is_empty() {
        let run = run_length(plane);
        let taken = if run >= MIN_RUN {
            bytes.extend([128 + run as u8, plane[0]]);
            run
        } else {
            let longest = plane.len().min(MAX_LITERAL);
            let literal = (1..longest).find(|&i| run_length(&plane[i..]) >= MIN_RUN).unwrap_or(longest);
            bytes.push(literal as u8);
            bytes.extend_from_slice(&plane[..literal]);
            literal
        };
        plane = &plane[taken..];
    }
}
