//! PFM decoder (Debevec, *PFM Portable FloatMap Image Format*). `image` does not support this format.

use std::io::{BufRead, Read};

use ::image::error::{DecodingError, ImageFormatHint};
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};

/// Maximum size of the header.
const HEADER_BYTES: u64 = 1 << 10;

/// Whether a file that starts with these bytes is a PFM file.
pub(super) fn is_pfm(start: &[u8]) -> bool {
    matches!(start, [b'P', b'F' | b'f', blank, ..] if blank.is_ascii_whitespace())
}

/// PFM decoder. Rows are stored from bottom to top. Values are multiplied by the absolute value of the scale.
/// A negative scale means little-endian data.
pub(super) struct PfmDecoder<R> {
    file: R,
    size: [u32; 2],
    is_gray: bool,
    scale: f32,
}

impl<R: BufRead> PfmDecoder<R> {
    pub(super) fn new(mut file: R) -> ImageResult<Self> {
        let mut header = (&mut file).take(HEADER_BYTES);
        let kind = read_word(&mut header)?;
        let mut side = |name: &str| {
            let word = read_word(&mut header)?;
            word.parse().map_err(|_| decoding_error(format!("invalid {name} {word:?}")))
        };
        let size = [side("width")?, side("height")?];
        let scale = read_word(&mut header)?;
        let number: Option<f32> = fast_float2::parse(&scale).ok();
        match number.filter(|number| number.is_finite() && *number != 0.0) {
            Some(scale) => Ok(Self { file, size, is_gray: kind == "Pf", scale }),
            None => Err(decoding_error(format!("invalid scale {scale:?}; expected a nonzero number"))),
        }
    }
}

impl<R: BufRead> ImageDecoder for PfmDecoder<R> {
    fn dimensions(&self) -> (u32, u32) {
        self.size.into()
    }

    fn color_type(&self) -> ColorType {
        ColorType::Rgb32F
    }

    fn read_image(mut self, samples: &mut [u8]) -> ImageResult<()> {
        const FLOAT: usize = 4;
        let [width, _] = self.size.map(|side| side as usize);
        let copies = if self.is_gray { 3 } else { 1 };
        let mut row_bytes = vec![0; width * FLOAT * 3 / copies];
        for row in samples.chunks_exact_mut(width * FLOAT * 3).rev() {
            self.file.read_exact(&mut row_bytes)?;
            let targets = row.as_chunks_mut::<FLOAT>().0.chunks_exact_mut(copies);
            for (target, bytes) in targets.zip(row_bytes.as_chunks::<FLOAT>().0) {
                let value =
                    if self.scale < 0.0 { f32::from_le_bytes(*bytes) } else { f32::from_be_bytes(*bytes) };
                target.fill((value * self.scale.abs()).to_ne_bytes());
            }
        }
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, samples: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(samples)
    }
}

/// Reads a word and the whitespace character after it.
fn read_word(file: &mut impl Read) -> ImageResult<String> {
    let mut word = String::new();
    loop {
        let mut byte = [0];
        file.read_exact(&mut byte)?;
        match byte[0] {
            byte if byte.is_ascii_whitespace() && word.is_empty() => {}
            byte if byte.is_ascii_whitespace() => return Ok(word),
            byte => word.push(char::from(byte)),
        }
    }
}

fn decoding_error(reason: String) -> ImageError {
    ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::Pnm), reason))
}
