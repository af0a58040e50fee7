//! Moves files and folders without overwriting.

use std::fs::{self, File};
use std::io;
use std::path::Path;

/// Moves a file or a folder. Fails if the destination exists.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
pub(super) fn rename_no_replace(from: &Path, to: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    use rustix::io::Errno;
    match renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE) {
        // The file system or kernel does not support the flag.
        Err(Errno::INVAL | Errno::NOSYS | Errno::NOTSUP) => rename_over_new_placeholder(from, to),
        moved => moved.map_err(io::Error::from),
    }
}

#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
pub(super) fn rename_no_replace(from: &Path, to: &Path) -> io::Result<()> {
    rename_over_new_placeholder(from, to)
}

/// Implements [`rename_no_replace`] with two system calls. The first call fails if the destination exists.
fn rename_over_new_placeholder(from: &Path, to: &Path) -> io::Result<()> {
    if from.is_dir() {
        // A rename can replace only an empty folder, such as this new one.
        fs::create_dir(to)?;
        fs::rename(from, to)
    } else {
        drop(File::create_new(to)?);
        fs::rename(from, to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stepwise_moves_do_not_overwrite_files() {
        let directory = tempfile::tempdir().expect("a folder");
        let at = |name: &str| directory.path().join(name);
        fs::create_dir_all(at("from/in")).expect("a folder");
        fs::create_dir(at("to")).expect("a folder");
        assert!(rename_over_new_placeholder(&at("from"), &at("to")).is_err() && at("from/in").exists());
        rename_over_new_placeholder(&at("from"), &at("new")).expect("moved");
        fs::write(at("file"), "1").expect("a file");
        fs::write(at("other"), "2").expect("a file");
        assert!(rename_over_new_placeholder(&at("file"), &at("other")).is_err());
        assert_eq!(fs::read(at("other")).expect("a file"), b"2");
        rename_over_new_placeholder(&at("file"), &at("last")).expect("moved");
        assert!(at("new/in").exists() && at("last").exists());
    }
}
