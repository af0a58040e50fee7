//! OpenEXR: 32-bit float, linear, Rec. 709 primaries, lossless ZIP. Negative values, caused by filters with
//! negative lobes, are preserved, because clamping them would brighten dark, noisy areas on average.

use std::fs::File;
use std::io::{BufReader, Write};
use std::path::Path;

use ::exr::block::BlockIndex;
use ::exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use ::exr::block::writer::ChunksWriter;
use ::exr::compression::Compression as Encoding;
use ::exr::error::{Error, UnitResult};
use ::exr::meta::attribute::{
    AttributeValue, ChannelDescription, Chromaticities, LineOrder, SampleType, Text,
};
use ::exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use ::exr::meta::{BlockDescription, MetaData};
use ::exr::prelude::Vec2;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;

use super::cancelable::CancelableBuffer;
use super::{EncodeOptions, Format, LayerImage, OutputError, SOFTWARE, one_line, to_finite};
use crate::control::CancelToken;
use crate::film::RadianceImage;

/// Name of the attribute (a double) for the standard error of the image's mean luminance.
const MEAN_LUMINANCE_ERROR: &str = "glimtMeanLuminanceError";

/// Reads the standard error of the mean luminance from an EXR file. Reads only regular files, because a pipe
/// can be read only once.
pub fn read_mean_luminance_error(path: &Path) -> Option<f64> {
    let is_regular = path.metadata().is_ok_and(|found| found.is_file());
    let file = if is_regular { File::open(path).ok()? } else { return None };
    let meta = MetaData::read_from_buffered(BufReader::new(file), false).ok()?;
    match meta.headers.first()?.own_attributes.other.get(&to_exr_text(MEAN_LUMINANCE_ERROR)) {
        Some(AttributeValue::F64(error)) => Some(*error).filter(|error| error.is_finite() && *error >= 0.0),
        _ => None,
    }
}

pub(super) fn encode(
    image: &RadianceImage,
    layers: &[LayerImage],
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let size = (image.width as usize, image.height as usize);
    let channels = channels(image, layers);
    let description = |channel: &Channel<'_>| ChannelDescription::named(&*channel.name, SampleType::F32);
    let mut shared = ImageAttributes::with_size(size);
    shared.chromaticities = Some(REC_709);
    let header = Header::new(Text::default(), size, channels.iter().map(description).collect())
        .with_encoding(Encoding::ZIP16, BlockDescription::ScanLines, LineOrder::Increasing)
        .with_attributes(attributes(options))
        .with_shared_attributes(shared);
    let mut bytes = CancelableBuffer::new(token);
    ::exr::block::write(&mut bytes, [header].into_iter().collect(), true, |meta, file| {
        write_blocks(meta.enumerate_ordered_header_block_indices(), &channels, file)
    })
    .map_err(|error| OutputError::encoder(Format::Exr, &error))?;
    Ok(bytes.into_bytes())
}

/// A channel of the file: one component of an image.
struct Channel<'a> {
    name: String,
    image: &'a RadianceImage,
    component: usize,
}

/// Channels of an image and its layers (`albedo.R` and so on), sorted by name.
fn channels<'a>(image: &'a RadianceImage, layers: &'a [LayerImage]) -> Vec<Channel<'a>> {
    let own = ["R", "G", "B"].into_iter().enumerate();
    let mut channels: Vec<_> =
        own.map(|(component, name)| Channel { name: name.to_owned(), image, component }).collect();
    for LayerImage { name, channels: suffixes, image } in layers {
        let suffixes = suffixes.iter().take(3).enumerate();
        channels.extend(suffixes.map(|(component, suffix)| Channel {
            name: format!("{name}.{suffix}"),
            image,
            component,
        }));
    }
    channels.sort_unstable_by(|a, b| a.name.cmp(&b.name));
    channels
}

