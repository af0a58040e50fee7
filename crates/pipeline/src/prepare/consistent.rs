//! Reads one consistent version of a scene's files.

use std::path::PathBuf;
use std::sync::Arc;

use rayon::ThreadPool;

use crate::control::CancelToken;
use crate::sink::EventSink;
use crate::stages::containers::OpenAssetFiles;
use crate::stages::{AbortReason, FileReadContext, Findings};
use crate::system::memory::ulimit_or_cgroup_limit;
use crate::table::StageRecorder;
use crate::watch::content::{FileHashCache, FilesSeenByRequest};

/// Maximum number of attempts to read one consistent version of the scene's files.
const MAX_READS: usize = 16;

/// One attempt to read a scene's files.
pub(crate) struct SceneReadAttempt<'a, 't> {
    pub(crate) files: FileReadContext<'a>,
    pub(crate) table: &'a mut StageRecorder<'t>,
    pub(crate) findings: &'a mut Findings,
}

/// Everything needed to read files.
#[derive(Clone, Copy)]
pub(crate) struct FileReader<'a> {
    pub(crate) contents: &'a Arc<FileHashCache>,
    pub(crate) pool: &'a ThreadPool,
    pub(crate) sink: &'a EventSink,
    pub(crate) token: &'a CancelToken,
}

impl FileReader<'_> {
    /// Calls `read` repeatedly until no file changes in the meantime, so that images and errors never result
    /// from a mix of file versions. `read` must verify the files that it loads.
    ///
    /// # Errors
    /// Returns the error from `read`, or an error if the files keep changing.
    pub(crate) fn read_until_files_unchanged<T>(
        &self,
        table: &mut StageRecorder<'_>,
        findings: &mut Findings,
        mut read: impl FnMut(&mut SceneReadAttempt<'_, '_>) -> Result<T, AbortReason>,
    ) -> Result<T, AbortReason> {
        for _ in 0..MAX_READS {
            let contents = FilesSeenByRequest::new(Arc::clone(self.contents));
            let containers = OpenAssetFiles::default();
            let files = self.file_read_context(&contents, &containers);
            let result = read(&mut SceneReadAttempt { files, table, findings });
            if result.is_err() && !self.token.is_canceled() {
                contents.record_changes_to_seen_files(self.token)?;
            }
            if self.token.is_canceled() || contents.changed_file().is_none() {
                return result;
            }
            findings.reset();
            table.stages.clear();
        }
        Err(AbortReason::from_work_error(
            "the scene's files keep changing while they are being read; try again once they are complete",
        ))
    }

    /// Calls `read` once. Returns `None` if a file changed in the meantime.
    ///
    /// # Errors
    /// Returns the error from `read`.
    pub(crate) fn read_once_if_files_unchanged<T>(
        &self,
        read: impl FnOnce(&FileReadContext<'_>) -> Result<T, AbortReason>,
    ) -> Result<Option<T>, AbortReason> {
        let contents = FilesSeenByRequest::new(Arc::clone(self.contents));
        let result = read(&self.file_read_context(&contents, &OpenAssetFiles::default()))?;
        contents.record_changes_to_seen_files(self.token)?;
        Ok(Some(result).filter(|_| contents.changed_file().is_none()))
    }

    fn file_read_context<'a>(
        &'a self,
        contents: &'a FilesSeenByRequest,
        containers: &'a OpenAssetFiles,
    ) -> FileReadContext<'a> {
        let FileReader { sink, token, pool, .. } = *self;
        let available_memory = ulimit_or_cgroup_limit().map_or(u64::MAX, |limit| limit.bytes);
        FileReadContext { sink, token, contents, pool, containers, available_memory }
    }
}

impl SceneReadAttempt<'_, '_> {
    /// Checks that no file has changed since the request first saw it.
    ///
    /// # Errors
    /// A file has changed, or the token is canceled.
    pub(crate) fn verify_files_unchanged(&self) -> Result<(), AbortReason> {
        self.files.contents.record_changes_to_seen_files(self.files.token)?;
        let changed = self.files.contents.changed_file();
        let message = |path: PathBuf| format!("{} changed while it was being read", path.display());
        changed.map_or(Ok(()), |path| Err(AbortReason::from_work_error(message(path))))
    }
}
