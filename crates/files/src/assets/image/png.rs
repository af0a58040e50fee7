//! PNG by `png`: `image` would unpack chunks beside the picture too.

use std::io::{BufRead, Seek};

use ::image::error::{DecodingError, ImageFormatHint, LimitError, LimitErrorKind};
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};

/// Decoder of the first picture, without colour profile and texts.
pub(super) struct PngDecoder<R: BufRead + Seek> {
    reader: png::Reader<R>,
    color_type: ColorType,
}

impl<R: BufRead + Seek> PngDecoder<R> {
    /// A decoder that takes at most so many bytes of memory besides the pixels.
    pub(super) fn new(file: R, memory_bytes: u64) -> ImageResult<Self> {
        let limits = png::Limits { bytes: usize::try_from(memory_bytes).unwrap_or(usize::MAX) };
        let mut decoder = png::Decoder::new_with_limits(file, limits);
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        // Palettes become colours, small numbers bytes; 16 bits stay.
        decoder.set_transformations(png::Transformations::EXPAND);
        let reader = decoder.read_info().map_err(image_error)?;
        let (color_type, depth) = reader.output_color_type();
        let is_wide = depth == png::BitDepth::Sixteen;
        let color_type = match color_type {
            png::ColorType::Grayscale if is_wide => ColorType::L16,
            png::ColorType::Grayscale => ColorType::L8,
            png::ColorType::GrayscaleAlpha if is_wide => ColorType::La16,
            png::ColorType::GrayscaleAlpha => ColorType::La8,
            png::ColorType::Rgba if is_wide => ColorType::Rgba16,
            png::ColorType::Rgba => ColorType::Rgba8,
            png::ColorType::Rgb if is_wide => ColorType::Rgb16,
            png::ColorType::Rgb | png::ColorType::Indexed => ColorType::Rgb8,
        };
        Ok(Self { reader, color_type })
    }
}

impl<R: BufRead + Seek> ImageDecoder for PngDecoder<R> {
    fn dimensions(&self) -> (u32, u32) {
        self.reader.info().size()
    }

    fn color_type(&self) -> ColorType {
        self.color_type
    }

    fn exif_metadata(&mut self) -> ImageResult<Option<Vec<u8>>> {
        Ok(self.reader.info().exif_metadata.as_ref().map(|exif| exif.to_vec()))
    }

    fn read_image(mut self, samples: &mut [u8]) -> ImageResult<()> {
        self.reader.next_frame(samples).map_err(image_error)?;
        if self.color_type.bytes_per_pixel() / self.color_type.channel_count() == 2 {
            for sample in samples.as_chunks_mut::<2>().0 {
                *sample = u16::from_be_bytes(*sample).to_ne_bytes();
            }
        }
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, samples: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(samples)
    }
}

fn image_error(error: png::DecodingError) -> ImageError {
    match error {
        png::DecodingError::IoError(error) => ImageError::IoError(error),
        png::DecodingError::LimitsExceeded => {
            ImageError::Limits(LimitError::from_kind(LimitErrorKind::InsufficientMemory))
        }
        error => ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::Png), error)),
    }
}
