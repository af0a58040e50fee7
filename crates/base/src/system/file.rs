//! Files that have an end, and can be opened and read to it without blocking.

use std::fs::{self, File, Metadata, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

/// Kind of file that a name leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A file that can be read to its end.
    Regular,
    /// A folder.
    Folder,
    /// A pipe, a socket or a device.
    Special,
    /// A file that looks regular, but whose content the kernel makes up during the read, perhaps without end.
    Kernel,
}

impl Kind {
    /// The words for it, to follow `it is`.
    pub fn words(self) -> &'static str {
        match self {
            Self::Regular => "a regular file",
            Self::Folder => "a folder",
            Self::Special => "a pipe, a socket or a device",
            Self::Kernel => "a file of the kernel, as in /proc",
        }
    }

    fn of(path: &Path, metadata: &Metadata) -> Self {
        match () {
            () if metadata.is_dir() => Self::Folder,
            () if !metadata.is_file() => Self::Special,
            () if is_of_kernel(path) => Self::Kernel,
            () => Self::Regular,
        }
    }
}

/// Kind of file that a name leads to, links followed, and its metadata.
///
/// # Errors
/// No file has this name, or it may not be looked at.
pub fn kind(path: &Path) -> io::Result<(Kind, Metadata)> {
    let metadata = fs::metadata(path)?;
    Ok((Kind::of(path, &metadata), metadata))
}

/// Reason for which a person would not want another file to replace this one. `None` if there is no such reason.
/// Permissions count also for root, whom they do not stop.
pub fn why_keep(metadata: &Metadata) -> Option<&'static str> {
    match () {
        () if metadata.nlink() > 1 => Some("has other names (hard links), which would keep the old text"),
        () if metadata.permissions().readonly() => Some("is read-only"),
        () => None,
    }
}

/// Opens a file for reading if it is a regular one; else returns its kind. Nothing that would block is opened, even if
/// the name leads elsewhere by then.
///
/// # Errors
/// The file does not exist, or may not be read.
pub fn open(path: &Path) -> io::Result<Result<(File, Metadata), Kind>> {
    let (kind, _) = kind(path)?;
    if kind != Kind::Regular {
        return Ok(Err(kind));
    }
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, nix::libc::O_NONBLOCK);
    let file = options.open(path)?;
    let metadata = file.metadata()?;
    Ok(match Kind::of(path, &metadata) {
        Kind::Regular => Ok((file, metadata)),
        other => Err(other),
    })
}

/// Whether a file lies in one of the kernel's own file systems.
#[cfg(target_os = "linux")]
fn is_of_kernel(path: &Path) -> bool {
    use nix::sys::statfs::{
        CGROUP_SUPER_MAGIC, CGROUP2_SUPER_MAGIC, DEBUGFS_MAGIC, PROC_SUPER_MAGIC, SYSFS_MAGIC, TRACEFS_MAGIC,
        statfs,
    };
    const KERNEL: [nix::sys::statfs::FsType; 6] = [
        PROC_SUPER_MAGIC,
        SYSFS_MAGIC,
        TRACEFS_MAGIC,
        DEBUGFS_MAGIC,
        CGROUP_SUPER_MAGIC,
        CGROUP2_SUPER_MAGIC,
    ];
    statfs(path).is_ok_and(|found| KERNEL.contains(&found.filesystem_type()))
}

#[cfg(not(target_os = "linux"))]
fn is_of_kernel(_: &Path) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_are_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let said = |path: &Path| open(path).expect("it is there").err();
        assert_eq!(said(folder.path()), Some(Kind::Folder));
        assert_eq!(said(Path::new("/dev/zero")), Some(Kind::Special));
        let pipe = folder.path().join("pipe");
        nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).expect("a pipe");
        assert_eq!(said(&pipe), Some(Kind::Special));
        let file = folder.path().join("file");
        fs::write(&file, "text").expect("written");
        assert_eq!(said(&file), None);
        assert_eq!(open(&folder.path().join("none")).expect_err("nothing").kind(), io::ErrorKind::NotFound);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn files_of_the_kernel_are_not_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/proc/kmsg", &link).expect("a link");
        for path in [Path::new("/proc/kmsg"), Path::new("/proc/self/status"), &link] {
            assert_eq!(open(path).expect("it is there").err(), Some(Kind::Kernel), "{}", path.display());
        }
        // A path to an open file by its number leads to the file itself.
        let file = File::create(folder.path().join("file")).expect("a file");
        let number = std::os::fd::AsRawFd::as_raw_fd(&file);
        let same = format!("/proc/self/fd/{number}");
        assert!(open(Path::new(&same)).expect("it is there").is_ok());
    }
}
