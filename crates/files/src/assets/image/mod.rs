//! Decodes image files to texels with `image`. Enforces size limits and catches panics.

mod convert;
mod counting_reader;
mod decode_thread;
mod decoder;
mod exr;
mod hdr;
mod icc;
mod jpeg;
mod metadata;
mod pfm;
mod png;
mod primaries;
mod space;
mod tga;

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::image::error::LimitErrorKind;
use ::image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader};

use super::catch_panic::catch_panic;
use super::read::{self, Monitor};
use super::{AssetError, FileHash};
use crate::control::{CancelToken, Canceled, Progress, ignore_progress};
use crate::materials::mipmaps::ImageHalver;
use crate::materials::texels::Texels;
use crate::materials::{ChannelSelector, Mipmaps};
use crate::system::describe_error;
use counting_reader::ProgressReader;
use decode_thread::ProgressReporter;
use decoder::{
    ImageDecoderWithMetadata, checked_texel_memory_size, create_decoder, max_memory_to_file_ratio,
    read_orientation, stored_bytes_per_texel,
};
use metadata::{ImageColorMetadata, ImageWarning};
use pfm::PfmDecoder;
use space::ColorSpace;

/// Maximum size of an image file.
const FILE_LIMIT: u64 = 4 << 30;
/// File size above which the header is checked before the rest of the file is read.
const CHECKED_FIRST: u64 = 16 << 20;

/// Interpretation of the samples in an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorEncoding {
    /// As declared by the file. By default, integers are sRGB and floats are linear.
    Color,
    /// Always sRGB.
    Srgb,
    /// Always linear, as in normal maps.
    Linear,
    /// Like [`Self::Color`], but keeps negative and nonfinite floats. Used to compare images.
    Raw,
    /// One scalar per pixel, stored in all channels. Alpha is always linear.
    Number {
        /// Source of the scalar.
        of: ChannelSelector,
        /// Whether the color channels are sRGB.
        is_srgb: bool,
    },
    /// Straight surface colors, with the surface's opacity in the alpha channel. Filtering weights the colors
    /// by alpha.
    CutOut(ColorTransferFunction),
}

/// Transfer function for colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorTransferFunction {
    /// As in [`ColorEncoding::Color`].
    Auto,
    /// As in [`ColorEncoding::Srgb`].
    Srgb,
    /// As in [`ColorEncoding::Linear`].
    Linear,
}

impl ColorTransferFunction {
    /// Interpretation of an image that has this transfer function and no alpha.
    pub fn encoding_without_alpha(self) -> ColorEncoding {
        match self {
            Self::Auto => ColorEncoding::Color,
            Self::Srgb => ColorEncoding::Srgb,
            Self::Linear => ColorEncoding::Linear,
        }
    }
}

impl ColorEncoding {
    /// Unique index of this interpretation.
    pub fn index(self) -> usize {
        match self {
            Self::Color => 0,
            Self::Srgb => 1,
            Self::Linear => 2,
            Self::Raw => 3,
            Self::Number { of: value, is_srgb } => {
                let index = match value {
                    ChannelSelector::Luminance => 0,
                    ChannelSelector::Opacity => 1,
                    ChannelSelector::Channel(channel) => 2 + channel as usize,
                    ChannelSelector::Mask { of_any_color } => 6 + usize::from(of_any_color),
                };
                4 + 2 * index + usize::from(is_srgb)
            }
            Self::CutOut(curve) => 20 + curve as usize,
        }
    }

    /// Color space of a file's samples.
    fn color_space(self, metadata: &ImageColorMetadata) -> ColorSpace {
        if self.uses_file_color_space() { metadata.space.clone() } else { ColorSpace::default() }
    }

    /// Whether the file rather than the scene determines the color space.
    fn uses_file_color_space(self) -> bool {
        match self {
            Self::Color | Self::Raw | Self::CutOut(ColorTransferFunction::Auto) => true,
            Self::Srgb | Self::Linear | Self::Number { .. } | Self::CutOut(_) => false,
        }
    }
}

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
        if let Some(words) = convert::constant_alpha_warning(&image, encoding, &metadata) {
            metadata.add_warning(words);
        }
        Ok((convert::texels(image, encoding, &metadata), metadata.warnings))
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

/// Bytes of an image: an open file, a file in memory, or an embedded image.
enum ImageStream {
    File(File),
    InMemory(Cursor<Vec<u8>>),
    Embedded(Cursor<Arc<[u8]>>),
}

impl Read for ImageStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(buffer),
            Self::InMemory(bytes) => bytes.read(buffer),
            Self::Embedded(bytes) => bytes.read(buffer),
        }
    }
}

impl Seek for ImageStream {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::InMemory(bytes) => bytes.seek(to),
            Self::Embedded(bytes) => bytes.seek(to),
        }
    }
}

/// An open image and its load settings.
struct OpenImage {
    path: PathBuf,
    file: ImageStream,
    length: u64,
    limits: ImageLimits,
    token: CancelToken,
}

