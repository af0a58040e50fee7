//! File contents, identified by hashes that are recomputed only if the file may have changed.

use std::collections::HashMap;
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use super::outputs::WrittenOutputs;
use crate::assets::{Companion, FileHash};
use crate::control::{CancelToken, Canceled};
use crate::scene::fingerprint::FingerprintHasher;
use crate::system::file::{self, FileKind, FileStamp};

/// A file that a request read or tried to read.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct FilePathAndContentId {
    /// Path of the file.
    pub path: PathBuf,
    /// The decoded content or, if the file was not decoded, its content during the request.
    pub content: FileContentId,
}

/// Content of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FileContentId {
    /// The file does not exist.
    Missing,
    /// Not a regular file, or not readable.
    Unusable(UnreadableReason),
    /// Hash of a regular file's bytes, or of its metadata if the file is very long.
    Hash([u8; 32]),
}

/// Reasons why a file cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UnreadableReason {
    /// A directory.
    Folder,
    /// A pipe, a socket or a device.
    Special,
    /// A file in a kernel file system, such as `/proc`.
    Kernel,
    /// The file cannot be opened or read.
    Error(ErrorKind),
}

impl FileContentId {
    /// Adds the content to a stage's fingerprint.
    pub(crate) fn add_to_fingerprint(self, key: &mut FingerprintHasher) {
        match self {
            Self::Missing => key.add_u64(0),
            Self::Unusable(_) => key.add_u64(1),
            Self::Hash(hash) => key.add_u64(2).add_bytes(&hash),
        };
    }
}

/// Changes within this time may result in the same timestamp on some file systems.
const STAMP_RESOLUTION: Duration = Duration::from_secs(2);
/// Maximum length of a hashed file, in bytes. Longer files are never decoded, and they are compared by
/// metadata to avoid reading sparse files of several terabytes.
const MAX_HASHED: u64 = 4 << 30;
/// Number of bytes to read between checks of the token.
const BYTES_PER_POLL: usize = 1 << 20;

/// Cache of file hashes.
#[derive(Debug, Default)]
pub struct FileHashCache {
    known: Mutex<HashMap<PathBuf, (FileStamp, FileContentId)>>,
    /// Files written by glimt.
    pub outputs: WrittenOutputs,
    /// Files that have been hashed.
    #[cfg(test)]
    pub(crate) hashed: Mutex<Vec<PathBuf>>,
    /// Maps a path to a second file and to the bytes that are written to that file right after the file at
    /// the path has been hashed.
    #[cfg(test)]
    pub(crate) replacements: Mutex<HashMap<PathBuf, (PathBuf, Vec<u8>)>>,
}

/// A file as first seen by a request.
#[derive(Clone, Copy, Debug)]
struct FirstSeenFile {
    content: FileContentId,
    /// The file's stamp before its content was read.
    stamp: Option<FileStamp>,
}

/// File contents as seen by a single request. A file's content must not change during a request. If it does,
/// the request starts again. The watcher detects later changes.
#[derive(Debug)]
pub(crate) struct FilesSeenByRequest {
    contents: Arc<FileHashCache>,
    /// Time before the first read.
    begun: SystemTime,
    seen: Mutex<HashMap<PathBuf, FirstSeenFile>>,
    changed: Mutex<Option<PathBuf>>,
}

impl FilesSeenByRequest {
    pub(crate) fn new(contents: Arc<FileHashCache>) -> Self {
        Self { contents, begun: SystemTime::now(), seen: Mutex::default(), changed: Mutex::default() }
    }

    /// Returns a file's content as first seen by this request.
    ///
    /// # Errors
    /// Returns [`Canceled`] if the token is canceled.
    pub(crate) fn first_seen_content_id(
        &self,
        path: &Path,
        token: &CancelToken,
    ) -> Result<FileContentId, Canceled> {
        if let Some(content) = self.content_id_if_seen(path) {
            return Ok(content);
        }
        let stamp = FileStamp::from_path(path);
        let content = self.contents.read_content_id(path, token)?;
        Ok(self.lock_seen_files().entry(path.to_owned()).or_insert(FirstSeenFile { content, stamp }).content)
    }

    /// Returns the content of a file whose decoded bytes have this hash. Records a change if the content
    /// differs from the content that this request saw earlier.
    pub(crate) fn record_decoded(&self, path: &Path, hash: FileHash) -> FileContentId {
        self.record_decoded_with_stamp(path, hash, None)
    }

