//! Image files → texels, by `image`, within limits and with its panics contained.

mod apart;
mod convert;
mod counting;
mod decoder;
mod exr;
mod facts;
mod hdr;
mod icc;
mod jpeg;
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

use super::contain::contain;
use super::read::{self, Watch};
use super::{AssetError, FileHash, read::describe_error};
use crate::control::{CancelToken, Cancelled, Progress, ignore_progress};
use crate::materials::mipmaps::ImageHalver;
use crate::materials::texels::Texels;
use crate::materials::{Mipmaps, PixelValue};
use apart::Reporter;
use counting::Counting;
use decoder::{Opened, check_size, choose, most_growth, orientation, texel_bytes};
use facts::{Facts, Ignored};
use pfm::PfmDecoder;
use space::ColorSpace;

/// Most bytes of an image file.
const FILE_LIMIT: u64 = 4 << 30;
/// Bytes from which on the header of a file is checked before the rest is read.
const CHECKED_FIRST: u64 = 16 << 20;

/// Encoding of the numbers of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImageEncoding {
    /// As the file says; else whole numbers are sRGB, floats are linear.
    Color,
    /// Always sRGB.
    Srgb,
    /// Always linear: normal maps.
    Linear,
    /// Like [`Self::Color`], but floats stay as they are, negative or not finite: for pictures to compare.
    Raw,
    /// One number of each pixel, in all channels; alpha is always linear.
    Number {
        /// The number.
        of: PixelValue,
        /// Whether colours are sRGB.
        is_srgb: bool,
    },
    /// Colors of a surface whose opacity is the alpha of the same image: not multiplied by alpha, but weighted by it between texels.
    CutOut(ColorCurve),
}

/// Encoding of colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorCurve {
    /// [`ImageEncoding::Color`].
    Auto,
    /// [`ImageEncoding::Srgb`].
    Srgb,
    /// [`ImageEncoding::Linear`].
    Linear,
}

impl ColorCurve {
    /// The encoding of an image without alpha.
    pub fn encoding(self) -> ImageEncoding {
        match self {
            Self::Auto => ImageEncoding::Color,
            Self::Srgb => ImageEncoding::Srgb,
            Self::Linear => ImageEncoding::Linear,
        }
    }
}

impl ImageEncoding {
    /// Index that no other encoding has.
    pub fn index(self) -> usize {
        match self {
            Self::Color => 0,
            Self::Srgb => 1,
            Self::Linear => 2,
            Self::Raw => 3,
            Self::Number { of, is_srgb } => {
                let of = match of {
                    PixelValue::Luminance => 0,
                    PixelValue::Opacity => 1,
                    PixelValue::Channel(channel) => 2 + channel as usize,
                    PixelValue::Mask { of_any_color } => 6 + usize::from(of_any_color),
                };
                4 + 2 * of + usize::from(is_srgb)
            }
            Self::CutOut(curve) => 20 + curve as usize,
        }
    }

    /// The color space of a file's samples.
    fn space(self, facts: &Facts) -> ColorSpace {
        if self.is_declared() { facts.space.clone() } else { ColorSpace::default() }
    }

    /// Whether the file declares its color space, and not the scene.
    fn is_declared(self) -> bool {
        match self {
            Self::Color | Self::Raw | Self::CutOut(ColorCurve::Auto) => true,
            Self::Srgb | Self::Linear | Self::Number { .. } | Self::CutOut(_) => false,
        }
    }
}

/// Texels of an image file.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedImage {
    /// The texels.
    pub texels: Texels,
    /// Warnings about parts of the file that are ignored, with its name.
    pub warnings: Vec<String>,
}

/// Limits on the size of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageLimits {
    /// Most columns, and most rows.
    pub side: u32,
    /// Most bytes in memory, the decoder's and the texels' together.
    pub memory_bytes: u64,
}

impl Default for ImageLimits {
    /// Limits of a picture in columns and rows; 2 GiB.
    fn default() -> Self {
        Self { side: 65536, memory_bytes: 2 << 30 }
    }
}

