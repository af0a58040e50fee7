//! File contents, identified by hashes that are recomputed only if the file may have changed.

use std::collections::HashMap;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use super::outputs::Outputs;
use crate::assets::{Companion, FileHash};
use crate::control::{CancelToken, Cancelled};
use crate::scene::fingerprint::FingerprintHasher;
use crate::system::file::{self, FileKind, FileStamp};

/// A file that a request read or tried to read.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct FileRead {
    /// Path of the file.
    pub path: PathBuf,
    /// The decoded content or, if the file was not decoded, its content during the request.
    pub content: Content,
}

/// Content of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Content {
    /// The file does not exist.
    Missing,
    /// Not a regular file, or not readable.
    Unusable(Obstacle),
    /// Hash of a regular file's bytes, or of its metadata if the file is very long.
    Hash([u8; 32]),
}

/// Reasons why a file cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Obstacle {
    /// A directory.
    Folder,
    /// A pipe, a socket or a device.
    Special,
    /// A file in a kernel file system, such as `/proc`.
    Kernel,
    /// The file cannot be opened or read.
    Error(ErrorKind),
}

impl Content {
    /// Adds the content to a stage's fingerprint.
    pub(crate) fn add_to(self, key: &mut FingerprintHasher) {
        match self {
            Self::Missing => key.u64(0),
            Self::Unusable(_) => key.u64(1),
            Self::Hash(hash) => key.u64(2).bytes(&hash),
        };
    }
}

/// Changes within this time may result in the same timestamp on some file systems.
const STAMP_RESOLUTION: Duration = Duration::from_secs(2);
/// Maximum length of a hashed file, in bytes. Longer files are never decoded. They are compared by metadata,
/// to avoid reading sparse files of several terabytes.
const MAX_HASHED: u64 = 4 << 30;
/// Number of bytes to read between checks of the token.
const CHUNK: usize = 1 << 20;

/// Cache of file hashes.
#[derive(Debug, Default)]
pub struct Contents {
    known: Mutex<HashMap<PathBuf, (FileStamp, Content)>>,
    /// Files written by glimt.
    pub outputs: Outputs,
    /// Files that have been hashed.
    #[cfg(test)]
    pub(crate) hashed: Mutex<Vec<PathBuf>>,
    /// Maps a path to another file and the bytes to be written to it right after the file at the path has
    /// been hashed.
    #[cfg(test)]
    pub(crate) replacements: Mutex<HashMap<PathBuf, (PathBuf, Vec<u8>)>>,
}

/// A file as first seen by a request.
#[derive(Clone, Copy, Debug)]
struct Seen {
    content: Content,
    /// The file's stamp before its content was read.
    stamp: Option<FileStamp>,
}

/// File contents as seen by a single request. A file's content must not change during a request. If it does,
/// the request starts again. The watcher detects later changes.
#[derive(Debug)]
pub(crate) struct Snapshot {
    contents: Arc<Contents>,
    /// Time before the first read.
    begun: SystemTime,
    seen: Mutex<HashMap<PathBuf, Seen>>,
    changed: Mutex<Option<PathBuf>>,
}

impl Snapshot {
    pub(crate) fn of(contents: Arc<Contents>) -> Self {
        Self { contents, begun: SystemTime::now(), seen: Mutex::default(), changed: Mutex::default() }
    }

    /// Returns a file's content as first seen by this request.
    ///
    /// # Errors
    /// Returns [`Cancelled`] if the token is cancelled.
    pub(crate) fn read(&self, path: &Path, token: &CancelToken) -> Result<Content, Cancelled> {
        if let Some(content) = self.known(path) {
            return Ok(content);
        }
        let stamp = FileStamp::of(path);
        let content = self.contents.read(path, token)?;
        Ok(self.seen().entry(path.to_owned()).or_insert(Seen { content, stamp }).content)
    }

    /// Returns the content of a file whose decoded bytes have this hash. Records a change if the content
    /// differs from what this request saw earlier.
    pub(crate) fn decoded(&self, path: &Path, hash: FileHash) -> Content {
        self.decoded_with_stamp(path, hash, None)
    }

    /// Like [`Snapshot::decoded`], but takes a stamp obtained before the file was read.
    fn decoded_with_stamp(&self, path: &Path, hash: FileHash, stamp: Option<FileStamp>) -> Content {
        let content = Content::Hash(hash);
        if self.seen().entry(path.to_owned()).or_insert(Seen { content, stamp }).content != content {
            self.record_change(path);
        }
        content
    }

