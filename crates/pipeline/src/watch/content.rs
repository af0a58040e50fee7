//! Contents of files, identified by hashes that are recomputed only if the file may have changed.

use std::collections::HashMap;
use std::fs::Metadata;
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use super::outputs::Outputs;
use crate::assets::{Companion, FileHash};
use crate::control::{CancelToken, Cancelled};
use crate::scene::fingerprint::Fingerprint;
use crate::system::file::{self, FileKind};

/// A file that a request read or tried to read.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct FileRead {
    /// Path of the file.
    pub path: PathBuf,
    /// Hash of the decoded bytes; for files that were not decoded, the content at about that time.
    pub content: Content,
}

/// Content of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Content {
    /// The file does not exist.
    Missing,
    /// Not a regular file, or not readable.
    Unusable(Obstacle),
    /// A regular file. The hash covers its bytes or, for a very long file, its metadata.
    Hash([u8; 32]),
}

/// Why a file cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Obstacle {
    /// A directory.
    Folder,
    /// A pipe, a socket or a device.
    Special,
    /// A file in a kernel file system such as `/proc`.
    Kernel,
    /// The file cannot be opened or read.
    Error(ErrorKind),
}

impl Content {
    /// Adds the content to a stage's fingerprint.
    pub(crate) fn add_to(self, key: &mut Fingerprint) {
        match self {
            Self::Missing => key.u64(0),
            Self::Unusable(_) => key.u64(1),
            Self::Hash(hash) => key.u64(2).bytes(&hash),
        };
    }
}

/// Changes within this time may get the same time stamp on some file systems.
const STAMP_RESOLUTION: Duration = Duration::from_secs(2);
/// Maximum number of bytes that are hashed, which covers the longest file that is decoded. Longer files are compared by
/// their metadata, so that a sparse file of terabytes is not read.
const MAX_HASHED: u64 = 4 << 30;
/// Bytes between two checks of the token.
const CHUNK: usize = 1 << 20;

/// Cache of file hashes.
#[derive(Debug, Default)]
pub struct Contents {
    known: Mutex<HashMap<PathBuf, (Stamp, Content)>>,
    /// Files that glimt wrote.
    pub outputs: Outputs,
    /// Files that were hashed.
    #[cfg(test)]
    pub(crate) hashed: Mutex<Vec<PathBuf>>,
    /// Replacement bytes of files, written right after the file has been hashed.
    #[cfg(test)]
    pub(crate) replacements: Mutex<HashMap<PathBuf, Vec<u8>>>,
}

/// File contents as seen by one request. Each file must have the same content throughout a request: a request that
/// notices a change starts again. The watcher finds later changes.
#[derive(Debug)]
pub(crate) struct Snapshot {
    contents: Arc<Contents>,
    seen: Mutex<HashMap<PathBuf, Content>>,
    changed: Mutex<Option<PathBuf>>,
}

impl Snapshot {
    pub(crate) fn of(contents: Arc<Contents>) -> Self {
        Self { contents, seen: Mutex::default(), changed: Mutex::default() }
    }

    /// Returns the content that this request first saw.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(crate) fn read(&self, path: &Path, token: &CancelToken) -> Result<Content, Cancelled> {
        if let Some(content) = self.known(path) {
            return Ok(content);
        }
        let content = self.contents.read(path, token)?;
        Ok(*self.seen().entry(path.to_owned()).or_insert(content))
    }

    /// Returns the content of a file from the hash of its decoded bytes. Notes a change if this request has seen
    /// another content.
    pub(crate) fn decoded(&self, path: &Path, hash: FileHash) -> Content {
        let content = Content::Hash(hash);
        if *self.seen().entry(path.to_owned()).or_insert(content) != content {
            *self.changed.lock().unwrap_or_else(PoisonError::into_inner) = Some(path.to_owned());
        }
        content
    }

    /// Returns a file that another file references, with the content that was decoded.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(crate) fn of_companion(
        &self,
        Companion { path, hash }: &Companion,
        token: &CancelToken,
    ) -> Result<FileRead, Cancelled> {
        let content = match hash {
            Some(hash) => self.decoded(path, *hash),
            None => self.read(path, token)?,
        };
        Ok(FileRead { path: path.clone(), content })
    }

    /// Returns a file that changed while this request was reading.
    pub(crate) fn changed(&self) -> Option<PathBuf> {
        self.changed.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns the content if this request has seen it.
    pub(crate) fn known(&self, path: &Path) -> Option<Content> {
        self.seen().get(path).copied()
    }

    fn seen(&self) -> MutexGuard<'_, HashMap<PathBuf, Content>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// File metadata that changes with every write, given some time between writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Stamp {
    device: u64,
    inode: u64,
    len: u64,
    modified: (i64, i64),
    changed: (i64, i64),
}

impl Stamp {
    fn of(metadata: &Metadata) -> Self {
        Self {
            device: metadata.dev(),
            inode: metadata.ino(),
            len: metadata.len(),
            modified: (metadata.mtime(), metadata.mtime_nsec()),
            changed: (metadata.ctime(), metadata.ctime_nsec()),
        }
    }

    /// Returns a substitute for the content of a file that is too long to hash.
    fn content(&self) -> Content {
        Content::Hash(*blake3::hash(format!("{self:?}").as_bytes()).as_bytes())
    }

    /// Whether a change after `now` is guaranteed to change the stamp.
    fn is_settled(&self, now: SystemTime) -> bool {
        let latest = self.modified.0.max(self.changed.0).max(0).unsigned_abs();
        let latest = SystemTime::UNIX_EPOCH + Duration::from_secs(latest);
        now.duration_since(latest).is_ok_and(|age| age > STAMP_RESOLUTION)
    }
}