/// Reads an image: PNG, JPEG, PNM, PFM, TGA, BMP, HDR, EXR or WebP, recognised by its first bytes, else by its ending.
///
/// Grey becomes RGB, alpha is left out but for numbers, a camera's orientation tag is followed. Texels that are negative or not finite become 0
/// (but for [`ImageEncoding::Raw`]). A JPEG that is cut short is an error. 16-bit and float files give linear floats. Progress is
/// in bytes of the file.
///
/// # Errors
/// [`AssetError::Unreadable`]; [`AssetError::Malformed`] if the content contradicts its header or exceeds the limits;
/// [`AssetError::Cancelled`].
pub fn load(
    path: &Path,
    encoding: ImageEncoding,
    limits: ImageLimits,
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<LoadedImage, AssetError> {
    load_hashed(path, encoding, limits, progress, token).map(|(image, _)| image)
}

/// [`load`], with the hash of the bytes that were decoded.
///
/// # Errors
/// As for [`load`].
pub fn load_hashed(
    path: &Path,
    encoding: ImageEncoding,
    limits: ImageLimits,
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<(LoadedImage, FileHash), AssetError> {
    let (source, hash) = Source::whole(path, encoding, limits, token)?;
    Ok((load_source(source, encoding, Watch { progress, token })?, hash))
}

fn load_source(file: Source, encoding: ImageEncoding, watch: Watch<'_>) -> Result<LoadedImage, AssetError> {
    let (path, length) = (file.path.clone(), file.length as usize);
    watch.tick(0, length)?;
    let (texels, ignored) = file.read_apart(watch, move |file, report| {
        let (image, mut facts) = file.decode(encoding, report)?;
        if let Some(words) = convert::constant_alpha(&image, encoding, &facts) {
            facts.warn(words);
        }
        Ok((convert::texels(image, encoding, &facts), facts.ignored))
    })?;
    watch.tick(length, length)?;
    let warning = |Ignored { line, words }| {
        let line = line.map_or(String::new(), |line| format!(":{line}"));
        format!("{}{line}: {words}", path.display())
    };
    Ok(LoadedImage { texels, warnings: ignored.into_iter().map(warning).collect() })
}

/// Columns and rows of an image, and the bytes that its texels will take, according to its header.
///
/// # Errors
/// As for [`load`], as far as the start of the file shows them.
pub fn size(
    path: &Path,
    encoding: ImageEncoding,
    limits: ImageLimits,
    token: &CancelToken,
) -> Result<(u32, u32, u64), AssetError> {
    size_of_source(Source::open(path, limits, token)?, encoding, Watch { progress: &ignore_progress, token })
}

fn size_of_source(
    file: Source,
    encoding: ImageEncoding,
    watch: Watch<'_>,
) -> Result<(u32, u32, u64), AssetError> {
    file.read_apart(watch, move |file, report| {
        let Opened { decoder, texel_bytes, .. } = file.opened(encoding, report)?;
        let (width, height) = decoder.dimensions();
        Ok((width, height, texel_bytes))
    })
}

/// An image inside another file.
#[derive(Clone, Debug)]
pub struct ImageWithin<'a> {
    /// The file.
    pub path: &'a Path,
    /// The bytes of the image.
    pub bytes: Arc<[u8]>,
}

/// [`load`] of an image inside another file.
///
/// # Errors
/// As for [`load`].
pub fn load_within(
    image: ImageWithin<'_>,
    encoding: ImageEncoding,
    limits: ImageLimits,
    progress: Progress<'_>,
    token: &CancelToken,
) -> Result<LoadedImage, AssetError> {
    load_source(Source::within(image, limits, token)?, encoding, Watch { progress, token })
}

/// [`size`] of an image inside another file.
///
/// # Errors
/// As for [`size`].
pub fn size_within(
    image: ImageWithin<'_>,
    encoding: ImageEncoding,
    limits: ImageLimits,
    token: &CancelToken,
) -> Result<(u32, u32, u64), AssetError> {
    size_of_source(
        Source::within(image, limits, token)?,
        encoding,
        Watch { progress: &ignore_progress, token },
    )
}

/// The mip levels of an image.
///
/// # Errors
/// [`Cancelled`].
pub fn mipmaps(texels: &Texels, token: &CancelToken) -> Result<Mipmaps, Cancelled> {
    Mipmaps::of(texels, |level| {
        let halving = ImageHalver::new(level);
        let mut rows = halving.start();
        for y in 0..halving.rows() {
            token.check()?;
            halving.row(y, &mut rows);
        }
        Ok(halving.texels(rows))
    })
}

/// The mip levels of the part of an image that is at least as large as a cutoff: numbers from 0 to 1.
///
/// # Errors
/// [`Cancelled`].
pub fn coverage(texels: &Texels, cutoff: f32, token: &CancelToken) -> Result<Mipmaps, Cancelled> {
    mipmaps(&texels.cut(cutoff), token)
}

/// The bytes of an image: an open file, a whole file in memory, or bytes of another one.
enum Bytes {
    File(File),
    Whole(Cursor<Vec<u8>>),
    Within(Cursor<Arc<[u8]>>),
}

impl Read for Bytes {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(buffer),
            Self::Whole(bytes) => bytes.read(buffer),
            Self::Within(bytes) => bytes.read(buffer),
        }
    }
}