    /// Returns a file referenced by another file, along with its decoded content.
    ///
    /// # Errors
    /// Returns [`Cancelled`] if the token is cancelled.
    pub(crate) fn read_companion(
        &self,
        Companion { path, hash, stamp }: &Companion,
        token: &CancelToken,
    ) -> Result<FileRead, Cancelled> {
        let content = match hash {
            Some(hash) => self.decoded_with_stamp(path, *hash, *stamp),
            None => self.read(path, token)?,
        };
        Ok(FileRead { path: path.clone(), content })
    }

    /// Records a change if a file's content differs from the content that this request first saw. Must be
    /// called after all files are loaded. Otherwise, a request could combine different versions of its files.
    /// A removed file does not count as changed.
    ///
    /// # Errors
    /// Returns [`Cancelled`] if the token is cancelled.
    pub(crate) fn verify(&self, token: &CancelToken) -> Result<(), Cancelled> {
        let seen: Vec<_> = self.seen().iter().map(|(path, seen)| (path.clone(), *seen)).collect();
        for (path, Seen { content, stamp }) in seen {
            let Some(now) = FileStamp::of(&path) else { continue };
            if Some(now) == stamp && is_settled(&now, self.begun) {
                continue;
            }
            let now = self.contents.read(&path, token)?;
            if now != Content::Missing && now != content {
                self.record_change(&path);
            }
        }
        Ok(())
    }

    fn record_change(&self, path: &Path) {
        *self.changed.lock().unwrap_or_else(PoisonError::into_inner) = Some(path.to_owned());
    }

