//! Subsampled channels, whose files `exr` refuses. It reads the file as if every channel had a sample in every pixel; blocks are then
//! unpacked with the true sampling.

use std::io::{self, Read, Seek, SeekFrom};

use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::{Chunk, CompressedBlock};
use ::exr::compression::Compression;
use ::exr::error::Error;
use ::exr::meta::MetaData;
use ::exr::meta::header::Header;
use ::exr::prelude::Vec2;

/// Most bytes of the headers.
const HEADER_BYTES: u64 = 1 << 20;
/// Bytes before the first header: magic number and version.
const START: usize = 8;

/// Sampling of a channel, and the place of its eight bytes in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sampling {
    at: u64,
    by: Vec2<usize>,
}

/// The sampling of all channels, part by part. Empty if every pixel has a sample in all of them, or if the headers cannot be
/// followed: `exr` then names the fault.
pub(super) fn find(file: &mut (impl Read + Seek)) -> io::Result<Vec<Vec<Sampling>>> {
    let mut bytes = Vec::new();
    file.by_ref().take(HEADER_BYTES).read_to_end(&mut bytes)?;
    file.seek(SeekFrom::Start(0))?;
    let found = Headers { bytes: &bytes, at: START }.samplings().unwrap_or_default();
    let is_full = found.iter().flatten().all(|sampling| sampling.by == Vec2(1, 1));
    Ok(if is_full { Vec::new() } else { found })
}

/// The headers as bytes.
struct Headers<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Headers<'a> {
    fn samplings(mut self) -> Option<Vec<Vec<Sampling>>> {
        const MULTIPART: u8 = 0x10;
        let is_multipart = self.bytes.get(5)? & MULTIPART != 0;
        let mut parts = Vec::new();
        loop {
            let mut channels = None;
            while let name = self.text()?
                && !name.is_empty()
            {
                let kind = self.text()?;
                let size = self.word()?;
                let start = self.at;
                if name == b"channels" && kind == b"chlist" {
                    channels = Some(self.channels(start.checked_add(size)?)?);
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

    fn channels(&mut self, end: usize) -> Option<Vec<Sampling>> {
        const KIND_BYTES: usize = 8;
        let mut channels = Vec::new();
        while self.at < end && !self.text()?.is_empty() {
            self.at += KIND_BYTES;
            let at = self.at as u64;
            channels.push(Sampling { at, by: Vec2(self.word()?, self.word()?) });
        }
        Some(channels)
    }

    /// Bytes up to a zero.
    fn text(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..)?;
        let end = memchr::memchr(0, rest)?;
        self.at += end + 1;
        Some(&rest[..end])
    }

    fn word(&mut self) -> Option<usize> {
        let word = self.bytes.get(self.at..)?.first_chunk()?;
        self.at += 4;
        usize::try_from(i32::from_le_bytes(*word)).ok()
    }
}

/// A file in which every channel claims a sample in every pixel.
pub(super) struct Unsampled<R> {
    file: R,
    at: u64,
    /// Places of numbers that read as 1.
    ones: Vec<u64>,
}

impl<R> Unsampled<R> {
    pub(super) fn new(file: R, samplings: &[Vec<Sampling>]) -> Self {
        let places = samplings.iter().flatten().flat_map(|sampling| [sampling.at, sampling.at + 4]);
        Self { file, at: 0, ones: places.collect() }
    }
}

impl<R: Read> Read for Unsampled<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.file.read(buffer)?;
        for &place in &self.ones {
            for (byte, value) in (place..).zip(1_u32.to_le_bytes()) {
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

impl<R: Seek> Seek for Unsampled<R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}

/// Unpacks blocks of channels with these samplings.
pub(super) struct Unpacking(MetaData);

impl Unpacking {
    pub(super) fn new(meta: &MetaData, samplings: &[Vec<Sampling>]) -> Self {
        let mut meta = meta.clone();
        for (header, samplings) in meta.headers.iter_mut().zip(samplings) {
            for (channel, sampling) in header.channels.list.iter_mut().zip(samplings) {
                channel.sampling = sampling.by;
            }
        }
        Self(meta)
    }

    pub(super) fn headers(&self) -> &[Header] {
        &self.0.headers
    }

    /// Unpacks a block.
    pub(super) fn unpacked(&mut self, chunk: Chunk) -> Result<UncompressedBlock, Error> {
        let part = chunk.layer_index;
        let Some(header) = self.0.headers.get(part).filter(|header| is_subsampled(header)) else {
            return UncompressedBlock::decompress_chunk(chunk, &self.0, false);
        };
        let tile = header.get_block_data_indices(&chunk.compressed_block)?;
        let pixels = header.get_absolute_block_pixel_coordinates(tile)?;
        let top = usize::try_from(pixels.position.y()).unwrap_or_default();
        let rows = top..top + pixels.size.height();
        let bytes: usize = rows.map(|row| row_bytes(header, row, pixels.size.width())).sum();
        // `exr` expects the bytes of a pixel times the pixels.
        if !bytes.is_multiple_of(pixels.size.area()) {
            return Err(Error::NotSupported("this subsampling of its channels".into()));
        }
        let packed = match &chunk.compressed_block {
            CompressedBlock::ScanLine(block) => block.compressed_pixels_le.len(),
            CompressedBlock::Tile(block) => block.compressed_pixels_le.len(),
            CompressedBlock::DeepScanLine(_) | CompressedBlock::DeepTile(_) => bytes,
        };
        // `exr` takes the subsampled channels of a B44 block for larger ones.
        if matches!(header.compression, Compression::B44 | Compression::B44A) && packed != bytes {
            let reason = "B44 compression of subsampled channels; save it with ZIP or PIZ";
            return Err(Error::NotSupported(reason.into()));
        }
        self.0.headers[part].channels.bytes_per_pixel = bytes / pixels.size.area();
        UncompressedBlock::decompress_chunk(chunk, &self.0, false)
    }
}

fn is_subsampled(header: &Header) -> bool {
    header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1))
}

/// Bytes of a row of the data window in all channels.
fn row_bytes(header: &Header, row: usize, width: usize) -> usize {
    let channels = header.channels.list.iter().filter(|channel| row.is_multiple_of(channel.sampling.y()));
    channels.map(|channel| width / channel.sampling.x() * channel.sample_type.bytes_per_sample()).sum()
}