impl Seek for Bytes {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::Whole(bytes) => bytes.seek(to),
            Self::Within(bytes) => bytes.seek(to),
        }
    }
}

/// An open image with the settings for reading it.
struct Source {
    path: PathBuf,
    file: Bytes,
    length: u64,
    limits: ImageLimits,
    token: CancelToken,
}

impl Source {
    fn open(path: &Path, limits: ImageLimits, token: &CancelToken) -> Result<Self, AssetError> {
        let (file, length) = read::open(path, FILE_LIMIT)?;
        if length == 0 {
            return Err(AssetError::malformed(path, None, "the file is empty"));
        }
        Ok(Self { path: path.to_owned(), file: Bytes::File(file), length, limits, token: token.clone() })
    }

    /// Reads a file into memory and hashes it: the hash is of the bytes that are decoded, even if the file is replaced or rewritten
    /// meanwhile.
    fn whole(
        path: &Path,
        encoding: ImageEncoding,
        limits: ImageLimits,
        token: &CancelToken,
    ) -> Result<(Self, FileHash), AssetError> {
        let (file, length) = read::open(path, FILE_LIMIT)?;
        if length > CHECKED_FIRST {
            // Do not fill the memory with a file that is not going to be decoded.
            size(path, encoding, limits, token)?;
        }
        let unreadable = |error: io::Error| AssetError::unreadable(path, describe_error(&error));
        let without_text = match length > CHECKED_FIRST {
            true => png::without_text(&file, token),
            false => Ok(None),
        };
        token.check()?;
        let (bytes, hash) = match without_text.map_err(unreadable)? {
            Some(found) => found,
            None => {
                let watch = Watch { progress: &ignore_progress, token };
                let bytes = read::rest(path, file, (length, FILE_LIMIT), watch)?;
                let hash = read::hash(&bytes);
                (bytes, hash)
            }
        };
        let length = bytes.len() as u64;
        if length == 0 {
            return Err(AssetError::malformed(path, None, "the file is empty"));
        }
        let file = Bytes::Whole(Cursor::new(bytes));
        Ok((Self { path: path.to_owned(), file, length, limits, token: token.clone() }, hash))
    }

    fn within(image: ImageWithin<'_>, limits: ImageLimits, token: &CancelToken) -> Result<Self, AssetError> {
        let (path, length) = (image.path.to_owned(), image.bytes.len() as u64);
        if length == 0 {
            return Err(AssetError::malformed(&path, None, "an image in it is empty"));
        }
        let file = Bytes::Within(Cursor::new(image.bytes));
        Ok(Self { path, file, length, limits, token: token.clone() })
    }

