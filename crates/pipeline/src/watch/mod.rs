//! Reports when a file that a scene depends on has changed.
//!
//! Editors save files in many ways: in place, by renaming, or by removing and rewriting. The watcher
//! therefore watches folders (for a symbolic link, also the folder of its target) and treats notifications
//! only as hints. It compares contents and reports only real changes. A file that was closed after writing or
//! renamed into place is checked immediately. A file that is still being written is checked after a short
//! pause. Timestamps are also checked every two seconds, or several times per second if there are no
//! notifications (network file systems, no watches left) or a folder or the working directory is missing.
//!
//! A program may write a file in several steps. [`WatchEvent::Settled`] follows a change when no further
//! changes are expected. Errors in a file are not reported earlier.

mod change_debouncer;
pub mod content;
mod folders;

pub mod outputs;
mod working_folder;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use self::change_debouncer::ChangeDebouncer;
use self::content::FileContentId;
pub use self::content::{FileHashCache, FilePathAndContentId};
use self::folders::{ChangeHint, WatchedFolders};
use self::outputs::PossiblyTransientChanges;
pub use self::outputs::{ExternalChange, OutputChange};
pub use self::working_folder::find_missing_folder;
use crate::control::CancelToken;
use crate::system::threads::spawn;

/// Interval between checks while notifications work.
const HEARTBEAT: Duration = Duration::from_secs(2);
/// Interval between checks without notifications.
const POLL: Duration = Duration::from_millis(200);
/// Minimum time between reported changes, which is long enough to show a first image during continuous saves.
const BETWEEN_CHANGES: Duration = Duration::from_millis(100);

/// Delays for reacting to hints.
#[derive(Clone, Copy, Debug)]
pub(super) struct WatchDelays {
    /// Time without hints after which to check a file that is being written.
    quiet: Duration,
    /// Like `quiet`, but for a missing or empty file, which is probably being replaced.
    quiet_missing: Duration,
    /// Maximum time between a hint and the resulting check.
    longest: Duration,
    /// Time without hints after which files count as settled. A program that writes a file in two steps takes
    /// only a fraction of this time.
    settle: Duration,
    /// Like `settle`, but while a file is open for writing. This is longer than network stalls in `scp` or
    /// `sftp`.
    settle_open: Duration,
    /// Maximum time before files count as settled, regardless of hints.
    settle_longest: Duration,
}

impl Default for WatchDelays {
    fn default() -> Self {
        Self {
            quiet: Duration::from_millis(40),
            quiet_missing: Duration::from_millis(250),
            longest: Duration::from_secs(2),
            settle: Duration::from_millis(400),
            settle_open: Duration::from_secs(2),
            settle_longest: Duration::from_secs(10),
        }
    }
}

/// An update from a watcher.
#[derive(Clone, Debug)]
pub enum WatchEvent {
    /// A file's content changed, and the save appears complete.
    Changed(ContentChangeTime),
    /// The changed files appear to be complete.
    Settled,
    /// A file written by glimt was changed, or was restored to the content that glimt wrote.
    Output(OutputChange),
}

/// A change to one or more files.
#[derive(Clone, Copy, Debug)]
pub struct ContentChangeTime {
    /// Time of the first hint, from which the save-to-screen latency is measured.
    pub noticed: Instant,
}

/// Handle to the watcher thread. Dropping it ends the thread.
#[derive(Debug)]
pub struct Watcher {
    orders: Sender<Message>,
}

enum Message {
    /// A hint about a watched file.
    Hint(ChangeHint),
    /// Files to watch: those read after the specified time, and those read earlier.
    Files(Vec<FilePathAndContentId>, Vec<FilePathAndContentId>, Instant),
    /// The worker has written a file.
    Outputs,
    Quit,
}

impl Watcher {
    /// Starts the watcher without any files. `poll` disables system notifications. `contents` is shared with
    /// the worker so that no file is hashed twice.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start(
        poll: bool,
        contents: Arc<FileHashCache>,
        say: impl FnMut(WatchEvent) + Send + 'static,
    ) -> std::io::Result<Self> {
        Self::start_with_delays(poll, contents, WatchDelays::default(), say)
    }

    fn start_with_delays(
        poll: bool,
        contents: Arc<FileHashCache>,
        delays: WatchDelays,
        say: impl FnMut(WatchEvent) + Send + 'static,
    ) -> std::io::Result<Self> {
        working_folder::remember_working_folder();
        let (orders, received) = mpsc::channel();
        let hints = orders.clone();
        let folders = WatchedFolders::new(poll, move |hint| {
            // Sending only fails after the watcher has ended.
            let _ = hints.send(Message::Hint(hint));
        });
        let change_debouncer = ChangeDebouncer::new(delays);
        let (files, pending, suspects) = Default::default();
        let quiet = delays.quiet_missing;
        let watch = WatchThread {
            folders,
            has_working_folder: true,
            contents,
            files,
            change_debouncer,
            pending,
            suspects,
            quiet,
            say,
        };
        spawn("glimt-watch", move || watch.run(&received))?;
        Ok(Self { orders })
    }

    /// Sets the files to watch: those in `read`, which were read after `since`, and those in `before`, which
    /// were read earlier. A file counts as changed if its content differs from the specified content, unless
    /// a change has been reported since the file was read.
    pub fn set_files(
        &self,
        read: Vec<FilePathAndContentId>,
        before: Vec<FilePathAndContentId>,
        since: Instant,
    ) {
        let _ = self.orders.send(Message::Files(read, before, since));
    }

    /// Watches the files written by the worker.
    pub fn watch_outputs(&self) {
        let _ = self.orders.send(Message::Outputs);
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        let _ = self.orders.send(Message::Quit);
    }
}

