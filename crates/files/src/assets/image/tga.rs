//! The meaning of alpha in a TGA (Truevision, *TGA File Format Specification*, version 2.0), which `image` leaves out, and headers
//! that it refuses.

use std::io::{self, Chain, Cursor, Read, Seek, SeekFrom};

use ::image::codecs::tga::TgaDecoder;
use ::image::error::{DecodingError, ImageFormatHint};
use ::image::{ImageError, ImageFormat, ImageResult};

use super::facts::Alpha;

/// Bytes of the header.
const HEADER: usize = 18;
/// Place of the image descriptor, and its bits that count those of alpha.
const DESCRIPTOR: usize = 17;
const ALPHA_BITS: u8 = 0xf;
/// The end of the file: offsets of two areas, then these words.
const FOOTER: i64 = 26;
const SIGNATURE: &[u8] = b"TRUEVISION-XFILE.\0";
/// Place of the type of alpha in the extension area.
const ATTRIBUTES: u64 = 494;

/// The rest of a file behind a header.
type Patched<R> = Chain<Cursor<[u8; HEADER]>, R>;

/// A decoder of a file, and the meaning of its alpha. `image` wants the header to count as many alpha bits as the pixels have room for;
/// files count none, or more.
pub(super) fn open<R: Read + Seek>(mut file: R) -> ImageResult<(TgaDecoder<Patched<R>>, Alpha)> {
    let mut header = [0; HEADER];
    file.read_exact(&mut header)?;
    let alpha_bits = header[DESCRIPTOR] & ALPHA_BITS;
    let alpha = match attributes(&mut file) {
        Ok(Some(0..=2)) => Alpha::Unused,
        Ok(Some(4)) => Alpha::Premultiplied,
        Ok(Some(3)) => Alpha::Straight,
        Ok(_) | Err(_) if alpha_bits == 0 => Alpha::Unused,
        Ok(_) | Err(_) => Alpha::Straight,
    };
    header[DESCRIPTOR] =
        header[DESCRIPTOR] & !ALPHA_BITS | room_for_alpha(&header).map_err(decoding_error)?;
    file.seek(SeekFrom::Start(HEADER as u64))?;
    Ok((TgaDecoder::new(Cursor::new(header).chain(file))?, alpha))
}

/// Bits of a pixel that may be alpha.
fn room_for_alpha(header: &[u8; HEADER]) -> Result<u8, String> {
    let (kind, map_bits, pixel_bits) = (header[2], header[7], header[16]);
    let bits = match kind {
        1 | 9 => map_bits,
        2 | 3 | 10 | 11 => pixel_bits,
        _ => return Err(format!("its pixels are of type {kind}; save it as PNG")),
    };
    match (kind, bits) {
        (3 | 11, 8) | (1 | 2 | 9 | 10, 15 | 16 | 24) => Ok(0),
        (3 | 11, 16) | (1 | 2 | 9 | 10, 32) => Ok(8),
        (3 | 11, _) => {
            Err(format!("its gray pixels have {bits} bits, not 8, or 16 with alpha; save it as PNG"))
        }
        _ => Err(format!("its colors have {bits} bits, not 15, 16, 24 or 32; save it as PNG")),
    }
}

fn decoding_error(reason: String) -> ImageError {
    ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::Tga), reason))
}

/// The type of alpha in the extension area. `None` if there is no such area.
fn attributes(file: &mut (impl Read + Seek)) -> io::Result<Option<u8>> {
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
