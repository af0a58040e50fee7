//! JPEG: 8 bit sRGB, every component at full resolution.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use super::stoppable::{self, Stoppable};
use super::{EncodeOptions, Format, OutputError};
use crate::control::CancelToken;
use crate::film::RadianceImage;

/// Quality, of 100: no visible loss at arm's length, at a quarter of the size of 100.
const QUALITY: u8 = 92;

pub(super) fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let mut picture = Vec::with_capacity(3 * image.pixels.len());
    let take = |part: &[u8]| {
        picture.extend_from_slice(part);
        Ok(())
    };
    let developed = stoppable::developed(image, options, token, take);
    developed.map_err(|error| OutputError::encoder(Format::Jpeg, &error))?;
    let mut bytes = Stoppable::new(token);
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(&picture, image.width, image.height, ExtendedColorType::Rgb8)
        .map_err(|error| OutputError::encoder(Format::Jpeg, &error))?;
    Ok(bytes.into_bytes())
}
