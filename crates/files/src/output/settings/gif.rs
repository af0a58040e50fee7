//! GIF: comments before the first frame. The decoders that there are skip them.

use super::Made;

/// Blocks of a GIF by their first bytes.
const EXTENSION: u8 = 0x21;
const COMMENT: u8 = 0xfe;
/// The flag of a palette for all frames.
const HAS_PALETTE: u8 = 0x80;

pub(super) fn of_gif(bytes: &[u8]) -> Option<Made> {
    let word = |at: usize| bytes.get(at..)?.first_chunk().map(|two| u32::from(u16::from_le_bytes(*two)));
    let flags = *bytes.get(10)?;
    let palette = if flags & HAS_PALETTE != 0 { 3 << ((flags & 7) + 1) } else { 0 };
    let mut made = Made { format: "GIF".to_owned(), size: Some((word(6)?, word(8)?)), ..Made::default() };
    let mut at = 13 + palette;
    while let [EXTENSION, kind, ..] = *bytes.get(at..)? {
        at += 2;
        let mut content = Vec::new();
        // Blocks of at most 255 bytes, up to an empty one.
        loop {
            let length = usize::from(*bytes.get(at)?);
            content.extend_from_slice(bytes.get(at + 1..at + 1 + length)?);
            at += 1 + length;
            if length == 0 {
                break;
            }
        }
        if kind == COMMENT {
            String::from_utf8_lossy(&content).lines().for_each(|line| made.add_line(line));
        }
    }
    Some(made)
}
