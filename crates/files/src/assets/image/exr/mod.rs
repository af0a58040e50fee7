//! EXR by `exr`: `image` would only find red, green and blue without a layer's name.

mod channels;
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

use super::facts::{Alpha, Facts};
use super::primaries::Primaries;
use super::space::ColorSpace;
use channels::{Channel, Chosen, choose, no_color};
use chroma::Planes;
use sampling::{Sampling, Unpacking, Unsampled};

/// Bytes of a sample.
const SAMPLE_BYTES: usize = 4;

/// Decoder of a color or gray, with its alpha, from one layer of the file: its display window, black outside of the data, in the largest
/// resolution.
pub(super) struct ExrDecoder<R> {
    reader: Reader<Unsampled<R>>,
    channels: Chosen,
    samplings: Vec<Vec<Sampling>>,
}

impl<R: BufRead + Seek> ExrDecoder<R> {
    /// Creates a decoder that allocates at most `memory_bytes` besides the pixels.
    pub(super) fn new(mut file: R, memory_bytes: u64) -> ImageResult<Self> {
        let samplings = sampling::find(&mut file).map_err(ImageError::IoError)?;
        let file = Unsampled::new(file, &samplings);
        let reader = ::exr::block::read(file, false).map_err(image_error)?;
        let Some(channels) = choose(reader.headers()) else {
            return Err(decoding_error(no_color(reader.headers())));
        };
        let unpacking = Unpacking::new(reader.meta_data(), &samplings);
        check_samplings(unpacking.headers(), channels).map_err(decoding_error)?;
        let needed = channels.all().map(|channel| block_bytes(&reader.headers()[channel.part])).max();
        let of_chroma =
            channels.planes().map_or(0, |planes| Planes::memory_bytes(unpacking.headers(), planes));
        if needed.unwrap_or_default().saturating_add(of_chroma) > memory_bytes {
            return Err(ImageError::Limits(LimitError::from_kind(LimitErrorKind::InsufficientMemory)));
        }
        Ok(Self { reader, channels, samplings })
    }

    /// The facts that the samples do not contain.
    pub(super) fn facts(&self) -> Facts {
        let mut facts = Facts { alpha: Alpha::Premultiplied, ..Facts::default() };
        if let Some(primaries) = primaries(self.header()) {
            match primaries.to_rec_709() {
                Some(matrix) => facts.space = ColorSpace::of_matrix(matrix),
                None => facts.warn("its chromaticities span no colors and are ignored"),
            }
        }
        facts
    }

    fn header(&self) -> &Header {
        let [red, ..] = self.channels.slots();
        &self.reader.headers()[red.map_or(0, |channel| channel.part)]
    }
}

fn primaries(header: &Header) -> Option<Primaries> {
    let Chromaticities { red, green, blue, white } = header.shared_attributes.chromaticities?;
    let [red, green, blue, white] = [red, green, blue, white].map(|Vec2(x, y)| [f64::from(x), f64::from(y)]);
    Some(Primaries { red, green, blue, white })
}