    /// Like [`FilesSeenByRequest::record_decoded`], but takes a stamp obtained before the file was read.
    fn record_decoded_with_stamp(
        &self,
        path: &Path,
        hash: FileHash,
        stamp: Option<FileStamp>,
    ) -> FileContentId {
        let content = FileContentId::Hash(hash);
        if self.lock_seen_files().entry(path.to_owned()).or_insert(FirstSeenFile { content, stamp }).content
            != content
        {
            self.record_change(path);
        }
        content
    }

    /// Returns a file referenced by another file, along with its decoded content.
    ///
    /// # Errors
    /// Returns [`Canceled`] if the token is canceled.
    pub(crate) fn record_companion(
        &self,
        Companion { path, hash, stamp }: &Companion,
        token: &CancelToken,
    ) -> Result<FilePathAndContentId, Canceled> {
        let content = match hash {
            Some(hash) => self.record_decoded_with_stamp(path, *hash, *stamp),
            None => self.first_seen_content_id(path, token)?,
        };
        Ok(FilePathAndContentId { path: path.clone(), content })
    }

    /// Records a change if a file's content differs from the content that this request first saw. Must be
    /// called after all files are loaded. Otherwise, a request could combine different versions of its files.
    /// A removed file does not count as changed.
    ///
    /// # Errors
    /// Returns [`Canceled`] if the token is canceled.
    pub(crate) fn record_changes_to_seen_files(&self, token: &CancelToken) -> Result<(), Canceled> {
        let seen: Vec<_> = self.lock_seen_files().iter().map(|(path, seen)| (path.clone(), *seen)).collect();
        for (path, FirstSeenFile { content, stamp }) in seen {
            let Some(now) = FileStamp::from_path(&path) else { continue };
            if Some(now) == stamp && is_stamp_reliable(&now, self.begun) {
                continue;
            }
            let now = self.contents.read_content_id(&path, token)?;
            if now != FileContentId::Missing && now != content {
                self.record_change(&path);
            }
        }
        Ok(())
    }

    /// Waits until no file has changed for [`SETTLE_TIME`], or until about that much time has passed. As a
    /// result, [`Self::record_changes_to_seen_files`] also detects a program that is still writing.
    ///
    /// # Errors
    /// Returns [`Canceled`] if the token is canceled.
    pub(crate) fn wait_for_writers(&self, token: &CancelToken) -> Result<(), Canceled> {
        let begun = Instant::now();
        loop {
            let now = SystemTime::now();
            let is_young = |path: &PathBuf| {
                let last_change =
                    FileStamp::from_path(path).and_then(|stamp| stamp.last_content_or_metadata_change());
                let age = last_change.and_then(|change| now.duration_since(change).ok());
                age.is_some_and(|age| age < SETTLE_TIME)
            };
            if begun.elapsed() > SETTLE_TIME || !self.lock_seen_files().keys().any(is_young) {
                return Ok(());
            }
            token.check_pause_and_cancel()?;
            std::thread::sleep(SETTLE_TIME / 20);
        }
    }

    fn record_change(&self, path: &Path) {
        *self.changed.lock().unwrap_or_else(PoisonError::into_inner) = Some(path.to_owned());
    }

