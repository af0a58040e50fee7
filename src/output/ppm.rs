//! Binary PPM (P6): 8 or 16 bit sRGB.

use super::png::big_endian;
use super::{BitDepth, EncodeOptions, SOFTWARE, one_line};
use crate::film::RadianceImage;
use crate::film::tone::develop;

pub(super) fn encode(image: &RadianceImage, options: &EncodeOptions) -> Vec<u8> {
    let mut header = format!("P6\n# Software: {SOFTWARE}\n");
    for (name, value) in &options.metadata {
        header += &format!("# {}: {}\n", one_line(name), one_line(value));
    }
    let largest = match options.bit_depth {
        BitDepth::Eight => 255,
        BitDepth::Sixteen => 65535,
    };
    header += &format!("{} {}\n{largest}\n", image.width, image.height);
    let mut bytes = header.into_bytes();
    match options.bit_depth {
        BitDepth::Eight => bytes.extend_from_slice(develop(image, &options.tone).pixels.as_flattened()),
        BitDepth::Sixteen => bytes.extend(big_endian(image, options)),
    }
    bytes
}
