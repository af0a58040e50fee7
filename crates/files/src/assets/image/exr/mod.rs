//! EXR decoder based on the `exr` crate. The `image` crate's own decoder supports only R, G and B channels
//! that are not in a named layer.

pub(super) mod channels;
mod chroma;
mod sampling;

use std::io::{BufRead, Seek};

use ::exr::block::UncompressedBlock;
use ::exr::block::reader::Reader;
use ::exr::error::Error;
use ::exr::meta::BlockDescription;
use ::exr::meta::attribute::{ChannelDescription, Chromaticities, SampleType};
use ::exr::meta::header::Header;
use ::exr::prelude::{Vec2, f16};
use ::image::error::{DecodingError, ImageFormatHint, LimitError, LimitErrorKind};
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};

use super::metadata::{AlphaInterpretation, ImageColorMetadata};
use super::primaries::Primaries;
use super::space::ColorSpace;
use channels::{ChosenChannels, PartAndChannelIndex, choose_channels, describe_unusable_channels};
use chroma::LuminanceChromaPlanes;
use sampling::{BlockDecompressor, ChannelSampling, SubsamplingHidingReader};

/// Size of a decoded sample in bytes.
const SAMPLE_BYTES: usize = 4;

/// Decodes one RGB or gray layer, including alpha if present. The image covers the display window at the
/// highest resolution and is black outside the data window.
pub(super) struct ExrDecoder<R> {
    reader: Reader<SubsamplingHidingReader<R>>,
    channels: ChosenChannels,
    samplings: Vec<Vec<ChannelSampling>>,
}

impl<R: BufRead + Seek> ExrDecoder<R> {
    /// Creates a decoder that allocates at most `memory_bytes` in addition to the pixels.
    pub(super) fn new(mut file: R, memory_bytes: u64) -> ImageResult<Self> {
        let samplings = sampling::read_samplings_if_subsampled(&mut file).map_err(ImageError::IoError)?;
        let file = SubsamplingHidingReader::new(file, &samplings);
        let reader = ::exr::block::read(file, false).map_err(to_image_error)?;
        let Some(channels) = choose_channels(reader.headers()) else {
            return Err(decoding_error(describe_unusable_channels(reader.headers())));
        };
        let decompressor = BlockDecompressor::new(reader.meta_data(), &samplings);
        check_samplings(decompressor.headers_with_subsampling(), channels).map_err(decoding_error)?;
        let needed =
            channels.all().map(|channel| decompressed_block_size(&reader.headers()[channel.part])).max();
        let chroma_bytes = channels.as_luminance_chroma().map_or(0, |planes| {
            LuminanceChromaPlanes::memory_bytes(decompressor.headers_with_subsampling(), planes)
        });
        if needed.unwrap_or_default().saturating_add(chroma_bytes) > memory_bytes {
            return Err(ImageError::Limits(LimitError::from_kind(LimitErrorKind::InsufficientMemory)));
        }
        Ok(Self { reader, channels, samplings })
    }

    /// Color space, alpha usage and warnings.
    pub(super) fn color_metadata(&self) -> ImageColorMetadata {
        let mut metadata =
            ImageColorMetadata { alpha: AlphaInterpretation::Premultiplied, ..ImageColorMetadata::default() };
        if let Some(primaries) = primaries(self.header()) {
            match primaries.to_rec_709_matrix() {
                Some(matrix) => metadata.space = ColorSpace::from_matrix_to_rec_709(matrix),
                None => metadata.add_warning(DEGENERATE_CHROMATICITIES),
            }
        }
        metadata
    }

    fn header(&self) -> &Header {
        let [red, ..] = self.channels.component_channels();
        &self.reader.headers()[red.map_or(0, |channel| channel.part)]
    }
}

/// Warning for chromaticities that do not form a triangle.
pub(super) const DEGENERATE_CHROMATICITIES: &str = "degenerate chromaticities are ignored";

const SIZE_NOT_DIVISIBLE: &str = "the subsampling does not divide the image size";
const CHROMA_DIFFERS: &str = "channels RY and BY have different subsampling";

pub(super) fn subsampled_channel_message(channel: &str) -> String {
    format!("channel {channel} is subsampled; only RY and BY may be subsampled")
}

fn primaries(header: &Header) -> Option<Primaries> {
    let Chromaticities { red, green, blue, white } = header.shared_attributes.chromaticities?;
    let [red, green, blue, white] = [red, green, blue, white].map(|Vec2(x, y)| [f64::from(x), f64::from(y)]);
    Some(Primaries { red, green, blue, white })
}