impl OpenImage {
    fn open(path: &Path, limits: ImageLimits, token: &CancelToken) -> Result<Self, AssetError> {
        let (file, length) = read::open_regular_with_limit(path, FILE_LIMIT)?;
        if length == 0 {
            return Err(AssetError::malformed(path, None, EMPTY_FILE));
        }
        Ok(Self {
            path: path.to_owned(),
            file: ImageStream::File(file),
            length,
            limits,
            token: token.clone(),
        })
    }

    /// Reads a file into memory and hashes it. The hash matches the decoded bytes even if the file is
    /// replaced in the meantime.
    fn open_in_memory_and_hash(
        path: &Path,
        encoding: ColorEncoding,
        limits: ImageLimits,
        token: &CancelToken,
    ) -> Result<(Self, FileHash), AssetError> {
        let (file, length) = read::open_regular_with_limit(path, FILE_LIMIT)?;
        if length > CHECKED_FIRST {
            // Avoid reading a large file that will be rejected.
            read_dimensions_and_memory_size(path, encoding, limits, token)?;
        }
        let unreadable = |error: io::Error| AssetError::from_io(path, &error);
        let without_text = match length > CHECKED_FIRST {
            true => png::read_without_text_chunks(&file, token),
            false => Ok(None),
        };
        token.check_pause_and_cancel()?;
        let (bytes, hash) = match without_text.map_err(unreadable)? {
            Some(found) => found,
            None => {
                let monitor = Monitor { progress: &ignore_progress, token };
                let bytes = read::read_rest(path, file, length, FILE_LIMIT, monitor)?;
                let hash = read::hash_bytes(&bytes);
                (bytes, hash)
            }
        };
        let length = bytes.len() as u64;
        if length == 0 {
            return Err(AssetError::malformed(path, None, EMPTY_FILE));
        }
        let file = ImageStream::InMemory(Cursor::new(bytes));
        Ok((Self { path: path.to_owned(), file, length, limits, token: token.clone() }, hash))
    }

    fn from_embedded(
        image: EmbeddedImage<'_>,
        limits: ImageLimits,
        token: &CancelToken,
    ) -> Result<Self, AssetError> {
        let (path, length) = (image.path.to_owned(), image.bytes.len() as u64);
        if length == 0 {
            return Err(AssetError::malformed(&path, None, EMPTY_EMBEDDED));
        }
        let file = ImageStream::Embedded(Cursor::new(image.bytes));
        Ok(Self { path, file, length, limits, token: token.clone() })
    }

    /// Runs a decoder on a separate thread, catching panics.
    fn run_on_decode_thread<T: Send + 'static>(
        self,
        monitor: Monitor<'_>,
        work: impl FnOnce(Self, ProgressReporter) -> Result<T, String> + Send + 'static,
    ) -> Result<T, AssetError> {
        let (path, length) = (self.path.clone(), self.length);
        let done =
            decode_thread::run_on_thread(monitor, length, move |report| catch_panic(|| work(self, report)))?;
        monitor.token.check_pause_and_cancel()?;
        let done = done.unwrap_or_else(|| Err("cannot start a decoder thread".to_owned()));
        done.unwrap_or_else(|panic| Err(format!("the decoder failed: {panic}")))
            .map_err(|reason| AssetError::malformed(&path, None, reason))
    }

    fn decode(
        self,
        encoding: ColorEncoding,
        report: ProgressReporter,
    ) -> Result<(DynamicImage, ImageColorMetadata), String> {
        let ImageDecoderWithMetadata { mut decoder, metadata, .. } = self.open_decoder(encoding, report)?;
        let (width, height) = decoder.dimensions();
        let orientation = read_orientation(&mut *decoder).map_err(|error| shorten_decoder_error(&error))?;
        let image = DynamicImage::from_decoder(decoder);
        let mut image = image
            .map_err(|error| undecodable_image_message(width, height, &shorten_decoder_error(&error)))?;
        image.apply_orientation(orientation);
        Ok((image, metadata))
    }

    /// Creates a decoder after checking the limits.
    fn open_decoder(
        mut self,
        encoding: ColorEncoding,
        report: ProgressReporter,
    ) -> Result<ImageDecoderWithMetadata, String> {
        let start = |bytes: &[u8]| ::image::guess_format(bytes).ok();
        let (mut in_memory, mut is_checked) = (0, true);
        match &mut self.file {
            ImageStream::File(_) => is_checked = false,
            ImageStream::InMemory(bytes) => {
                in_memory = self.length;
                if start(bytes.get_ref()) == Some(ImageFormat::Jpeg) {
                    jpeg::check_complete_bytes(bytes.get_ref())?;
                    jpeg::fix_adobe_color_transform(bytes.get_mut());
                }
            }
            ImageStream::Embedded(bytes) if start(bytes.get_ref()) == Some(ImageFormat::Jpeg) => {
                jpeg::check_complete_bytes(bytes.get_ref())?;
                if jpeg::find_wrong_adobe_transform(bytes.get_ref()).is_some() {
                    let mut copy = bytes.get_ref().to_vec();
                    jpeg::fix_adobe_color_transform(&mut copy);
                    self.file = ImageStream::InMemory(Cursor::new(copy));
                }
            }
            ImageStream::Embedded(_) => {}
        }
        let mut bytes = BufReader::new(ProgressReader::new(self.file, self.length, report));
        let first = bytes.fill_buf().map_err(|error| describe_error(&error))?;
        let (is_hdr, is_pfm) = (first.starts_with(hdr::MAGIC), pfm::is_pfm(first));
        let mut reader =
            ImageReader::new(bytes).with_guessed_format().map_err(|error| describe_error(&error))?;
        if is_hdr {
            reader.set_format(ImageFormat::Hdr);
        }
        if is_pfm {
            reader.set_format(ImageFormat::Pnm);
        }
        if reader.format().is_none() {
            // TGA is the only format without a signature.
            let format = ImageFormat::from_path(&self.path).ok().filter(|format| *format == ImageFormat::Tga);
            reader.set_format(format.ok_or_else(unknown_format_message)?);
        }
        let is_jpeg = reader.format() == Some(ImageFormat::Jpeg);
        if is_jpeg && !is_checked {
            jpeg::check_complete(&self.path, self.limits.memory_bytes, &self.token)?;
        }
        let expansion = max_memory_to_file_ratio(reader.format());
        let chosen = if is_pfm {
            PfmDecoder::new(reader.into_inner())
                .map(|decoder| (Box::new(decoder) as _, ImageColorMetadata::default()))
        } else {
            create_decoder(reader, encoding, self.limits.memory_bytes)
        };
        let (decoder, metadata) = chosen.map_err(|error| shorten_decoder_error(&error))?;
        let held_bytes = if is_jpeg { self.length } else { 0 };
        let texel = stored_bytes_per_texel(decoder.color_type(), encoding, &metadata);
        let texel_bytes = checked_texel_memory_size(
            &*decoder,
            texel,
            [self.length, held_bytes, in_memory],
            self.limits,
            expansion,
        )?;
        if is_jpeg {
            let (width, height) = decoder.dimensions();
            jpeg::check_plausible_size(width, height, self.length)?;
        }
        Ok(ImageDecoderWithMetadata { decoder, metadata, texel_bytes })
    }
}

