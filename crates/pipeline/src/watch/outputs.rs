//! Files that glimt wrote, and whether they still hold what it wrote.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::content::{Content, Contents};
use crate::control::CancelToken;

/// Change of a file by another program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lost {
    /// The file does not exist any more.
    Removed,
    /// The file has another content.
    Replaced,
}

impl Lost {
    /// A predicate for the file's name.
    pub fn words(self) -> &'static str {
        match self {
            Self::Removed => "was removed",
            Self::Replaced => "was replaced by another program",
        }
    }
}

/// A file that glimt wrote was changed, or is again as glimt wrote it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutputChange {
    /// The file.
    pub path: PathBuf,
    /// The change. `None` if the file is as glimt wrote it.
    pub lost: Option<Lost>,
}

/// Outputs by their paths, shared between the worker, which writes them, and the watcher.
#[derive(Debug, Default)]
pub struct Outputs(Mutex<HashMap<PathBuf, Output>>);

#[derive(Clone, Copy, Debug)]
struct Output {
    /// The content that glimt wrote.
    content: Content,
    /// Number of writes that began so far.
    writes: u64,
    is_being_written: bool,
    /// The change that was reported last.
    reported: Option<Lost>,
}

impl Outputs {
    /// Notes that a file is about to be written: until [`Self::end`], it may have any content.
    pub(crate) fn begin(&self, path: &Path) {
        let mut known = self.known();
        let new = Output { content: Content::Missing, writes: 0, is_being_written: true, reported: None };
        let output = known.entry(path.to_owned()).or_insert(new);
        (output.writes, output.is_being_written) = (output.writes + 1, true);
    }

    /// Notes the content of a file that was written, or that it could not be written. Special files are not watched.
    pub(crate) fn end(&self, path: &Path, content: Option<Content>) {
        let mut known = self.known();
        let Some(output) = known.get_mut(path) else { return };
        output.is_being_written = false;
        if let Some(content) = content {
            (output.content, output.reported) = (content, None);
        }
        if !matches!(output.content, Content::Hash(_)) {
            known.remove(path);
        }
    }

    /// Forgets all files but these.
    pub(crate) fn retain(&self, mut keep: impl FnMut(&PathBuf) -> bool) {
        self.known().retain(|path, _| keep(path));
    }

    /// The files.
    pub(super) fn paths(&self) -> Vec<PathBuf> {
        self.known().keys().cloned().collect()
    }

    /// Files that do not hold what glimt wrote.
    pub fn lost(&self, contents: &Contents) -> Vec<(PathBuf, Lost)> {
        let found = self.states(contents).into_iter();
        found.filter_map(|(path, _, lost)| Some((path, lost?))).collect()
    }

    /// Files whose state differs from the reported one.
    fn news(&self, contents: &Contents) -> Vec<OutputChange> {
        let found = self.states(contents).into_iter().filter(|(_, reported, lost)| reported != lost);
        found.map(|(path, _, lost)| OutputChange { path, lost }).collect()
    }

    /// The reported and the current state of each file that is not being written.
    fn states(&self, contents: &Contents) -> Vec<(PathBuf, Option<Lost>, Option<Lost>)> {
        let before: Vec<(PathBuf, Output)> = {
            let known = self.known();
            let idle = known.iter().filter(|(_, output)| !output.is_being_written);
            idle.map(|(path, output)| (path.clone(), *output)).collect()
        };
        let state = |(path, output): (PathBuf, Output)| {
            // Nobody cancels this token.
            let now = contents.read(&path, &CancelToken::new()).unwrap_or(Content::Missing);
            let lost = match now {
                now if now == output.content => None,
                Content::Missing => Some(Lost::Removed),
                Content::Hash(_) | Content::Unusable(_) => Some(Lost::Replaced),
            };
            // A write may have begun since: then the content is glimt's own.
            let is_current = self.known().get(&path).is_some_and(|now| now.writes == output.writes);
            is_current.then_some((path, output.reported, lost))
        };
        let mut states: Vec<_> = before.into_iter().filter_map(state).collect();
        states.sort_by(|a, b| a.0.cmp(&b.0));
        states
    }

    fn report(&self, change: &OutputChange) {
        if let Some(output) = self.known().get_mut(&change.path) {
            output.reported = change.lost;
        }
    }

