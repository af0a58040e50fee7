//! Reads settings from text headers and JPEG comments.

use super::ImageFileInfo;

/// Reads a Radiance HDR header. The settings end at an empty line, which is followed by the resolution.
pub(super) fn read_hdr_info(bytes: &[u8]) -> Option<ImageFileInfo> {
    let mut info = ImageFileInfo { format: "HDR".to_owned(), ..ImageFileInfo::default() };
    let mut lines = bytes.split(|byte| *byte == b'\n').map(String::from_utf8_lossy);
    for line in lines.by_ref() {
        match line.strip_prefix("# ") {
            Some(comment) => info.add_name_value_line(comment),
            None if line.is_empty() => break,
            None => {
                if let Some((name, value)) = line.split_once('=').filter(|(name, _)| *name == "SOFTWARE") {
                    info.add_entry(name, value);
                }
            }
        }
    }
    // `-Y 480 +X 640`
    let size = lines.next()?;
    let mut words = size.split_ascii_whitespace();
    let (_, height, _, width) = (words.next()?, words.next()?, words.next()?, words.next()?);
    info.size = Some((width.parse().ok()?, height.parse().ok()?));
    Some(info)
}

/// Reads a PPM header, which contains the settings as comments between the numbers.
pub(super) fn read_ppm_info(bytes: &[u8]) -> Option<ImageFileInfo> {
    let mut info = ImageFileInfo::default();
    let mut numbers = Vec::new();
    for line in bytes.get(2..)?.split(|byte| *byte == b'\n').map(String::from_utf8_lossy) {
        match line.strip_prefix('#') {
            Some(comment) => info.add_name_value_line(comment.trim_start()),
            None => {
                numbers.extend(line.split_ascii_whitespace().map_while(|word| word.parse::<u32>().ok()));
            }
        }
        if numbers.len() >= 3 {
            break;
        }
    }
    let [width, height, max, ..] = numbers[..] else { return None };
    info.size = Some((width, height));
    info.format = format!("PPM, {} bits per channel", if max > 255 { 16 } else { 8 });
    Some(info)
}

/// Reads the segments that precede the pixels in a JPEG.
pub(super) fn read_jpeg_info(bytes: &[u8]) -> Option<ImageFileInfo> {
    const COMMENT: u8 = 0xfe;
    let mut info = ImageFileInfo { format: "JPEG".to_owned(), ..ImageFileInfo::default() };
    let mut at = 2;
    loop {
        let (mark, kind) = (*bytes.get(at)?, *bytes.get(at + 1)?);
        let length = usize::from(u16::from_be_bytes(*bytes.get(at + 2..)?.first_chunk()?));
        let content = bytes.get(at + 4..at + 2 + length)?;
        match kind {
            _ if mark != 0xff => return None,
            COMMENT => {
                String::from_utf8_lossy(content).lines().for_each(|line| info.add_name_value_line(line));
            }
            // Start of frame. The excluded codes are Huffman tables and arithmetic coding.
            0xc0..=0xcf if !matches!(kind, 0xc4 | 0xc8 | 0xcc) => {
                let [_, height @ .., _, _] = *content.first_chunk::<5>()?;
                let width = u16::from_be_bytes(*content.get(3..)?.first_chunk()?);
                info.size = Some((width.into(), u16::from_be_bytes(height).into()));
                return Some(info);
            }
            _ => {}
        }
        at += 2 + length;
    }
}
