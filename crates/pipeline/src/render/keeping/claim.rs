//! Checkpoints that this process has met: the one that it holds, and the last one that a person has heard of.

use std::fs::{File, TryLockError};
use std::path::Path;

use crate::output::FileIdentity;

/// Checkpoints that a process has met, whatever the request.
#[derive(Debug, Default)]
pub(crate) struct Claim {
    /// The checkpoint that it wrote or went on from. It stays open and locked, so that other processes notice it, and so that no other
    /// file gets its identity.
    held: Option<File>,
    /// The last one that it wrote, or reported as unused.
    told: Option<FileIdentity>,
    /// The request whose failure was reported: each further one of it has the same cause.
    failed: Option<u64>,
}

impl Claim {
    /// Holds a file that this process has written, which is locked.
    pub(super) fn hold(&mut self, path: &Path, file: Option<File>) {
        (self.held, self.told) = (file, FileIdentity::of(path));
    }

    /// Holds the file of a process that has ended. Does nothing if another process holds it.
    pub(super) fn take_over(&mut self, path: &Path) {
        let Some(file) = open(path) else { return };
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {}
            // Without locks, the identity tells as well whether it is the same file.
            Ok(()) | Err(TryLockError::Error(_)) => self.hold(path, Some(file)),
        }
    }

    /// Holds nothing any more.
    pub(super) fn release(&mut self) {
        self.held = None;
    }

    /// Whether the file of this path is the one that it holds.
    pub(super) fn holds(&self, path: &Path) -> bool {
        let is_held = |identity: FileIdentity| self.held.as_ref().is_some_and(|file| identity.is_of(file));
        FileIdentity::of(path).is_some_and(is_held)
    }

    /// Whether another process, which is still there, holds the file of this path.
    pub(super) fn is_of_another(&self, path: &Path) -> bool {
        let is_locked = |file: File| matches!(file.try_lock(), Err(TryLockError::WouldBlock));
        !self.holds(path) && open(path).is_some_and(is_locked)
    }

    /// Whether a failure is the first one of a request; from now on, there was one.
    pub(super) fn is_first_failure(&mut self, request: u64) -> bool {
        self.failed.replace(request) != Some(request)
    }

    /// Whether a person has not heard of this file yet; from now on, they have.
    pub(super) fn is_news(&mut self, path: &Path) -> bool {
        let identity = FileIdentity::of(path);
        let is_news = self.told != identity;
        self.told = identity;
        is_news
    }
}

/// A regular file. `None` for all else: opening a pipe would wait for its writer.
fn open(path: &Path) -> Option<File> {
    if path.metadata().is_ok_and(|found| found.is_file()) { File::open(path).ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_held_by_one_process_and_no_other_file_passes_for_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.checkpoint");
        std::fs::write(&path, "first").expect("written");
        let (mut one, mut other) = (Claim::default(), Claim::default());
        assert!(!one.holds(&path) && !one.is_of_another(&path));
        one.take_over(&path);
        assert!(one.holds(&path) && !one.is_of_another(&path));
        // Another claim stands for another process: a lock is that of an open file.
        other.take_over(&path);
        assert!(!other.holds(&path) && other.is_of_another(&path));
        // A new file of the same name.
        std::fs::write(folder.path().join("b"), "second").expect("written");
        std::fs::rename(folder.path().join("b"), &path).expect("renamed");
        assert!(!one.holds(&path) && !other.is_of_another(&path));
        other.take_over(&path);
        assert!(one.is_of_another(&path));
        other.release();
        assert!(!one.is_of_another(&path));
    }

    #[test]
    fn a_file_is_news_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.checkpoint");
        std::fs::write(&path, "first").expect("written");
        let mut claim = Claim::default();
        assert!(claim.is_news(&path) && !claim.is_news(&path));
        std::fs::write(folder.path().join("b"), "second").expect("written");
        std::fs::rename(folder.path().join("b"), &path).expect("renamed");
        assert!(claim.is_news(&path) && !claim.is_news(&path));
        claim.hold(&path, None);
        assert!(!claim.is_news(&path), "it wrote the file itself");
    }
}
