//! EXR by `exr`: `image` would only find red, green and blue without a layer's name.

use std::collections::BTreeMap;
use std::io::{BufRead, Seek};

use ::exr::block::UncompressedBlock;
use ::exr::block::reader::{ChunksReader, Reader};
use ::exr::error::Error;
use ::exr::meta::BlockDescription;
use ::exr::meta::attribute::SampleType;
use ::exr::meta::header::Header;
use ::exr::prelude::{Vec2, f16};
use ::image::error::{DecodingError, ImageFormatHint, LimitError, LimitErrorKind};
use ::image::{ColorType, ImageDecoder, ImageError, ImageFormat, ImageResult};

/// Bytes of a sample.
const SAMPLE_BYTES: usize = 4;

/// Decoder of a colour or grey, with its alpha, from one part of the file: its display window, black outside of the data, in the largest
/// resolution.
pub(super) struct ExrDecoder<R> {
    reader: Reader<R>,
    part: usize,
    channels: Chosen,
}

/// Indices among the channels of a part.
#[derive(Clone, Copy)]
struct Chosen {
    /// Red, green and blue; all the same for grey.
    color: [usize; 3],
    /// Alpha.
    alpha: Option<usize>,
}

impl Chosen {
    /// Samples of a pixel.
    fn count(self) -> usize {
        if self.alpha.is_some() { 4 } else { 3 }
    }

    /// The places of a channel among the samples of a pixel.
    fn slots(self, channel: usize) -> impl Iterator<Item = usize> {
        let all = [Some(self.color[0]), Some(self.color[1]), Some(self.color[2]), self.alpha];
        (0..4).filter(move |&slot| all[slot] == Some(channel))
    }
}

impl<R: BufRead + Seek> ExrDecoder<R> {
    /// A decoder that takes at most so many bytes of memory besides the pixels.
    pub(super) fn new(file: R, memory_bytes: u64) -> ImageResult<Self> {
        let reader = ::exr::block::read(file, false).map_err(image_error)?;
        let Some((part, channels)) = choose(reader.headers()) else {
            return Err(decoding_error(no_colour(reader.headers())));
        };
        if block_bytes(&reader.headers()[part]) > memory_bytes {
            return Err(ImageError::Limits(LimitError::from_kind(LimitErrorKind::InsufficientMemory)));
        }
        Ok(Self { reader, part, channels })
    }

    fn header(&self) -> &Header {
        &self.reader.headers()[self.part]
    }
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

/// The channels of a layer that are known by their names, in any case.
#[derive(Clone, Copy, Default)]
struct Layer {
    rgb: [Option<usize>; 3],
    luminance: Option<usize>,
    alpha: Option<usize>,
    has_chroma: bool,
}

impl Layer {
    fn color(&self) -> Option<Chosen> {
        let [red, green, blue] = self.rgb;
        Some(Chosen { color: [red?, green?, blue?], alpha: self.alpha })
    }

