//! GIF: comments before the first frame, and the number of frames. The decoders that there are skip comments.

use std::io::Read;

use super::Made;

/// Blocks of a GIF by their first bytes.
const EXTENSION: u8 = 0x21;
const FRAME: u8 = 0x2c;
const END: u8 = 0x3b;
/// The kind of an extension that is a comment.
const COMMENT: u8 = 0xfe;
/// The flag of a palette, for all frames or for one.
const HAS_PALETTE: u8 = 0x80;

/// A GIF by its blocks, from its start. The frames of a file that is cut short are not counted. `None` if it has no frame.
pub(super) fn of_gif(mut file: impl Read) -> Option<Made> {
    let [_, _, _, _, _, _, a, b, c, d, flags, _, _] = next(&mut file)?;
    let size = (u32::from(u16::from_le_bytes([a, b])), u32::from(u16::from_le_bytes([c, d])));
    let mut made = Made { format: "GIF".to_owned(), size: Some(size), ..Made::default() };
    skip_palette(&mut file, flags)?;
    let mut frames = 0;
    let is_whole = loop {
        match next(&mut file) {
            Some([EXTENSION]) => {
                let Some([kind]) = next(&mut file) else { break false };
                let mut comment = Vec::new();
                let keep = |part: &[u8]| comment.extend_from_slice(if kind == COMMENT { part } else { &[] });
                if sub_blocks(&mut file, keep).is_none() {
                    break false;
                }
                String::from_utf8_lossy(&comment).lines().for_each(|line| made.add_line(line));
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
    made.frames = is_whole.then_some(frames);
    (frames > 0).then_some(made)
}

/// The next bytes.
fn next<const N: usize>(file: &mut impl Read) -> Option<[u8; N]> {
    let mut bytes = [0; N];
    file.read_exact(&mut bytes).ok().map(|()| bytes)
}

fn skip_palette(file: &mut impl Read, flags: u8) -> Option<()> {
    let colors = if flags & HAS_PALETTE != 0 { 2 << (flags & 7) } else { 0 };
    (0..colors).try_for_each(|_| next::<3>(file).map(|_| ()))
}

/// Skips a frame: its place and size, its palette, the width of its codes, its pixels.
fn skip_frame(file: &mut impl Read) -> Option<()> {
    let [_, _, _, _, _, _, _, _, flags] = next(file)?;
    skip_palette(file, flags)?;
    let [_] = next(file)?;
    sub_blocks(file, |_| {})
}

/// Takes blocks of at most 255 bytes, up to an empty one.
fn sub_blocks(file: &mut impl Read, mut take: impl FnMut(&[u8])) -> Option<()> {
    let mut content = [0; 255];
    loop {
        let [length] = next(file)?;
        let part = &mut content[..usize::from(length)];
        if part.is_empty() {
            return Some(());
        }
        file.read_exact(part).ok()?;
        take(part);
    }
}
