//! Checks file protections other than permissions: chattr(1) flags and sticky directories. Without these
//! checks, the error would not occur until rename(2), after the new file has been written.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use nix::unistd::{Uid, geteuid};

/// Mode bit for directories in which only owners may replace files.
const STICKY: u32 = 0o1000;

/// A flag that protects a file, or all files in a directory. Not even root can replace a protected file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProtectionFlag {
    /// `chattr +a`
    AppendOnly,
    /// `chattr +i`
    Immutable,
}

impl ProtectionFlag {
    /// Returns the flag that protects a file or directory, or `None` if there is none or flags are not
    /// supported.
    #[cfg(target_os = "linux")]
    pub(super) fn from_path(path: &Path) -> Option<Self> {
        use rustix::fs::{AtFlags, CWD, StatxAttributes, StatxFlags, statx};
        let found = statx(CWD, path, AtFlags::empty(), StatxFlags::empty()).ok()?.stx_attributes;
        if found.contains(StatxAttributes::IMMUTABLE) {
            Some(Self::Immutable)
        } else {
            found.contains(StatxAttributes::APPEND).then_some(Self::AppendOnly)
        }
    }

    #[cfg(not(target_os = "linux"))]
    pub(super) fn from_path(_: &Path) -> Option<Self> {
        None
    }

    /// Description of the flag.
    pub(super) fn description(self) -> &'static str {
        match self {
            Self::AppendOnly => "append-only (chattr +a)",
            Self::Immutable => "immutable (chattr +i)",
        }
    }

    /// Returns advice on removing the flag.
    pub(super) fn removal_advice(self) -> &'static str {
        match self {
            Self::AppendOnly => "remove the flag (chattr -a) or choose another location",
            Self::Immutable => "remove the flag (chattr -i) or choose another location",
        }
    }
}

/// Whether a sticky directory prevents this process from replacing a file. This is the case if the process
/// owns neither the directory nor the file, and lacks the capability to act as the owner.
pub(super) fn is_protected_by_sticky_bit(directory: &Metadata, file: &Metadata) -> bool {
    let user = geteuid();
    let is_own = |found: &Metadata| Uid::from_raw(found.uid()) == user;
    directory.mode() & STICKY != 0 && !is_own(directory) && !is_own(file) && !has_fowner_capability(user)
}

/// Whether this thread may act as the owner of any file.
#[cfg(target_os = "linux")]
fn has_fowner_capability(user: Uid) -> bool {
    use rustix::thread::{CapabilitySet, capabilities};
    capabilities(None)
        .map_or(user.is_root(), |capabilities| capabilities.effective.contains(CapabilitySet::FOWNER))
}

