//! The folders in which watched files are, and the system's hints of what happens there.

use std::collections::{HashMap, HashSet};
use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use notify::event::{AccessKind, AccessMode, EventKind, ModifyKind, RenameMode};
use notify::{Event, RecommendedWatcher, RecursiveMode, Watcher};

/// An event about a watched name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Hint {
    /// It was closed after writing, or renamed into its place.
    Whole(OsString),
    /// It was written to, and is still open.
    Written(OsString),
    /// It was removed or renamed away.
    Gone(OsString),
    /// Something else, perhaps to a name that is not known.
    Touched,
}

/// Watches folders for what happens to some names in them.
#[derive(Debug)]
pub(super) struct Folders {
    /// None where hints are not wanted or cannot be had.
    watcher: Option<RecommendedWatcher>,
    names: Arc<Mutex<HashSet<OsString>>>,
    /// All folders that are to be watched, and whether each is on another machine, which says nothing.
    wanted: HashMap<PathBuf, bool>,
    /// Watched folders, with their identities at that time.
    watched: HashMap<PathBuf, Identity>,
}

/// Device and number of a folder: another one may take its name.
type Identity = (u64, u64);

fn identity(folder: &Path) -> Option<Identity> {
    fs::metadata(folder).ok().map(|metadata| (metadata.dev(), metadata.ino()))
}

/// The watcher, unless its thread could not be started: then its handler, which shares `names`, is gone, and all that the watcher can
/// do is panic, also when it is dropped.
fn if_alive<W>(watcher: W, names: &Arc<Mutex<HashSet<OsString>>>) -> Option<W> {
    if Arc::strong_count(names) > 1 {
        return Some(watcher);
    }
    std::mem::forget(watcher);
    None
}

impl Folders {
    pub(super) fn new(poll: bool, say: impl Fn(Hint) + Send + 'static) -> Self {
        let names: Arc<Mutex<HashSet<OsString>>> = Arc::default();
        let of_interest = names.clone();
        let handler = move |event: notify::Result<Event>| {
            let names = of_interest.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(hint) = event.map_or(Some(Hint::Touched), |event| hint(&event, &names)) {
                say(hint);
            }
        };
        let watcher = if poll { None } else { notify::recommended_watcher(handler).ok() };
        let watcher = watcher.and_then(|watcher| if_alive(watcher, &names));
        Self { watcher, names, wanted: HashMap::new(), watched: HashMap::new() }
    }

    /// Whether the system reports changes of all files.
    pub(super) fn gives_hints(&self) -> bool {
        self.watcher.is_some() && self.watched.len() == self.wanted.len()
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
        // An event under a folder's own name reports that the folder is gone.
        let own = folders
            .iter()
            .filter_map(|folder| folder.canonicalize().ok()?.file_name().map(ToOwned::to_owned));
        names.extend(own);
        *self.names.lock().unwrap_or_else(PoisonError::into_inner) = names;
        let is_gone = |folder: &PathBuf| !folders.contains(folder);
        self.release(is_gone);
        self.wanted = folders.into_iter().map(|folder| (folder.clone(), is_remote(&folder))).collect();
        self.watch_wanted();
    }

    /// Watch those again whose names other folders have now, and those that are back.
    pub(super) fn renew_lost(&mut self) {
        let lost: HashSet<PathBuf> = self
            .watched
            .iter()
            .filter(|(folder, known)| identity(folder) != Some(**known))
            .map(|(folder, _)| folder.clone())
            .collect();
        self.release(|folder| lost.contains(folder));
        self.watch_wanted();
    }

    /// A hint was missed: none of them may be watched as it should be.
    pub(super) fn renew(&mut self) {
        self.release(|_| true);
        self.watch_wanted();
    }

    fn release(&mut self, is_released: impl Fn(&PathBuf) -> bool) {
        let Some(watcher) = &mut self.watcher else { return };
        self.watched.retain(|folder, _| {
            let stays = !is_released(folder);
            if !stays {
                // It may have been removed: then there is nothing to end.
                let _ = watcher.unwatch(folder);
            }
            stays
        });
    }

    fn watch_wanted(&mut self) {
        let Some(watcher) = &mut self.watcher else { return };
        for (folder, is_remote) in &self.wanted {
            if *is_remote || self.watched.contains_key(folder) {
                continue;
            }
            // Looked at before: one that changes in between is then seen as another one.
            if let Some(identity) = identity(folder)
                && watcher.watch(folder, RecursiveMode::NonRecursive).is_ok()
            {
                self.watched.insert(folder.clone(), identity);
            }
        }
    }
}