    fn known(&self) -> MutexGuard<'_, HashMap<PathBuf, Output>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Changes that were found and may pass: a program that replaces a file removes it first.
#[derive(Debug, Default)]
pub(super) struct Suspects(Vec<(OutputChange, Instant)>);

impl Suspects {
    /// Changes that have lasted for `quiet`; reports each once.
    pub(super) fn look(&mut self, contents: &Contents, quiet: Duration, now: Instant) -> Vec<OutputChange> {
        let before = std::mem::take(&mut self.0);
        let mut lasting = Vec::new();
        for change in contents.outputs.news(contents) {
            let since =
                before.iter().find(|(suspect, _)| *suspect == change).map_or(now, |(_, since)| *since);
            if now.saturating_duration_since(since) >= quiet {
                contents.outputs.report(&change);
                lasting.push(change);
            } else {
                self.0.push((change, since));
            }
        }
        lasting
    }

    /// Time of the next look. `None` if nothing is suspected.
    pub(super) fn due(&self, quiet: Duration) -> Option<Instant> {
        self.0.iter().map(|(_, since)| *since + quiet).min()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const QUIET: Duration = Duration::from_millis(250);

    fn write(contents: &Contents, path: &Path, text: &str) {
        contents.outputs.begin(path);
        fs::write(path, text).expect("written");
        let content = contents.read(path, &CancelToken::new()).expect("not cancelled");
        contents.outputs.end(path, Some(content));
    }

    #[test]
    fn lasting_changes_are_reported_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let (contents, mut suspects) = (Contents::default(), Suspects::default());
        let begin = Instant::now();
        let mut look = |contents: &Contents, after: u64| {
            let found = suspects.look(contents, QUIET, begin + Duration::from_millis(after));
            found.into_iter().map(|change| change.lost).collect::<Vec<_>>()
        };
        write(&contents, &path, "one");
        assert_eq!(look(&contents, 0), []);
        // Its own writes are no change, neither during them nor afterwards.
        contents.outputs.begin(&path);
        fs::write(&path, "two").expect("written");
        assert_eq!((look(&contents, 1000), look(&contents, 2000)), (vec![], vec![]));
        write(&contents, &path, "two");
        assert_eq!((look(&contents, 3000), look(&contents, 4000)), (vec![], vec![]));
        // Another program removes the file, then replaces it.
        fs::remove_file(&path).expect("removed");
        assert_eq!(look(&contents, 5000), []);
        fs::write(&path, "of another").expect("written");
        assert_eq!(look(&contents, 5300), [], "it may be on its way");
        assert_eq!(look(&contents, 5600), [Some(Lost::Replaced)]);
        fs::write(&path, "of another again").expect("written");
        assert_eq!((look(&contents, 6000), look(&contents, 7000)), (vec![], vec![]), "once");
        assert_eq!(contents.outputs.lost(&contents), [(path.clone(), Lost::Replaced)]);
        fs::remove_file(&path).expect("removed");
        assert_eq!((look(&contents, 8000), look(&contents, 9000)), (vec![], vec![Some(Lost::Removed)]));
        // It is put back.
        fs::write(&path, "two").expect("written");
        assert_eq!((look(&contents, 10_000), look(&contents, 11_000)), (vec![], vec![None]));
        // glimt writes it again.
        fs::remove_file(&path).expect("removed");
        assert_eq!((look(&contents, 12_000), look(&contents, 13_000)), (vec![], vec![Some(Lost::Removed)]));
        write(&contents, &path, "three");
        assert_eq!((look(&contents, 14_000), look(&contents, 15_000)), (vec![], vec![]));
    }

    #[test]
    fn a_failed_write_leaves_the_known_content() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let contents = Contents::default();
        write(&contents, &path, "one");
        contents.outputs.begin(&path);
        contents.outputs.end(&path, None);
        assert_eq!(contents.outputs.lost(&contents), []);
        fs::remove_file(&path).expect("removed");
        assert_eq!(contents.outputs.lost(&contents), [(path, Lost::Removed)]);
        // One that was never written is not watched.
        let other = folder.path().join("b.png");
        contents.outputs.begin(&other);
        contents.outputs.end(&other, None);
        assert_eq!(contents.outputs.paths().len(), 1);
    }
}
