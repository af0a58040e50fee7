//! Tracks files written by glimt and whether other programs have changed them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::content::{FileContentId, FileHashCache};
use crate::control::CancelToken;
use crate::protected::{OverwriteProtection, OverwriteRefusalReason};
use crate::scene::fingerprint::Fingerprint;

/// A change that another program made to a file written by glimt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExternalChange {
    /// The file was removed.
    Removed,
    /// The file has different content.
    Replaced,
    /// The file is now another scene's image, which glimt must not replace.
    ReplacedByOtherScene,
    /// The file now has other content that glimt must not replace.
    ReplacedByForeign,
}

impl ExternalChange {
    /// Describes the change as a phrase that follows the file name.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Removed => "was removed",
            Self::Replaced | Self::ReplacedByForeign => "was replaced by another program",
            Self::ReplacedByOtherScene => "was replaced by another scene's image",
        }
    }

    /// Whether glimt keeps the file instead of replacing it.
    pub fn is_kept(self) -> bool {
        match self {
            Self::Removed | Self::Replaced => false,
            Self::ReplacedByOtherScene | Self::ReplacedByForeign => true,
        }
    }
}

/// A change to a file written by glimt, or the restoration of its original content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputChange {
    /// Path of the file.
    pub path: PathBuf,
    /// The change, or `None` if the file's content is back to what glimt wrote.
    pub lost: Option<ExternalChange>,
}

/// Written files by path, shared by the worker and the watcher.
#[derive(Debug, Default)]
pub struct WrittenOutputs(Mutex<HashMap<PathBuf, WrittenOutput>>);

#[derive(Clone, Debug)]
struct WrittenOutput {
    /// The content written by glimt.
    content: FileContentId,
    /// Key of the image in the file. A file without a key is written again.
    image: Option<Fingerprint>,
    /// Number of writes started so far.
    writes: u64,
    is_being_written: bool,
    protection: OverwriteProtection,
    /// The last reported change.
    reported: Option<ExternalChange>,
}

impl WrittenOutput {
    /// Whether the file is a regular file. Special files are not watched.
    fn is_regular(&self) -> bool {
        matches!(self.content, FileContentId::Hash(_))
    }

    /// Whether the file at `path` still has the content written by glimt.
    fn is_unchanged(&self, path: &Path, contents: &FileHashCache) -> bool {
        // Use a token that is never canceled.
        contents.read_content_id(path, &CancelToken::new()).is_ok_and(|content| content == self.content)
    }
}

impl WrittenOutputs {
    /// Records that a file is about to be written. Its content is ignored until [`Self::end_write`].
    /// `protection` decides whether glimt may replace content that another program writes to the file.
    pub(crate) fn begin_write(&self, path: &Path, protection: OverwriteProtection) {
        let mut known = self.lock();
        let output = known.entry(path.to_owned()).or_insert(WrittenOutput {
            content: FileContentId::Missing,
            image: None,
            writes: 0,
            is_being_written: true,
            protection: OverwriteProtection::Nothing,
            reported: None,
        });
        (output.writes, output.is_being_written) = (output.writes + 1, true);
        output.protection = protection;
    }

    /// Records a written file's content, or `None` if the write failed.
    pub(crate) fn end_write(&self, path: &Path, content: Option<FileContentId>) {
        let mut known = self.lock();
        let Some(output) = known.get_mut(path) else { return };
        output.is_being_written = false;
        if let Some(content) = content {
            (output.content, output.reported) = (content, None);
        }
        if output.content == FileContentId::Missing {
            known.remove(path);
        }
    }

    /// Records which image a written file contains.
    pub(crate) fn record_image_key(&self, path: &Path, key: Fingerprint) {
        if let Some(output) = self.lock().get_mut(path) {
            output.image = Some(key);
        }
    }

    /// Returns the content of a file when glimt wrote this image to it.
    pub(crate) fn content_written_for_image(&self, path: &Path, key: Fingerprint) -> Option<FileContentId> {
        self.lock().get(path).filter(|output| output.image == Some(key)).map(|output| output.content)
    }

    /// Forgets which images the files contain, so that the next write stage writes them again.
    pub(crate) fn mark_images_outdated(&self) {
        self.lock().values_mut().for_each(|output| output.image = None);
    }

    /// Whether no file was written.
    pub(crate) fn is_empty(&self) -> bool {
        self.lock().is_empty()
    }

    /// Whether a file still has the content written by glimt.
    pub(crate) fn has_any_unchanged_file(&self, contents: &FileHashCache) -> bool {
        let known = self.lock().clone();
        known.iter().any(|(path, output)| output.is_unchanged(path, contents))
    }

