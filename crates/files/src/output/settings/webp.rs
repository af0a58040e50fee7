//! WebP: the chunks around the pixels (RFC 9649, 2.3).

use std::io::{Read, Seek, SeekFrom};

use super::Made;

/// Longest XMP packet that is read, in bytes.
const MOST: u32 = 1 << 20;

/// A WebP file by its chunks. `None` if it has none with its size.
pub(super) fn of_webp(mut file: impl Read + Seek) -> Option<Made> {
    let mut made = Made { format: "WebP".to_owned(), ..Made::default() };
    file.seek(SeekFrom::Start(12)).ok()?;
    let mut header = [0; 8];
    while file.read_exact(&mut header).is_ok() {
        let [kind @ .., _, _, _, _] = header;
        let length = u32::from_le_bytes(*header.last_chunk()?);
        let behind = file.stream_position().ok()? + u64::from(length) + u64::from(length % 2);
        let mut content = Vec::new();
        let kept = match &kind {
            b"VP8X" | b"VP8L" => 10,
            b"XMP " => MOST,
            _ => 0,
        };
        (&mut file).take(length.min(kept).into()).read_to_end(&mut content).ok()?;
        match &kind {
            b"VP8X" => made.size = Some((canvas(&content, 4)?, canvas(&content, 7)?)),
            b"VP8L" if made.size.is_none() => made.size = Some(lossless(&content)?),
            b"XMP " => add_packet(&mut made, &String::from_utf8_lossy(&content)),
            _ => {}
        }
        file.seek(SeekFrom::Start(behind)).ok()?;
    }
    made.size.map(|_| made)
}

/// A side of the canvas of an extended file: 24 bits, one less.
fn canvas(content: &[u8], at: usize) -> Option<u32> {
    let [a, b, c] = *content.get(at..)?.first_chunk()?;
    Some(u32::from_le_bytes([a, b, c, 0]) + 1)
}

/// Sides of a picture without loss: 14 bits each, one less.
fn lossless(content: &[u8]) -> Option<(u32, u32)> {
    let bits = u32::from_le_bytes(*content.get(1..)?.first_chunk()?);
    Some(((bits & 0x3fff) + 1, (bits >> 14 & 0x3fff) + 1))
}

/// Adds the program and the lines of the description of an XMP packet.
fn add_packet(made: &mut Made, packet: &str) {
    let between = |start: &str, end: &str| {
        let (_, rest) = packet.split_once(start)?;
        Some(plain(rest.split_once(end)?.0))
    };
    if let Some(program) = between("xmp:CreatorTool=\"", "\"") {
        made.add("Software", &program);
    }
    if let Some(lines) = between("<rdf:li xml:lang=\"x-default\">", "</rdf:li>") {
        lines.lines().for_each(|line| made.add_line(line));
    }
}

/// Text that XML has escaped.
fn plain(text: &str) -> String {
    text.replace("&quot;", "\"").replace("&gt;", ">").replace("&lt;", "<").replace("&amp;", "&")
}
