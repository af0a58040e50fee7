//! Reads a GIF's comments, which existing decoders skip, and counts its frames.

use std::io::Read;

use super::ImageFileInfo;

/// Block types.
const EXTENSION: u8 = 0x21;
const FRAME: u8 = 0x2c;
const END: u8 = 0x3b;
/// Label that marks a comment extension.
const COMMENT: u8 = 0xfe;
/// Flag for a global or local palette.
const HAS_PALETTE: u8 = 0x80;

/// Reads a GIF from the start. The frame count is unknown if the file is truncated. Returns `None` if the
/// file has no frames.
pub(super) fn read_gif_info(mut file: impl Read) -> Option<ImageFileInfo> {
    let [_, _, _, _, _, _, a, b, c, d, flags, _, _] = read_array(&mut file)?;
    let size = (u32::from(u16::from_le_bytes([a, b])), u32::from(u16::from_le_bytes([c, d])));
    let mut info = ImageFileInfo { format: "GIF".to_owned(), size: Some(size), ..ImageFileInfo::default() };
    skip_palette(&mut file, flags)?;
    let mut frames = 0;
    let is_complete = loop {
        match read_array(&mut file) {
            Some([EXTENSION]) => {
                let Some([kind]) = read_array(&mut file) else { break false };
                let mut comment = Vec::new();
                let keep = |part: &[u8]| comment.extend_from_slice(if kind == COMMENT { part } else { &[] });
                if for_each_sub_block(&mut file, keep).is_none() {
                    break false;
                }
                String::from_utf8_lossy(&comment).lines().for_each(|line| info.add_name_value_line(line));
            }
            Some([FRAME]) => {
                frames += 1;
                if skip_frame(&mut file).is_none() {
                    break false;
                }
            }
            Some([END]) => break true,
            Some(_) | None => break false,
        }
    };
    info.frames = is_complete.then_some(frames);
    (frames > 0).then_some(info)
}

/// Reads the next `N` bytes.
fn read_array<const N: usize>(file: &mut impl Read) -> Option<[u8; N]> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes).ok().map(|()| bytes)
}

fn skip_palette(file: &mut impl Read, flags: u8) -> Option<()> {
    let colors = if flags & HAS_PALETTE != 0 { 2 << (flags & 7) } else { 0 };
    (0..colors).try_for_each(|_| read_array::<3>(file).map(|_| ()))
}

/// Skips a frame: position and size, palette, code size, pixels.
fn skip_frame(file: &mut impl Read) -> Option<()> {
    let [_, _, _, _, _, _, _, _, flags] = read_array(file)?;
    skip_palette(file, flags)?;
    let [_] = read_array(file)?;
    for_each_sub_block(file, |_| {})
}

/// Reads sub-blocks of at most 255 bytes, up to the first empty one.
fn for_each_sub_block(file: &mut impl Read, mut take: impl FnMut(&[u8])) -> Option<()> {
    let mut content = [0; 255];
    loop {
        let [length] = read_array(file)?;
        let part = &mut content[..usize::from(length)];
        if part.is_empty() {
            return Some(());
        }
        file.read_exact(part).ok()?;
        take(part);
    }
}
