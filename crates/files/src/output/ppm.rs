//! Binary PPM (P6): 8-bit or 16-bit sRGB.

use super::{BitDepth, EncodeOptions, Format, OutputError, SOFTWARE, cancelable, one_line};
use crate::control::CancelToken;
use crate::film::RadianceImage;

pub(super) fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
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
    let take = |part: &[u8]| {
        bytes.extend_from_slice(part);
        Ok(())
    };
    let written = cancelable::for_each_tone_mapped_part(image, options, token, take);
    written.map_err(|error| OutputError::encoder(Format::Ppm, &error))?;
    Ok(bytes)
}
