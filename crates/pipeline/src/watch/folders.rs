//! Watches the folders that contain relevant files, and converts system notifications to hints.

use std::collections::{HashMap, HashSet};
use std::ffi::OsString;
use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use notify::event::{AccessKind, AccessMode, EventKind, ModifyKind, RenameMode};
use notify::{Event, RecommendedWatcher, RecursiveMode, Watcher};

/// A notification about a watched file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ChangeHint {
    /// The file was closed after writing, or renamed into place.
    Complete(OsString),
    /// The file was written to and is still open.
    Written(OsString),
    /// The file was removed or renamed away.
    Gone(OsString),
    /// Something else happened, perhaps to an unknown file.
    Touched,
}

/// Set of watched folders.
#[derive(Debug)]
pub(super) struct WatchedFolders {
    /// `None` if notifications are disabled or unavailable.
    watcher: Option<RecommendedWatcher>,
    names: Arc<Mutex<HashSet<OsString>>>,
    /// Folders to watch, and whether each is on a network file system, which sends no notifications.
    wanted: HashMap<PathBuf, bool>,
    /// Watched folders, with their identities at the time they were added.
    watched: HashMap<PathBuf, FolderIdentity>,
}

/// A folder's device and inode, which differ if another folder takes its name.
type FolderIdentity = (u64, u64);

fn folder_identity(folder: &Path) -> Option<FolderIdentity> {
    fs::metadata(folder).ok().map(|metadata| (metadata.dev(), metadata.ino()))
}

/// Returns the watcher, or `None` if its thread did not start. A watcher without a thread has already dropped
/// its handler, which shares `names`. It would panic when used or dropped, so it is leaked.
fn watcher_if_alive<W>(watcher: W, names: &Arc<Mutex<HashSet<OsString>>>) -> Option<W> {
    if Arc::strong_count(names) > 1 {
        return Some(watcher);
    }
    std::mem::forget(watcher);
    None
}

impl WatchedFolders {
    pub(super) fn new(poll: bool, say: impl Fn(ChangeHint) + Send + 'static) -> Self {
        let names: Arc<Mutex<HashSet<OsString>>> = Arc::default();
        let of_interest = names.clone();
        let handler = move |event: notify::Result<Event>| {
            let names = of_interest.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(hint) =
                event.map_or(Some(ChangeHint::Touched), |event| change_hint_for_event(&event, &names))
            {
                say(hint);
            }
        };
        let watcher = if poll { None } else { notify::recommended_watcher(handler).ok() };
        let watcher = watcher.and_then(|watcher| watcher_if_alive(watcher, &names));
        Self { watcher, names, wanted: HashMap::new(), watched: HashMap::new() }
    }

    /// Whether notifications cover all folders.
    pub(super) fn covers_all_folders(&self) -> bool {
        self.watcher.is_some() && self.watched.len() == self.wanted.len()
    }

