//! Lists and removes folders. Unlike `std::fs::read_dir` and `remove_dir_all`, these functions do not panic
//! if the system fails to close a folder.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use rustix::fs::{AtFlags, Dir, Mode, OFlags, openat, unlinkat};

/// Names of a folder's entries, in the order returned by the system. The list ends at the first entry that
/// cannot be read.
///
/// # Errors
/// Returns an error if the folder cannot be opened.
pub fn entry_names(folder: &Path) -> io::Result<impl Iterator<Item = OsString> + use<>> {
    entry_names_in(File::open(folder)?.as_fd())
}

fn entry_names_in(folder: BorrowedFd<'_>) -> io::Result<impl Iterator<Item = OsString> + use<>> {
    let entries = Dir::read_from(folder)?.map_while(Result::ok);
    let name = |entry: rustix::fs::DirEntry| OsStr::from_bytes(entry.file_name().to_bytes()).to_owned();
    Ok(entries.map(name).filter(|name| name != "." && name != ".."))
}

/// Removes a folder and its contents. Symbolic links are removed, not followed.
///
/// # Errors
/// Returns an error if the folder or any of its contents cannot be removed.
pub fn remove_folder_and_contents(folder: &Path) -> io::Result<()> {
    let parent = folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = folder.file_name().ok_or(io::ErrorKind::InvalidInput)?;
    remove_folder_recursively(File::open(parent)?.as_fd(), name)
}

fn remove_folder_recursively(parent: BorrowedFd<'_>, name: &OsStr) -> io::Result<()> {
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let folder: OwnedFd = openat(parent, name, flags, Mode::empty())?;
    // Read all names first because removing entries may disturb the listing.
    let names: Vec<OsString> = entry_names_in(folder.as_fd())?.collect();
    for name in names {
        match unlinkat(&folder, &name, AtFlags::empty()) {
            Ok(()) => {}
            Err(rustix::io::Errno::ISDIR | rustix::io::Errno::PERM) => {
                remove_folder_recursively(folder.as_fd(), &name)?;
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(unlinkat(parent, name, AtFlags::REMOVEDIR)?)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn removing_a_folder_keeps_linked_folders() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("tree/a/b")).expect("folders");
        fs::create_dir(at("kept")).expect("a folder");
        for name in ["tree/1", "tree/a/2", "tree/a/b/3", "kept/4"] {
            fs::write(at(name), "").expect("written");
        }
        std::os::unix::fs::symlink(at("kept"), at("tree/a/link")).expect("a link");
        let mut listed: Vec<_> = entry_names(&at("tree/a")).expect("listed").collect();
        listed.sort();
        assert_eq!(listed, ["2", "b", "link"]);
        remove_folder_and_contents(&at("tree")).expect("removed");
        assert_eq!(entry_names(folder.path()).expect("listed").collect::<Vec<_>>(), ["kept"]);
        assert!(at("kept/4").exists());
        assert!(
            remove_folder_and_contents(&at("tree")).is_err()
                && remove_folder_and_contents(&at("kept/4")).is_err()
        );
        assert!(entry_names(&at("none")).is_err());
    }
}
