//! OpenEXR: 32-bit float, linear, Rec. 709 primaries, lossless ZIP. Negative values, caused by filters with
//! negative lobes, are preserved, because clamping them would brighten dark, noisy areas on average.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use ::exr::block::writer::ChunksWriter;
use ::exr::error::{Error, UnitResult};
use ::exr::image::write::layers::{LayersWriter, WritableLayers};
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, Chromaticities, Text};
use ::exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, Vec2,
};
use rayon::prelude::*;

use super::cancellable::CancellableBuffer;
use super::{EncodeOptions, Format, LayerImage, OutputError, SOFTWARE, one_line, replace_non_finite};
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
    match meta.headers.first()?.own_attributes.other.get(&text(MEAN_LUMINANCE_ERROR)) {
        Some(AttributeValue::F64(error)) => Some(*error).filter(|error| error.is_finite() && *error >= 0.0),
        _ => None,
    }
}

pub(super) fn encode(
    (image, layers): (&RadianceImage, &[LayerImage]),
    options: &EncodeOptions,
    token: &CancelToken,
) -> Result<Vec<u8>, OutputError> {
    let size = (image.width as usize, image.height as usize);
    let channels = channels(image, layers);
    let layer = Layer::new(size, attributes(options), Encoding::SMALL_LOSSLESS, channels);
    let mut file = Image::from_layer(layer);
    file.attributes.chromaticities = Some(REC_709);
    let headers = file.layer_data.infer_headers(&file.attributes);
    let layers = file.layer_data.create_writer(&headers);
    let mut bytes = CancellableBuffer::new(token);
    ::exr::block::write(&mut bytes, headers, true, |meta, file| {
        let block = |index| layers.extract_uncompressed_block(&meta.headers, index);
        compress_and_write_blocks(meta.collect_ordered_block_data(block), file)
    })
    .map_err(|error| OutputError::encoder(Format::Exr, &error))?;
    Ok(bytes.into_bytes())
}

/// Channels of an image and its layers (`albedo.R` and so on).
fn channels(image: &RadianceImage, layers: &[LayerImage]) -> AnyChannels<FlatSamples> {
    let channel = |name: &str, image: &RadianceImage, component: usize| {
        let samples = image.pixels.iter().map(|pixel| replace_non_finite(pixel[component])).collect();
        AnyChannel::new(name, FlatSamples::F32(samples))
    };
    let names = ["R", "G", "B"];
    let mut channels: SmallVec<[_; 4]> =
        (0..3).map(|component| channel(names[component], image, component)).collect();
    for LayerImage { name, channels: layer_channels, image } in layers {
        let layer_channels = layer_channels.iter().take(3).enumerate();
        channels.extend(
            layer_channels.map(|(component, suffix)| channel(&format!("{name}.{suffix}"), image, component)),
        );
    }
    AnyChannels::sort(channels)
}

/// Compresses blocks in the caller's thread pool, or on the caller's thread if there is no pool. By default,
/// the encoder would create its own pool with one thread per core.
fn compress_and_write_blocks(
    mut blocks: impl Iterator<Item = (usize, UncompressedBlock)>,
    file: &mut impl ChunksWriter,
) -> UnitResult {
    let is_in_pool = rayon::current_thread_index().is_some();
    let batch_size = if is_in_pool { 4 * rayon::current_num_threads() } else { 1 };
    let compressed = |(index, block): (usize, UncompressedBlock)| (index, compress_scan_lines(block));
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
        for (index, chunk) in chunks {
            file.write_chunk(index, chunk?)?;
        }
    }
}

/// Compresses a block of scan lines with `f32` channels as ZIP: separates the bytes at even positions from
/// those at odd positions, replaces each byte by its difference from the previous one, and deflates the
/// result. The encoder's own function deflates at level 4, which takes three times as long as level 1 for
/// files that are only 4 % smaller.
fn compress_scan_lines(block: UncompressedBlock) -> ::exr::error::Result<Chunk> {
    let UncompressedBlock { index, data } = block;
    let samples = data
        .chunks_exact(size_of::<f32>())
        .map(|bytes| f32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    let samples: Vec<u8> = samples.flat_map(f32::to_le_bytes).collect();
    let (even, odd) = (samples.iter().step_by(2), samples.iter().skip(1).step_by(2));
    let mut before = 128_u8;
    let differences = even.chain(odd).map(|byte| {
        let difference = byte.wrapping_sub(before).wrapping_add(128);
        before = *byte;
        difference
    });
    let differences: Vec<u8> = differences.collect();
    let deflated = miniz_oxide::deflate::compress_to_vec_zlib(&differences, 1);
    // A block that does not become smaller is stored uncompressed, which readers recognize by its length.
    let compressed_pixels_le = if deflated.len() < samples.len() { deflated } else { samples };
    let top = i32::try_from(index.pixel_position.y()).map_err(|_| Error::Invalid("image height".into()))?;
    let block = CompressedScanLineBlock { y_coordinate: top, compressed_pixels_le };
    Ok(Chunk { layer_index: index.layer, compressed_block: CompressedBlock::ScanLine(block) })
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
    let comments = (!lines.is_empty()).then(|| text(&lines.join("\n")));
    let error = options.mean_luminance_error.map(AttributeValue::F64);
    let other = error.map(|error| (text(MEAN_LUMINANCE_ERROR), error)).into_iter().collect();
    LayerAttributes { software_name: Some(text(SOFTWARE)), comments, other, ..Default::default() }
}

/// Encodes text as UTF-8, as other programs do.
fn text(value: &str) -> Text {
    Text::from_slice_unchecked(value.as_bytes())
}