    /// Runs a foreign decoder on it.
    fn read_apart<T: Send + 'static>(
        self,
        watch: Watch<'_>,
        work: impl FnOnce(Self, Reporter) -> Result<T, String> + Send + 'static,
    ) -> Result<T, AssetError> {
        let (path, length) = (self.path.clone(), self.length);
        let done = apart::run(watch, length, move |report| contain(|| work(self, report)))?;
        watch.token.check()?;
        let done = done.unwrap_or_else(|| Err("no thread could be started for it".to_owned()));
        done.unwrap_or_else(|panic| Err(format!("the decoder gave up: {panic}")))
            .map_err(|reason| AssetError::malformed(&path, None, reason))
    }

    fn decode(self, encoding: ImageEncoding, report: Reporter) -> Result<(DynamicImage, Facts), String> {
        let Opened { mut decoder, facts, .. } = self.opened(encoding, report)?;
        let (width, height) = decoder.dimensions();
        let orientation = orientation(&mut *decoder).map_err(|error| reason(&error))?;
        let image = DynamicImage::from_decoder(decoder);
        let mut image =
            image.map_err(|error| format!("it claims {width} × {height} pixels: {}", reason(&error)))?;
        image.apply_orientation(orientation);
        Ok((image, facts))
    }

    /// A decoder of an image within the limits.
    fn opened(mut self, encoding: ImageEncoding, report: Reporter) -> Result<Opened, String> {
        let start = |bytes: &[u8]| ::image::guess_format(bytes).ok();
        let (mut in_memory, mut is_checked) = (0, true);
        match &mut self.file {
            Bytes::File(_) => is_checked = false,
            Bytes::Whole(bytes) => {
                in_memory = self.length;
                if start(bytes.get_ref()) == Some(ImageFormat::Jpeg) {
                    jpeg::check_bytes(bytes.get_ref())?;
                    jpeg::correct_transform(bytes.get_mut());
                }
            }
            Bytes::Within(bytes) if start(bytes.get_ref()) == Some(ImageFormat::Jpeg) => {
                jpeg::check_bytes(bytes.get_ref())?;
                if jpeg::misleading_transform(bytes.get_ref()).is_some() {
                    let mut copy = bytes.get_ref().to_vec();
                    jpeg::correct_transform(&mut copy);
                    self.file = Bytes::Whole(Cursor::new(copy));
                }
            }
            Bytes::Within(_) => {}
        }
        let mut bytes = BufReader::new(Counting::new(self.file, self.length, report));
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
            // Only TGA has no first bytes to recognize it by.
            let format = ImageFormat::from_path(&self.path).ok().filter(|format| *format == ImageFormat::Tga);
            reader.set_format(format.ok_or_else(unknown_format)?);
        }
        let is_jpeg = reader.format() == Some(ImageFormat::Jpeg);
        if is_jpeg && !is_checked {
            jpeg::check_whole(&self.path, self.limits.memory_bytes, &self.token)?;
        }
        let growth = most_growth(reader.format());
        let chosen = match is_pfm {
            true => {
                PfmDecoder::new(reader.into_inner()).map(|decoder| (Box::new(decoder) as _, Facts::default()))
            }
            false => choose(reader, encoding, self.limits.memory_bytes),
        };
        let (decoder, facts) = chosen.map_err(|error| reason(&error))?;
        let held_bytes = if is_jpeg { self.length } else { 0 };
        let texel = texel_bytes(decoder.color_type(), encoding, &facts);
        let texel_bytes =
            check_size(&*decoder, texel, [self.length, held_bytes, in_memory], self.limits, growth)?;
        if is_jpeg {
            let (width, height) = decoder.dimensions();
            jpeg::check_plausible(width, height, self.length)?;
        }
        Ok(Opened { decoder, facts, texel_bytes })
    }
}

fn unknown_format() -> String {
    "its content is no image that can be read: png, jpg, ppm, pfm, tga, bmp, hdr, exr or webp".to_owned()
}

/// A decoder's error in few words, as its own text may quote much of the file.
fn reason(error: &ImageError) -> String {
    const MOST: usize = 200;
    let words = match error {
        ImageError::Unsupported(_) => format!("{}: {error}", unknown_format()),
        ImageError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            "the file ends before the image does".to_owned()
        }
        ImageError::IoError(error) => describe_error(error),
        ImageError::Limits(error) if error.kind() == LimitErrorKind::InsufficientMemory => {
            "it takes more memory than an image may take".to_owned()
        }
        _ => without_types(&error.to_string()),
    };
    if words.chars().count() <= MOST { words } else { words.chars().take(MOST).chain(['…']).collect() }
}

/// A decoder's words with the name of a chunk in place of all that the decoder knows of it.
fn without_types(words: &str) -> String {
    const OPENING: &str = "ChunkType { type: ";
    let Some((before, rest)) = words.split_once(OPENING) else { return words.to_owned() };
    let Some((chunk, after)) = rest.split_once(" }") else { return words.to_owned() };
    let name = chunk.split(',').next().unwrap_or_default();
    format!("{before}{name}{after}")
}

#[cfg(test)]
mod tests;
