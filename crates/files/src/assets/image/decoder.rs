//! Selects the decoder for each format, and checks limits before memory is allocated.

use std::io::{BufRead, Seek, SeekFrom};

use ::image::codecs::bmp::BmpDecoder;
use ::image::codecs::jpeg::JpegDecoder;
use ::image::codecs::pnm::PnmDecoder;
use ::image::codecs::webp::WebPDecoder;
use ::image::error::ImageFormatHint;
use ::image::metadata::Orientation;
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::exr::ExrDecoder;
use super::hdr::HdrDecoder;
use super::messages::{
    empty_image_message, implausible_size_message, memory_limit_message, side_too_long_message,
};
use super::metadata::{AlphaInterpretation, ImageColorMetadata};
use super::png::PngDecoder;
use super::{ColorEncoding, ImageLimits, tga};

/// A decoder, with metadata that the decoder itself does not apply.
pub(super) struct ImageDecoderWithMetadata {
    pub(super) decoder: Box<dyn ImageDecoder>,
    pub(super) metadata: ImageColorMetadata,
    /// Size of the texels in bytes.
    pub(super) texel_bytes: u64,
}

/// Creates the decoder for the detected format. [`ImageReader::into_decoder`] would link decoders that are
/// never used.
pub(super) fn create_decoder<R: BufRead + Seek + 'static>(
    reader: ImageReader<R>,
    encoding: ColorEncoding,
    memory_bytes: u64,
) -> Result<(Box<dyn ImageDecoder>, ImageColorMetadata), ImageError> {
    match reader.format() {
        Some(ImageFormat::Png) => {
            let decoder = PngDecoder::new(reader.into_inner(), memory_bytes)?;
            let metadata = decoder.color_space_and_warnings();
            Ok((Box::new(decoder), metadata))
        }
        Some(ImageFormat::OpenExr) => {
            let decoder = ExrDecoder::new(reader.into_inner(), memory_bytes)?;
            let metadata = decoder.color_metadata();
            Ok((Box::new(decoder), metadata))
        }
        Some(ImageFormat::Hdr) => {
            let mut decoder = HdrDecoder::new(reader.into_inner())?;
            let metadata = decoder.take_metadata();
            Ok((Box::new(decoder), metadata))
        }
        Some(ImageFormat::Tga) => {
            let (decoder, alpha) = tga::open_with_alpha_usage(reader.into_inner())?;
            Ok((Box::new(decoder), ImageColorMetadata { alpha, ..ImageColorMetadata::default() }))
        }
        Some(ImageFormat::Jpeg) => {
            limit_memory_and_read_profile(JpegDecoder::new(reader.into_inner())?, encoding, memory_bytes)
        }
        Some(ImageFormat::Pnm) => {
            limit_memory_and_read_profile(PnmDecoder::new(reader.into_inner())?, encoding, memory_bytes)
        }
        Some(ImageFormat::Bmp) => {
            let (decoder, mut metadata) =
                limit_memory_and_read_profile(BmpDecoder::new(reader.into_inner())?, encoding, memory_bytes)?;
            metadata.alpha = AlphaInterpretation::UnusedIfZero;
            Ok((decoder, metadata))
        }
        Some(ImageFormat::WebP) => {
            let mut file = reader.into_inner();
            // Errors are reported by the decoder below.
            let frames = image_webp::WebPDecoder::new(&mut file).map_or(0, |webp| webp.num_frames());
            file.seek(SeekFrom::Start(0))?;
            let (decoder, mut metadata) =
                limit_memory_and_read_profile(WebPDecoder::new(file)?, encoding, memory_bytes)?;
            metadata.warn_about_extra_frames(frames);
            Ok((decoder, metadata))
        }
        format => {
            let hint = format.map_or(ImageFormatHint::Unknown, ImageFormatHint::Exact);
            Err(ImageError::Unsupported(hint.into()))
        }
    }
}

