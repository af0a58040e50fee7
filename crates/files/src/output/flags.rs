//! Flags that chattr(1) sets, carried over to the file that takes a file's place.

use std::fs::File;
use std::path::Path;

use rustix::fs::{IFlags, ioctl_getflags, ioctl_setflags};

/// Flags that a person sets and files keep. Append-only and immutable files are not replaced; the other flags are the
/// system's own.
const CARRIED: IFlags = IFlags::NODUMP
    .union(IFlags::NOATIME)
    .union(IFlags::SYNC)
    .union(IFlags::JOURNALING)
    .union(IFlags::COMPRESSED)
    .union(IFlags::NOCOW)
    .union(IFlags::SECURE_REMOVAL)
    .union(IFlags::UNRM);

/// The flags of a file; `None` if they cannot be read, or if its file system has none.
#[derive(Debug)]
pub(super) struct Flags(Option<IFlags>);

impl Flags {
    /// Reads the flags of the file.
    pub(super) fn of(path: &Path) -> Self {
        Self(File::open(path).ok().and_then(|file| ioctl_getflags(file).ok()))
    }

    /// Gives the flags to a new, empty file; returns whether it has them.
    pub(super) fn carry_over(&self, new: &File) -> bool {
        let Some(wanted) = self.0 else { return true };
        let set = || {
            let now = ioctl_getflags(new)?;
            let then = (now - CARRIED) | (wanted & CARRIED);
            // Flags that are already set need no right to be set.
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
    fn flags_stay_and_those_of_the_folder_do_not_take_their_place() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.png");
        let flags = |path: &Path| ioctl_getflags(File::open(path).expect("it is there"));
        let set = |path: &Path, to: IFlags| {
            let now = flags(path)?;
            ioctl_setflags(File::open(path).expect("it is there"), (now - CARRIED) | to)
        };
        for flag in [IFlags::NODUMP, IFlags::NODUMP | IFlags::NOATIME, IFlags::empty()] {
            std::fs::write(&path, "old").expect("written");
            if let Err(error) = set(&path, flag).and_then(|()| set(folder.path(), IFlags::NODUMP)) {
                return eprintln!("skipped: no flags can be had here: {error}");
            }
            write::atomic(&path, b"new").expect("written");
            assert_eq!(std::fs::read(&path).expect("read"), b"new");
            assert_eq!(flags(&path).expect("flags") & CARRIED, flag);
        }
    }
}