impl Contents {
    /// Returns the current content of a file.
    ///
    /// # Errors
    /// [`Cancelled`], checked once per mebibyte.
    pub fn read(&self, path: &Path, token: &CancelToken) -> Result<Content, Cancelled> {
        token.check()?;
        let now = SystemTime::now();
        let metadata = match file::kind(path) {
            Ok((FileKind::Regular, metadata)) => metadata,
            Ok((FileKind::Folder, _)) => return Ok(Content::Unusable(Obstacle::Folder)),
            Ok((FileKind::Special, _)) => return Ok(Content::Unusable(Obstacle::Special)),
            Ok((FileKind::Kernel, _)) => return Ok(Content::Unusable(Obstacle::Kernel)),
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Content::Missing),
            Err(error) => return Ok(unreadable(&error)),
        };
        let stamp = Stamp::of(&metadata);
        let known = self.known().get(path).filter(|(known, _)| *known == stamp).map(|(_, content)| *content);
        if let Some(content) = known {
            return Ok(content);
        }
        let content = if stamp.len > MAX_HASHED { stamp.content() } else { self.hash(path, token)? };
        if stamp.is_settled(now) {
            self.known().insert(path.to_owned(), (stamp, content));
        } else {
            self.known().remove(path);
        }
        Ok(content)
    }

    /// Forgets all other files.
    pub fn retain(&self, mut keep: impl FnMut(&Path) -> bool) {
        self.known().retain(|path, _| keep(path));
    }

    fn hash(&self, path: &Path, token: &CancelToken) -> Result<Content, Cancelled> {
        #[cfg(test)]
        self.hashed.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
        let content = hash(path, token);
        #[cfg(test)]
        if let Some(bytes) = self.replacements.lock().unwrap_or_else(PoisonError::into_inner).remove(path) {
            std::fs::write(path, bytes).expect("replaced");
        }
        content
    }

    fn known(&self) -> MutexGuard<'_, HashMap<PathBuf, (Stamp, Content)>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn unreadable(error: &io::Error) -> Content {
    Content::Unusable(Obstacle::Error(error.kind()))
}

fn hash(path: &Path, token: &CancelToken) -> Result<Content, Cancelled> {
    let mut file = match file::open(path) {
        Ok(Ok((file, _))) => file,
        // The file has been replaced since its metadata was read.
        Ok(Err(FileKind::Folder)) => return Ok(Content::Unusable(Obstacle::Folder)),
        Ok(Err(FileKind::Special)) => return Ok(Content::Unusable(Obstacle::Special)),
        Ok(Err(FileKind::Regular | FileKind::Kernel)) => return Ok(Content::Unusable(Obstacle::Kernel)),
        Err(error) => return Ok(unreadable(&error)),
    };
    let mut hasher = blake3::Hasher::new();
    let mut buffer = vec![0; CHUNK];
    loop {
        token.check()?;
        match file.read(&mut buffer) {
            Ok(0) => return Ok(Content::Hash(*hasher.finalize().as_bytes())),
            Ok(count) => hasher.update(&buffer[..count]),
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Ok(unreadable(&error)),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, File};

    #[test]
    fn content_is_compared_not_time_stamps() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        let token = CancelToken::new();
        let contents = Contents::default();
        assert_eq!(contents.read(&path, &token), Ok(Content::Missing));
        fs::write(&path, "a").expect("written");
        let first = contents.read(&path, &token).expect("not cancelled");
        fs::write(&path, "b").expect("written");
        let second = contents.read(&path, &token).expect("not cancelled");
        assert_ne!(first, second, "the same length within one tick of the clock");
        fs::write(&path, "a").expect("written");
        assert_eq!(contents.read(&path, &token), Ok(first));
        assert_eq!(contents.read(folder.path(), &token), Ok(Content::Unusable(Obstacle::Folder)));
        #[cfg(target_os = "linux")]
        assert_eq!(contents.read(Path::new("/proc/kmsg"), &token), Ok(Content::Unusable(Obstacle::Kernel)));
    }

    #[test]
    fn huge_file_is_not_read() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        let file = File::create(&path).expect("a file");
        let token = CancelToken::new();
        let contents = Contents::default();
        let read = |len| {
            file.set_len(len).expect("a sparse file");
            contents.read(&path, &token).expect("not cancelled")
        };
        let first = read(3 << 40);
        assert!(matches!(first, Content::Hash(_)));
        assert_ne!(first, read((3 << 40) + 1));
    }

    #[test]
    fn request_sees_one_content_per_file() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        let token = CancelToken::new();
        let contents = Arc::new(Contents::default());
        let snapshot = Snapshot::of(contents.clone());
        fs::write(&path, "a").expect("written");
        let first = snapshot.read(&path, &token).expect("not cancelled");
        fs::write(&path, "b").expect("written");
        assert_eq!(snapshot.read(&path, &token), Ok(first));
        assert_ne!(Snapshot::of(contents).read(&path, &token), Ok(first), "the next request sees the change");
    }

    #[test]
    fn old_file_is_hashed_once() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        fs::write(&path, "a").expect("written");
        let stamp = Stamp::of(&fs::metadata(&path).expect("metadata"));
        assert!(!stamp.is_settled(SystemTime::now()));
        assert!(stamp.is_settled(SystemTime::now() + Duration::from_secs(4)));
        let contents = Contents::default();
        contents.known().insert(path.clone(), (stamp, Content::Unusable(Obstacle::Special)));
        let read = contents.read(&path, &CancelToken::new());
        assert_eq!(
            read,
            Ok(Content::Unusable(Obstacle::Special)),
            "the cached content is valid while the stamp is unchanged"
        );
    }
}