/// Meaning of an event for these names. Reading does not count as a change: a watcher that reads must not wake itself.
fn hint(event: &Event, names: &HashSet<OsString>) -> Option<Hint> {
    let mut of_paths = event.paths.iter().map(|path| path.file_name());
    let named = of_paths.clone().flatten().find(|name| names.contains(*name)).map(ToOwned::to_owned);
    // A path that has no name, or no path at all, may stand for any.
    let Some(name) = named else {
        let is_any = event.paths.is_empty() || of_paths.any(|name| name.is_none());
        return (is_any && !matches!(event.kind, EventKind::Access(_))).then_some(Hint::Touched);
    };
    match event.kind {
        EventKind::Access(AccessKind::Close(AccessMode::Write)) => Some(Hint::Whole(name)),
        EventKind::Access(_) => None,
        EventKind::Modify(ModifyKind::Name(RenameMode::To)) => Some(Hint::Whole(name)),
        // Both of its ends have events of their own.
        EventKind::Modify(ModifyKind::Name(RenameMode::Both)) => None,
        EventKind::Modify(ModifyKind::Data(_)) => Some(Hint::Written(name)),
        EventKind::Modify(ModifyKind::Name(RenameMode::From)) | EventKind::Remove(_) => {
            Some(Hint::Gone(name))
        }
        EventKind::Any | EventKind::Create(_) | EventKind::Modify(_) | EventKind::Other => {
            Some(Hint::Touched)
        }
    }
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
    use notify::event::{CreateKind, DataChange, RemoveKind};

    use super::*;

    /// As the watcher of a thread that was not started.
    struct Dead;

    impl Drop for Dead {
        fn drop(&mut self) {
            panic!("dropped");
        }
    }

    #[test]
    fn watchers_without_threads_are_not_used() {
        let names: Arc<Mutex<HashSet<OsString>>> = Arc::default();
        assert!(if_alive(Dead, &names).is_none());
        let _handler = names.clone();
        assert_eq!(if_alive(1, &names), Some(1));
    }

    #[test]
    fn an_event_says_whether_a_save_is_over() {
        let names = HashSet::from([OsString::from("a.toml")]);
        let of = |kind, path: &str| hint(&Event::new(kind).add_path(PathBuf::from(path)), &names);
        let name = || OsString::from("a.toml");
        let closed = EventKind::Access(AccessKind::Close(AccessMode::Write));
        let renamed = |mode| EventKind::Modify(ModifyKind::Name(mode));
        assert_eq!(of(closed, "/x/a.toml"), Some(Hint::Whole(name())));
        assert_eq!(of(renamed(RenameMode::To), "/x/a.toml"), Some(Hint::Whole(name())));
        assert_eq!(of(renamed(RenameMode::From), "/x/a.toml"), Some(Hint::Gone(name())));
        assert_eq!(of(renamed(RenameMode::Both), "/x/a.toml"), None);
        assert_eq!(of(EventKind::Remove(RemoveKind::File), "/x/a.toml"), Some(Hint::Gone(name())));
        let written = EventKind::Modify(ModifyKind::Data(DataChange::Any));
        assert_eq!(of(written, "/x/a.toml"), Some(Hint::Written(name())));
        assert_eq!(of(EventKind::Create(CreateKind::File), "/x/a.toml"), Some(Hint::Touched));
    }

    #[test]
    fn reads_and_other_names_are_no_hint() {
        let names = HashSet::from([OsString::from("a.toml")]);
        let of = |kind, path: &str| hint(&Event::new(kind).add_path(PathBuf::from(path)), &names);
        let opened = EventKind::Access(AccessKind::Open(AccessMode::Any));
        let read = EventKind::Access(AccessKind::Close(AccessMode::Read));
        assert_eq!(of(opened, "/x/a.toml"), None);
        assert_eq!(of(read, "/x/a.toml"), None);
        assert_eq!(of(EventKind::Access(AccessKind::Close(AccessMode::Write)), "/x/a.png"), None);
        assert_eq!(of(EventKind::Create(CreateKind::File), "/x/b"), None);
        let overflow = Event::new(EventKind::Other);
        assert_eq!(hint(&overflow, &names), Some(Hint::Touched), "the queue overflowed");
    }
}