    /// Returns a file that changed while this request was reading its files.
    pub(crate) fn changed_file(&self) -> Option<PathBuf> {
        self.changed.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns a file's content if this request has seen it.
    pub(crate) fn content_id_if_seen(&self, path: &Path) -> Option<FileContentId> {
        self.lock_seen_files().get(path).map(|seen| seen.content)
    }

    fn lock_seen_files(&self) -> MutexGuard<'_, HashMap<PathBuf, FirstSeenFile>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Time after which a file that has not changed is assumed to be complete.
const SETTLE_TIME: Duration = Duration::from_millis(100);

/// Content to use for a file that is too long to hash.
fn hash_stamp_as_content_id(stamp: &FileStamp) -> FileContentId {
    FileContentId::Hash(*blake3::hash(format!("{stamp:?}").as_bytes()).as_bytes())
}

/// Whether any change made after `now` is guaranteed to change the stamp.
fn is_stamp_reliable(stamp: &FileStamp, now: SystemTime) -> bool {
    let latest = stamp.modified.0.max(stamp.changed.0).max(0).unsigned_abs();
    let latest = SystemTime::UNIX_EPOCH + Duration::from_secs(latest);
    now.duration_since(latest).is_ok_and(|age| age > STAMP_RESOLUTION)
}

impl FileHashCache {
    /// Returns the current content of a file.
    ///
    /// # Errors
    /// Returns [`Canceled`] if the token is canceled. The token is checked once per mebibyte.
    pub fn read_content_id(&self, path: &Path, token: &CancelToken) -> Result<FileContentId, Canceled> {
        token.check_pause_and_cancel()?;
        let now = SystemTime::now();
        let metadata = match file::file_kind_and_metadata(path) {
            Ok((FileKind::Regular, metadata)) => metadata,
            Ok((FileKind::Folder, _)) => return Ok(FileContentId::Unusable(UnreadableReason::Folder)),
            Ok((FileKind::Special, _)) => return Ok(FileContentId::Unusable(UnreadableReason::Special)),
            Ok((FileKind::Kernel, _)) => return Ok(FileContentId::Unusable(UnreadableReason::Kernel)),
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(FileContentId::Missing),
            Err(error) => return Ok(unreadable_content_id(&error)),
        };
        let stamp = FileStamp::new(&metadata);
        let known =
            self.lock_entries().get(path).filter(|(known, _)| *known == stamp).map(|(_, content)| *content);
        if let Some(content) = known {
            return Ok(content);
        }
        let content = if stamp.len > MAX_HASHED {
            hash_stamp_as_content_id(&stamp)
        } else {
            self.hash_uncached(path, token)?
        };
        if is_stamp_reliable(&stamp, now) {
            self.lock_entries().insert(path.to_owned(), (stamp, content));
        } else {
            self.lock_entries().remove(path);
        }
        Ok(content)
    }

    /// Forgets all files for which `keep` returns false.
    pub fn retain(&self, mut keep: impl FnMut(&Path) -> bool) {
        self.lock_entries().retain(|path, _| keep(path));
    }

    fn hash_uncached(&self, path: &Path, token: &CancelToken) -> Result<FileContentId, Canceled> {
        #[cfg(test)]
        self.hashed.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
        let content = hash_file_contents(path, token);
        #[cfg(test)]
        let replacement = self.replacements.lock().unwrap_or_else(PoisonError::into_inner).remove(path);
        #[cfg(test)]
        if let Some((path, bytes)) = replacement {
            std::fs::write(path, bytes).expect("replaced");
        }
        content
    }

    fn lock_entries(&self) -> MutexGuard<'_, HashMap<PathBuf, (FileStamp, FileContentId)>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn unreadable_content_id(error: &io::Error) -> FileContentId {
    FileContentId::Unusable(UnreadableReason::Error(error.kind()))
}

fn hash_file_contents(path: &Path, token: &CancelToken) -> Result<FileContentId, Canceled> {
    let mut file = match file::open_regular_file(path) {
        Ok(Ok((file, _))) => file,
        // In these cases, the file has been replaced since its metadata was read.
        Ok(Err(FileKind::Folder)) => return Ok(FileContentId::Unusable(UnreadableReason::Folder)),
        Ok(Err(FileKind::Special)) => return Ok(FileContentId::Unusable(UnreadableReason::Special)),
        Ok(Err(FileKind::Regular | FileKind::Kernel)) => {
            return Ok(FileContentId::Unusable(UnreadableReason::Kernel));
        }
        Err(error) => return Ok(unreadable_content_id(&error)),
    };
    let mut hasher = blake3::Hasher::new();
    let mut buffer = vec![0; BYTES_PER_POLL];
    loop {
        token.check_pause_and_cancel()?;
        match file.read(&mut buffer) {
            Ok(0) => return Ok(FileContentId::Hash(*hasher.finalize().as_bytes())),
            Ok(count) => hasher.update(&buffer[..count]),
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Ok(unreadable_content_id(&error)),
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
        let contents = FileHashCache::default();
        assert_eq!(contents.read_content_id(&path, &token), Ok(FileContentId::Missing));
        fs::write(&path, "a").expect("written");
        let first = contents.read_content_id(&path, &token).expect("not canceled");
        fs::write(&path, "b").expect("written");
        let second = contents.read_content_id(&path, &token).expect("not canceled");
        assert_ne!(first, second, "a change should be detected at equal length and timestamp");
        fs::write(&path, "a").expect("written");
        assert_eq!(contents.read_content_id(&path, &token), Ok(first));
        assert_eq!(
            contents.read_content_id(folder.path(), &token),
            Ok(FileContentId::Unusable(UnreadableReason::Folder))
        );
        #[cfg(target_os = "linux")]
        assert_eq!(
            contents.read_content_id(Path::new("/proc/kmsg"), &token),
            Ok(FileContentId::Unusable(UnreadableReason::Kernel))
        );
    }

    #[test]
    fn huge_file_is_not_read() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        let file = File::create(&path).expect("a file");
        let token = CancelToken::new();
        let contents = FileHashCache::default();
        let read = |len| {
            file.set_len(len).expect("a sparse file");
            contents.read_content_id(&path, &token).expect("not canceled")
        };
        let first = read(3 << 40);
        assert!(matches!(first, FileContentId::Hash(_)));
        assert_ne!(first, read((3 << 40) + 1));
    }

    #[test]
    fn file_content_is_fixed_during_a_request() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        let token = CancelToken::new();
        let contents = Arc::new(FileHashCache::default());
        let snapshot = FilesSeenByRequest::new(contents.clone());
        fs::write(&path, "a").expect("written");
        let first = snapshot.first_seen_content_id(&path, &token).expect("not canceled");
        fs::write(&path, "b").expect("written");
        assert_eq!(snapshot.first_seen_content_id(&path, &token), Ok(first));
        assert_ne!(
            FilesSeenByRequest::new(contents).first_seen_content_id(&path, &token),
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
        let verified = |snapshot: &FilesSeenByRequest| {
            snapshot.record_changes_to_seen_files(&token).expect("not canceled");
            snapshot.changed_file()
        };
        for is_decoded in [false, true] {
            show("old");
            let snapshot = FilesSeenByRequest::new(Arc::default());
            snapshot.first_seen_content_id(&same, &token).expect("not canceled");
            if is_decoded {
                let (hash, stamp) = (Some(hash_of(&library)), FileStamp::from_path(&library));
                let companion = Companion { path: library.clone(), hash, stamp };
                show("new");
                snapshot.record_companion(&companion, &token).expect("not canceled");
            } else {
                snapshot.first_seen_content_id(&mesh, &token).expect("not canceled");
                assert_eq!(verified(&snapshot), None);
                show("new");
            }
            snapshot.first_seen_content_id(&texture, &token).expect("not canceled");
            assert_eq!(verified(&snapshot), Some(if is_decoded { library.clone() } else { mesh.clone() }));
        }
        // Neither replacement with the same content nor removal is a change.
        show("old");
        let snapshot = FilesSeenByRequest::new(Arc::default());
        snapshot.first_seen_content_id(&same, &token).expect("not canceled");
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
        let (old, stamp) = (*blake3::hash(b"old").as_bytes(), FileStamp::from_path(&path));
        let token = CancelToken::new();
        for is_settled in [false, true] {
            let mut snapshot = FilesSeenByRequest::new(Arc::default());
            if is_settled {
                snapshot.begun += Duration::from_secs(4);
            }
            snapshot.record_decoded_with_stamp(&path, old, stamp);
            snapshot.record_changes_to_seen_files(&token).expect("not canceled");
            // A file with a settled stamp is not read again.
            assert_eq!(snapshot.changed_file(), (!is_settled).then(|| path.clone()));
        }
    }

    #[test]
    fn new_files_settle_before_they_are_trusted() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        fs::write(&path, "half").expect("written");
        let (snapshot, token) = (FilesSeenByRequest::new(Arc::default()), CancelToken::new());
        snapshot.first_seen_content_id(&path, &token).expect("not canceled");
        snapshot.wait_for_writers(&token).expect("not canceled");
        let modified = fs::metadata(&path).and_then(|found| found.modified()).expect("metadata");
        assert!(modified.elapsed().is_ok_and(|age| age >= SETTLE_TIME));
    }

    #[test]
    fn old_file_is_hashed_once() {
        let folder = tempfile::tempdir().expect("a scratch folder");
        let path = folder.path().join("file");
        fs::write(&path, "a").expect("written");
        let stamp = FileStamp::from_path(&path).expect("metadata");
        assert!(!is_stamp_reliable(&stamp, SystemTime::now()));
        assert!(is_stamp_reliable(&stamp, SystemTime::now() + Duration::from_secs(4)));
        let contents = FileHashCache::default();
        contents
            .lock_entries()
            .insert(path.clone(), (stamp, FileContentId::Unusable(UnreadableReason::Special)));
        let read = contents.read_content_id(&path, &CancelToken::new());
        assert_eq!(
            read,
            Ok(FileContentId::Unusable(UnreadableReason::Special)),
            "the cached content should be used while the stamp is unchanged"
        );
    }
}
