//! An open image, and the decoder that is chosen for its format.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::super::catch_panic::catch_panic;
use super::super::read::{self, Monitor};
use super::super::{AssetError, FileHash};
use super::counting_reader::ProgressReader;
use super::decode_thread::ProgressReporter;
use super::decoder::{
    ImageDecoderWithMetadata, checked_texel_memory_size, create_decoder, max_memory_to_file_ratio,
    read_orientation, stored_bytes_per_texel,
};
use super::encoding::ColorEncoding;
use super::messages::{
    EMPTY_EMBEDDED, EMPTY_FILE, shorten_decoder_error, undecodable_image_message, unknown_format_message,
};
use super::metadata::ImageColorMetadata;
use super::pfm::PfmDecoder;
use super::{
    EmbeddedImage, ImageLimits, decode_thread, hdr, jpeg, pfm, png, read_dimensions_and_memory_size,
};
use crate::control::{CancelToken, ignore_progress};
use crate::system::describe_io_error;

/// Maximum size of an image file.
const FILE_LIMIT: u64 = 4 << 30;
/// File size above which the header is checked before the rest of the file is read.
const CHECKED_FIRST: u64 = 16 << 20;

/// Bytes of an image: an open file, a file in memory, or an embedded image.
enum ImageStream {
    File(File),
    InMemory(Cursor<Vec<u8>>),
    Embedded(Cursor<Arc<[u8]>>),
}

impl Read for ImageStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(buffer),
            Self::InMemory(bytes) => bytes.read(buffer),
            Self::Embedded(bytes) => bytes.read(buffer),
        }
    }
}

impl Seek for ImageStream {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::InMemory(bytes) => bytes.seek(to),
            Self::Embedded(bytes) => bytes.seek(to),
        }
    }
}

/// An open image and its load settings.
pub(super) struct OpenImage {
    pub(super) path: PathBuf,
    file: ImageStream,
    pub(super) length: u64,
    limits: ImageLimits,
    token: CancelToken,
}

impl OpenImage {
    pub(super) fn open(path: &Path, limits: ImageLimits, token: &CancelToken) -> Result<Self, AssetError> {
        let (file, length) = read::open_regular_with_limit(path, FILE_LIMIT)?;
        if length == 0 {
            return Err(AssetError::malformed(path, None, EMPTY_FILE));
        }
        Ok(Self {
            path: path.to_owned(),
            file: ImageStream::File(file),
            length,
            limits,
            token: token.clone(),
        })
    }

    /// Reads a file into memory and hashes it. The hash matches the decoded bytes even if the file is
    /// replaced in the meantime.
    pub(super) fn open_in_memory_and_hash(
        path: &Path,
        encoding: ColorEncoding,
        limits: ImageLimits,
        token: &CancelToken,
    ) -> Result<(Self, FileHash), AssetError> {
        let (file, length) = read::open_regular_with_limit(path, FILE_LIMIT)?;
        if length > CHECKED_FIRST {
            // Avoid reading a large file that will be rejected.
            read_dimensions_and_memory_size(path, encoding, limits, token)?;
        }
        let unreadable = |error: io::Error| AssetError::from_io(path, &error);
        let without_text = match length > CHECKED_FIRST {
            true => png::read_without_text_chunks(&file, token),
            false => Ok(None),
        };
        token.check_pause_and_cancel()?;
        let (bytes, hash) = match without_text.map_err(unreadable)? {
            Some(found) => found,
            None => {
                let monitor = Monitor { progress: &ignore_progress, token };
                let bytes = read::read_rest(path, file, length, FILE_LIMIT, monitor)?;
                let hash = read::hash_bytes(&bytes);
                (bytes, hash)
            }
        };
        let length = bytes.len() as u64;
        if length == 0 {
            return Err(AssetError::malformed(path, None, EMPTY_FILE));
        }
        let file = ImageStream::InMemory(Cursor::new(bytes));
        Ok((Self { path: path.to_owned(), file, length, limits, token: token.clone() }, hash))
    }

    pub(super) fn from_embedded(
        image: EmbeddedImage<'_>,
        limits: ImageLimits,
        token: &CancelToken,
    ) -> Result<Self, AssetError> {
        let (path, length) = (image.path.to_owned(), image.bytes.len() as u64);
        if length == 0 {
            return Err(AssetError::malformed(&path, None, EMPTY_EMBEDDED));
        }
        let file = ImageStream::Embedded(Cursor::new(image.bytes));
        Ok(Self { path, file, length, limits, token: token.clone() })
    }

