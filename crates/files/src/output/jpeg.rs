//! JPEG: 8 bit sRGB, every component at full resolution.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use super::stoppable::{self, Stoppable};
use super::{EncodeOptions, Format, OutputError, SOFTWARE, one_line};
use crate::control::CancelToken;
use crate::film::RadianceImage;

/// Quality, of 100: no visible loss at arm's length, at a quarter of the size of 100.
const QUALITY: u8 = 92;

pub(super) fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let picture = stoppable::developed_whole(image, (options, Format::Jpeg), token)?;
    let mut bytes = Stoppable::new(token);
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(&picture, image.width, image.height, ExtendedColorType::Rgb8)
        .map_err(|error| OutputError::encoder(Format::Jpeg, &error))?;
    Ok(with_comment(&bytes.into_bytes(), &comment(options)))
}

/// The settings, a line each.
fn comment(options: &EncodeOptions) -> String {
    let mut comment = format!("Software: {SOFTWARE}\n");
    for (name, value) in &options.metadata {
        comment += &format!("{}: {}\n", one_line(name), one_line(value));
    }
    comment
}

/// The file with a comment behind its first two bytes and the segment that must follow them (ITU-T T.81, B.2.4.5): the encoder
/// writes none.
fn with_comment(file: &[u8], comment: &str) -> Vec<u8> {
    const COMMENT: [u8; 2] = [0xff, 0xfe];
    /// Most bytes of a segment's content.
    const MOST: usize = u16::MAX as usize - 2;
    let length = file.get(4..6).map_or(0, |two| usize::from(u16::from_be_bytes([two[0], two[1]])));
    let (head, rest) = file.split_at((4 + length).min(file.len()));
    let comment = &comment.as_bytes()[..comment.len().min(MOST)];
    let length = (comment.len() as u16 + 2).to_be_bytes();
    [head, &COMMENT, &length, comment, rest].concat()
}