/// Bytes that are unpacked at once: a tile, or some rows, with all channels.
fn block_bytes(header: &Header) -> u64 {
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

fn description(headers: &[Header], channel: Channel) -> &ChannelDescription {
    &headers[channel.part].channels.list[channel.channel]
}

/// Checks that only chroma is subsampled, by the same steps in both channels.
fn check_samplings(headers: &[Header], channels: Chosen) -> Result<(), String> {
    let sampling = |channel: Channel| description(headers, channel).sampling;
    let is_divided = |channel: &Channel| {
        let (Vec2(x, y), size) = (sampling(*channel), headers[channel.part].layer_size);
        x > 0 && y > 0 && size.width().is_multiple_of(x) && size.height().is_multiple_of(y)
    };
    if !channels.all().all(|channel| is_divided(&channel)) {
        return Err("its subsampling does not divide its size".to_owned());
    }
    match channels.slots().into_iter().flatten().find(|channel| sampling(*channel) != Vec2(1, 1)) {
        Some(channel) => {
            let name = &description(headers, channel).name;
            Err(format!("its channel {name} has a subsampling, which only RY and BY may have"))
        }
        None => match channels.planes() {
            Some([_, ry, by]) if sampling(ry) != sampling(by) => {
                Err("the subsampling of its channels RY and BY differs".to_owned())
            }
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
        let mut unpacking = Unpacking::new(self.reader.meta_data(), &self.samplings);
        let headers = unpacking.headers().to_vec();
        let mut image = Image {
            headers: &headers,
            channels,
            planes: channels.planes().map(|planes| Planes::new(&headers, planes)),
        };
        samples.fill(0);
        let is_read = |part: usize| channels.all().any(|channel| channel.part == part);
        let chunks = self
            .reader
            .filter_chunks(false, |_, tile, block| is_read(block.layer) && tile.level_index == Vec2(0, 0));
        for chunk in chunks.map_err(image_error)? {
            let block = chunk.and_then(|chunk| unpacking.unpacked(chunk)).map_err(image_error)?;
            image.add(&block, samples);
        }
        image.add_chroma(samples);
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, samples: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(samples)
    }
}

/// An image that is being read.
struct Image<'a> {
    headers: &'a [Header],
    channels: Chosen,
    planes: Option<Planes>,
}

impl Image<'_> {
    /// Adds the samples of a block.
    fn add(&mut self, block: &UncompressedBlock, samples: &mut [u8]) {
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
                let line = Line { kind: description.sample_type, bytes: line };
                let channel = Channel { part, channel };
                if let Some(planes) = &mut self.planes {
                    planes.add(channel, row / down, line);
                }
                self.place(channel, [left, row], line, samples);
            }
        }
    }

    /// Copies a line of a channel, from a pixel of the data window on, to its slots.
    fn place(&self, channel: Channel, [left, row]: [usize; 2], line: Line<'_>, samples: &mut [u8]) {
        let header = &self.headers[channel.part];
        let window = header.shared_attributes.display_window;
        let offset = header.own_attributes.layer_position - window.position;
        let slots = self.channels.slots();
        let pixel_bytes = pixel_bytes(self.channels);
        let Ok(row) = usize::try_from(row as i64 + i64::from(offset.y())) else { return };
        let width = window.size.width() * pixel_bytes;
        let Some(row) = samples.chunks_exact_mut(width).nth(row) else { return };
        let start = left as i64 + i64::from(offset.x());
        for slot in (0..4).filter(|&slot| slots[slot] == Some(channel)) {
            let (skipped, start) =
                if start < 0 { (start.unsigned_abs() as usize, 0) } else { (0, start as usize) };
            let pixels = row.chunks_exact_mut(pixel_bytes).skip(start);
            line.values(skipped, pixels, |pixel, value| {
                pixel[SAMPLE_BYTES * slot..][..SAMPLE_BYTES].copy_from_slice(&value.to_ne_bytes());
            });
        }
    }

    /// Makes colors of luminance and chroma.
    fn add_chroma(self, samples: &mut [u8]) {
        let (Some([y, ..]), Some(planes)) = (self.channels.planes(), self.planes) else { return };
        let header = &self.headers[y.part];
        let window = header.shared_attributes.display_window;
        let weights = primaries(header).unwrap_or(Primaries::REC_709).luminance_weights();
        let Some(weights) = weights.or(Primaries::REC_709.luminance_weights()) else { return };
        let offset = header.own_attributes.layer_position - window.position;
        let (width, height) = (window.size.width() as i64, window.size.height() as i64);
        let bytes = pixel_bytes(self.channels);
        planes.colors(weights, |[x, y], color| {
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

/// Bytes of a pixel of the image.
fn pixel_bytes(channels: Chosen) -> usize {
    SAMPLE_BYTES * if channels.alpha.is_some() { 4 } else { 3 }
}

/// Samples of one channel, side by side.
#[derive(Clone, Copy)]
struct Line<'a> {
    kind: SampleType,
    bytes: &'a [u8],
}

impl Line<'_> {
    /// Puts each value behind the `skipped` first ones into a place.
    fn values<T>(self, skipped: usize, places: impl Iterator<Item = T>, put: impl Fn(T, f32)) {
        fn each<const N: usize, T>(
            bytes: &[u8],
            skipped: usize,
            places: impl Iterator<Item = T>,
            put: impl Fn(T, [u8; N]),
        ) {
            let samples = bytes.as_chunks().0.iter().skip(skipped);
            places.zip(samples).for_each(|(place, sample)| put(place, *sample));
        }
        match self.kind {
            SampleType::F32 => {
                each(self.bytes, skipped, places, |at, bytes| put(at, f32::from_ne_bytes(bytes)));
            }
            SampleType::F16 => {
                each(self.bytes, skipped, places, |at, bytes| put(at, f16::from_ne_bytes(bytes).to_f32()));
            }
            SampleType::U32 => {
                each(self.bytes, skipped, places, |at, bytes| put(at, u32::from_ne_bytes(bytes) as f32));
            }
        }
    }
}

fn image_error(error: Error) -> ImageError {
    match error {
        Error::Io(error) => ImageError::IoError(error),
        error => decoding_error(error.to_string()),
    }
}

fn decoding_error(reason: String) -> ImageError {
    ImageError::Decoding(DecodingError::new(ImageFormatHint::Exact(ImageFormat::OpenExr), reason))
}
