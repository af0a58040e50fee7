//! Locking of checkpoint files, and which checkpoints have been reported.

use std::fs::{File, TryLockError};
use std::path::Path;

use crate::output::FileIdentity;

/// Checkpoint state of a process across requests.
#[derive(Debug, Default)]
pub(crate) struct CheckpointLock {
    /// The checkpoint that this process wrote or resumed from. It stays open and locked, so that other processes notice
    /// it and no other file gets its identity.
    held: Option<File>,
    /// Last checkpoint that was written or reported as unused.
    told: Option<FileIdentity>,
    /// Request whose failure was reported. Further failures of it have the same cause.
    failed: Option<u64>,
}

impl CheckpointLock {
    /// Holds a file that this process has written and locked.
    pub(super) fn hold(&mut self, path: &Path, file: Option<File>) {
        (self.held, self.told) = (file, FileIdentity::of(path));
    }

    /// Holds the file of a process that has ended. Does nothing if another process holds it.
    pub(super) fn take_over(&mut self, path: &Path) {
        let Some(file) = open(path) else { return };
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {}
            // Without locks, the identity is enough to recognize the file.
            Ok(()) | Err(TryLockError::Error(_)) => self.hold(path, Some(file)),
        }
    }

    /// Releases the file.
    pub(super) fn release(&mut self) {
        self.held = None;
    }

    /// Whether the file at this path is the held one.
    pub(super) fn holds(&self, path: &Path) -> bool {
        let is_held = |identity: FileIdentity| self.held.as_ref().is_some_and(|file| identity.is_of(file));
        FileIdentity::of(path).is_some_and(is_held)
    }

    /// Whether another running process holds the file at this path.
    pub(super) fn is_of_another(&self, path: &Path) -> bool {
        let is_locked = |file: File| matches!(file.try_lock(), Err(TryLockError::WouldBlock));
        !self.holds(path) && open(path).is_some_and(is_locked)
    }

    /// Records a failure and returns whether it is the first of a request.
    pub(super) fn is_first_failure(&mut self, request: u64) -> bool {
        self.failed.replace(request) != Some(request)
    }

    /// Records a file as reported and returns whether it was not reported before.
    pub(super) fn is_news(&mut self, path: &Path) -> bool {
        let identity = FileIdentity::of(path);
        let is_news = self.told != identity;
        self.told = identity;
        is_news
    }
}

/// Opens a regular file. Returns `None` for other files, because opening a pipe would block.
fn open(path: &Path) -> Option<File> {
    if path.metadata().is_ok_and(|found| found.is_file()) { File::open(path).ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_is_held_by_one_process() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.checkpoint");
        std::fs::write(&path, "first").expect("written");
        let (mut one, mut other) = (CheckpointLock::default(), CheckpointLock::default());
        assert!(!one.holds(&path) && !one.is_of_another(&path));
        one.take_over(&path);
        assert!(one.holds(&path) && !one.is_of_another(&path));
        // A second instance acts like another process, because locks belong to open files.
        other.take_over(&path);
        assert!(!other.holds(&path) && other.is_of_another(&path));
        // Replace the file by a new one of the same name.
        std::fs::write(folder.path().join("b"), "second").expect("written");
        std::fs::rename(folder.path().join("b"), &path).expect("renamed");
        assert!(!one.holds(&path) && !other.is_of_another(&path));
        other.take_over(&path);
        assert!(one.is_of_another(&path));
        other.release();
        assert!(!one.is_of_another(&path));
    }

    #[test]
    fn file_is_news_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.checkpoint");
        std::fs::write(&path, "first").expect("written");
        let mut lock = CheckpointLock::default();
        assert!(lock.is_news(&path) && !lock.is_news(&path));
        std::fs::write(folder.path().join("b"), "second").expect("written");
        std::fs::rename(folder.path().join("b"), &path).expect("renamed");
        assert!(lock.is_news(&path) && !lock.is_news(&path));
        lock.hold(&path, None);
        assert!(!lock.is_news(&path), "this process wrote the file");
    }
}
