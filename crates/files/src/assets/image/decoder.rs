//! The decoder of each format, and the limits that an image must keep before memory of its size is allocated.

use std::io::{BufRead, Seek, SeekFrom};

use ::image::metadata::Orientation;
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::exr::ExrDecoder;
use super::facts::{Alpha, Facts};
use super::hdr::HdrDecoder;
use super::png::PngDecoder;
use super::{ImageEncoding, ImageLimits, tga};

/// A decoder of an image, with the properties that it does not apply.
pub(super) struct Opened {
    pub(super) decoder: Box<dyn ImageDecoder>,
    pub(super) facts: Facts,
    /// Bytes that the texels will take.
    pub(super) texel_bytes: u64,
}

/// The decoder of the format that was found.
pub(super) fn choose<R: BufRead + Seek + 'static>(
    mut reader: ImageReader<R>,
    encoding: ImageEncoding,
    memory_bytes: u64,
) -> Result<(Box<dyn ImageDecoder>, Facts), ImageError> {
    match reader.format() {
        Some(ImageFormat::Png) => {
            let decoder = PngDecoder::new(reader.into_inner(), memory_bytes)?;
            let facts = decoder.facts();
            Ok((Box::new(decoder), facts))
        }
        Some(ImageFormat::OpenExr) => {
            let decoder = ExrDecoder::new(reader.into_inner(), memory_bytes)?;
            let facts = decoder.facts();
            Ok((Box::new(decoder), facts))
        }
        Some(ImageFormat::Hdr) => {
            let mut decoder = HdrDecoder::new(reader.into_inner())?;
            let facts = decoder.facts();
            Ok((Box::new(decoder), facts))
        }
        Some(ImageFormat::Tga) => {
            let (decoder, alpha) = tga::open(reader.into_inner())?;
            Ok((Box::new(decoder), Facts { alpha, ..Facts::default() }))
        }
        format => {
            let mut facts = Facts::default();
            if format == Some(ImageFormat::Bmp) {
                facts.alpha = Alpha::Unsure;
            }
            if format == Some(ImageFormat::WebP) {
                let mut file = reader.into_inner();
                // The decoder reports what is wrong with the file.
                let frames = image_webp::WebPDecoder::new(&mut file).map_or(0, |webp| webp.num_frames());
                file.seek(SeekFrom::Start(0))?;
                facts.warn_of_frames(frames);
                reader = ImageReader::with_format(file, ImageFormat::WebP);
            }
            // Width and height are checked elsewhere, with better messages.
            let mut limits = Limits::default();
            limits.max_alloc = Some(memory_bytes);
            reader.limits(limits);
            let mut decoder = reader.into_decoder()?;
            if encoding.is_declared()
                && let Some(profile) = decoder.icc_profile()?
            {
                facts.add_profile(Some(&profile), !decoder.color_type().has_color());
            }
            Ok((Box::new(decoder), facts))
        }
    }
}

/// The orientation of an image. Some programs begin its Exif data as in a JPEG, which `image` does not read elsewhere.
pub(super) fn orientation(decoder: &mut dyn ImageDecoder) -> Result<Orientation, ImageError> {
    let found = decoder.orientation()?;
    let exif = if found == Orientation::NoTransforms { decoder.exif_metadata()? } else { None };
    let bare = exif.as_ref().and_then(|exif| exif.strip_prefix(b"Exif\0\0"));
    Ok(bare.and_then(Orientation::from_exif_chunk).unwrap_or(found))
}

/// Bytes of a texel, as [`convert::texels`] makes it.
pub(super) fn texel_bytes(color: ColorType, encoding: ImageEncoding, facts: &Facts) -> u64 {
    let sample_bytes = color.bytes_per_pixel() / color.channel_count();
    let is_packed = sample_bytes == 1 && encoding.space(facts).is_usual();
    match encoding {
        ImageEncoding::CutOut(_) if color.has_alpha() => {
            if is_packed && facts.alpha != Alpha::Premultiplied {
                4
            } else {
                16
            }
        }
        _ if is_packed => 3,
        _ => 12,
    }
}

/// Bytes of memory that an image may take however short its file is.
const SMALL_BYTES: u64 = 256 << 20;
/// Bytes of memory that a byte of a file may become, by how the format packs: the image as it is decoded, and its texels.
pub(super) fn most_growth(format: Option<ImageFormat>) -> u64 {
    match format {
        // Eight pixels of a bitmap.
        Some(ImageFormat::Pnm) => 64,
        // Runs of 128 pixels in two bytes.
        Some(ImageFormat::Tga) => 512,
        // Runs of 255 pixels in two bytes.
        Some(ImageFormat::Bmp) => 1024,
        // An EXR of one colour, which deflate packs best.
        _ => 4200,
    }
}

/// Refuses an image before memory of its size is allocated; returns the bytes of the texels. Bytes of the file that the
/// decoder holds count too; those in memory beside it make way for the texels.
pub(super) fn check_size(
    decoder: &dyn ImageDecoder,
    texel_bytes: u64,
    [length, held_bytes, in_memory]: [u64; 3],
    limits: ImageLimits,
    most_growth: u64,
) -> Result<u64, String> {
    let (width, height) = decoder.dimensions();
    let size = format!("it has {width} × {height} pixels");
    if width == 0 || height == 0 {
        return Err(size);
    }
    if width.max(height) > limits.side {
        return Err(format!("{size}, more than {} a side", limits.side));
    }
    let texels = u64::from(width) * u64::from(height) * texel_bytes;
    let needed = decoder.total_bytes().saturating_add(texels.max(in_memory)).saturating_add(held_bytes);
    if needed > limits.memory_bytes {
        let (needed, most) = (needed.div_ceil(1 << 20), limits.memory_bytes >> 20);
        return Err(format!(
            "{size}, which take {needed} MiB of memory, more than the {most} MiB that one image may take"
        ));
    }
    // Runs may leave out most of an image, so that a few bytes are a whole one.
    if needed > SMALL_BYTES.saturating_add(length.saturating_mul(most_growth)) {
        let needed = needed.div_ceil(1 << 20);
        return Err(format!(
            "it claims {width} × {height} pixels, which take {needed} MiB of memory, more than a file of {length} bytes \
             stands for"
        ));
    }
    Ok(texels)
}
