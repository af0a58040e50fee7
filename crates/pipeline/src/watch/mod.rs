//! Says when a file that a scene depends on holds something else.
//!
//! Editors save in many ways: in place, by rename, by unlink and rewrite. So folders are watched, of the name and
//! of what a link leads to; what happens there is taken as a hint only. The files' contents are compared, and only a
//! difference counts. A file that was closed after writing or renamed into its place is looked at at once; one that
//! is still being written, after a short quiet. Where hints cannot be had (network file systems, no watches left)
//! the contents' time stamps are looked at several times a second, and every two seconds everywhere. So they are while
//! a folder is gone, the working folder too, until one of its name is there.
//!
//! A program may write in pieces. So [`News::Settled`] follows a change once no more changes are expected: whoever finds the file
//! broken waits for that before reporting errors.

pub mod content;
mod folders;
mod growth;
mod home;
pub mod outputs;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use self::content::{Content, Contents, FileRead};
use self::folders::{Folders, Hint};
use self::growth::Growth;
pub use self::home::missing_folder;
use self::outputs::Suspects;
pub use self::outputs::{Lost, OutputChange};
use crate::control::CancelToken;

/// Between two looks where hints are had.
const HEARTBEAT: Duration = Duration::from_secs(2);
/// Between two looks where no hints are had.
const POLL: Duration = Duration::from_millis(200);
/// Shortest time between two reports of a change: enough for a first picture while saves never stop.
const BETWEEN_CHANGES: Duration = Duration::from_millis(100);

/// Times that files must be still, or may be in motion, before the watcher reacts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Waits {
    /// Without a hint, after which a file that is being written is looked at.
    quiet: Duration,
    /// The same where a file is missing or empty: most likely it is being replaced.
    quiet_missing: Duration,
    /// The longest wait for quiet.
    longest: Duration,
    /// Without a hint, after which files are settled. Programs that write a file in two goes take a fraction of it.
    settle: Duration,
    /// The same while a file was written and not closed: longer than a network makes `scp` or `sftp` pause.
    settle_open: Duration,
    /// The longest that files are unsettled, whatever happens to them.
    settle_longest: Duration,
}

impl Default for Waits {
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

/// News from a watcher.
#[derive(Clone, Debug)]
pub enum News {
    /// A file has another content, whole as far as can be told.
    Changed(Changed),
    /// The files that changed stay as they are: nobody seems to be writing.
    Settled,
    /// A file that glimt wrote was changed, or is as glimt wrote it again.
    Output(OutputChange),
}

/// Some file holds something else.
#[derive(Clone, Copy, Debug)]
pub struct Changed {
    /// When the first sign of it came: the start of "from save to first changed cell".
    pub noticed: Instant,
}

/// Watches files until it is dropped.
#[derive(Debug)]
pub struct Watcher {
    orders: Sender<Message>,
}

enum Message {
    /// Something happened to a watched name.
    Hint(Hint),
    /// Watch these, which were read after that, and these, which were read before.
    Files(Vec<FileRead>, Vec<FileRead>, Instant),
    /// The worker has written a file.
    Outputs,
    Quit,
}

impl Watcher {
    /// Starts without watching anything. `poll`: do not rely on the system's notifications. `contents`: the worker's knowledge of
    /// files, so that no file is hashed twice.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(
        poll: bool,
        contents: Arc<Contents>,
        say: impl FnMut(News) + Send + 'static,
    ) -> std::io::Result<Self> {
        Self::start_with(poll, contents, Waits::default(), say)
    }

    fn start_with(
        poll: bool,
        contents: Arc<Contents>,
        waits: Waits,
        say: impl FnMut(News) + Send + 'static,
    ) -> std::io::Result<Self> {
        home::remember();
        let (orders, received) = mpsc::channel();
        let hints = orders.clone();
        let folders = Folders::new(poll, move |hint| {
            // The watcher is gone: nobody wants hints.
            let _ = hints.send(Message::Hint(hint));
        });
        let growth = Growth::new(waits);
        let (files, pending, suspects) = Default::default();
        let quiet = waits.quiet_missing;
        let watch = Watch { folders, is_home: true, contents, files, growth, pending, suspects, quiet, say };
        std::thread::Builder::new().name("glimt-watch".to_owned()).spawn(move || watch.run(&received))?;
        Ok(Self { orders })
    }

    /// Watches these files and no others: files read after `since`, and files known from before. A file with another content than
    /// given counts as changed, unless a change was reported since it was read.
    pub fn set_files(&self, read: Vec<FileRead>, before: Vec<FileRead>, since: Instant) {
        let _ = self.orders.send(Message::Files(read, before, since));
    }

    /// Watches the files that the worker has written by now.
    pub fn watch_outputs(&self) {
        let _ = self.orders.send(Message::Outputs);
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        let _ = self.orders.send(Message::Quit);
    }
}

