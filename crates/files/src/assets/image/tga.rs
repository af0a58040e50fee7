//! Adds TGA support that `image` lacks: determines the meaning of alpha, and corrects some headers that
//! `image` rejects (Truevision, *TGA File Format Specification*, version 2.0).

use std::io::{self, Chain, Cursor, Read, Seek, SeekFrom};

use ::image::codecs::tga::TgaDecoder;
use ::image::error::{DecodingError, ImageFormatHint};
use ::image::{ImageError, ImageFormat, ImageResult};

use super::metadata::AlphaInterpretation;

/// Size of the TGA header in bytes.
const HEADER: usize = 18;
/// Offset of the image descriptor in the header.
const DESCRIPTOR: usize = 17;
/// Mask for the number of alpha bits in the descriptor.
const ALPHA_BITS: u8 = 0xf;
/// Size of the footer in bytes: two offsets and the signature.
const FOOTER: i64 = 26;
const SIGNATURE: &[u8] = b"TRUEVISION-XFILE.\0";
/// Offset of the attribute type in the extension area.
const ATTRIBUTES: u64 = 494;

/// A TGA file with a corrected header.
type PatchedTga<R> = Chain<Cursor<[u8; HEADER]>, R>;

/// Creates a decoder and determines the meaning of alpha. `image` requires the header to declare exactly as
/// many alpha bits as the pixel format can store, but many files declare too many or none at all.
pub(super) fn open_with_alpha_usage<R: Read + Seek>(
    mut file: R,
) -> ImageResult<(TgaDecoder<PatchedTga<R>>, AlphaInterpretation)> {
    let mut header = [0; HEADER];
    file.read_exact(&mut header)?;
    let alpha_bits = header[DESCRIPTOR] & ALPHA_BITS;
    let alpha = match read_attribute_type(&mut file) {
        Ok(Some(0..=2)) => AlphaInterpretation::Unused,
        Ok(Some(4)) => AlphaInterpretation::Premultiplied,
        Ok(Some(3)) => AlphaInterpretation::Straight,
        Ok(_) | Err(_) if alpha_bits == 0 => AlphaInterpretation::Unused,
        Ok(_) | Err(_) => AlphaInterpretation::Straight,
    };
    // `image` does not decode the alpha bit of 16-bit colors.
    let has_alpha_bit = bits_per_color(&header) == Some(16) && alpha != AlphaInterpretation::Unused;
    let alpha = if has_alpha_bit { AlphaInterpretation::Dropped } else { alpha };
    header[DESCRIPTOR] =
        header[DESCRIPTOR] & !ALPHA_BITS | max_alpha_bits(&header).map_err(decoding_error)?;
    file.seek(SeekFrom::Start(HEADER as u64))?;
    Ok((TgaDecoder::new(Cursor::new(header).chain(file))?, alpha))
}

/// Returns the number of bits per color, or `None` for gray images and unknown types.
fn bits_per_color(header: &[u8; HEADER]) -> Option<u8> {
    match header[2] {
        1 | 9 => Some(header[7]),
        2 | 10 => Some(header[16]),
        _ => None,
    }
}

/// Returns how many bits of each pixel may contain alpha.
fn max_alpha_bits(header: &[u8; HEADER]) -> Result<u8, String> {
    let kind = header[2];
    let bits = match (kind, bits_per_color(header)) {
        (_, Some(bits)) => bits,
        (3 | 11, None) => header[16],
        _ => return Err(format!("image type {kind} is not supported; save it as PNG")),
    };
    match (kind, bits) {
        (3 | 11, 8) | (1 | 2 | 9 | 10, 15 | 16 | 24) => Ok(0),
        (3 | 11, 16) | (1 | 2 | 9 | 10, 32) => Ok(8),
        (3 | 11, _) => Err(format!(
            "{bits}-bit gray is not supported (only 8-bit, or 16-bit including alpha); save it as PNG"
        )),
        _ => Err(format!("{bits}-bit color is not supported (only 15, 16, 24 or 32 bits); save it as PNG")),
    }
}

fn decoding_error(reason: String) -> ImageError {
    ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::Tga), reason))
}

/// Attribute type in the extension area, if the file has one.
fn read_attribute_type(file: &mut (impl Read + Seek)) -> io::Result<Option<u8>> {
    file.seek(SeekFrom::End(-FOOTER))?;
    let mut offset = [0; 4];
    file.read_exact(&mut offset)?;
    file.seek(SeekFrom::Current(4))?;
    let mut signature = [0; SIGNATURE.len()];
    file.read_exact(&mut signature)?;
    let offset = u64::from(u32::from_le_bytes(offset));
    if signature != *SIGNATURE || offset == 0 {
        return Ok(None);
    }
    file.seek(SeekFrom::Start(offset + ATTRIBUTES))?;
    let mut kind = [0];
    file.read_exact(&mut kind)?;
    Ok(Some(kind[0]))
}
