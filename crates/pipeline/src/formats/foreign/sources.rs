//! Reads the text files of a foreign scene.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::assets::{AssetError, Companion, FileHash, TextFile, read_text_file};
use crate::control::CancelToken;
use crate::scene::{MAX_FILE_BYTES, SourceFiles};

/// Maximum number of files in a scene.
const MAX_FILES: usize = 10_000;

/// The text files of a foreign scene that have been read so far.
#[derive(Debug, Default)]
pub(crate) struct SourceReader {
    /// The texts of the files.
    pub(crate) files: SourceFiles,
    /// Hash of the first file.
    pub(crate) hash: FileHash,
    /// All files except the first, including missing ones.
    pub(crate) companions: Vec<Companion>,
    count: usize,
}

impl SourceReader {
    /// Reads a file. Returns its text, and the offset of the text in the concatenation of all files.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or is not UTF-8, or if there are too many files or bytes.
    pub(crate) fn read(&mut self, path: &Path, token: &CancelToken) -> Result<(Arc<str>, usize), AssetError> {
        if self.count >= MAX_FILES {
            return Err(AssetError::malformed(
                path,
                None,
                format!("more than {MAX_FILES} files are included"),
            ));
        }
        let rest = MAX_FILE_BYTES.saturating_sub(self.files.total_bytes() as u64);
        let TextFile { text, hash, stamp } = match read_text_file(path, rest, token) {
            Ok(read) => read,
            Err(error) => {
                if self.count > 0 {
                    self.companions.push(Companion { path: path.to_owned(), hash: None, stamp: None });
                }
                return Err(error);
            }
        };
        match self.count {
            0 => self.hash = hash,
            _ => self.companions.push(Companion { path: path.to_owned(), hash: Some(hash), stamp }),
        }
        self.count += 1;
        let start = self.files.add(path, Arc::clone(&text));
        Ok((text, start))
    }

    /// Watches a missing file, so that the scene is reloaded when the file appears.
    pub(crate) fn watch_missing(&mut self, path: PathBuf) {
        self.companions.push(Companion { path, hash: None, stamp: None });
    }
}
