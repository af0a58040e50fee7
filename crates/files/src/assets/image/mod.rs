//! Decodes image files to texels with `image`. Enforces size limits and catches panics.

mod convert;
mod counting_reader;
mod decode_thread;
mod decoder;
mod encoding;
mod exr;
mod hdr;
mod icc;
mod jpeg;
pub(super) mod messages;
mod metadata;
mod open_image;
mod pfm;
mod png;
mod primaries;
mod space;
mod tga;

use std::path::Path;
use std::sync::Arc;

use ::image::ImageDecoder;

use super::read::Monitor;
use super::{AssetError, FileHash};
use crate::control::{CancelToken, Canceled, Progress, ignore_progress};
use crate::materials::Mipmaps;
use crate::materials::mipmaps::ImageHalver;
use crate::materials::texels::Texels;
use decoder::ImageDecoderWithMetadata;
pub use encoding::{ColorEncoding, ColorTransferFunction};
use metadata::ImageWarning;
use open_image::OpenImage;

/// A decoded image file.
#[derive(Clone, Debug, PartialEq)]
pub struct DecodedImage {
    /// The texels.
    pub texels: Texels,
    /// Warnings about ignored parts of the file. Each starts with the file name.
    pub warnings: Vec<String>,
}

/// Limits on the size of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageLimits {
    /// Maximum width and height.
    pub side: u32,
    /// Maximum memory for the decoder and the texels together.
    pub memory_bytes: u64,
}

impl Default for ImageLimits {
    /// 65536 pixels per side and 2 GiB.
    fn default() -> Self {
        Self { side: 65536, memory_bytes: 2 << 30 }
    }
}

/// Reads a PNG, JPEG, PNM, PFM, TGA, BMP, HDR, EXR or WebP image. The format is detected from the first
/// bytes. Only TGA, which has no signature, is detected from the file extension.
///
/// Gray becomes RGB, alpha is dropped except for scalars and cutouts, and the EXIF orientation is applied.
/// Negative and nonfinite texels become 0 (except for [`ColorEncoding::Raw`]). A truncated JPEG is an error.
/// 16-bit and float samples are converted to linear floats. Progress is measured in bytes of the file.
///
/// # Errors
/// [`AssetError::Unreadable`], [`AssetError::Malformed`] if the content contradicts the header or exceeds the
/// limits, or [`AssetError::Canceled`].
pub fn load(
    path: &Path,
    encoding: ColorEncoding,
    limits: ImageLimits,
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<DecodedImage, AssetError> {
    load_and_hash(path, encoding, limits, progress, token).map(|(image, _)| image)
}

/// Like [`load`], but also returns the hash of the decoded bytes.
///
/// # Errors
/// Same as [`load`].
pub fn load_and_hash(
    path: &Path,
    encoding: ColorEncoding,
    limits: ImageLimits,
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<(DecodedImage, FileHash), AssetError> {
    let (source, hash) = OpenImage::open_in_memory_and_hash(path, encoding, limits, token)?;
    Ok((decode_source(source, encoding, Monitor { progress, token })?, hash))
}

fn decode_source(
    file: OpenImage,
    encoding: ColorEncoding,
    monitor: Monitor<'_>,
) -> Result<DecodedImage, AssetError> {
    let (path, length) = (file.path.clone(), file.length as usize);
    monitor.report_and_check_cancel(0, length)?;
    let (texels, warnings) = file.run_on_decode_thread(monitor, move |file, report| {
        let (image, mut metadata) = file.decode(encoding, report)?;
        if let Some(words) = convert::opacity_from_alpha_warning(&image, encoding, &metadata) {
            metadata.add_warning(words);
        }
        Ok((convert::image_to_texels(image, encoding, &metadata), metadata.warnings))
    })?;
    monitor.report_and_check_cancel(length, length)?;
    let warning = |ImageWarning { line, words }| {
        let line = line.map_or(String::new(), |line| format!(":{line}"));
        format!("{}{line}: {words}", path.display())
    };
    Ok(DecodedImage { texels, warnings: warnings.into_iter().map(warning).collect() })
}

/// Reads an image header. Returns the width and height in pixels, and the size of the texels in bytes.
///
/// # Errors
/// Any error from [`load`] that can be detected at the start of the file.
pub fn read_dimensions_and_memory_size(
    path: &Path,
    encoding: ColorEncoding,
    limits: ImageLimits,
    token: &CancelToken,
) -> Result<(u32, u32, u64), AssetError> {
    source_dimensions_and_memory_size(
        OpenImage::open(path, limits, token)?,
        encoding,
        Monitor { progress: &ignore_progress, token },
    )
}

fn source_dimensions_and_memory_size(
    file: OpenImage,
    encoding: ColorEncoding,
    monitor: Monitor<'_>,
) -> Result<(u32, u32, u64), AssetError> {
    file.run_on_decode_thread(monitor, move |file, report| {
        let ImageDecoderWithMetadata { decoder, texel_bytes, .. } = file.open_decoder(encoding, report)?;
        let (width, height) = decoder.dimensions();
        Ok((width, height, texel_bytes))
    })
}

/// An image embedded in another file.
#[derive(Clone, Debug)]
pub struct EmbeddedImage<'a> {
    /// The containing file.
    pub path: &'a Path,
    /// Bytes of the image.
    pub bytes: Arc<[u8]>,
}

/// Like [`load`], but for an embedded image.
///
/// # Errors
/// Same as [`load`].
pub fn load_embedded(
    image: EmbeddedImage<'_>,
    encoding: ColorEncoding,
    limits: ImageLimits,
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<DecodedImage, AssetError> {
    decode_source(OpenImage::from_embedded(image, limits, token)?, encoding, Monitor { progress, token })
}

/// Like [`read_dimensions_and_memory_size`], but for an embedded image.
///
/// # Errors
/// Same as [`read_dimensions_and_memory_size`].
pub fn embedded_dimensions_and_memory_size(
    image: EmbeddedImage<'_>,
    encoding: ColorEncoding,
    limits: ImageLimits,
    token: &CancelToken,
) -> Result<(u32, u32, u64), AssetError> {
    source_dimensions_and_memory_size(
        OpenImage::from_embedded(image, limits, token)?,
        encoding,
        Monitor { progress: &ignore_progress, token },
    )
}

/// Computes mip levels for an image.
///
/// # Errors
/// [`Canceled`].
pub fn mipmaps(texels: &Texels, token: &CancelToken) -> Result<Mipmaps, Canceled> {
    Mipmaps::build(texels, |level| {
        let halving = ImageHalver::new(level);
        let mut rows = halving.allocate_halved_rows();
        for y in 0..halving.halved_height() {
            token.check_pause_and_cancel()?;
            halving.append_halved_row(y, &mut rows);
        }
        Ok(halving.assemble_image(rows))
    })
}

/// Computes mip levels for an image's coverage: the fraction of texels whose value is at least `cutoff`.
///
/// # Errors
/// [`Canceled`].
pub fn mipmaps_of_thresholded_texels(
    texels: &Texels,
    cutoff: f32,
    token: &CancelToken,
) -> Result<Mipmaps, Canceled> {
    mipmaps(&texels.threshold_red_channel(cutoff), token)
}

#[cfg(test)]
mod tests;
