//! Lists the files that a glTF file references, without loading its buffers or images.

use std::fmt;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::{Deserializer, Error, Visitor};

use super::container::{BOM, JSON_LIMIT};
use super::resolve_relative_uri;
use crate::assets::read;
use crate::control::{CancelToken, Canceled};

/// The URIs in a glTF file. Everything else in the file is ignored, valid or not.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct UriReferences {
    buffers: Vec<BufferOrImage>,
    images: Vec<BufferOrImage>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct BufferOrImage {
    uri: Option<FileUri>,
}

/// A file URI, or `None` for a data URI, whose contents are not copied.
#[derive(Debug)]
struct FileUri(Option<String>);

impl<'de> Deserialize<'de> for FileUri {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct UriVisitor;
        impl Visitor<'_> for UriVisitor {
            type Value = FileUri;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a URI")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<FileUri, E> {
                Ok(FileUri((!text.starts_with("data:")).then(|| text.to_owned())))
            }
        }
        deserializer.deserialize_str(UriVisitor)
    }
}

/// A reader that fails once the token is canceled.
struct CancelableReader<'a, R> {
    reader: R,
    token: &'a CancelToken,
}

impl<R: Read> Read for CancelableReader<'_, R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.token.check_pause_and_cancel().map_err(io::Error::other)?;
        self.reader.read(bytes)
    }
}

/// Lists the buffer and image files that a glTF file references, including unused ones. Reads only the JSON,
/// without keeping it in memory. Returns an empty list if the file is unreadable or its JSON is invalid.
///
/// # Errors
/// Returns [`Canceled`] if the token is canceled.
pub fn referenced_files(path: &Path, token: &CancelToken) -> Result<Vec<PathBuf>, Canceled> {
    let references = open_json_reader(path, token).ok().and_then(|json| serde_json::from_reader(json).ok());
    token.check_pause_and_cancel()?;
    let UriReferences { buffers, images } = references.unwrap_or_default();
    let uris = buffers.into_iter().chain(images).filter_map(|reference| reference.uri?.0);
    Ok(uris.filter_map(|uri| resolve_relative_uri(path, &uri).ok()).collect())
}

/// Opens the JSON in a glTF file.
fn open_json_reader<'a>(path: &Path, token: &'a CancelToken) -> io::Result<impl Read + use<'a>> {
    /// Number of bytes that precede the JSON in a GLB file (4.4.2): the file header and the first chunk's
    /// length and type.
    const BEFORE_JSON: u64 = 20;
    const BUFFER: usize = 1 << 16;
    let (mut file, _) = read::open_regular_with_limit(path, u64::MAX).map_err(io::Error::other)?;
    let mut header = Vec::new();
    (&mut file).take(BEFORE_JSON).read_to_end(&mut header)?;
    let (before, length) = match header[..] {
        [b'g', b'l', b'T', b'F', _, _, _, _, _, _, _, _, a, b, c, d, ..] => {
            (BEFORE_JSON, u32::from_le_bytes([a, b, c, d]) as usize)
        }
        _ => (0, JSON_LIMIT),
    };
    file.seek(SeekFrom::Start(before))?;
    let json = CancelableReader { reader: file.take(length.min(JSON_LIMIT) as u64), token };
    let mut json = BufReader::with_capacity(BUFFER, json);
    if json.fill_buf()?.starts_with(BOM) {
        json.consume(BOM.len());
    }
    Ok(json)
}