/// Compresses and writes blocks in the caller's thread pool, or on the caller's thread if there is no pool.
/// By default, the encoder would create its own pool with one thread per core.
fn write_blocks(
    mut blocks: impl Iterator<Item = (usize, BlockIndex)>,
    channels: &[Channel<'_>],
    file: &mut impl ChunksWriter,
) -> UnitResult {
    let is_in_pool = rayon::current_thread_index().is_some();
    let batch_size = if is_in_pool { 4 * rayon::current_num_threads() } else { 1 };
    let compressed = |(place, index): (usize, BlockIndex)| (place, compress_scan_lines(index, channels));
    loop {
        let batch: Vec<_> = blocks.by_ref().take(batch_size).collect();
        if batch.is_empty() {
            return Ok(());
        }
        let chunks: Vec<_> = if is_in_pool {
            batch.into_par_iter().map(compressed).collect()
        } else {
            batch.into_iter().map(compressed).collect()
        };
        for (place, chunk) in chunks {
            file.write_chunk(place, chunk?)?;
        }
    }
}

/// Compresses a block of scan lines as ZIP: applies the predictor and deflates the result. The encoder's own
/// function uses a higher level, which takes several times as long.
fn compress_scan_lines(index: BlockIndex, channels: &[Channel<'_>]) -> ::exr::error::Result<Chunk> {
    let samples = block_samples_to_le_bytes(index, channels);
    let deflated = Vec::with_capacity(samples.len());
    let mut encoder = ZlibEncoder::new(deflated, Compression::fast());
    let deflated =
        encoder.write_all(&deinterleave_and_delta_encode(&samples)).and_then(|()| encoder.finish())?;
    // A block that does not become smaller is stored uncompressed, which readers recognize by its length.
    let compressed_pixels_le = if deflated.len() < samples.len() { deflated } else { samples };
    let top = i32::try_from(index.pixel_position.y()).map_err(|_| Error::Invalid("image height".into()))?;
    let block = CompressedScanLineBlock { y_coordinate: top, compressed_pixels_le };
    Ok(Chunk { layer_index: index.layer, compressed_block: CompressedBlock::ScanLine(block) })
}

/// The samples of a block, line by line and channel by channel, as little-endian bytes.
fn block_samples_to_le_bytes(index: BlockIndex, channels: &[Channel<'_>]) -> Vec<u8> {
    let (top, Vec2(width, height)) = (index.pixel_position.y(), index.pixel_size);
    let mut bytes = vec![0; width * height * channels.len() * size_of::<f32>()];
    let lines = (top..top + height).flat_map(|line| channels.iter().map(move |channel| (line, channel)));
    for (bytes, (line, channel)) in bytes.chunks_exact_mut(width * size_of::<f32>()).zip(lines) {
        let pixels = channel.image.pixels.iter().skip(line * width);
        for (bytes, pixel) in bytes.as_chunks_mut().0.iter_mut().zip(pixels) {
            *bytes = to_finite(pixel.as_ref()[channel.component]).to_le_bytes();
        }
    }
    bytes
}

/// Separates the bytes at even positions from those at odd positions, and replaces each byte except the first
/// with its difference from the previous byte, plus 128.
fn deinterleave_and_delta_encode(samples: &[u8]) -> Vec<u8> {
    let mut separated = vec![0; samples.len()];
    let (even, odd) = separated.split_at_mut(samples.len() / 2);
    for ((pair, even), odd) in samples.chunks_exact(2).zip(even).zip(odd) {
        (*even, *odd) = (pair[0], pair[1]);
    }
    let mut predicted = separated.clone();
    for (predicted, bytes) in predicted.iter_mut().skip(1).zip(separated.windows(2)) {
        *predicted = bytes[1].wrapping_sub(bytes[0]).wrapping_add(128);
    }
    predicted
}

/// ITU-R BT.709 primaries with D65 white.
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Returns the file's attributes. Metadata is written to the standard attribute `comments`, one item per
/// line. [`MEAN_LUMINANCE_ERROR`] is the only custom attribute. More than one would make files
/// nondeterministic, because the encoder writes them in the random order of its hash map.
fn attributes(options: &EncodeOptions) -> LayerAttributes {
    let line = |(name, value): &(String, String)| format!("{}: {}", one_line(name), one_line(value));
    let lines: Vec<_> = options.metadata.iter().map(line).collect();
    let comments = (!lines.is_empty()).then(|| to_exr_text(&lines.join("\n")));
    let error = options.mean_luminance_error.map(AttributeValue::F64);
    let other = error.map(|error| (to_exr_text(MEAN_LUMINANCE_ERROR), error)).into_iter().collect();
    LayerAttributes { software_name: Some(to_exr_text(SOFTWARE)), comments, other, ..Default::default() }
}

/// Encodes text as UTF-8, as other programs do.
fn to_exr_text(value: &str) -> Text {
    Text::from_slice_unchecked(value.as_bytes())
}
