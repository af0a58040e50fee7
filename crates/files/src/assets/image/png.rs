//! PNG decoder based on `png`. Unlike `image`, it does not decompress ancillary chunks.

use std::io::{self, BufRead, Read, Seek, SeekFrom};

use ::image::error::{DecodingError, ImageFormatHint, LimitError, LimitErrorKind};
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};

use super::metadata::ImageColorMetadata;
use super::primaries::Primaries;
use super::space::{ColorSpace, TransferFunction};
use crate::assets::FileHash;
use crate::control::CancelToken;
use crate::math::DMat3;

const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Maximum size of a color profile, both compressed and decompressed.
const PROFILE_BYTES: u32 = 16 << 20;

/// Number of bytes to skip between polls of the cancel token.
const SKIPPED_BYTES: usize = 1 << 16;

/// Reads a PNG into memory without its text chunks. The hash covers the entire file. If the file is not a
/// PNG, rewinds it and returns `None`.
pub(super) fn read_without_text_chunks(
    mut file: impl Read + Seek,
    token: &CancelToken,
) -> io::Result<Option<(Vec<u8>, FileHash)>> {
    let mut kept = Vec::new();
    (&mut file).take(SIGNATURE.len() as u64).read_to_end(&mut kept)?;
    if kept != SIGNATURE {
        file.rewind()?;
        return Ok(None);
    }
    let mut hasher = blake3::Hasher::new();
    hasher.update(&kept);
    loop {
        // Read the length and type of the next chunk.
        let start = kept.len();
        (&mut file).take(8).read_to_end(&mut kept)?;
        hasher.update(&kept[start..]);
        let Some([a, b, c, d, kind @ ..]) = kept[start..].first_chunk::<8>() else {
            return Ok(Some((kept, *hasher.finalize().as_bytes())));
        };
        // Include the checksum after the data.
        let length = u64::from(u32::from_be_bytes([*a, *b, *c, *d])) + 4;
        if !matches!(kind, b"tEXt" | b"zTXt" | b"iTXt") {
            let start = kept.len();
            (&mut file).take(length).read_to_end(&mut kept)?;
            hasher.update(&kept[start..]);
            continue;
        }
        kept.truncate(start);
        let (mut skipped, mut left) = (vec![0; SKIPPED_BYTES], length);
        while left > 0 {
            token.check_pause_and_cancel().map_err(|canceled| io::Error::other(canceled.to_string()))?;
            let most = skipped.len().min(left as usize);
            let got = file.read(&mut skipped[..most])?;
            if got == 0 {
                break;
            }
            hasher.update(&skipped[..got]);
            left -= got as u64;
        }
    }
}

/// PNG decoder for the first frame. Ignores text chunks.
pub(super) struct PngDecoder<R: BufRead + Seek> {
    reader: png::Reader<R>,
    color_type: ColorType,
    profile: Option<DecompressedProfile>,
}

/// A color profile, or `None` if it cannot be decompressed.
type DecompressedProfile = Option<Vec<u8>>;

impl<R: BufRead + Seek> PngDecoder<R> {
    /// Creates a decoder that allocates at most `memory_bytes` in addition to the pixels.
    pub(super) fn new(mut file: R, memory_bytes: u64) -> ImageResult<Self> {
        let profile = read_icc_profile(&mut file).map_err(ImageError::IoError)?;
        let limits = png::Limits { bytes: usize::try_from(memory_bytes).unwrap_or(usize::MAX) };
        let mut decoder = png::Decoder::new_with_limits(file, limits);
        decoder.set_ignore_text_chunk(true);
        decoder.set_ignore_iccp_chunk(true);
        // Expand palettes to colors and small integers to bytes. Keep 16-bit samples.
        decoder.set_transformations(png::Transformations::EXPAND);
        let reader = decoder.read_info().map_err(to_image_error)?;
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
        Ok(Self { reader, color_type, profile })
    }

    /// Color space and warnings. Color chunks take precedence in the order `cICP`, `sRGB`, `iCCP`, then
    /// `gAMA` with `cHRM`.
    pub(super) fn color_space_and_warnings(&self) -> ImageColorMetadata {
        let (info, mut metadata) = (self.reader.info(), ImageColorMetadata::default());
        metadata.warn_about_extra_frames(info.animation_control().map_or(0, |control| control.num_frames));
        let is_gray = !self.color_type.has_color();
        if let Some(points) = info.coding_independent_code_points {
            match color_space_from_cicp(points) {
                Some(space) => metadata.space = space,
                None => metadata.add_warning(unsupported_cicp_warning(points)),
            }
        } else if info.srgb.is_some() {
        } else if let Some(profile) = &self.profile {
            metadata.apply_icc_profile(profile.as_deref(), is_gray);
        } else {
            metadata.space = self.color_space_from_gama_and_chrm(&mut metadata, is_gray);
        }
        metadata
    }

