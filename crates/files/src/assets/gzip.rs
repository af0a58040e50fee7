//! Reads gzip files, such as compressed meshes of foreign scenes.

use std::io::Read;
use std::path::Path;

use super::{AssetError, FileHash, read};
use crate::control::{CancelToken, ignore_progress};
use crate::system::file::FileStamp;

/// The content of a gzip file.
#[derive(Clone, Debug)]
pub struct GzipFile {
    /// The decompressed bytes.
    pub bytes: Vec<u8>,
    /// Hash of the compressed file.
    pub hash: FileHash,
    /// Stamp of the file, taken before it was read.
    pub stamp: Option<FileStamp>,
}

/// Decompresses a gzip file (RFC 1952) of at most `limit` bytes, compressed and decompressed.
///
/// # Errors
/// [`AssetError::Unreadable`], or [`AssetError::Malformed`] if the file is not a gzip file or is too large.
pub fn read_gzip_file(path: &Path, limit: u64, token: &CancelToken) -> Result<GzipFile, AssetError> {
    let stamp = FileStamp::from_path(path);
    let monitor = read::Monitor { progress: &ignore_progress, token };
    let compressed = read::read_unless_zeros_in_magic(path, limit, monitor)?;
    let hash = read::hash_bytes(&compressed);
    let mut bytes = Vec::new();
    let decoder = flate2::read::MultiGzDecoder::new(&compressed[..]);
    decoder
        .take(limit + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| AssetError::malformed(path, None, format!("this gzip file is damaged: {error}")))?;
    if bytes.len() as u64 > limit {
        let reason = format!("its content is larger than {} MiB", limit >> 20);
        return Err(AssetError::malformed(path, None, reason));
    }
    Ok(GzipFile { bytes, hash, stamp })
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    #[test]
    fn gzip_files_are_decompressed_up_to_a_limit() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.gz");
        let mut encoder = flate2::write::GzEncoder::new(
            std::fs::File::create(&path).expect("a file"),
            flate2::Compression::fast(),
        );
        encoder.write_all(&[7; 5000]).expect("written");
        encoder.finish().expect("written");
        let read = |limit| read_gzip_file(&path, limit, &CancelToken::new()).map(|file| file.bytes);
        assert_eq!(read(5000).expect("bytes"), [7; 5000]);
        assert!(matches!(read(4999), Err(AssetError::Malformed { .. })));
        let bytes = std::fs::read(&path).expect("read");
        std::fs::write(&path, &bytes[..bytes.len() - 9]).expect("written");
        assert!(matches!(read(5000), Err(AssetError::Malformed { .. })));
    }
}