    /// Watches the folders that contain the files or the targets of symbolic links.
    pub(super) fn watch_folders_of_files<'a>(&mut self, files: impl Iterator<Item = &'a PathBuf>) {
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
        // An event with the folder's own name means that the folder was removed.
        let own = folders
            .iter()
            .filter_map(|folder| folder.canonicalize().ok()?.file_name().map(ToOwned::to_owned));
        names.extend(own);
        *self.names.lock().unwrap_or_else(PoisonError::into_inner) = names;
        let is_gone = |folder: &PathBuf| !folders.contains(folder);
        self.unwatch_matching(is_gone);
        self.wanted = folders.into_iter().map(|folder| (folder.clone(), is_remote(&folder))).collect();
        self.watch_wanted();
    }

    /// Renews the watches of folders that were replaced or recreated.
    pub(super) fn renew_lost(&mut self) {
        let lost: HashSet<PathBuf> = self
            .watched
            .iter()
            .filter(|(folder, known)| folder_identity(folder) != Some(**known))
            .map(|(folder, _)| folder.clone())
            .collect();
        self.unwatch_matching(|folder| lost.contains(folder));
        self.watch_wanted();
    }

    /// Renews all watches, because any of them may be broken if a notification was missed.
    pub(super) fn renew_all(&mut self) {
        self.unwatch_matching(|_| true);
        self.watch_wanted();
    }

    fn unwatch_matching(&mut self, is_released: impl Fn(&PathBuf) -> bool) {
        let Some(watcher) = &mut self.watcher else { return };
        self.watched.retain(|folder, _| {
            let stays = !is_released(folder);
            if !stays {
                // The folder may have been removed, which ends the watch.
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
            // Read the identity first, so that a replacement between the two steps is detected later.
            if let Some(identity) = folder_identity(folder)
                && watcher.watch(folder, RecursiveMode::NonRecursive).is_ok()
            {
                self.watched.insert(folder.clone(), identity);
            }
        }
    }
}

/// Converts an event to a hint if it concerns one of the names. Ignores reads, because the watcher's own
/// reads would wake it.
fn change_hint_for_event(event: &Event, names: &HashSet<OsString>) -> Option<ChangeHint> {
    let mut of_paths = event.paths.iter().map(|path| path.file_name());
    let named = of_paths.clone().flatten().find(|name| names.contains(*name)).map(ToOwned::to_owned);
    // An event without a path or a file name may concern any file.
    let Some(name) = named else {
        let is_any = event.paths.is_empty() || of_paths.any(|name| name.is_none());
        return (is_any && !matches!(event.kind, EventKind::Access(_))).then_some(ChangeHint::Touched);
    };
    match event.kind {
        EventKind::Access(AccessKind::Close(AccessMode::Write)) => Some(ChangeHint::Complete(name)),
        EventKind::Access(_) => None,
        EventKind::Modify(ModifyKind::Name(RenameMode::To)) => Some(ChangeHint::Complete(name)),
        // Each of the two names also has its own event.
        EventKind::Modify(ModifyKind::Name(RenameMode::Both)) => None,
        EventKind::Modify(ModifyKind::Data(_)) => Some(ChangeHint::Written(name)),
        EventKind::Modify(ModifyKind::Name(RenameMode::From)) | EventKind::Remove(_) => {
            Some(ChangeHint::Gone(name))
        }
        EventKind::Any | EventKind::Create(_) | EventKind::Modify(_) | EventKind::Other => {
            Some(ChangeHint::Touched)
        }
    }
}

/// Whether the folder is on a network file system, where changes by other machines do not cause
/// notifications.
#[cfg(target_os = "linux")]
fn is_remote(folder: &Path) -> bool {
    use nix::sys::statfs::{self, statfs};
    // Constants from linux/magic.h that nix lacks: the kernel's SMB1 and SMB2 clients, 9P, Ceph, AFS.
    const OTHERS: [u32; 5] = [0xff53_4d42, 0xfe53_4d42, 0x0102_1997, 0x00c3_6400, 0x5346_414f];
    let Ok(stat) = statfs(folder) else { return false };
    let kind = stat.filesystem_type();
    [statfs::NFS_SUPER_MAGIC, statfs::SMB_SUPER_MAGIC, statfs::FUSE_SUPER_MAGIC].contains(&kind)
        || OTHERS.contains(&(kind.0 as u32))
}

/// Always false: other systems rely on notifications and the heartbeat.
#[cfg(not(target_os = "linux"))]
fn is_remote(_folder: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use notify::event::{CreateKind, DataChange, RemoveKind};

    use super::*;

    /// A watcher whose thread failed to start.
    struct FailedWatcher;

    impl Drop for FailedWatcher {
        fn drop(&mut self) {
            panic!("dropped");
        }
    }

    #[test]
    fn watcher_without_thread_is_not_used() {
        let names: Arc<Mutex<HashSet<OsString>>> = Arc::default();
        assert!(watcher_if_alive(FailedWatcher, &names).is_none());
        let _handler = names.clone();
        assert_eq!(watcher_if_alive(1, &names), Some(1));
    }

    #[test]
    fn events_are_converted_to_hints() {
        let names = HashSet::from([OsString::from("a.toml")]);
        let of =
            |kind, path: &str| change_hint_for_event(&Event::new(kind).add_path(PathBuf::from(path)), &names);
        let name = || OsString::from("a.toml");
        let closed = EventKind::Access(AccessKind::Close(AccessMode::Write));
        let renamed = |mode| EventKind::Modify(ModifyKind::Name(mode));
        assert_eq!(of(closed, "/x/a.toml"), Some(ChangeHint::Complete(name())));
        assert_eq!(of(renamed(RenameMode::To), "/x/a.toml"), Some(ChangeHint::Complete(name())));
        assert_eq!(of(renamed(RenameMode::From), "/x/a.toml"), Some(ChangeHint::Gone(name())));
        assert_eq!(of(renamed(RenameMode::Both), "/x/a.toml"), None);
        assert_eq!(of(EventKind::Remove(RemoveKind::File), "/x/a.toml"), Some(ChangeHint::Gone(name())));
        let written = EventKind::Modify(ModifyKind::Data(DataChange::Any));
        assert_eq!(of(written, "/x/a.toml"), Some(ChangeHint::Written(name())));
        assert_eq!(of(EventKind::Create(CreateKind::File), "/x/a.toml"), Some(ChangeHint::Touched));
    }

    #[test]
    fn reads_and_unrelated_names_are_ignored() {
        let names = HashSet::from([OsString::from("a.toml")]);
        let of =
            |kind, path: &str| change_hint_for_event(&Event::new(kind).add_path(PathBuf::from(path)), &names);
        let opened = EventKind::Access(AccessKind::Open(AccessMode::Any));
        let read = EventKind::Access(AccessKind::Close(AccessMode::Read));
        assert_eq!(of(opened, "/x/a.toml"), None);
        assert_eq!(of(read, "/x/a.toml"), None);
        assert_eq!(of(EventKind::Access(AccessKind::Close(AccessMode::Write)), "/x/a.png"), None);
        assert_eq!(of(EventKind::Create(CreateKind::File), "/x/b"), None);
        let overflow = Event::new(EventKind::Other);
        assert_eq!(
            change_hint_for_event(&overflow, &names),
            Some(ChangeHint::Touched),
            "a queue overflow may concern any file"
        );
    }
}
