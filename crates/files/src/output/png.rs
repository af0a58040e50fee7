//! PNG: 8-bit or 16-bit sRGB, with text chunks.

use std::io::Write;

use ::png::{ColorType, Encoder, EncodingError, SrgbRenderingIntent};

use super::{BitDepth, EncodeOptions, Format, OutputError, SOFTWARE, cancelable};
use crate::control::CancelToken;
use crate::film::RadianceImage;

/// Maximum length of a keyword (PNG specification, 11.3.3.1).
const KEYWORD_BYTES: usize = 79;
/// Size of an IDAT chunk.
const CHUNK_BYTES: usize = 1 << 18;

pub(super) fn encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    try_encode(image, options, token).map_err(|error| OutputError::encoder(Format::Png, &error))
}

fn try_encode(
    image: &RadianceImage,
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_source_srgb(SrgbRenderingIntent::Perceptual);
    encoder.set_depth(match options.bit_depth {
        BitDepth::Eight => ::png::BitDepth::Eight,
        BitDepth::Sixteen => ::png::BitDepth::Sixteen,
    });
    add_text(&mut encoder, "Software", SOFTWARE)?;
    for (name, value) in &options.metadata {
        add_text(&mut encoder, name, value)?;
    }
    let mut writer = encoder.write_header()?;
    let mut data = writer.stream_writer_with_size(CHUNK_BYTES)?;
    cancelable::for_each_tone_mapped_part(image, options, token, |part| data.write_all(part))?;
    data.finish()?;
    writer.finish()?;
    Ok(bytes)
}

/// Adds a text chunk. ASCII is written as tEXt, which all readers support, and other text as iTXt.
pub(super) fn add_text(
    encoder: &mut Encoder<'_, &mut Vec<u8>>,
    name: &str,
    value: &str,
) -> Result<(), EncodingError> {
    let name: String =
        name.chars().filter(|c| c.is_ascii_graphic() || *c == ' ').take(KEYWORD_BYTES).collect();
    let name = name.trim().to_owned();
    if name.is_empty() {
        return Ok(());
    }
    let value = value.replace('\0', "");
    if value.is_ascii() { encoder.add_text_chunk(name, value) } else { encoder.add_itxt_chunk(name, value) }
}