    fn grey(&self) -> Option<Chosen> {
        let luminance = self.luminance.filter(|_| !self.has_chroma)?;
        Some(Chosen { color: [luminance; 3], alpha: self.alpha })
    }
}

/// The part and its channels to read. Colour comes before grey, channels without a layer's name before those with one,
/// then the first; otherwise the only channel of a part, whatever its name.
fn choose(headers: &[Header]) -> Option<(usize, Chosen)> {
    let flat = || headers.iter().enumerate().filter(|(_, header)| !header.deep);
    let parts: Vec<_> = flat().map(|(part, header)| (part, layers(header))).collect();
    let find = |is_named: bool, channels: fn(&Layer) -> Option<Chosen>| {
        parts.iter().find_map(|(part, layers)| {
            let mut layers = layers.iter().filter(|(name, _)| name.is_empty() != is_named);
            Some((*part, layers.find_map(|(_, layer)| channels(layer))?))
        })
    };
    let only = Chosen { color: [0; 3], alpha: None };
    let alone = || flat().find(|(_, header)| header.channels.list.len() == 1).map(|(part, _)| (part, only));
    let unnamed = find(false, Layer::color).or_else(|| find(false, Layer::grey));
    unnamed.or_else(|| find(true, Layer::color)).or_else(|| find(true, Layer::grey)).or_else(alone)
}

/// Layers of a part by name; the name stands before the last dot of the channels' names.
fn layers(header: &Header) -> BTreeMap<String, Layer> {
    let mut layers: BTreeMap<String, Layer> = BTreeMap::new();
    for (index, channel) in header.channels.list.iter().enumerate() {
        let name = channel.name.to_string();
        let (layer, name) = name.rsplit_once('.').unwrap_or(("", &name));
        let layer = layers.entry(layer.to_owned()).or_default();
        match name.to_ascii_uppercase().as_str() {
            "R" => layer.rgb[0] = Some(index),
            "G" => layer.rgb[1] = Some(index),
            "B" => layer.rgb[2] = Some(index),
            "A" => layer.alpha = Some(index),
            "Y" => layer.luminance = Some(index),
            "RY" | "BY" => layer.has_chroma = true,
            _ => {}
        }
    }
    layers
}

fn no_colour(headers: &[Header]) -> String {
    const MOST_NAMES: usize = 8;
    if headers.iter().all(|header| header.deep) {
        return "deep images are not read; flatten it".to_owned();
    }
    let flat = headers.iter().filter(|header| !header.deep);
    let mut names = flat.flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
    let some: Vec<_> = names.by_ref().take(MOST_NAMES).collect();
    let more = if names.next().is_some() { ", …" } else { "" };
    format!("its channels are {}{more}; wanted are R, G and B, or Y for grey", some.join(", "))
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
        let Self { reader, part, channels } = self;
        let header = reader.headers()[part].clone();
        samples.fill(0);
        let chunks = reader
            .filter_chunks(false, |_, tile, block| block.layer == part && tile.level_index == Vec2(0, 0));
        let mut blocks = chunks.map_err(image_error)?.sequential_decompressor(false);
        while let Some(block) = blocks.decompress_next_block() {
            copy(&block.map_err(image_error)?, &header, channels, samples);
        }
        Ok(())
    }

    fn read_image_boxed(self: Box<Self>, samples: &mut [u8]) -> ImageResult<()> {
        (*self).read_image(samples)
    }
}

/// Copies the block's part of the picture.
fn copy(block: &UncompressedBlock, header: &Header, channels: Chosen, samples: &mut [u8]) {
    let window = header.shared_attributes.display_window;
    let offset = header.own_attributes.layer_position - window.position;
    let (width, size) = (window.size.width(), channels.count() * SAMPLE_BYTES);
    for line in block.lines(&header.channels) {
        let slots = channels.slots(line.location.channel);
        let (column, row) = (line.location.position.x() as i64, line.location.position.y() as i64);
        let Ok(row) = usize::try_from(row + i64::from(offset.y())) else { continue };
        let Some(row) = samples.chunks_exact_mut(width * size).nth(row) else { continue };
        let start = column + i64::from(offset.x());
        for slot in slots {
            match header.channels.list[line.location.channel].sample_type {
                SampleType::F32 => place((row, size), slot, start, line.value, f32::from_ne_bytes),
                SampleType::F16 => {
                    place((row, size), slot, start, line.value, |bytes| f16::from_ne_bytes(bytes).to_f32());
                }
                SampleType::U32 => {
                    place((row, size), slot, start, line.value, |bytes| u32::from_ne_bytes(bytes) as f32);
                }
            }
        }
    }
}

/// Copies samples of one channel to a row with pixels of `size` bytes, from a column on that may lie outside of the row.
fn place<const N: usize>(
    (row, size): (&mut [u8], usize),
    slot: usize,
    start: i64,
    samples: &[u8],
    value: impl Fn([u8; N]) -> f32,
) {
    let (skipped, start) = if start < 0 { (start.unsigned_abs() as usize, 0) } else { (0, start as usize) };
    let pixels = row.chunks_exact_mut(size).skip(start);
    for (pixel, &sample) in pixels.zip(samples.as_chunks().0.iter().skip(skipped)) {
        pixel[4 * slot..4 * slot + 4].copy_from_slice(&value(sample).to_ne_bytes());
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
