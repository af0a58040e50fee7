//! Reads whole text files for readers of foreign scenes.

use std::path::Path;
use std::sync::Arc;

use super::{AssetError, FileHash, read};
use crate::control::{CancelToken, ignore_progress};
use crate::system::file::FileStamp;

/// A text file.
#[derive(Clone, Debug)]
pub struct TextFile {
    /// The text.
    pub text: Arc<str>,
    /// Hash of the file.
    pub hash: FileHash,
    /// Stamp of the file, taken before it was read.
    pub stamp: Option<FileStamp>,
}

/// Reads a UTF-8 text file of at most `limit` bytes.
///
/// # Errors
/// [`AssetError::Unreadable`], or [`AssetError::Malformed`] with the line if the file is not UTF-8 text.
pub fn read_text_file(path: &Path, limit: u64, token: &CancelToken) -> Result<TextFile, AssetError> {
    let stamp = FileStamp::from_path(path);
    let monitor = read::Monitor { progress: &ignore_progress, token };
    let bytes = read::read_text_bytes(path, limit, monitor)?;
    let hash = read::hash_bytes(&bytes);
    let text = String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = valid.iter().filter(|byte| **byte == b'\n').count() + 1;
        AssetError::malformed(path, Some(line), "this is not UTF-8 text; save it as UTF-8")
    })?;
    Ok(TextFile { text: text.into(), hash, stamp })
}
