//! Copies file flags (chattr(1)) to a replacement file.

use std::fs::File;
use std::path::Path;

use rustix::fs::{IFlags, ioctl_getflags, ioctl_setflags};

/// Flags that users can set, except append-only and immutable, because files with these two are never
/// replaced. All other flags are managed by the system.
const USER_FLAGS: IFlags = IFlags::NODUMP
    .union(IFlags::NOATIME)
    .union(IFlags::SYNC)
    .union(IFlags::JOURNALING)
    .union(IFlags::COMPRESSED)
    .union(IFlags::NOCOW)
    .union(IFlags::SECURE_REMOVAL)
    .union(IFlags::UNRM);

/// Flags of a file. `None` if they cannot be read or the file system does not support them.
#[derive(Debug)]
pub(super) struct InodeFlags(Option<IFlags>);

impl InodeFlags {
    /// Reads the flags of a file.
    pub(super) fn read(path: &Path) -> Self {
        Self(File::open(path).ok().and_then(|file| ioctl_getflags(file).ok()))
    }

    /// Applies the flags to a new, empty file and returns whether this succeeded.
    pub(super) fn try_apply_to_file(&self, new: &File) -> bool {
        let Some(wanted) = self.0 else { return true };
        let set = || {
            let now = ioctl_getflags(new)?;
            let then = (now - USER_FLAGS) | (wanted & USER_FLAGS);
            // Skip the call if nothing changes, because it may require special permissions.
            if now == then { Ok(()) } else { ioctl_setflags(new, then) }
        };
        set().is_ok()
    }
}

#[cfg(test)]
mod tests {
    use super::super::write;
    use super::*;

    #[test]
    fn file_flags_are_kept_despite_folder_flags() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let flags = |path: &Path| ioctl_getflags(File::open(path).expect("a file"));
        let set = |path: &Path, to: IFlags| {
            let now = flags(path)?;
            ioctl_setflags(File::open(path).expect("a file"), (now - USER_FLAGS) | to)
        };
        for flag in [IFlags::NODUMP, IFlags::NODUMP | IFlags::NOATIME, IFlags::empty()] {
            std::fs::write(&path, "old").expect("written");
            if let Err(error) = set(&path, flag).and_then(|()| set(folder.path(), IFlags::NODUMP)) {
                return eprintln!("skipped: flags are not supported here: {error}");
            }
            write::write_atomically(&path, b"new").expect("written");
            assert_eq!(std::fs::read(&path).expect("read"), b"new");
            assert_eq!(flags(&path).expect("flags") & USER_FLAGS, flag);
        }
    }
}
