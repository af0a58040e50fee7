//! Says when a file that a scene depends on holds something else.
//!
//! Editors save in many ways: in place, by rename, by unlink and rewrite. So folders are watched, of the name and
//! of what a link leads to; what happens there is taken as a hint only. After a short quiet the files' contents
//! are compared, and only a difference counts. Where hints cannot be had (network file systems, no watches left)
//! the contents' time stamps are looked at several times a second, and every two seconds everywhere.

pub mod content;
mod folders;

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use self::content::{Content, Contents, FileRead};
use self::folders::Folders;
use crate::control::CancelToken;

/// Time without a hint after which a save is taken to be over.
const QUIET: Duration = Duration::from_millis(40);
/// The same where a file is missing: most likely it is being replaced.
const QUIET_MISSING: Duration = Duration::from_millis(250);
/// The longest wait for quiet.
const PATIENCE: Duration = Duration::from_millis(500);
/// Between two looks where hints are had.
const HEARTBEAT: Duration = Duration::from_secs(2);
/// Between two looks where no hints are had.
const POLL: Duration = Duration::from_millis(200);

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
    Hint,
    /// Watch these.
    Files(Vec<FileRead>),
    Quit,
}

impl Watcher {
    /// Watch nothing yet. `poll`: do not rely on the system's notifications. `contents`: what the worker knows, so
    /// that no file is hashed twice.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(
        poll: bool,
        contents: Arc<Contents>,
        changed: impl FnMut(Changed) + Send + 'static,
    ) -> std::io::Result<Self> {
        let (orders, received) = mpsc::channel();
        let hints = orders.clone();
        let folders = Folders::new(poll, move || {
            // The watcher is gone: nobody wants hints.
            let _ = hints.send(Message::Hint);
        });
        let watch =
            Watch { folders, contents, files: HashMap::new(), signs: None, pending: Vec::new(), changed };
        std::thread::Builder::new().name("glimt-watch".to_owned()).spawn(move || watch.run(&received))?;
        Ok(Self { orders })
    }

    /// Watch these files and no others. A file that was not watched before and holds something else than given
    /// counts as changed.
    pub fn set_files(&self, files: Vec<FileRead>) {
        let _ = self.orders.send(Message::Files(files));
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        let _ = self.orders.send(Message::Quit);
    }
}

struct Watch<F> {
    folders: Folders,
    contents: Arc<Contents>,
    /// What the files held when that was last said, or when they were last read.
    files: HashMap<PathBuf, Content>,
    /// When the first sign of a change came, and the latest.
    signs: Option<(Instant, Instant)>,
    /// What was found by a look without a sign before it.
    pending: Vec<FileRead>,
    changed: F,
}

impl<F: FnMut(Changed)> Watch<F> {
    fn run(mut self, orders: &Receiver<Message>) {
        loop {
            match orders.recv_timeout(self.pause()) {
                Ok(Message::Hint) => self.sign(),
                Ok(Message::Files(files)) => self.set(files),
                Err(RecvTimeoutError::Timeout) => self.look(),
                Ok(Message::Quit) | Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn pause(&self) -> Duration {
        match self.signs {
            Some((first, latest)) => {
                (latest + QUIET).min(first + PATIENCE).saturating_duration_since(Instant::now())
            }
            None if self.folders.gives_hints() => HEARTBEAT,
            None => POLL,
        }
    }

    fn sign(&mut self) {
        let now = Instant::now();
        self.signs = Some((self.signs.map_or(now, |(first, _)| first), now));
    }

    fn set(&mut self, files: Vec<FileRead>) {
        let before = std::mem::take(&mut self.files);
        for FileRead { path, content } in files {
            // What was already said of a file is newer than what was read of it.
            let content = before.get(&path).copied().unwrap_or(content);
            self.files.insert(path, content);
        }
        self.contents.retain(|path| self.files.contains_key(path));
        self.folders.set(self.files.keys());
        if self.files.keys().any(|path| !before.contains_key(path)) {
            self.sign();
        }
    }

    /// It was quiet for long enough, or it is time for a look without a sign.
    fn look(&mut self) {
        let found = self.differences();
        let Some((first, _)) = self.signs.filter(|_| !found.is_empty()) else {
            self.signs = None;
            if !found.is_empty() {
                self.folders.renew();
                self.pending = found;
                self.sign();
            }
            return;
        };
        let moves = !self.pending.is_empty() && self.pending != found;
        self.pending.clear();
        if first.elapsed() < PATIENCE && (moves || (first.elapsed() < QUIET_MISSING && is_half_way(&found))) {
            self.pending = found;
            return self.sign();
        }
        for FileRead { path, content } in found {
            self.files.insert(path, content);
        }
        self.signs = None;
        (self.changed)(Changed { noticed: first });
    }

    /// Files that do not hold what was last said of them.
    fn differences(&self) -> Vec<FileRead> {
        let token = CancelToken::new();
        let now = |path: &PathBuf| self.contents.read(path, &token).unwrap_or(Content::Unusable);
        let files = self.files.iter();
        let mut found: Vec<FileRead> = files
            .map(|(path, content)| (path, *content, now(path)))
            .filter(|(_, before, now)| before != now)
            .map(|(path, _, content)| FileRead { path: path.clone(), content })
            .collect();
        found.sort_by(|a, b| a.path.cmp(&b.path));
        found
    }
}

/// Whether a file is missing or empty: probably in the middle of being replaced.
fn is_half_way(files: &[FileRead]) -> bool {
    let empty = Content::Hash(*blake3::hash(b"").as_bytes());
    files.iter().any(|file| file.content == Content::Missing || file.content == empty)
}

#[cfg(test)]
mod tests;
