//! Locks checkpoint files and tracks which checkpoints have been reported.

use std::fs::{File, TryLockError};
use std::path::Path;

use crate::output::FileIdentity;

/// A process's checkpoint state, which persists across requests.
#[derive(Debug, Default)]
pub(crate) struct ProcessCheckpointState {
    /// The checkpoint that this process wrote or resumed from. The file stays open and locked, so that other
    /// processes can detect the lock and the file's identity cannot be reused.
    held: Option<File>,
    /// The checkpoint that was last written or reported as unused.
    last_reported: Option<FileIdentity>,
    /// The last request for which a failure was reported. Later failures in the same request have the same
    /// cause and are not reported.
    failed: Option<u64>,
}

impl ProcessCheckpointState {
    /// Keeps a file open after this process has written and locked it.
    pub(super) fn keep_open(&mut self, path: &Path, file: Option<File>) {
        (self.held, self.last_reported) = (file, FileIdentity::from_existing_or_new_path(path));
    }

    /// Locks a file left behind by a process that has ended. Does nothing if another process has locked the
    /// file.
    pub(super) fn lock_abandoned_checkpoint(&mut self, path: &Path) {
        let Some(file) = open_if_regular(path) else { return };
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {}
            // If locking is unsupported, the file's identity is enough to recognize it.
            Ok(()) | Err(TryLockError::Error(_)) => self.keep_open(path, Some(file)),
        }
    }

    /// Releases the held checkpoint file.
    pub(super) fn release(&mut self) {
        self.held = None;
    }

    /// Whether this process holds the file at this path.
    pub(super) fn is_held_by_this_process(&self, path: &Path) -> bool {
        let is_held =
            |identity: FileIdentity| self.held.as_ref().is_some_and(|file| identity.matches_open_file(file));
        FileIdentity::from_existing_or_new_path(path).is_some_and(is_held)
    }

    /// Whether another running process holds the file at this path.
    pub(super) fn is_held_by_another_process(&self, path: &Path) -> bool {
        let is_locked = |file: File| matches!(file.try_lock(), Err(TryLockError::WouldBlock));
        !self.is_held_by_this_process(path) && open_if_regular(path).is_some_and(is_locked)
    }

    /// Records a failure and returns whether it is the first failure in the request.
    pub(super) fn record_failure_and_check_first(&mut self, request: u64) -> bool {
        self.failed.replace(request) != Some(request)
    }

    /// Records a file as reported and returns whether it had not been reported before.
    pub(super) fn record_first_report_of_file(&mut self, path: &Path) -> bool {
        let identity = FileIdentity::from_existing_or_new_path(path);
        let is_news = self.last_reported != identity;
        self.last_reported = identity;
        is_news
    }
}

/// Opens a regular file. Returns `None` for other kinds of files, because opening a pipe would block.
fn open_if_regular(path: &Path) -> Option<File> {
    if path.metadata().is_ok_and(|found| found.is_file()) { File::open(path).ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_process_can_hold_a_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.checkpoint");
        std::fs::write(&path, "first").expect("written");
        let (mut one, mut other) = (ProcessCheckpointState::default(), ProcessCheckpointState::default());
        assert!(!one.is_held_by_this_process(&path) && !one.is_held_by_another_process(&path));
        one.lock_abandoned_checkpoint(&path);
        assert!(one.is_held_by_this_process(&path) && !one.is_held_by_another_process(&path));
        // Locks belong to open file handles, so a second instance acts like another process.
        other.lock_abandoned_checkpoint(&path);
        assert!(!other.is_held_by_this_process(&path) && other.is_held_by_another_process(&path));
        // Replace the file with a new one of the same name.
        std::fs::write(folder.path().join("b"), "second").expect("written");
        std::fs::rename(folder.path().join("b"), &path).expect("renamed");
        assert!(!one.is_held_by_this_process(&path) && !other.is_held_by_another_process(&path));
        other.lock_abandoned_checkpoint(&path);
        assert!(one.is_held_by_another_process(&path));
        other.release();
        assert!(!one.is_held_by_another_process(&path));
    }

    #[test]
    fn each_file_is_reported_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.checkpoint");
        std::fs::write(&path, "first").expect("written");
        let mut lock = ProcessCheckpointState::default();
        assert!(lock.record_first_report_of_file(&path) && !lock.record_first_report_of_file(&path));
        std::fs::write(folder.path().join("b"), "second").expect("written");
        std::fs::rename(folder.path().join("b"), &path).expect("renamed");
        assert!(lock.record_first_report_of_file(&path) && !lock.record_first_report_of_file(&path));
        lock.keep_open(&path, None);
        assert!(
            !lock.record_first_report_of_file(&path),
            "a file written by this process should not be reported"
        );
    }
}