/// Error message for an empty file.
const EMPTY_FILE: &str = "the file is empty";
/// Error message for an empty embedded image.
const EMPTY_EMBEDDED: &str = "an embedded image is empty";

fn empty_image_message(width: u32, height: u32) -> String {
    format!("it has {width} × {height} pixels")
}

fn side_too_long_message(width: u32, height: u32, limit: u32) -> String {
    format!("it has {width} × {height} pixels; the limit is {limit} per side")
}

fn memory_limit_message(width: u32, height: u32, needed: u64, limit: u64) -> String {
    let (needed, limit) = (needed.div_ceil(1 << 20), limit >> 20);
    format!("it has {width} × {height} pixels, which need {needed} MiB of memory; the limit is {limit} MiB")
}

fn implausible_size_message(width: u32, height: u32, needed: u64, length: u64) -> String {
    let needed = needed.div_ceil(1 << 20);
    format!(
        "the header claims {width} × {height} pixels ({needed} MiB), too many for a file of {length} bytes"
    )
}

/// Error message for an image that cannot be decoded.
fn undecodable_image_message(width: u32, height: u32, reason: &str) -> String {
    format!("the header claims {width} × {height} pixels: {reason}")
}

pub(crate) fn unknown_format_message() -> String {
    "unsupported image format; expected png, jpg, ppm, pfm, tga, bmp, hdr, exr or webp".to_owned()
}

/// Shortens a decoder's error message, which may quote large parts of the file.
fn shorten_decoder_error(error: &ImageError) -> String {
    const MAX_LENGTH: usize = 200;
    let words = match error {
        ImageError::Unsupported(_) => format!("{}: {error}", unknown_format_message()),
        ImageError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            jpeg::TRUNCATED.to_owned()
        }
        ImageError::IoError(error) => describe_error(error),
        ImageError::Limits(error) if error.kind() == LimitErrorKind::InsufficientMemory => {
            "it needs more memory than the limit for images".to_owned()
        }
        _ => replace_chunk_debug_with_name(&error.to_string()),
    };
    if words.chars().count() <= MAX_LENGTH {
        words
    } else {
        words.chars().take(MAX_LENGTH).chain(['…']).collect()
    }
}

/// Replaces PNG chunk types in a decoder message with the chunk names. The decoder prints them in debug
/// format.
fn replace_chunk_debug_with_name(words: &str) -> String {
    const OPENING: &str = "ChunkType { type: ";
    let Some((before, rest)) = words.split_once(OPENING) else { return words.to_owned() };
    let Some((chunk, after)) = rest.split_once(" }") else { return words.to_owned() };
    let name = chunk.split(',').next().unwrap_or_default();
    format!("{before}{name}{after}")
}

#[cfg(test)]
mod tests;