/// Sets a decoder's memory limit, and reads the color profile if the encoding uses it.
fn limit_memory_and_read_profile(
    mut decoder: impl ImageDecoder + 'static,
    encoding: ColorEncoding,
    memory_bytes: u64,
) -> Result<(Box<dyn ImageDecoder>, ImageColorMetadata), ImageError> {
    // `check_size` checks the width and height, and reports errors more clearly.
    let mut limits = Limits::default();
    limits.max_alloc = Some(memory_bytes);
    decoder.set_limits(limits)?;
    let mut metadata = ImageColorMetadata::default();
    if encoding.uses_file_color_space()
        && let Some(profile) = decoder.icc_profile()?
    {
        metadata.apply_icc_profile(Some(&profile), !decoder.color_type().has_color());
    }
    Ok((Box::new(decoder), metadata))
}

/// Returns an image's orientation from its Exif data. Accepts JPEG's Exif prefix in all formats, because some
/// programs write it there, although `image` does not accept it.
pub(super) fn read_orientation(decoder: &mut dyn ImageDecoder) -> Result<Orientation, ImageError> {
    let orientation = decoder.orientation()?;
    let exif = if orientation == Orientation::NoTransforms { decoder.exif_metadata()? } else { None };
    let without_prefix = exif.as_ref().and_then(|exif| exif.strip_prefix(b"Exif\0\0"));
    Ok(without_prefix.and_then(Orientation::from_exif_chunk).unwrap_or(orientation))
}

/// Size of a texel produced by [`image_to_texels`](super::convert::image_to_texels).
pub(super) fn stored_bytes_per_texel(
    color: ColorType,
    encoding: ColorEncoding,
    metadata: &ImageColorMetadata,
) -> u64 {
    let sample_bytes = color.bytes_per_pixel() / color.channel_count();
    let is_packed = sample_bytes == 1 && encoding.source_color_space(metadata).is_default();
    match encoding {
        ColorEncoding::CutOut(_) if color.has_alpha() => {
            if is_packed && metadata.alpha != AlphaInterpretation::Premultiplied { 4 } else { 16 }
        }
        _ if is_packed => 3,
        _ => 12,
    }
}

/// Memory allowed for any image, regardless of its file size.
const SMALL_BYTES: u64 = 256 << 20;
/// Maximum ratio of memory size to file size for a format. The memory holds the decoded image and its texels.
pub(super) fn max_memory_to_file_ratio(format: Option<ImageFormat>) -> u64 {
    match format {
        // Worst case: eight pixels per byte in a bitmap.
        Some(ImageFormat::Pnm) => 64,
        // Worst case: runs of 128 pixels in two bytes.
        Some(ImageFormat::Tga) => 512,
        // Worst case: runs of 255 pixels in two bytes.
        Some(ImageFormat::Bmp) => 1024,
        // Worst case: a single-color EXR compressed with deflate.
        _ => 4200,
    }
}

/// Checks an image's size before memory is allocated, and returns the size of its texels. `held_bytes` is the
/// size of the file data kept by the decoder. `in_memory` is the size of the in-memory copy of the file,
/// which is freed before the texels are complete.
pub(super) fn checked_texel_memory_size(
    decoder: &dyn ImageDecoder,
    texel_bytes: u64,
    [length, held_bytes, in_memory]: [u64; 3],
    limits: ImageLimits,
    max_expansion: u64,
) -> Result<u64, String> {
    let (width, height) = decoder.dimensions();
    if width == 0 || height == 0 {
        return Err(empty_image_message(width, height));
    }
    if width.max(height) > limits.side {
        return Err(side_too_long_message(width, height, limits.side));
    }
    let texels = u64::from(width) * u64::from(height) * texel_bytes;
    let needed = decoder.total_bytes().saturating_add(texels.max(in_memory)).saturating_add(held_bytes);
    if needed > limits.memory_bytes {
        return Err(memory_limit_message(width, height, needed, limits.memory_bytes));
    }
    // A few run-length encoded bytes can expand to a large image.
    if needed > SMALL_BYTES.saturating_add(length.saturating_mul(max_expansion)) {
        return Err(implausible_size_message(width, height, needed, length));
    }
    Ok(texels)
}
