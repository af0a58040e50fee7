//! Sixel encoding (DEC, "VT330/VT340 Programmer Reference Manual", chapter 14): six-pixel columns, one color
//! at a time.

use ratatui::layout::Rect;

use super::palette::Palette;
use crate::film::Srgb8Image;
use crate::rescale::resized;

/// Register of the first palette color. Lower registers are reserved for the terminal.
const FIRST_REGISTER: u8 = 16;
/// Number of color registers.
const REGISTER_COUNT: usize = 256;

/// Encodes an image to be drawn at the cursor, scaled to cover these cells. `cell` is the size of a cell in
/// pixels. The palette is reused if it still fits the image and recomputed otherwise. Small images are
/// enlarged only after quantization, which saves time and memory.
pub(super) fn encode(
    picture: &Srgb8Image,
    cells: Rect,
    cell: (u16, u16),
    palette: &mut Option<Palette>,
) -> Vec<u8> {
    let side = |cells: u16, pixels: u16| (u32::from(cells) * u32::from(pixels)).max(1);
    let (width, height) = (side(cells.width, cell.0), side(cells.height, cell.1));
    let smaller = (picture.width > width || picture.height > height)
        .then(|| resized(picture, picture.width.min(width), picture.height.min(height)));
    let picture = smaller.as_ref().unwrap_or(picture);
    let fitting = Palette::reused_or_new(picture, palette.take());
    let palette = palette.insert(fitting);
    let registers: Vec<u8> =
        palette.indices(picture).into_iter().map(|index| FIRST_REGISTER.saturating_add(index)).collect();
    let mut bytes = format!("\x1bP0;1;0q\"1;1;{width};{height}").into_bytes();
    for (register, color) in (FIRST_REGISTER..=u8::MAX).zip(palette.colors()) {
        let [r, g, b] = color.map(|level| (u32::from(level) * 100 + 127) / 255);
        bytes.extend(format!("#{register};2;{r};{g};{b}").into_bytes());
    }
    // Each sixel column and row shows the pixel at its center.
    let middle = |i: u32, count: u32, of: u32| {
        ((2 * u64::from(i) + 1) * u64::from(of) / (2 * u64::from(count))) as usize
    };
    let columns: Vec<usize> = (0..width).map(|x| middle(x, width, picture.width)).collect();
    let mut band = SixelBand::new(width as usize);
    for top in (0..height).step_by(6) {
        for y in top..height.min(top + 6) {
            let row = &registers[middle(y, height, picture.height) * picture.width as usize..];
            band.set_row(y - top, columns.iter().map(|x| row[*x]));
        }
        band.drain_to_sixels(&mut bytes);
    }
    bytes.extend_from_slice(b"\x1b\\");
    bytes
}

/// A band of six pixel rows, with a separate set of sixels for each color.
struct SixelBand {
    width: usize,
    /// Sixels of all registers, concatenated.
    sixels: Vec<u8>,
    is_used: [bool; REGISTER_COUNT],
}

impl SixelBand {
    fn new(width: usize) -> Self {
        Self { width, sixels: vec![0; REGISTER_COUNT * width], is_used: [false; REGISTER_COUNT] }
    }

    /// Sets one of the band's pixel rows.
    fn set_row(&mut self, y: u32, registers: impl Iterator<Item = u8>) {
        for (x, register) in registers.enumerate() {
            self.is_used[usize::from(register)] = true;
            self.sixels[usize::from(register) * self.width + x] |= 1 << y;
        }
    }

    /// Appends each color's sixels followed by a carriage return, then appends a line feed and clears the
    /// band.
    fn drain_to_sixels(&mut self, bytes: &mut Vec<u8>) {
        for register in (0..REGISTER_COUNT).filter(|register| std::mem::take(&mut self.is_used[*register])) {
            bytes.extend(format!("#{register}").into_bytes());
            let own = &mut self.sixels[register * self.width..][..self.width];
            push_runs(own.iter().map(|bits| b'?' + bits), bytes);
            own.fill(0);
            bytes.push(b'$');
        }
        bytes.push(b'-');
    }
}

/// Appends run-length encoded sixels, omitting trailing empty ones.
fn push_runs(sixels: impl Iterator<Item = u8>, bytes: &mut Vec<u8>) {
    let mut push = |sixel: u8, count: usize| match count {
        0..4 => bytes.extend(std::iter::repeat_n(sixel, count)),
        _ => bytes.extend(format!("!{count}{}", char::from(sixel)).into_bytes()),
    };
    let (mut last, mut count) = (b'?', 0);
    for sixel in sixels {
        if sixel != last {
            push(last, count);
            (last, count) = (sixel, 0);
        }
        count += 1;
    }
    if last != b'?' {
        push(last, count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_encoded_and_trailing_blanks_omitted() {
        let mut bytes = Vec::new();
        push_runs(b"???@@@@@~~A????".iter().copied(), &mut bytes);
        assert_eq!(String::from_utf8(bytes).expect("ASCII"), "???!5@~~A");
    }
}
