//! JPEG: 8 bit sRGB, every component at full resolution.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use super::{EncodeOptions, Format, OutputError};
use crate::film::RadianceImage;
use crate::film::tone::develop;

/// Of 100: no loss that is seen at arm's length, at a quarter of the size of 100.
const QUALITY: u8 = 92;

pub(super) fn encode(image: &RadianceImage, options: &EncodeOptions) -> Result<Vec<u8>, OutputError> {
    let picture = develop(image, &options.tone);
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode(picture.pixels.as_flattened(), image.width, image.height, ExtendedColorType::Rgb8)
        .map_err(|error| OutputError::encoder(Format::Jpeg, &error))?;
    Ok(bytes)
}