/// Size in bytes of a decompressed block (a tile or several rows), including all channels.
fn decompressed_block_size(header: &Header) -> u64 {
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    let (width, height) = match header.blocks {
        BlockDescription::ScanLines => (width, header.compression.scan_lines_per_block().min(height)),
        BlockDescription::Tiles(tiles) => {
            (tiles.tile_size.width().min(width), tiles.tile_size.height().min(height))
        }
    };
    let pixels = (width as u64).saturating_mul(height as u64);
    pixels.saturating_mul(header.channels.bytes_per_pixel as u64)
}

fn channel_by_index(headers: &[Header], channel: PartAndChannelIndex) -> &ChannelDescription {
    &headers[channel.part].channels.list[channel.channel]
}

/// Checks that only the chroma channels are subsampled, and both by the same factors.
fn check_samplings(headers: &[Header], channels: ChosenChannels) -> Result<(), String> {
    let sampling = |channel: PartAndChannelIndex| channel_by_index(headers, channel).sampling;
    let is_divided = |channel: &PartAndChannelIndex| {
        let (Vec2(x, y), size) = (sampling(*channel), headers[channel.part].layer_size);
        x > 0 && y > 0 && size.width().is_multiple_of(x) && size.height().is_multiple_of(y)
    };
    if !channels.all().all(|channel| is_divided(&channel)) {
        return Err(SIZE_NOT_DIVISIBLE.to_owned());
    }
    match channels.component_channels().into_iter().flatten().find(|channel| sampling(*channel) != Vec2(1, 1))
    {
        Some(channel) => {
            Err(subsampled_channel_message(&channel_by_index(headers, channel).name.to_string()))
        }
        None => match channels.as_luminance_chroma() {
            Some([_, ry, by]) if sampling(ry) != sampling(by) => Err(CHROMA_DIFFERS.to_owned()),
            Some(_) | None => Ok(()),
        },
    }
}

impl<R: BufRead + Seek> ImageDecoder for ExrDecoder<R> {
    fn dimensions(&self) -> (u32, u32) {
        let size = self.header().shared_attributes.display_window.size;
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        (side(size.width()), side(size.height()))
    }

    fn color_type(&self) -> ColorType {
        if self.channels.alpha.is_some() { ColorType::Rgba32F } else { ColorType::Rgb32F }
    }

    fn read_image(self, samples: &mut [u8]) -> ImageResult<()> {
        let channels = self.channels;
        let mut decompressor = BlockDecompressor::new(self.reader.meta_data(), &self.samplings);
        let headers = decompressor.headers_with_subsampling().to_vec();
        let mut image = BlockAssembler {
            headers: &headers,
            channels,
            planes: channels.as_luminance_chroma().map(|planes| LuminanceChromaPlanes::new(&headers, planes)),
        };
        samples.fill(0);
        let is_read = |part: usize| channels.all().any(|channel| channel.part == part);
        let chunks = self
            .reader
            .filter_chunks(false, |_, tile, block| is_read(block.layer) && tile.level_index == Vec2(0, 0));
        for chunk in chunks.map_err(to_image_error)? {
            let block = chunk.and_then(|chunk| decompressor.decompress(chunk)).map_err(to_image_error)?;
            image.add_block(&block, samples);
        }
        image.convert_luminance_chroma(samples);
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, samples: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(samples)
    }
}

/// Assembles an image from decompressed blocks.
struct BlockAssembler<'a> {
    headers: &'a [Header],
    channels: ChosenChannels,
    planes: Option<LuminanceChromaPlanes>,
}

