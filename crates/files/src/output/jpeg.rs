//! JPEG: 8-bit sRGB without chroma subsampling.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use super::cancelable::{self, CancelableBuffer};
use super::{EncodeOptions, Format, OutputError, SOFTWARE, one_line};
use crate::control::CancelToken;
use crate::film::RadianceImage;

/// JPEG quality (maximum 100). Visually lossless at arm's length, with a quarter of the file size of quality
/// 100.
const QUALITY: u8 = 92;

pub(super) fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let pixels = cancelable::tone_map_all(image, options, Format::Jpeg, token)?;
    let mut bytes = CancelableBuffer::new(token);
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(&pixels, image.width, image.height, ExtendedColorType::Rgb8)
        .map_err(|error| OutputError::encoder(Format::Jpeg, &error))?;
    Ok(insert_comment(&bytes.into_bytes(), &metadata_comment(options)))
}

/// Formats the metadata as a comment with one line per item.
fn metadata_comment(options: &EncodeOptions) -> String {
    let mut comment = format!("Software: {SOFTWARE}\n");
    for (name, value) in &options.metadata {
        comment += &format!("{}: {}\n", one_line(name), one_line(value));
    }
    comment
}

/// Inserts a comment after the first two bytes and the mandatory first segment (ITU-T T.81, B.2.4.5). The
/// encoder does not write comments.
fn insert_comment(file: &[u8], comment: &str) -> Vec<u8> {
    const COMMENT: [u8; 2] = [0xff, 0xfe];
    /// Maximum size of a segment's content.
    const MAX_BYTES: usize = u16::MAX as usize - 2;
    let length = file.get(4..6).map_or(0, |two| usize::from(u16::from_be_bytes([two[0], two[1]])));
    let (head, rest) = file.split_at((4 + length).min(file.len()));
    let comment = &comment.as_bytes()[..comment.len().min(MAX_BYTES)];
    let length = (comment.len() as u16 + 2).to_be_bytes();
    [head, &COMMENT, &length, comment, rest].concat()
}
