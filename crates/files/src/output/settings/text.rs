//! Headers of lines, and the comments of JPEG.

use super::Made;

/// Radiance HDR: lines up to an empty one, then the size.
pub(super) fn of_hdr(bytes: &[u8]) -> Option<Made> {
    let mut made = Made { format: "HDR".to_owned(), ..Made::default() };
    let mut lines = bytes.split(|byte| *byte == b'\n').map(String::from_utf8_lossy);
    for line in lines.by_ref() {
        match line.strip_prefix("# ") {
            Some(comment) => made.add_line(comment),
            None if line.is_empty() => break,
            None => {
                if let Some((name, value)) = line.split_once('=').filter(|(name, _)| *name == "SOFTWARE") {
                    made.add(name, value);
                }
            }
        }
    }
    // `-Y 480 +X 640`
    let size = lines.next()?;
    let mut words = size.split_ascii_whitespace();
    let (_, height, _, width) = (words.next()?, words.next()?, words.next()?, words.next()?);
    made.size = Some((width.parse().ok()?, height.parse().ok()?));
    Some(made)
}

/// PPM: comments between the numbers.
pub(super) fn of_ppm(bytes: &[u8]) -> Option<Made> {
    let mut made = Made::default();
    let mut numbers = Vec::new();
    for line in bytes.get(2..)?.split(|byte| *byte == b'\n').map(String::from_utf8_lossy) {
        match line.strip_prefix('#') {
            Some(comment) => made.add_line(comment.trim_start()),
            None => {
                numbers.extend(line.split_ascii_whitespace().map_while(|word| word.parse::<u32>().ok()));
            }
        }
        if numbers.len() >= 3 {
            break;
        }
    }
    let [width, height, greatest, ..] = numbers[..] else { return None };
    made.size = Some((width, height));
    made.format = format!("PPM, {} bits a channel", if greatest > 255 { 16 } else { 8 });
    Some(made)
}

/// JPEG: the segments before the pixels.
pub(super) fn of_jpeg(bytes: &[u8]) -> Option<Made> {
    const COMMENT: u8 = 0xfe;
    let mut made = Made { format: "JPEG".to_owned(), ..Made::default() };
    let mut at = 2;
    loop {
        let (mark, kind) = (*bytes.get(at)?, *bytes.get(at + 1)?);
        let length = usize::from(u16::from_be_bytes(*bytes.get(at + 2..)?.first_chunk()?));
        let content = bytes.get(at + 4..at + 2 + length)?;
        match kind {
            _ if mark != 0xff => return None,
            COMMENT => String::from_utf8_lossy(content).lines().for_each(|line| made.add_line(line)),
            // Frame headers but for tables of Huffman and arithmetic codes.
            0xc0..=0xcf if !matches!(kind, 0xc4 | 0xc8 | 0xcc) => {
                let [_, height @ .., _, _] = *content.first_chunk::<5>()?;
                let width = u16::from_be_bytes(*content.get(3..)?.first_chunk()?);
                made.size = Some((width.into(), u16::from_be_bytes(height).into()));
                return Some(made);
            }
            _ => {}
        }
        at += 2 + length;
    }
}
