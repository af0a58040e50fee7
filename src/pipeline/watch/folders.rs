//! The folders in which watched files are, and the system's hints of what happens there.

use std::collections::HashSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use notify::event::{AccessKind, AccessMode, EventKind};
use notify::{Event, RecommendedWatcher, RecursiveMode, Watcher};

/// Watches folders for what happens to some names in them.
#[derive(Debug)]
pub(super) struct Folders {
    /// None where hints are not wanted or cannot be had.
    watcher: Option<RecommendedWatcher>,
    names: Arc<Mutex<HashSet<OsString>>>,
    watched: HashSet<PathBuf>,
    /// Whether every folder is watched.
    is_complete: bool,
}

impl Folders {
    pub(super) fn new(poll: bool, hint: impl Fn() + Send + 'static) -> Self {
        let names: Arc<Mutex<HashSet<OsString>>> = Arc::default();
        let of_interest = names.clone();
        let handler = move |event: notify::Result<Event>| {
            let names = of_interest.lock().unwrap_or_else(PoisonError::into_inner);
            if event.map_or(true, |event| is_hint(&event, &names)) {
                hint();
            }
        };
        let watcher = if poll { None } else { notify::recommended_watcher(handler).ok() };
        Self { watcher, names, watched: HashSet::new(), is_complete: true }
    }

    /// Whether changes of all files are told by themselves.
    pub(super) fn gives_hints(&self) -> bool {
        self.watcher.is_some() && self.is_complete
    }

    /// Watch the folders of these files: of the name, and of what it leads to if it is a link.
    pub(super) fn set<'a>(&mut self, files: impl Iterator<Item = &'a PathBuf>) {
        let mut folders = HashSet::new();
        let mut names = HashSet::new();
        for file in files {
            let mut add = |path: &Path| {
                names.extend(path.file_name().map(ToOwned::to_owned));
                let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
                folders.insert(parent.unwrap_or(Path::new(".")).to_owned());
            };
            add(file);
            if let Ok(canonical) = file.canonicalize() {
                add(&canonical);
            }
        }
        *self.names.lock().unwrap_or_else(PoisonError::into_inner) = names;
        let Some(watcher) = &mut self.watcher else { return };
        for gone in self.watched.difference(&folders) {
            // It may have been removed: then there is nothing to end.
            let _ = watcher.unwatch(gone);
        }
        self.watched.retain(|folder| folders.contains(folder));
        self.is_complete = true;
        for folder in folders {
            let is_watched = self.watched.contains(&folder)
                || (!is_remote(&folder) && watcher.watch(&folder, RecursiveMode::NonRecursive).is_ok());
            self.is_complete &= is_watched;
            if is_watched {
                self.watched.insert(folder);
            }
        }
    }

    /// A hint was missed: a folder may have been replaced by another one of its name.
    pub(super) fn renew(&mut self) {
        let Some(watcher) = &mut self.watcher else { return };
        self.watched.retain(|folder| {
            // Not watched any more is what is wanted.
            let _ = watcher.unwatch(folder);
            watcher.watch(folder, RecursiveMode::NonRecursive).is_ok()
        });
    }
}

/// Reading is no change: a watcher that reads must not wake itself.
fn is_hint(event: &Event, names: &HashSet<OsString>) -> bool {
    let may_change = match event.kind {
        EventKind::Access(kind) => kind == AccessKind::Close(AccessMode::Write),
        _ => true,
    };
    let is_named = |path: &PathBuf| path.file_name().is_none_or(|name| names.contains(name));
    may_change && (event.paths.is_empty() || event.paths.iter().any(is_named))
}

/// Whether changes made by another machine would go unnoticed.
#[cfg(target_os = "linux")]
fn is_remote(folder: &Path) -> bool {
    use nix::sys::statfs::{self, statfs};
    // From linux/magic.h where the library has no name: SMB1 and SMB2 by the kernel's client, 9P, Ceph, AFS.
    const OTHERS: [u32; 5] = [0xff53_4d42, 0xfe53_4d42, 0x0102_1997, 0x00c3_6400, 0x5346_414f];
    let Ok(stat) = statfs(folder) else { return false };
    let kind = stat.filesystem_type();
    [statfs::NFS_SUPER_MAGIC, statfs::SMB_SUPER_MAGIC, statfs::FUSE_SUPER_MAGIC].contains(&kind)
        || OTHERS.contains(&(kind.0 as u32))
}

/// Elsewhere the notifications are relied on, with the heartbeat behind them.
#[cfg(not(target_os = "linux"))]
fn is_remote(_folder: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_and_other_names_are_no_hint() {
        let names = HashSet::from([OsString::from("a.toml")]);
        let event = |kind, path: &str| Event::new(kind).add_path(PathBuf::from(path));
        let closed = EventKind::Access(AccessKind::Close(AccessMode::Write));
        let opened = EventKind::Access(AccessKind::Open(AccessMode::Any));
        assert!(is_hint(&event(closed, "/x/a.toml"), &names));
        assert!(!is_hint(&event(opened, "/x/a.toml"), &names));
        assert!(!is_hint(&event(closed, "/x/a.png"), &names));
        assert!(is_hint(&Event::new(EventKind::Other), &names), "the queue overflowed");
    }
}