    /// Color space defined by the `gAMA` and `cHRM` chunks.
    fn color_space_from_gama_and_chrm(&self, metadata: &mut ImageColorMetadata, is_gray: bool) -> ColorSpace {
        let info = self.reader.info();
        let curve = info.gama_chunk.map_or(TransferFunction::Srgb, |gamma| gamma_curve(gamma.into_scaled()));
        let number = |number: png::ScaledFloat| f64::from(number.into_scaled()) / 100_000.0;
        let matrix = info.chrm_chunk.filter(|_| !is_gray).map_or(Some(DMat3::IDENTITY), |chunk| {
            let [red, green, blue, white] =
                [chunk.red, chunk.green, chunk.blue, chunk.white].map(|(x, y)| [number(x), number(y)]);
            Primaries { red, green, blue, white }.to_rec_709_matrix()
        });
        if matrix.is_none() {
            metadata.add_warning("a degenerate cHRM chunk is ignored");
        }
        ColorSpace::from_curves_and_matrix_to_rec_709(
            Some([curve.clone(), curve.clone(), curve]),
            matrix.unwrap_or(DMat3::IDENTITY),
        )
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
        self.reader.next_frame(samples).map_err(to_image_error)?;
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

/// Returns the transfer function for a `gAMA` value in units of 1/100000. A gamma of 1/2.2 usually means sRGB
/// (PNG, 11.3.2.5).
fn gamma_curve(gamma: u32) -> TransferFunction {
    const SRGB: u32 = 45_455;
    const TOLERANCE: u32 = 500;
    match gamma {
        0 => TransferFunction::Srgb,
        _ if gamma.abs_diff(SRGB) <= TOLERANCE => TransferFunction::Srgb,
        _ => TransferFunction::Power(100_000.0 / f64::from(gamma)),
    }
}

/// Returns the color space for video signal code points (ITU-T H.273, tables 2 and 3), or `None` for
/// undefined codes, logarithmic curves, and anything other than full-range RGB.
fn color_space_from_cicp(points: png::CodingIndependentCodePoints) -> Option<ColorSpace> {
    let primaries = match points.color_primaries {
        1 => Primaries::REC_709,
        4 => Primaries::from_numbers([0.67, 0.33, 0.21, 0.71, 0.14, 0.08, 0.310, 0.316]),
        5 => Primaries::from_numbers([0.64, 0.33, 0.29, 0.60, 0.15, 0.06, 0.3127, 0.3290]),
        6 | 7 => Primaries::from_numbers([0.630, 0.340, 0.310, 0.595, 0.155, 0.070, 0.3127, 0.3290]),
        8 => Primaries::from_numbers([0.681, 0.319, 0.243, 0.692, 0.145, 0.049, 0.310, 0.316]),
        9 => Primaries::REC_2020,
        10 => Primaries::XYZ,
        11 => Primaries { white: [0.314, 0.351], ..Primaries::DISPLAY_P3 },
        12 => Primaries::DISPLAY_P3,
        22 => Primaries::from_numbers([0.630, 0.340, 0.295, 0.605, 0.155, 0.077, 0.3127, 0.3290]),
        _ => return None,
    };
    let curve = match points.transfer_function {
        1 | 6 | 11 | 12 | 14 | 15 => TransferFunction::REC_709,
        4 => TransferFunction::Power(2.2),
        5 => TransferFunction::Power(2.8),
        7 => TransferFunction::SMPTE_240M,
        8 => TransferFunction::LINEAR,
        13 => TransferFunction::Srgb,
        16 => TransferFunction::Pq,
        18 => TransferFunction::Hlg,
        _ => return None,
    };
    let is_plain = points.matrix_coefficients == 0 && points.is_video_full_range_image;
    let curves = [curve.clone(), curve.clone(), curve];
    is_plain.then(|| {
        Some(ColorSpace::from_curves_and_matrix_to_rec_709(Some(curves), primaries.to_rec_709_matrix()?))
    })?
}

/// Warning about unsupported code points.
fn unsupported_cicp_warning(points: png::CodingIndependentCodePoints) -> String {
    let png::CodingIndependentCodePoints {
        color_primaries,
        transfer_function,
        matrix_coefficients,
        is_video_full_range_image,
    } = points;
    format!(
        "unsupported cICP chunk (primaries {color_primaries}, transfer function {transfer_function}, matrix \
         {matrix_coefficients}, full range {is_video_full_range_image}); colors are read as sRGB"
    )
}

/// Reads a file's color profile, then rewinds the file.
fn read_icc_profile(file: &mut (impl Read + Seek)) -> io::Result<Option<DecompressedProfile>> {
    let profile = find_and_decompress_profile(file);
    file.seek(SeekFrom::Start(0))?;
    match profile {
        // The decoder reports truncated files.
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(None),
        profile => profile,
    }
}

fn find_and_decompress_profile(file: &mut (impl Read + Seek)) -> io::Result<Option<DecompressedProfile>> {
    const SIGNATURE: u64 = 8;
    const CHECKSUM: i64 = 4;
    file.seek(SeekFrom::Start(SIGNATURE))?;
    loop {
        let mut header = [[0; 4]; 2];
        file.read_exact(header.as_flattened_mut())?;
        let [length, kind] = header;
        let length = u32::from_be_bytes(length);
        match &kind {
            b"IDAT" | b"IEND" => return Ok(None),
            b"iCCP" if length > PROFILE_BYTES => return Ok(Some(None)),
            b"iCCP" => {
                let mut chunk = vec![0; length as usize];
                file.read_exact(&mut chunk)?;
                return Ok(Some(decompress_profile(&chunk)));
            }
            _ => file.seek(SeekFrom::Current(i64::from(length) + CHECKSUM))?,
        };
    }
}

/// Decompresses a chunk's profile. The data follows the profile name and the compression method, which is 0.
fn decompress_profile(chunk: &[u8]) -> Option<Vec<u8>> {
    let name = memchr::memchr(0, chunk)?;
    let packed = chunk[name + 1..].strip_prefix(&[0])?;
    fdeflate::decompress_to_vec_bounded(packed, PROFILE_BYTES as usize).ok()
}

fn to_image_error(error: png::DecodingError) -> ImageError {
    match error {
        png::DecodingError::IoError(error) => ImageError::IoError(error),
        png::DecodingError::LimitsExceeded => {
            ImageError::Limits(LimitError::from_kind(LimitErrorKind::InsufficientMemory))
        }
        error => ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::Png), error)),
    }
}
