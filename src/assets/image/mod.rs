//! Image files → texels, by `image`, within limits and with its panics contained.

mod convert;
mod counting;
mod jpeg;

use std::io::BufReader;
use std::path::Path;

use ::image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::contain::contain;
use super::read::{self, Watch};
use super::{AssetError, read::in_words};
use crate::control::{CancelToken, Progress};
use crate::materials::texels::Texels;
use counting::Counting;

/// Most bytes of an image file.
const FILE_LIMIT: u64 = 4 << 30;

/// How the numbers of an image file are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImageEncoding {
    /// Whole numbers are sRGB, floats linear.
    Color,
    /// Always sRGB.
    Srgb,
    /// Always linear: normal maps.
    Linear,
}

/// What an image may cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageLimits {
    /// Most columns, and most rows.
    pub side: u32,
    /// Most bytes in memory, the decoder's and the texels' together.
    pub memory_bytes: u64,
}

impl Default for ImageLimits {
    /// 16384 a side, 2 GiB.
    fn default() -> Self {
        Self { side: 16384, memory_bytes: 2 << 30 }
    }
}

/// Read an image: PNG, JPEG, PNM, TGA, BMP, HDR, EXR, WebP, told by its first bytes, else by its ending.
///
/// Grey becomes RGB, alpha is left out, a camera's note on orientation is followed; texels that are negative or
/// not finite become 0. A JPEG that is cut short is an error. 16-bit and float files give linear floats. Progress is in bytes of the file.
///
/// # Errors
/// [`AssetError::Unreadable`], [`AssetError::Malformed`] where the content is not what it says or beyond the
/// limits, [`AssetError::Cancelled`].
pub fn load(
    path: &Path,
    encoding: ImageEncoding,
    limits: ImageLimits,
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<Texels, AssetError> {
    let watch = Watch { progress, token };
    let (file, length) = read::open(path, FILE_LIMIT)?;
    let wrong = |reason: String| AssetError::malformed(path, None, reason);
    if length == 0 {
        return Err(wrong("the file is empty".to_owned()));
    }
    watch.tick(0, length as usize)?;
    let reader = BufReader::new(Counting::new(file, length, watch));
    let texels = contain(|| Ok(convert::texels(decode(path, reader, length, limits)?, encoding)));
    token.check()?;
    let texels =
        texels.unwrap_or_else(|panic| Err(format!("the decoder gave up: {panic}"))).map_err(wrong)?;
    watch.tick(length as usize, length as usize)?;
    Ok(texels)
}

fn decode(
    path: &Path,
    reader: BufReader<Counting<'_, std::fs::File>>,
    length: u64,
    limits: ImageLimits,
) -> Result<DynamicImage, String> {
    let mut reader = ImageReader::new(reader).with_guessed_format().map_err(|error| in_words(&error))?;
    if reader.format().is_none() {
        let format = ImageFormat::from_path(path).map_err(|_| unknown_format())?;
        reader.set_format(format);
    }
    let is_jpeg = reader.format() == Some(ImageFormat::Jpeg);
    if is_jpeg {
        jpeg::check_whole(path, FILE_LIMIT)?;
    }
    let mut decoder_limits = Limits::default();
    decoder_limits.max_image_width = Some(limits.side);
    decoder_limits.max_image_height = Some(limits.side);
    decoder_limits.max_alloc = Some(limits.memory_bytes);
    reader.limits(decoder_limits);
    let mut decoder = reader.into_decoder().map_err(|error| reason(&error))?;
    let (width, height) = decoder.dimensions();
    check_size(&decoder, limits)?;
    if is_jpeg {
        jpeg::check_plausible(width, height, length)?;
    }
    let orientation = decoder.orientation().map_err(|error| reason(&error))?;
    let image = DynamicImage::from_decoder(decoder);
    let mut image =
        image.map_err(|error| format!("it claims {width} × {height} pixels: {}", reason(&error)))?;
    image.apply_orientation(orientation);
    Ok(image)
}

/// Refuse before anything of that size is allocated.
fn check_size(decoder: &impl ImageDecoder, limits: ImageLimits) -> Result<(), String> {
    let (width, height) = decoder.dimensions();
    let size = format!("it has {width} × {height} pixels");
    if width == 0 || height == 0 {
        return Err(size);
    }
    if width.max(height) > limits.side {
        return Err(format!("{size}, more than {} a side", limits.side));
    }
    let color = decoder.color_type();
    let sample_bytes = u64::from(color.bytes_per_pixel() / color.channel_count());
    let texel_bytes = if sample_bytes == 1 { 3 } else { 12 };
    let texels = u64::from(width) * u64::from(height) * texel_bytes;
    let needed = decoder.total_bytes().saturating_add(texels);
    if needed > limits.memory_bytes {
        return Err(format!("{size}, which take {needed} bytes, more than {}", limits.memory_bytes));
    }
    Ok(())
}

fn unknown_format() -> String {
    "no image that can be read: png, jpg, ppm, tga, bmp, hdr, exr or webp".to_owned()
}

fn reason(error: &ImageError) -> String {
    match error {
        ImageError::Unsupported(_) => format!("{}: {error}", unknown_format()),
        ImageError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            "the file ends before the image does".to_owned()
        }
        ImageError::IoError(error) => in_words(error),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests;
