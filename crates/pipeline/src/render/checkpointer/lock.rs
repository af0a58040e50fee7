//! Locks checkpoint files and tracks which checkpoints have been reported.

use std::fs::{File, TryLockError};
use std::path::Path;

use crate::output::FileIdentity;

/// A process's checkpoint state, which persists across requests.
#[derive(Debug, Default)]
pub(crate) struct CheckpointLock {
    /// The checkpoint that this process wrote or resumed from. The file stays open and locked, so that other
    /// processes can detect the lock and the file's identity cannot be reused.
    held: Option<File>,
    /// The last checkpoint written or reported as unused.
    told: Option<FileIdentity>,
    /// The last request with a reported failure. Its later failures have the same cause and are not reported.
    failed: Option<u64>,
}

impl CheckpointLock {
    /// Keeps a file open that this process has written and locked.
    pub(super) fn hold(&mut self, path: &Path, file: Option<File>) {
        (self.held, self.told) = (file, FileIdentity::of(path));
    }

    /// Locks a file left by a process that has ended. Does nothing if another process has locked it.
    pub(super) fn take_over(&mut self, path: &Path) {
        let Some(file) = open(path) else { return };
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {}
            // If locks are unsupported, the file's identity is enough to recognize it.
            Ok(()) | Err(TryLockError::Error(_)) => self.hold(path, Some(file)),
        }
    }

    /// Releases the file.
    pub(super) fn release(&mut self) {
        self.held = None;
    }

    /// Whether this process holds the file at this path.
    pub(super) fn holds(&self, path: &Path) -> bool {
        let is_held = |identity: FileIdentity| self.held.as_ref().is_some_and(|file| identity.is_of(file));
        FileIdentity::of(path).is_some_and(is_held)
    }

    /// Whether another running process holds the file at this path.
    pub(super) fn is_of_another(&self, path: &Path) -> bool {
        let is_locked = |file: File| matches!(file.try_lock(), Err(TryLockError::WouldBlock));
        !self.holds(path) && open(path).is_some_and(is_locked)
    }

    /// Records a failure. Returns whether it is the request's first.
    pub(super) fn is_first_failure(&mut self, request: u64) -> bool {
        self.failed.replace(request) != Some(request)
    }

    /// Records a file as reported. Returns whether it had not been reported before.
    pub(super) fn is_news(&mut self, path: &Path) -> bool {
        let identity = FileIdentity::of(path);
        let is_news = self.told != identity;
        self.told = identity;
        is_news
    }
}

/// Opens a regular file. Returns `None` for other kinds of files, because opening a pipe would block.
fn open(path: &Path) -> Option<File> {
    if path.metadata().is_ok_and(|found| found.is_file()) { File::open(path).ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_is_held_by_only_one_process() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.checkpoint");
        std::fs::write(&path, "first").expect("written");
        let (mut one, mut other) = (CheckpointLock::default(), CheckpointLock::default());
        assert!(!one.holds(&path) && !one.is_of_another(&path));
        one.take_over(&path);
        assert!(one.holds(&path) && !one.is_of_another(&path));
        // Locks belong to open file handles, so a second instance acts like another process.
        other.take_over(&path);
        assert!(!other.holds(&path) && other.is_of_another(&path));
        // Replace the file with a new one of the same name.
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
        assert!(!lock.is_news(&path), "a file written by this process should not be reported");
    }
}