#[cfg(not(target_os = "linux"))]
fn has_fowner_capability(user: Uid) -> bool {
    user.is_root()
}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    use std::fs::{self, File, Permissions};
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::path::PathBuf;

    use rustix::fs::{IFlags, ioctl_getflags, ioctl_setflags};

    use super::super::{check_image_target, write};

    /// A file or directory with a flag. The flag is cleared when this value is dropped.
    struct Flagged(PathBuf);

    impl Flagged {
        /// Sets a flag. Returns `None` if this fails because the user is not root or the file system does not
        /// support flags.
        fn new(path: PathBuf, flag: IFlags) -> Option<Self> {
            let set = change(&path, |flags| flags | flag);
            if let Err(error) = &set {
                eprintln!("skipped: {} does not support flags: {error}", path.display());
            }
            set.is_ok().then(|| Self(path))
        }
    }

    impl Drop for Flagged {
        fn drop(&mut self) {
            let cleared = change(&self.0, |flags| flags - IFlags::APPEND - IFlags::IMMUTABLE);
            cleared.expect("clearing the flags should succeed");
        }
    }

    fn change(path: &std::path::Path, to: impl Fn(IFlags) -> IFlags) -> rustix::io::Result<()> {
        let file = File::open(path).expect("a file");
        ioctl_setflags(&file, to(ioctl_getflags(&file)?))
    }

    fn refused(path: &std::path::Path) -> String {
        let before = check_image_target(path).expect_err("refused before rendering").to_string();
        let after = write::write_atomically(path, b"new").expect_err("refused when writing").to_string();
        assert_eq!(before, after);
        after
    }

    #[test]
    fn chattr_flags_are_detected_before_writing() {
        let folder = tempfile::tempdir().expect("a folder");
        let directory = folder.path().join("kept");
        let (old, new) = (directory.join("old.png"), directory.join("new.png"));
        let link = folder.path().join("link.png");
        fs::create_dir(&directory).expect("a directory");
        fs::write(&old, "old").expect("written");
        symlink(&old, &link).expect("a link");
        let of_directory = format!("the directory {}", directory.display());
        for (flagged, called, flag, words, advice) in [
            (&old, "it", IFlags::APPEND, "append-only (chattr +a)", "(chattr -a)"),
            (&old, "it", IFlags::IMMUTABLE, "immutable (chattr +i)", "(chattr -i)"),
            (&directory, &*of_directory, IFlags::APPEND, "append-only (chattr +a)", "(chattr -a)"),
            (&directory, &*of_directory, IFlags::IMMUTABLE, "immutable (chattr +i)", "(chattr -i)"),
        ] {
            let Some(_flagged) = Flagged::new(flagged.clone(), flag) else { return };
            let targets = if flagged == &old { vec![&old, &link] } else { vec![&old, &link, &new] };
            for path in targets {
                let expected = format!(
                    "cannot write {}: {called} is {words}; remove the flag {advice} or choose another location",
                    path.display()
                );
                assert_eq!(refused(path), expected);
            }
            assert_eq!(fs::read_dir(&directory).expect("a directory").count(), 1, "{words}: {called}");
            assert_eq!(fs::read(&old).expect("read"), b"old");
        }
        write::write_atomically(&link, b"new").expect("replaced without flags");
        assert_eq!(fs::read(&old).expect("read"), b"new");
    }

    /// Requires root, because a thread switches to another user.
    #[test]
    fn sticky_directories_protect_other_users_files() {
        use rustix::thread::{set_thread_res_gid, set_thread_res_uid};
        const NOBODY: u32 = 65534;
        let folder = tempfile::tempdir().expect("a folder");
        let [other, own] = ["other.png", "own.png"].map(|name| folder.path().join(name));
        for path in [&other, &own] {
            fs::write(path, "old").expect("written");
            fs::set_permissions(path, Permissions::from_mode(0o666)).expect("permitted");
        }
        if std::os::unix::fs::chown(&own, Some(NOBODY), Some(NOBODY)).is_err() {
            eprintln!("skipped: creating another user's files requires root");
            return;
        }
        let permit = |mode| {
            fs::set_permissions(folder.path(), Permissions::from_mode(mode)).expect("permitted");
        };
        let as_nobody = |work: &(dyn Fn() + Sync)| {
            let become_nobody = || {
                let (user, group) = (rustix::fs::Uid::from_raw(NOBODY), rustix::fs::Gid::from_raw(NOBODY));
                set_thread_res_gid(group, group, group).expect("another group");
                set_thread_res_uid(user, user, user).expect("another user");
                work();
            };
            std::thread::scope(|scope| scope.spawn(become_nobody).join().expect("no panic"));
        };
        permit(0o1777);
        as_nobody(&|| {
            let expected = format!(
                "cannot write {}: it belongs to another user, and in the sticky directory {} only its owner may \
                 replace it; choose another name or location",
                other.display(),
                folder.path().display()
            );
            assert_eq!(refused(&other), expected);
            write::write_atomically(&own, b"new").expect("its own file");
            write::write_atomically(&folder.path().join("new.png"), b"new").expect("a new file");
        });
        assert_eq!(fs::read(&other).expect("read"), b"old");
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 3);
        write::write_atomically(&own, b"root's").expect("root may replace the file");
        permit(0o777);
        as_nobody(&|| write::write_atomically(&other, b"new").expect("not sticky"));
    }
}
