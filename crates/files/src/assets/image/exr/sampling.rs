//! Support for subsampled channels, which `exr` rejects. The headers are patched so that `exr` sees no
//! subsampling, and the blocks are decompressed with the actual sampling.

use std::io::{self, Read, Seek, SeekFrom};

use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::{Chunk, CompressedBlock};
use ::exr::compression::Compression;
use ::exr::error::Error;
use ::exr::meta::MetaData;
use ::exr::meta::header::Header;
use ::exr::prelude::Vec2;

/// Maximum size of the EXR headers in bytes.
const HEADER_BYTES: u64 = 1 << 20;
/// Offset of the first header, after the magic number and version.
const FIRST_HEADER_OFFSET: usize = 8;

/// A channel's subsampling factors, and the file offset of the two integers that store them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChannelSampling {
    at: u64,
    step: Vec2<usize>,
}

/// Reads the subsampling factors of all channels in each part. Returns an empty list if no channel is
/// subsampled, or if the headers are malformed, which `exr` then reports.
pub(super) fn read_samplings_if_subsampled(
    file: &mut (impl Read + Seek),
) -> io::Result<Vec<Vec<ChannelSampling>>> {
    let mut bytes = Vec::new();
    file.by_ref().take(HEADER_BYTES).read_to_end(&mut bytes)?;
    file.seek(SeekFrom::Start(0))?;
    let found = HeaderParser { bytes: &bytes, at: FIRST_HEADER_OFFSET }.parse_samplings().unwrap_or_default();
    let is_full = found.iter().flatten().all(|sampling| sampling.step == Vec2(1, 1));
    Ok(if is_full { Vec::new() } else { found })
}

/// Parser for EXR headers.
struct HeaderParser<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> HeaderParser<'a> {
    fn parse_samplings(mut self) -> Option<Vec<Vec<ChannelSampling>>> {
        const MULTIPART: u8 = 0x10;
        let is_multipart = self.bytes.get(5)? & MULTIPART != 0;
        let mut parts = Vec::new();
        loop {
            let mut channels = None;
            while let name = self.read_c_string()?
                && !name.is_empty()
            {
                let kind = self.read_c_string()?;
                let size = self.read_nonnegative_i32()?;
                let start = self.at;
                if name == b"channels" && kind == b"chlist" {
                    channels = Some(self.parse_channel_list(start.checked_add(size)?)?);
                }
                self.at = start.checked_add(size)?;
            }
            let is_last = channels.is_none();
            parts.extend(channels);
            if is_last || !is_multipart {
                return Some(parts);
            }
        }
    }

    fn parse_channel_list(&mut self, end: usize) -> Option<Vec<ChannelSampling>> {
        const KIND_BYTES: usize = 8;
        let mut channels = Vec::new();
        while self.at < end && !self.read_c_string()?.is_empty() {
            self.at += KIND_BYTES;
            let at = self.at as u64;
            channels.push(ChannelSampling {
                at,
                step: Vec2(self.read_nonnegative_i32()?, self.read_nonnegative_i32()?),
            });
        }
        Some(channels)
    }

    /// Reads a zero-terminated string.
    fn read_c_string(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..)?;
        let end = memchr::memchr(0, rest)?;
        self.at += end + 1;
        Some(&rest[..end])
    }

    fn read_nonnegative_i32(&mut self) -> Option<usize> {
        let word = self.bytes.get(self.at..)?.first_chunk()?;
        self.at += 4;
        usize::try_from(i32::from_le_bytes(*word)).ok()
    }
}

/// Wraps a file and patches its headers while reading, so that no channel appears to be subsampled.
pub(super) struct SubsamplingHidingReader<R> {
    file: R,
    at: u64,
    /// File offsets of the integers that are replaced with 1.
    ones: Vec<u64>,
}

impl<R> SubsamplingHidingReader<R> {
    pub(super) fn new(file: R, samplings: &[Vec<ChannelSampling>]) -> Self {
        let offsets = samplings.iter().flatten().flat_map(|sampling| [sampling.at, sampling.at + 4]);
        Self { file, at: 0, ones: offsets.collect() }
    }
}

impl<R: Read> Read for SubsamplingHidingReader<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.file.read(buffer)?;
        for &offset in &self.ones {
            for (byte, value) in (offset..).zip(1_u32.to_le_bytes()) {
                let index = byte.checked_sub(self.at).filter(|index| *index < got as u64);
                if let Some(index) = index {
                    buffer[index as usize] = value;
                }
            }
        }
        self.at += got as u64;
        Ok(got)
    }
}

impl<R: Seek> Seek for SubsamplingHidingReader<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}

/// Decompresses blocks with the actual subsampling factors.
pub(super) struct BlockDecompressor(MetaData);

impl BlockDecompressor {
    pub(super) fn new(meta: &MetaData, samplings: &[Vec<ChannelSampling>]) -> Self {
        let mut meta = meta.clone();
        for (header, samplings) in meta.headers.iter_mut().zip(samplings) {
            for (channel, sampling) in header.channels.list.iter_mut().zip(samplings) {
                channel.sampling = sampling.step;
            }
        }
        Self(meta)
    }

    pub(super) fn headers_with_subsampling(&self) -> &[Header] {
        &self.0.headers
    }

    /// Decompresses a block.
    pub(super) fn decompress(&mut self, chunk: Chunk) -> Result<UncompressedBlock, Error> {
        let part = chunk.layer_index;
        let Some(header) = self.0.headers.get(part).filter(|header| has_subsampled_channels(header)) else {
            return UncompressedBlock::decompress_chunk(chunk, &self.0, false);
        };
        let tile = header.get_block_data_indices(&chunk.compressed_block)?;
        let pixels = header.get_absolute_block_pixel_coordinates(tile)?;
        let top = usize::try_from(pixels.position.y()).unwrap_or_default();
        let rows = top..top + pixels.size.height();
        let bytes: usize = rows.map(|row| row_size_in_bytes(header, row, pixels.size.width())).sum();
        // `exr` expects the block size to be a multiple of the number of pixels.
        if !bytes.is_multiple_of(pixels.size.area()) {
            return Err(Error::NotSupported("this channel subsampling".into()));
        }
        let packed = match &chunk.compressed_block {
            CompressedBlock::ScanLine(block) => block.compressed_pixels_le.len(),
            CompressedBlock::Tile(block) => block.compressed_pixels_le.len(),
            CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => bytes,
        };
        // In B44 blocks, `exr` assumes the wrong size for subsampled channels.
        if matches!(header.compression, Compression::B44 | Compression::B44A) && packed != bytes {
            let reason = "B44 compression of subsampled channels; save it with ZIP or PIZ";
            return Err(Error::NotSupported(reason.into()));
        }
        self.0.headers[part].channels.bytes_per_pixel = bytes / pixels.size.area();
        UncompressedBlock::decompress_chunk(chunk, &self.0, false)
    }
}

fn has_subsampled_channels(header: &Header) -> bool {
    header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1))
}

/// Size in bytes of a row of pixels, including all channels.
fn row_size_in_bytes(header: &Header, row: usize, width: usize) -> usize {
    let channels = header.channels.list.iter().filter(|channel| row.is_multiple_of(channel.sampling.y()));
    channels.map(|channel| width / channel.sampling.x() * channel.sample_type.bytes_per_sample()).sum()
}
