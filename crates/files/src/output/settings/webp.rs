//! Reads settings from the chunks in a WebP file (RFC 9649, 2.3).

use std::io::{Read, Seek, SeekFrom};

use super::ImageFileInfo;

/// Maximum size of an XMP packet.
const MAX_XMP: u32 = 1 << 20;

/// Reads the chunks in a WebP file. Returns `None` if the size is missing.
pub(super) fn read_webp_info(mut file: impl Read + Seek) -> Option<ImageFileInfo> {
    let mut info = ImageFileInfo { format: "WebP".to_owned(), ..ImageFileInfo::default() };
    file.seek(SeekFrom::Start(12)).ok()?;
    let mut header = [0; 8];
    while file.read_exact(&mut header).is_ok() {
        let [kind @ .., _, _, _, _] = header;
        let length = u32::from_le_bytes(*header.last_chunk()?);
        let next = file.stream_position().ok()? + u64::from(length) + u64::from(length % 2);
        let mut content = Vec::new();
        let kept = match &kind {
            b"VP8X" | b"VP8L" => 10,
            b"XMP " => MAX_XMP,
            _ => 0,
        };
        (&mut file).take(length.min(kept).into()).read_to_end(&mut content).ok()?;
        match &kind {
            b"VP8X" => {
                info.size = Some((read_canvas_dimension(&content, 4)?, read_canvas_dimension(&content, 7)?));
            }
            b"VP8L" if info.size.is_none() => info.size = Some(read_lossless_size(&content)?),
            b"XMP " => add_info_from_xmp_packet(&mut info, &String::from_utf8_lossy(&content)),
            _ => {}
        }
        file.seek(SeekFrom::Start(next)).ok()?;
    }
    info.size.map(|_| info)
}

/// Reads the canvas width or height of an extended file, which is stored in 24 bits, minus one.
fn read_canvas_dimension(content: &[u8], at: usize) -> Option<u32> {
    let [a, b, c] = *content.get(at..)?.first_chunk()?;
    Some(u32::from_le_bytes([a, b, c, 0]) + 1)
}

/// Reads the size of a lossless image. Width and height are stored as 14 bits each, minus one.
fn read_lossless_size(content: &[u8]) -> Option<(u32, u32)> {
    let bits = u32::from_le_bytes(*content.get(1..)?.first_chunk()?);
    Some(((bits & 0x3fff) + 1, (bits >> 14 & 0x3fff) + 1))
}

/// Adds the program and the description lines from an XMP packet.
fn add_info_from_xmp_packet(info: &mut ImageFileInfo, packet: &str) {
    let between = |start: &str, end: &str| {
        let (_, rest) = packet.split_once(start)?;
        Some(unescape_xml(rest.split_once(end)?.0))
    };
    if let Some(program) = between("xmp:CreatorTool=\"", "\"") {
        info.add_entry("Software", &program);
    }
    if let Some(lines) = between("<rdf:li xml:lang=\"x-default\">", "</rdf:li>") {
        lines.lines().for_each(|line| info.add_name_value_line(line));
    }
}

/// Unescapes XML text.
fn unescape_xml(text: &str) -> String {
    text.replace("&quot;", "\"").replace("&gt;", ">").replace("&lt;", "<").replace("&amp;", "&")
}