    /// Returns a file that changed while this request was reading its files.
    pub(crate) fn changed(&self) -> Option<PathBuf> {
        self.changed.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns a file's content if this request has seen it.
    pub(crate) fn known(&self, path: &Path) -> Option<Content> {
        self.seen().get(path).map(|seen| seen.content)
    }

    fn seen(&self) -> MutexGuard<'_, HashMap<PathBuf, Seen>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Content to use for a file that is too long to hash.
fn content_of_stamp(stamp: &FileStamp) -> Content {
    Content::Hash(*blake3::hash(format!("{stamp:?}").as_bytes()).as_bytes())
}

/// Whether any change made after `now` is guaranteed to change the stamp.
fn is_settled(stamp: &FileStamp, now: SystemTime) -> bool {
    let latest = stamp.modified.0.max(stamp.changed.0).max(0).unsigned_abs();
    let latest = SystemTime::UNIX_EPOCH + Duration::from_secs(latest);
    now.duration_since(latest).is_ok_and(|age| age > STAMP_RESOLUTION)
}

impl Contents {
    /// Returns the current content of a file.
    ///
    /// # Errors
    /// Returns [`Cancelled`] if the token is cancelled. The token is checked once per mebibyte.
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
        let stamp = FileStamp::new(&metadata);
        let known = self.known().get(path).filter(|(known, _)| *known == stamp).map(|(_, content)| *content);
        if let Some(content) = known {
            return Ok(content);
        }
        let content = if stamp.len > MAX_HASHED { content_of_stamp(&stamp) } else { self.hash(path, token)? };
        if is_settled(&stamp, now) {
            self.known().insert(path.to_owned(), (stamp, content));
        } else {
            self.known().remove(path);
        }
        Ok(content)
    }

    /// Forgets all files for which `keep` returns false.
    pub fn retain(&self, mut keep: impl FnMut(&Path) -> bool) {
        self.known().retain(|path, _| keep(path));
    }

    fn hash(&self, path: &Path, token: &CancelToken) -> Result<Content, Cancelled> {
        #[cfg(test)]
        self.hashed.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
        let content = hash(path, token);
        #[cfg(test)]
        let replacement = self.replacements.lock().unwrap_or_else(PoisonError::into_inner).remove(path);
        #[cfg(test)]
        if let Some((path, bytes)) = replacement {
            std::fs::write(path, bytes).expect("replaced");
        }
        content
    }

    fn known(&self) -> MutexGuard<'_, HashMap<PathBuf, (FileStamp, Content)>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn unreadable(error: &io::Error) -> Content {
    Content::Unusable(Obstacle::Error(error.kind()))
}

fn hash(path: &Path, token: &CancelToken) -> Result<Content, Cancelled> {
    let mut file = match file::open(path) {
        Ok(Ok((file, _))) => file,
        // In these cases, the file has been replaced since its metadata was read.
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
    fn content_is_compared_instead_of_timestamps() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        let token = CancelToken::new();
        let contents = Contents::default();
        assert_eq!(contents.read(&path, &token), Ok(Content::Missing));
        fs::write(&path, "a").expect("written");
        let first = contents.read(&path, &token).expect("not cancelled");
        fs::write(&path, "b").expect("written");
        let second = contents.read(&path, &token).expect("not cancelled");
        assert_ne!(first, second, "a change should be detected at equal length and timestamp");
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
    fn file_content_is_fixed_during_a_request() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        let token = CancelToken::new();
        let contents = Arc::new(Contents::default());
        let snapshot = Snapshot::of(contents.clone());
        fs::write(&path, "a").expect("written");
        let first = snapshot.read(&path, &token).expect("not cancelled");
        fs::write(&path, "b").expect("written");
        assert_eq!(snapshot.read(&path, &token), Ok(first));
        assert_ne!(
            Snapshot::of(contents).read(&path, &token),
            Ok(first),
            "the next request should see the change"
        );
    }

    #[test]
    fn mixed_file_versions_are_detected() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let token = CancelToken::new();
        for version in ["old", "new"] {
            fs::create_dir(folder.path().join(version)).expect("a folder");
            for name in ["mesh", "texture", "library"] {
                fs::write(folder.path().join(version).join(name), format!("{version} {name}"))
                    .expect("written");
            }
            fs::write(folder.path().join(version).join("same"), "same").expect("written");
        }
        let current = folder.path().join("current");
        let show = |version| {
            let _ = fs::remove_file(&current);
            std::os::unix::fs::symlink(version, &current).expect("a link");
        };
        let [mesh, texture, library, same] =
            ["mesh", "texture", "library", "same"].map(|name| current.join(name));
        let hash_of = |path: &Path| *blake3::hash(&fs::read(path).expect("read")).as_bytes();
        let verified = |snapshot: &Snapshot| {
            snapshot.verify(&token).expect("not cancelled");
            snapshot.changed()
        };
        for is_decoded in [false, true] {
            show("old");
            let snapshot = Snapshot::of(Arc::default());
            snapshot.read(&same, &token).expect("not cancelled");
            if is_decoded {
                let (hash, stamp) = (Some(hash_of(&library)), FileStamp::of(&library));
                let companion = Companion { path: library.clone(), hash, stamp };
                show("new");
                snapshot.read_companion(&companion, &token).expect("not cancelled");
            } else {
                snapshot.read(&mesh, &token).expect("not cancelled");
                assert_eq!(verified(&snapshot), None);
                show("new");
            }
            snapshot.read(&texture, &token).expect("not cancelled");
            assert_eq!(verified(&snapshot), Some(if is_decoded { library.clone() } else { mesh.clone() }));
        }
        // Neither replacement with the same content nor removal is a change.
        show("old");
        let snapshot = Snapshot::of(Arc::default());
        snapshot.read(&same, &token).expect("not cancelled");
        show("new");
        assert_eq!(verified(&snapshot), None);
        fs::remove_file(&current).expect("removed");
        assert_eq!(verified(&snapshot), None);
    }

    #[test]
    fn change_within_the_stamp_resolution_is_detected() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        fs::write(&path, "new").expect("written");
        let (old, stamp) = (*blake3::hash(b"old").as_bytes(), FileStamp::of(&path));
        let token = CancelToken::new();
        for is_settled in [false, true] {
            let mut snapshot = Snapshot::of(Arc::default());
            if is_settled {
                snapshot.begun += Duration::from_secs(4);
            }
            snapshot.decoded_with_stamp(&path, old, stamp);
            snapshot.verify(&token).expect("not cancelled");
            // A file with a settled stamp is not read again.
            assert_eq!(snapshot.changed(), (!is_settled).then(|| path.clone()));
        }
    }

    #[test]
    fn old_file_is_hashed_once() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        fs::write(&path, "a").expect("written");
        let stamp = FileStamp::of(&path).expect("metadata");
        assert!(!is_settled(&stamp, SystemTime::now()));
        assert!(is_settled(&stamp, SystemTime::now() + Duration::from_secs(4)));
        let contents = Contents::default();
        contents.known().insert(path.clone(), (stamp, Content::Unusable(Obstacle::Special)));
        let read = contents.read(&path, &CancelToken::new());
        assert_eq!(
            read,
            Ok(Content::Unusable(Obstacle::Special)),
            "the cached content should be used while the stamp is unchanged"
        );
    }
}
