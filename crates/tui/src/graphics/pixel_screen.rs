//! A minimal terminal that displays images, for tests and benchmarks.

use super::base64::decode_base64;
use crate::film::Srgb8Image;

/// A terminal that understands only kitty graphics and Sixel, and shows the last complete image.
#[derive(Debug, Default)]
pub struct TestImageTerminal {
    /// The control string being received, including its introducer.
    string: Option<Vec<u8>>,
    is_escaped: bool,
    /// Base64 data from the kitty chunks received so far.
    chunks: Vec<u8>,
    shown: Option<Srgb8Image>,
}

impl TestImageTerminal {
    /// Processes terminal output, which may be split at any byte.
    pub fn process_output(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let is_escaped = std::mem::replace(&mut self.is_escaped, *byte == 0x1b);
            match (is_escaped, byte, &mut self.string) {
                (true, b'P' | b'_', _) => self.string = Some(vec![*byte]),
                (true, b'\\', string) => {
                    if let Some(string) = string.take() {
                        self.end_control_string(&string);
                    }
                }
                (_, 0x1b, _) => {}
                (false, byte, Some(string)) => string.push(*byte),
                (..) => {}
            }
        }
    }

    /// The image on the screen.
    pub fn displayed_image(&self) -> Option<&Srgb8Image> {
        self.shown.as_ref()
    }

    fn end_control_string(&mut self, string: &[u8]) {
        let picture = match string {
            [b'_', b'G', command @ ..] => self.handle_kitty_chunk(command),
            [b'P', sixels @ ..] => decode_sixel(sixels),
            _ => None,
        };
        if picture.is_some() {
            self.shown = picture;
        }
    }

    /// Handles a kitty command, which contains a chunk of an image. Returns the image if the chunk completes
    /// it.
    fn handle_kitty_chunk(&mut self, command: &[u8]) -> Option<Srgb8Image> {
        let split = command.iter().position(|byte| *byte == b';')?;
        let (keys, data) = (std::str::from_utf8(&command[..split]).ok()?, &command[split + 1..]);
        self.chunks.extend_from_slice(data);
        if keys.split(',').any(|key| key == "m=1") {
            return None;
        }
        decode_png(&decode_base64(&std::mem::take(&mut self.chunks)))
    }
}

/// Decodes an RGB image from PNG.
fn decode_png(bytes: &[u8]) -> Option<Srgb8Image> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().ok()?;
    let mut data = vec![0; reader.output_buffer_size()?];
    let info = reader.next_frame(&mut data).ok()?;
    let pixels = data[..info.buffer_size()].as_chunks().0.to_vec();
    (info.color_type == png::ColorType::Rgb).then_some(Srgb8Image {
        width: info.width,
        height: info.height,
        pixels,
    })
}

/// Decodes a Sixel string that includes its size and palette.
fn decode_sixel(string: &[u8]) -> Option<Srgb8Image> {
    let start = string.iter().position(|byte| *byte == b'q')? + 1;
    let mut rest = &string[start..];
    let (mut width, mut height, mut pixels) = (0, 0, Vec::new());
    let (mut palette, mut color, mut count) = ([[0; 3]; 256], 0, 1);
    let (mut x, mut top) = (0, 0);
    while let Some((byte, after)) = rest.split_first() {
        rest = after;
        match byte {
            b'"' => {
                let numbers = take_numbers(&mut rest);
                (width, height) = (*numbers.get(2)?, *numbers.get(3)?);
                pixels = vec![[0; 3]; width * height];
            }
            b'#' => {
                let numbers = take_numbers(&mut rest);
                color = *numbers.first()?;
                if let [_, 2, rgb @ ..] = &*numbers {
                    let channel = |i: usize| (rgb.get(i).copied().unwrap_or(0) * 255 + 50) / 100;
                    *palette.get_mut(color)? = std::array::from_fn(|i| channel(i) as u8);
                }
            }
            b'!' => count = *take_numbers(&mut rest).first()?,
            b'$' => x = 0,
            b'-' => (x, top) = (0, top + 6),
            b'?'..=b'~' => {
                for row in (0..6).filter(|row| (byte - b'?') >> row & 1 == 1 && top + row < height) {
                    let line = &mut pixels[(top + row) * width..][..width];
                    line[x.min(width)..(x + count).min(width)].fill(*palette.get(color)?);
                }
                (x, count) = (x + count, 1);
            }
            _ => {}
        }
    }
    Some(Srgb8Image { width: width as u32, height: height as u32, pixels })
}

/// Removes and parses leading semicolon-separated numbers.
fn take_numbers(rest: &mut &[u8]) -> Vec<usize> {
    let end = rest.iter().position(|byte| !matches!(byte, b'0'..=b'9' | b';')).unwrap_or(rest.len());
    let (text, after) = rest.split_at(end);
    *rest = after;
    let number = |text: &[u8]| text.iter().fold(0, |number, digit| number * 10 + usize::from(digit - b'0'));
    text.split(|byte| *byte == b';').map(number).collect()
}