    /// Runs a decoder on a separate thread, catching panics.
    pub(super) fn run_on_decode_thread<T: Send + 'static>(
        self,
        monitor: Monitor<'_>,
        work: impl FnOnce(Self, ProgressReporter) -> Result<T, String> + Send + 'static,
    ) -> Result<T, AssetError> {
        let (path, length) = (self.path.clone(), self.length);
        let done =
            decode_thread::run_on_thread(monitor, length, move |report| catch_panic(|| work(self, report)))?;
        monitor.token.check_pause_and_cancel()?;
        let done = done.unwrap_or_else(|| Err("cannot start a decoder thread".to_owned()));
        done.unwrap_or_else(|panic| Err(format!("the decoder failed: {panic}")))
            .map_err(|reason| AssetError::malformed(&path, None, reason))
    }

    pub(super) fn decode(
        self,
        encoding: ColorEncoding,
        report: ProgressReporter,
    ) -> Result<(DynamicImage, ImageColorMetadata), String> {
        let ImageDecoderWithMetadata { mut decoder, metadata, .. } = self.open_decoder(encoding, report)?;
        let (width, height) = decoder.dimensions();
        let orientation = read_orientation(&mut *decoder).map_err(|error| shorten_decoder_error(&error))?;
        let image = DynamicImage::from_decoder(decoder);
        let mut image = image
            .map_err(|error| undecodable_image_message(width, height, &shorten_decoder_error(&error)))?;
        image.apply_orientation(orientation);
        Ok((image, metadata))
    }

    /// Creates a decoder after checking the limits.
    pub(super) fn open_decoder(
        mut self,
        encoding: ColorEncoding,
        report: ProgressReporter,
    ) -> Result<ImageDecoderWithMetadata, String> {
        let start = |bytes: &[u8]| ::image::guess_format(bytes).ok();
        let (mut in_memory, mut is_checked) = (0, true);
        match &mut self.file {
            ImageStream::File(_) => is_checked = false,
            ImageStream::InMemory(bytes) => {
                in_memory = self.length;
                if start(bytes.get_ref()) == Some(ImageFormat::Jpeg) {
                    jpeg::check_complete_bytes(bytes.get_ref())?;
                    jpeg::fix_adobe_color_transform(bytes.get_mut());
                }
            }
            ImageStream::Embedded(bytes) if start(bytes.get_ref()) == Some(ImageFormat::Jpeg) => {
                jpeg::check_complete_bytes(bytes.get_ref())?;
                if jpeg::wrong_adobe_transform_offset(bytes.get_ref()).is_some() {
                    let mut copy = bytes.get_ref().to_vec();
                    jpeg::fix_adobe_color_transform(&mut copy);
                    self.file = ImageStream::InMemory(Cursor::new(copy));
                }
            }
            ImageStream::Embedded(_) => {}
        }
        let mut bytes = BufReader::new(ProgressReader::new(self.file, self.length, report));
        let first = bytes.fill_buf().map_err(|error| describe_io_error(&error))?;
        let (is_hdr, is_pfm) = (first.starts_with(hdr::MAGIC), pfm::is_pfm(first));
        let mut reader =
            ImageReader::new(bytes).with_guessed_format().map_err(|error| describe_io_error(&error))?;
        if is_hdr {
            reader.set_format(ImageFormat::Hdr);
        }
        if is_pfm {
            reader.set_format(ImageFormat::Pnm);
        }
        if reader.format().is_none() {
            // TGA is the only format without a signature.
            let format = ImageFormat::from_path(&self.path).ok().filter(|format| *format == ImageFormat::Tga);
            reader.set_format(format.ok_or_else(unknown_format_message)?);
        }
        let is_jpeg = reader.format() == Some(ImageFormat::Jpeg);
        if is_jpeg && !is_checked {
            jpeg::check_complete(&self.path, self.limits.memory_bytes, &self.token)?;
        }
        let expansion = max_memory_to_file_ratio(reader.format());
        let chosen = if is_pfm {
            PfmDecoder::new(reader.into_inner())
                .map(|decoder| (Box::new(decoder) as _, ImageColorMetadata::default()))
        } else {
            create_decoder(reader, encoding, self.limits.memory_bytes)
        };
        let (decoder, metadata) = chosen.map_err(|error| shorten_decoder_error(&error))?;
        let held_bytes = if is_jpeg { self.length } else { 0 };
        let texel = stored_bytes_per_texel(decoder.color_type(), encoding, &metadata);
        let texel_bytes = checked_texel_memory_size(
            &*decoder,
            texel,
            [self.length, held_bytes, in_memory],
            self.limits,
            expansion,
        )?;
        if is_jpeg {
            let (width, height) = decoder.dimensions();
            jpeg::check_plausible_size(width, height, self.length)?;
        }
        Ok(ImageDecoderWithMetadata { decoder, metadata, texel_bytes })
    }
}
