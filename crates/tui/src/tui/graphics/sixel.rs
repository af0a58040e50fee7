//! Sixels (DEC, "VT330/VT340 Programmer Reference Manual", chapter 14): columns of six pixels, one colour after the other.

use ratatui::layout::Rect;
use ratatui::style::Color;

use crate::film::Picture;
use crate::tui::color::{self, ColorDepth, Shades};
use crate::tui::view::preview::resized;

/// First of the colours of xterm's palette that are used.
const FIRST: u8 = 16;

/// The commands that show a picture at the cursor over these cells of so many pixels. The colours are those of xterm's
/// palette, dithered.
pub(super) fn encode(picture: &Picture, cells: Rect, cell: (u16, u16)) -> Vec<u8> {
    let side = |cells: u16, pixels: u16| (u32::from(cells) * u32::from(pixels)).max(1);
    let (width, height) = (side(cells.width, cell.0), side(cells.height, cell.1));
    let scaled = resized(picture, width, height);
    let indices = indices(&scaled);
    let mut bytes = format!("\x1bP0;1;0q\"1;1;{width};{height}").into_bytes();
    for index in (FIRST..=u8::MAX).filter(|index| indices.contains(index)) {
        let [r, g, b] =
            color::fixed(index).unwrap_or_default().map(|level| (u32::from(level) * 100 + 127) / 255);
        bytes.extend(format!("#{index};2;{r};{g};{b}").into_bytes());
    }
    for band in indices.chunks(6 * width as usize) {
        push_band(band, width as usize, &mut bytes);
    }
    bytes.extend_from_slice(b"\x1b\\");
    bytes
}

/// The colour of each pixel. Five bits of a channel are enough to find it, dithered as well.
fn indices(picture: &Picture) -> Vec<u8> {
    let shades = Shades::new(ColorDepth::Indexed256, &[[0; 3]; 16]);
    let width = picture.width as usize;
    let index = |(i, rgb): (usize, &[u8; 3])| {
        let (x, y) = (i % width, i / width);
        match shades.color(color::coarse(*rgb, x, y), x, y) {
            Color::Indexed(index) => index,
            _ => FIRST,
        }
    };
    picture.pixels.iter().enumerate().map(index).collect()
}

/// Six rows: for each colour in them its sixels, back to the left, and at last down.
fn push_band(band: &[u8], width: usize, bytes: &mut Vec<u8>) {
    let mut is_used = [false; 256];
    for index in band {
        is_used[usize::from(*index)] = true;
    }
    for index in (0..=u8::MAX).filter(|index| is_used[usize::from(*index)]) {
        bytes.extend(format!("#{index}").into_bytes());
        let sixel = |x: usize| {
            let rows = band.chunks(width).enumerate();
            let bits =
                rows.filter(|(_, row)| row.get(x) == Some(&index)).fold(0, |bits, (y, _)| bits | 1 << y);
            b'?' + bits
        };
        push_runs((0..width).map(sixel), bytes);
        bytes.push(b'$');
    }
    bytes.push(b'-');
}

/// Sixels, with a count where many are alike; nothing for empty ones at the end.
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
    fn runs_are_counted_and_the_end_is_left_out() {
        let mut bytes = Vec::new();
        push_runs(b"???@@@@@~~A????".iter().copied(), &mut bytes);
        assert_eq!(String::from_utf8(bytes).expect("ASCII"), "???!5@~~A");
    }
}