impl BlockAssembler<'_> {
    /// Adds the samples from a decompressed block.
    fn add_block(&mut self, block: &UncompressedBlock, samples: &mut [u8]) {
        let part = block.index.layer;
        let header = &self.headers[part];
        let (Vec2(left, top), size) = (block.index.pixel_position, block.index.pixel_size);
        let mut data = block.data.as_slice();
        for row in top..top + size.height() {
            for (channel, description) in header.channels.list.iter().enumerate() {
                let Vec2(across, down) = description.sampling;
                if !row.is_multiple_of(down) {
                    continue;
                }
                let bytes = size.width() / across * description.sample_type.bytes_per_sample();
                let Some((line, rest)) = data.split_at_checked(bytes) else { return };
                data = rest;
                let line = ChannelRow { sample_type: description.sample_type, bytes: line };
                let channel = PartAndChannelIndex { part, channel };
                if let Some(planes) = &mut self.planes {
                    planes.store_channel_row(channel, row / down, line);
                }
                self.copy_channel_row(channel, [left, row], line, samples);
            }
        }
    }

    /// Copies a row of a channel to the pixel components that use the channel. `left` and `row` are relative
    /// to the data window.
    fn copy_channel_row(
        &self,
        channel: PartAndChannelIndex,
        [left, row]: [usize; 2],
        line: ChannelRow<'_>,
        samples: &mut [u8],
    ) {
        let header = &self.headers[channel.part];
        let window = header.shared_attributes.display_window;
        let offset = header.own_attributes.layer_position - window.position;
        let slots = self.channels.component_channels();
        let pixel_bytes = decoded_bytes_per_pixel(self.channels);
        let Ok(row) = usize::try_from(row as i64 + i64::from(offset.y())) else { return };
        let width = window.size.width() * pixel_bytes;
        let Some(row) = samples.chunks_exact_mut(width).nth(row) else { return };
        let start = left as i64 + i64::from(offset.x());
        for slot in (0..4).filter(|&slot| slots[slot] == Some(channel)) {
            let (skipped, start) =
                if start < 0 { (start.unsigned_abs() as usize, 0) } else { (0, start as usize) };
            let pixels = row.chunks_exact_mut(pixel_bytes).skip(start);
            line.for_each_value(skipped, pixels, |pixel, value| {
                pixel[SAMPLE_BYTES * slot..][..SAMPLE_BYTES].copy_from_slice(&value.to_ne_bytes());
            });
        }
    }

    /// Computes colors from luminance and chroma.
    fn convert_luminance_chroma(self, samples: &mut [u8]) {
        let (Some([y, ..]), Some(planes)) = (self.channels.as_luminance_chroma(), self.planes) else {
            return;
        };
        let header = &self.headers[y.part];
        let window = header.shared_attributes.display_window;
        let weights = primaries(header).unwrap_or(Primaries::REC_709).luminance_weights();
        let Some(weights) = weights.or(Primaries::REC_709.luminance_weights()) else { return };
        let offset = header.own_attributes.layer_position - window.position;
        let (width, height) = (window.size.width() as i64, window.size.height() as i64);
        let bytes = decoded_bytes_per_pixel(self.channels);
        planes.for_each_color(weights, |[x, y], color| {
            let (x, y) = (x as i64 + i64::from(offset.x()), y as i64 + i64::from(offset.y()));
            if !(0..width).contains(&x) || !(0..height).contains(&y) {
                return;
            }
            let start = (y * width + x) as usize * bytes;
            let color = color.map(f32::to_ne_bytes);
            samples[start..][..3 * SAMPLE_BYTES].copy_from_slice(color.as_flattened());
        });
    }
}

/// Size of a decoded pixel in bytes.
fn decoded_bytes_per_pixel(channels: ChosenChannels) -> usize {
    SAMPLE_BYTES * if channels.alpha.is_some() { 4 } else { 3 }
}

/// Consecutive samples from one channel.
#[derive(Clone, Copy)]
struct ChannelRow<'a> {
    sample_type: SampleType,
    bytes: &'a [u8],
}

impl ChannelRow<'_> {
    /// Skips the first `skipped` values, then passes each remaining value to `put` with the next item from
    /// `targets`.
    fn for_each_value<T>(self, skipped: usize, targets: impl Iterator<Item = T>, put: impl Fn(T, f32)) {
        fn for_each_raw_sample<const N: usize, T>(
            bytes: &[u8],
            skipped: usize,
            targets: impl Iterator<Item = T>,
            put: impl Fn(T, [u8; N]),
        ) {
            let samples = bytes.as_chunks().0.iter().skip(skipped);
            targets.zip(samples).for_each(|(target, sample)| put(target, *sample));
        }
        match self.sample_type {
            SampleType::F32 => {
                for_each_raw_sample(self.bytes, skipped, targets, |at, bytes| {
                    put(at, f32::from_ne_bytes(bytes));
                });
            }
            SampleType::F16 => {
                for_each_raw_sample(self.bytes, skipped, targets, |at, bytes| {
                    put(at, f16::from_ne_bytes(bytes).to_f32());
                });
            }
            SampleType::U32 => {
                for_each_raw_sample(self.bytes, skipped, targets, |at, bytes| {
                    put(at, u32::from_ne_bytes(bytes) as f32);
                });
            }
        }
    }
}

fn to_image_error(error: Error) -> ImageError {
    match error {
        Error::Io(error) => ImageError::IoError(error),
        error => decoding_error(error.to_string()),
    }
}

fn decoding_error(reason: String) -> ImageError {
    ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::OpenExr), reason))
}
