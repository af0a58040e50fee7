//! The meaning of alpha in a TGA (Truevision, *TGA File Format Specification*, version 2.0), which `image` leaves out.

use std::io::{self, Read, Seek, SeekFrom};

use super::facts::Alpha;

/// Bytes of the header.
const HEADER: usize = 18;
/// The end of the file: offsets of two areas, then these words.
const FOOTER: i64 = 26;
const SIGNATURE: &[u8] = b"TRUEVISION-XFILE.\0";
/// Place of the type of alpha in the extension area.
const ATTRIBUTES: u64 = 494;

/// The meaning of alpha, by the extension area or else the header. The file is then at its start again.
pub(super) fn alpha(file: &mut (impl Read + Seek)) -> io::Result<Alpha> {
    let mut header = [0; HEADER];
    file.read_exact(&mut header)?;
    let extended = attributes(file);
    file.seek(SeekFrom::Start(0))?;
    let alpha_bits = header[17] & 0xf;
    Ok(match extended {
        Ok(Some(0..=2)) => Alpha::Unused,
        Ok(Some(4)) => Alpha::Premultiplied,
        Ok(Some(3)) => Alpha::Straight,
        Ok(_) | Err(_) if alpha_bits == 0 => Alpha::Unused,
        Ok(_) | Err(_) => Alpha::Straight,
    })
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