struct WatchThread<F> {
    folders: WatchedFolders,
    /// Whether the working directory exists.
    has_working_folder: bool,
    contents: Arc<FileHashCache>,
    /// Each file's content when the file was last read or a change was last reported, and the time of that
    /// event.
    files: HashMap<PathBuf, (FileContentId, Instant)>,
    change_debouncer: ChangeDebouncer,
    /// Changes that the last check found but did not report.
    pending: Vec<FilePathAndContentId>,
    /// Output changes that may be temporary.
    suspects: PossiblyTransientChanges,
    /// Time after which to report a missing file or a changed output.
    quiet: Duration,
    say: F,
}

impl<F: FnMut(WatchEvent)> WatchThread<F> {
    fn run(mut self, orders: &Receiver<Message>) {
        loop {
            let pause = self.next_check_time().saturating_duration_since(Instant::now());
            match orders.recv_timeout(pause) {
                Ok(Message::Hint(hint)) => self.change_debouncer.add_hint(hint, Instant::now()),
                Ok(Message::Files(read, before, since)) => self.set_files(read, before, since),
                Ok(Message::Outputs) => self.update_watched_folders(),
                Err(RecvTimeoutError::Timeout) => self.check_and_report_changes(Instant::now()),
                Ok(Message::Quit) | Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn next_check_time(&self) -> Instant {
        let pause =
            if self.has_working_folder && self.folders.covers_all_folders() { HEARTBEAT } else { POLL };
        let unhinted = Instant::now() + pause;
        let due = [self.change_debouncer.next_check_time(), self.suspects.next_check_time(self.quiet)]
            .into_iter()
            .flatten()
            .min();
        due.map_or(unhinted, |due| due.min(unhinted))
    }

    fn set_files(
        &mut self,
        read: Vec<FilePathAndContentId>,
        known: Vec<FilePathAndContentId>,
        since: Instant,
    ) {
        let before = std::mem::take(&mut self.files);
        for FilePathAndContentId { path, content } in known {
            let known_content = before.get(&path).copied();
            self.files.insert(path, known_content.unwrap_or((content, since)));
        }
        for FilePathAndContentId { path, content } in read {
            // A change reported after `since` is newer than the content that was read. Ignore earlier
            // reports, because the file may have been restored.
            let known_content = before.get(&path).copied().filter(|(_, when)| *when > since);
            self.files.insert(path, known_content.unwrap_or((content, since)));
        }
        self.update_watched_folders();
        let was = |path: &PathBuf| before.get(path).map(|(content, _)| content);
        if self.files.iter().any(|(path, (content, _))| was(path) != Some(content)) {
            self.change_debouncer.add_hint(ChangeHint::Touched, Instant::now());
        }
    }

    /// Watches the folders of all files and outputs.
    fn update_watched_folders(&mut self) {
        let outputs = self.contents.outputs.paths_to_watch();
        let is_watched = |path: &Path| self.files.contains_key(path) || outputs.iter().any(|it| it == path);
        self.contents.retain(is_watched);
        self.folders.watch_folders_of_files(self.files.keys().chain(&outputs));
    }

    /// Checks all files and reports changes.
    fn check_and_report_changes(&mut self, now: Instant) {
        self.has_working_folder = working_folder::reenter_working_folder_if_removed();
        self.folders.renew_lost();
        for change in self.suspects.take_confirmed(&self.contents, self.quiet, now) {
            (self.say)(WatchEvent::Output(change));
        }
        let found = self.find_changed_files();
        let is_said = !self.postpone_report_if_early(&found, now);
        if is_said {
            for FilePathAndContentId { path, content } in found {
                self.files.insert(path, (content, now));
            }
            let noticed = self.change_debouncer.mark_reported(now);
            (self.say)(WatchEvent::Changed(ContentChangeTime { noticed }));
        }
        if self.change_debouncer.clear_if_settled(now) {
            (self.say)(WatchEvent::Settled);
        }
    }

    /// Keeps changes that are too early to report. Returns true if there is nothing to report now.
    fn postpone_report_if_early(&mut self, found: &[FilePathAndContentId], now: Instant) -> bool {
        let before = std::mem::take(&mut self.pending);
        if found.is_empty() {
            self.change_debouncer.discard_hints();
            return true;
        }
        let is_early = if self.change_debouncer.has_hints() {
            let moves = !before.is_empty() && before != found;
            self.change_debouncer.should_delay_report(has_missing_or_empty_file(found), moves, now)
        } else {
            // A notification was missed or is unavailable. The file may be incomplete, so wait for the next
            // check.
            self.folders.renew_all();
            self.change_debouncer.add_hint(ChangeHint::Touched, now);
            true
        };
        if is_early {
            self.pending = found.to_vec();
        }
        is_early
    }

    /// Returns the files whose content differs from the last reported content.
    fn find_changed_files(&self) -> Vec<FilePathAndContentId> {
        let token = CancelToken::new();
        // Use a token that is never canceled.
        let now =
            |path: &PathBuf| self.contents.read_content_id(path, &token).unwrap_or(FileContentId::Missing);
        let files = self.files.iter();
        let mut found: Vec<FilePathAndContentId> = files
            .map(|(path, (content, _))| (path, *content, now(path)))
            .filter(|(_, before, now)| before != now)
            .map(|(path, _, content)| FilePathAndContentId { path: path.clone(), content })
            .collect();
        found.sort_by(|a, b| a.path.cmp(&b.path));
        found
    }
}

/// Whether a file is missing or empty, in which case it is probably being replaced.
fn has_missing_or_empty_file(files: &[FilePathAndContentId]) -> bool {
    let empty = FileContentId::Hash(*blake3::hash(b"").as_bytes());
    files.iter().any(|file| file.content == FileContentId::Missing || file.content == empty)
}

#[cfg(test)]
mod tests;