struct Watch<F> {
    folders: Folders,
    /// Whether the working folder is there.
    is_home: bool,
    contents: Arc<Contents>,
    /// Contents of the files when a change was last reported, or when they were last read, whichever is later; and that time.
    files: HashMap<PathBuf, (Content, Instant)>,
    growth: Growth,
    /// Changes that the last look found and did not report.
    pending: Vec<FileRead>,
    /// Changes of outputs that may pass.
    suspects: Suspects,
    /// Time after which they do not.
    quiet: Duration,
    say: F,
}

impl<F: FnMut(News)> Watch<F> {
    fn run(mut self, orders: &Receiver<Message>) {
        loop {
            let pause = self.next_look().saturating_duration_since(Instant::now());
            match orders.recv_timeout(pause) {
                Ok(Message::Hint(hint)) => self.growth.hint(hint, Instant::now()),
                Ok(Message::Files(read, before, since)) => self.set(read, before, since),
                Ok(Message::Outputs) => self.set_folders(),
                Err(RecvTimeoutError::Timeout) => self.look(Instant::now()),
                Ok(Message::Quit) | Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn next_look(&self) -> Instant {
        let pause = if self.is_home && self.folders.gives_hints() { HEARTBEAT } else { POLL };
        let unhinted = Instant::now() + pause;
        let due = [self.growth.due(), self.suspects.due(self.quiet)].into_iter().flatten().min();
        due.map_or(unhinted, |due| due.min(unhinted))
    }

    fn set(&mut self, read: Vec<FileRead>, known: Vec<FileRead>, since: Instant) {
        let before = std::mem::take(&mut self.files);
        for FileRead { path, content } in known {
            let said = before.get(&path).copied();
            self.files.insert(path, said.unwrap_or((content, since)));
        }
        for FileRead { path, content } in read {
            // A report after `since` is newer than what was read; an earlier report is not, and the file may be as it was again.
            let said = before.get(&path).copied().filter(|(_, when)| *when > since);
            self.files.insert(path, said.unwrap_or((content, since)));
        }
        self.set_folders();
        let was = |path: &PathBuf| before.get(path).map(|(content, _)| content);
        if self.files.iter().any(|(path, (content, _))| was(path) != Some(content)) {
            self.growth.hint(Hint::Touched, Instant::now());
        }
    }

    /// Watches the folders of all files, and of the outputs.
    fn set_folders(&mut self) {
        let outputs = self.contents.outputs.paths();
        let is_watched = |path: &Path| self.files.contains_key(path) || outputs.iter().any(|it| it == path);
        self.contents.retain(is_watched);
        self.folders.set(self.files.keys().chain(&outputs));
    }

    /// It is time for a look, by the signs or without any.
    fn look(&mut self, now: Instant) {
        self.is_home = home::is_there();
        self.folders.renew_lost();
        for change in self.suspects.look(&self.contents, self.quiet, now) {
            (self.say)(News::Output(change));
        }
        let found = self.differences();
        let is_said = !self.is_early(&found, now);
        if is_said {
            for FileRead { path, content } in found {
                self.files.insert(path, (content, now));
            }
            let noticed = self.growth.said(now);
            (self.say)(News::Changed(Changed { noticed }));
        }
        if self.growth.settles(now) {
            (self.say)(News::Settled);
        }
    }

    /// Whether there is nothing to say of what a look found, not yet at least.
    fn is_early(&mut self, found: &[FileRead], now: Instant) -> bool {
        let before = std::mem::take(&mut self.pending);
        if found.is_empty() {
            self.growth.saw_nothing();
            return true;
        }
        let is_early = if self.growth.is_signed() {
            let moves = !before.is_empty() && before != found;
            self.growth.is_early(is_missing(found), moves, now)
        } else {
            // A hint was missed, or there are none: whether it is still being written the next look tells.
            self.folders.renew();
            self.growth.hint(Hint::Touched, now);
            true
        };
        if is_early {
            self.pending = found.to_vec();
        }
        is_early
    }

    /// Files that do not hold what was last said of them.
    fn differences(&self) -> Vec<FileRead> {
        let token = CancelToken::new();
        // Nobody cancels this token.
        let now = |path: &PathBuf| self.contents.read(path, &token).unwrap_or(Content::Missing);
        let files = self.files.iter();
        let mut found: Vec<FileRead> = files
            .map(|(path, (content, _))| (path, *content, now(path)))
            .filter(|(_, before, now)| before != now)
            .map(|(path, _, content)| FileRead { path: path.clone(), content })
            .collect();
        found.sort_by(|a, b| a.path.cmp(&b.path));
        found
    }
}

/// Whether a file is missing or empty: probably in the middle of being replaced.
fn is_missing(files: &[FileRead]) -> bool {
    let empty = Content::Hash(*blake3::hash(b"").as_bytes());
    files.iter().any(|file| file.content == Content::Missing || file.content == empty)
}

#[cfg(test)]
mod tests;