    /// Returns the first existing file whose content was not written by glimt.
    pub(crate) fn first_foreign_file<'a>(
        &self,
        paths: &'a [PathBuf],
        contents: &FileHashCache,
    ) -> Option<&'a Path> {
        let known = self.lock().clone();
        let is_foreign = |path: &&Path| {
            let is_ours = known.get(*path).is_some_and(|output| output.is_unchanged(path, contents));
            !is_ours && path.symlink_metadata().is_ok()
        };
        paths.iter().map(PathBuf::as_path).find(is_foreign)
    }

    /// Forgets all files for which `keep` returns false.
    pub(crate) fn retain(&self, mut keep: impl FnMut(&PathBuf) -> bool) {
        self.lock().retain(|path, _| keep(path));
    }

    /// Returns the paths of all files to watch.
    pub(super) fn paths_to_watch(&self) -> Vec<PathBuf> {
        let known = self.lock();
        let watched = known.iter().filter(|(_, output)| output.is_being_written || output.is_regular());
        watched.map(|(path, _)| path.clone()).collect()
    }

    /// Returns the files that no longer have the content written by glimt.
    pub fn list_external_changes(&self, contents: &FileHashCache) -> Vec<(PathBuf, ExternalChange)> {
        let found = self.reported_and_current_changes(contents).into_iter();
        found.filter_map(|(path, _, lost)| Some((path, lost?))).collect()
    }

    /// Returns the files whose state differs from the last report.
    fn unreported_changes(&self, contents: &FileHashCache) -> Vec<OutputChange> {
        let found = self
            .reported_and_current_changes(contents)
            .into_iter()
            .filter(|(_, reported, lost)| reported != lost);
        found.map(|(path, _, lost)| OutputChange { path, lost }).collect()
    }

    /// Returns each file's last reported state and current state, except for files that are being written.
    fn reported_and_current_changes(
        &self,
        contents: &FileHashCache,
    ) -> Vec<(PathBuf, Option<ExternalChange>, Option<ExternalChange>)> {
        let before: Vec<(PathBuf, WrittenOutput)> = {
            let known = self.lock();
            let idle = known.iter().filter(|(_, output)| !output.is_being_written && output.is_regular());
            idle.map(|(path, output)| (path.clone(), output.clone())).collect()
        };
        let state = |(path, output): (PathBuf, WrittenOutput)| {
            // Use a token that is never canceled.
            let now = contents.read_content_id(&path, &CancelToken::new()).unwrap_or(FileContentId::Missing);
            let lost = match now {
                now if now == output.content => None,
                FileContentId::Missing => Some(ExternalChange::Removed),
                FileContentId::Hash(_) | FileContentId::Unusable(_) => {
                    Some(match output.protection.reason_to_keep(&path) {
                        None => ExternalChange::Replaced,
                        Some(OverwriteRefusalReason::OtherScene) => ExternalChange::ReplacedByOtherScene,
                        Some(OverwriteRefusalReason::Foreign) => ExternalChange::ReplacedByForeign,
                    })
                }
            };
            // Ignore the content if another write has started in the meantime.
            let is_current = self.lock().get(&path).is_some_and(|now| now.writes == output.writes);
            is_current.then_some((path, output.reported, lost))
        };
        let mut states: Vec<_> = before.into_iter().filter_map(state).collect();
        states.sort_by(|a, b| a.0.cmp(&b.0));
        states
    }

    fn mark_reported(&self, change: &OutputChange) {
        if let Some(output) = self.lock().get_mut(&change.path) {
            output.reported = change.lost;
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<PathBuf, WrittenOutput>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Changes that may be temporary, because programs may remove a file before replacing it.
#[derive(Debug, Default)]
pub(super) struct PossiblyTransientChanges(Vec<(OutputChange, Instant)>);

impl PossiblyTransientChanges {
    /// Returns the changes that have lasted for `quiet`, each of them only once.
    pub(super) fn take_confirmed(
        &mut self,
        contents: &FileHashCache,
        quiet: Duration,
        now: Instant,
    ) -> Vec<OutputChange> {
        let before = std::mem::take(&mut self.0);
        let mut lasting = Vec::new();
        for change in contents.outputs.unreported_changes(contents) {
            let since =
                before.iter().find(|(suspect, _)| *suspect == change).map_or(now, |(_, since)| *since);
            if now.saturating_duration_since(since) >= quiet {
                contents.outputs.mark_reported(&change);
                lasting.push(change);
            } else {
                self.0.push((change, since));
            }
        }
        lasting
    }

    /// Returns the time of the next check, or `None` if there are no unconfirmed changes.
    pub(super) fn next_check_time(&self, quiet: Duration) -> Option<Instant> {
        self.0.iter().map(|(_, since)| *since + quiet).min()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const QUIET: Duration = Duration::from_millis(250);

    fn write(contents: &FileHashCache, path: &Path, text: &str) {
        contents.outputs.begin_write(path, OverwriteProtection::Parts);
        fs::write(path, text).expect("written");
        let content = contents.read_content_id(path, &CancelToken::new()).expect("not canceled");
        contents.outputs.end_write(path, Some(content));
    }

    #[test]
    fn lasting_changes_are_reported_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let (contents, mut suspects) = (FileHashCache::default(), PossiblyTransientChanges::default());
        let begin = Instant::now();
        let mut look = |contents: &FileHashCache, after: u64| {
            let found = suspects.take_confirmed(contents, QUIET, begin + Duration::from_millis(after));
            found.into_iter().map(|change| change.lost).collect::<Vec<_>>()
        };
        write(&contents, &path, "one");
        assert_eq!(look(&contents, 0), []);
        // glimt's own writes are not reported, either during or after the write.
        contents.outputs.begin_write(&path, OverwriteProtection::Parts);
        fs::write(&path, "two").expect("written");
        assert_eq!((look(&contents, 1000), look(&contents, 2000)), (vec![], vec![]));
        write(&contents, &path, "two");
        assert_eq!((look(&contents, 3000), look(&contents, 4000)), (vec![], vec![]));
        // Another program removes and then rewrites the file.
        fs::remove_file(&path).expect("removed");
        assert_eq!(look(&contents, 5000), []);
        fs::write(&path, "of another").expect("written");
        assert_eq!(look(&contents, 5300), [], "an incomplete file should not be reported");
        assert_eq!(look(&contents, 5600), [Some(ExternalChange::Replaced)]);
        fs::write(&path, "of another again").expect("written");
        assert_eq!((look(&contents, 6000), look(&contents, 7000)), (vec![], vec![]), "once");
        assert_eq!(
            contents.outputs.list_external_changes(&contents),
            [(path.clone(), ExternalChange::Replaced)]
        );
        fs::remove_file(&path).expect("removed");
        assert_eq!(
            (look(&contents, 8000), look(&contents, 9000)),
            (vec![], vec![Some(ExternalChange::Removed)])
        );
        // Restore the file.
        fs::write(&path, "two").expect("written");
        assert_eq!((look(&contents, 10_000), look(&contents, 11_000)), (vec![], vec![None]));
        // Have glimt write the file again.
        fs::remove_file(&path).expect("removed");
        assert_eq!(
            (look(&contents, 12_000), look(&contents, 13_000)),
            (vec![], vec![Some(ExternalChange::Removed)])
        );
        write(&contents, &path, "three");
        assert_eq!((look(&contents, 14_000), look(&contents, 15_000)), (vec![], vec![]));
    }

    #[test]
    fn failed_write_keeps_previous_content() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let contents = FileHashCache::default();
        write(&contents, &path, "one");
        contents.outputs.begin_write(&path, OverwriteProtection::Parts);
        contents.outputs.end_write(&path, None);
        assert_eq!(contents.outputs.list_external_changes(&contents), []);
        fs::remove_file(&path).expect("removed");
        assert_eq!(contents.outputs.list_external_changes(&contents), [(path, ExternalChange::Removed)]);
        // A file that was never written is not watched.
        let other = folder.path().join("b.png");
        contents.outputs.begin_write(&other, OverwriteProtection::Parts);
        contents.outputs.end_write(&other, None);
        assert_eq!(contents.outputs.paths_to_watch().len(), 1);
    }

    #[test]
    fn replacement_by_protected_file_is_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let contents = FileHashCache::default();
        let scene = folder.path().join("a.toml");
        for (protection, change) in [
            (OverwriteProtection::OtherImages(scene), ExternalChange::ReplacedByForeign),
            (OverwriteProtection::Parts, ExternalChange::Replaced),
            (OverwriteProtection::Nothing, ExternalChange::Replaced),
        ] {
            write(&contents, &path, "one");
            contents.outputs.begin_write(&path, protection);
            contents.outputs.end_write(&path, None);
            fs::write(&path, "of another").expect("written");
            assert_eq!(contents.outputs.list_external_changes(&contents), [(path.clone(), change)]);
        }
    }
}
