//! Creates several files atomically by writing them to a hidden folder and moving them to their destinations.

use std::ffi::OsStr;
use std::fs::{self, DirBuilder, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use super::move_new::rename_no_replace;
use super::temporary::{ATTEMPTS, next_temporary_name, remove_stale_folders};
use super::{OutputError, cancelable};
use crate::control::CancelToken;
use crate::system::folder::remove_folder_and_contents;

/// Creates files at paths relative to a folder. Creates either all of the files or none, without overwriting
/// anything. The files are written to a hidden folder, then the first component of each path is moved to its
/// destination, in the order of the files. Also removes hidden folders left by killed processes.
///
/// # Errors
/// A path cannot be written, for example because it exists ([`ErrorKind::AlreadyExists`]), or the operation
/// is canceled.
pub fn create_files_atomically(
    folder: &Path,
    files: &[(PathBuf, &[u8])],
    token: &CancelToken,
) -> Result<(), OutputError> {
    super::write::ignore_file_size_signal();
    let at = |name: &Path| {
        let path = folder.join(name);
        move |error: io::Error| OutputError::from_io(&path, error)
    };
    let Some((last, _)) = files.last() else { return Ok(()) };
    // Write all files to the hidden folder.
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    remove_stale_folders(here);
    let hidden = StagingFolder::create(here, last.as_os_str()).map_err(at(last))?;
    for (name, bytes) in files {
        cancelable::map_write_error(hidden.write(name, bytes, token), at(name))?;
    }
    // Move the files to their destinations. If a destination exists, undo all moves.
    let mut placed: Vec<&OsStr> = Vec::new();
    for (name, _) in files {
        let Some(first) = name.iter().next().filter(|first| !placed.contains(first)) else { continue };
        if let Err(error) = rename_no_replace(&hidden.path.join(first), &here.join(first)) {
            remove_placed_files(here, &placed, files);
            return Err(at(Path::new(first))(error));
        }
        placed.push(first);
    }
    Ok(())
}

/// Removes files that were already moved, and their folders unless they contain other files. Ignores errors
/// because the caller reports the original error.
fn remove_placed_files(folder: &Path, placed: &[&OsStr], files: &[(PathBuf, &[u8])]) {
    for (name, _) in
        files.iter().filter(|(name, _)| name.iter().next().is_some_and(|first| placed.contains(&first)))
    {
        let _ = fs::remove_file(folder.join(name));
    }
    for first in placed {
        let _ = fs::remove_dir(folder.join(first));
    }
}

/// A hidden folder that its writer locks, and that is removed with its contents on drop.
struct StagingFolder {
    path: PathBuf,
    _lock: File,
}

impl StagingFolder {
    fn create(folder: &Path, name: &OsStr) -> io::Result<Self> {
        for _ in 0..ATTEMPTS {
            let path = folder.join(next_temporary_name(name));
            match DirBuilder::new().mode(0o700).create(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
                Ok(()) => {
                    let lock = File::open(&path)?;
                    // If locking is not supported, no process treats the folder as stale and removes it.
                    let _ = lock.try_lock();
                    return Ok(Self { path, _lock: lock });
                }
            }
        }
        Err(io::Error::new(ErrorKind::AlreadyExists, "no free name for a temporary folder"))
    }

    fn write(&self, name: &Path, bytes: &[u8], token: &CancelToken) -> io::Result<()> {
        let path = self.path.join(name);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent)?;
        }
        let file = File::create_new(&path)?;
        cancelable::write_all(&file, bytes, token)?;
        file.sync_all()
    }
}

impl Drop for StagingFolder {
    fn drop(&mut self) {
        // Ignore errors, because the next writer tries again. Removing an empty folder needs no descriptors.
        let _ = fs::remove_dir(&self.path).or_else(|_| remove_folder_and_contents(&self.path));
    }
}

#[cfg(test)]
mod tests {
    use super::super::temporary::tests::{stale_temporary_name, temporary_name_of_other_machine};
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("a folder");
        let mut names: Vec<String> = entries
            .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn either_all_files_are_created_or_none() {
        let directory = tempfile::tempdir().expect("a folder");
        let at = directory.path();
        let files = [
            (PathBuf::from("a_files/x.ply"), &b"x"[..]),
            (PathBuf::from("a_files/y.ply"), b"y"),
            (PathBuf::from("a.toml"), b"text"),
        ];
        create_files_atomically(at, &files, &CancelToken::new()).expect("written");
        assert_eq!(names(at), ["a.toml", "a_files"]);
        assert_eq!(names(&at.join("a_files")), ["x.ply", "y.ply"]);
        // Existing files and folders are kept, even empty folders.
        fs::remove_dir_all(at.join("a_files")).expect("removed");
        let taken = create_files_atomically(at, &files, &CancelToken::new()).expect_err("taken");
        assert!(matches!(&taken, OutputError::File { path, .. } if path.ends_with("a.toml")), "{taken}");
        assert_eq!(
            (names(at), fs::read(at.join("a.toml")).expect("a file")),
            (vec!["a.toml".to_owned()], b"text".to_vec())
        );
        fs::remove_file(at.join("a.toml")).expect("removed");
        fs::create_dir(at.join("a_files")).expect("a folder");
        assert!(create_files_atomically(at, &files, &CancelToken::new()).is_err());
        assert_eq!((names(at), names(&at.join("a_files"))), (vec!["a_files".to_owned()], Vec::new()));
        // A canceled operation leaves no files behind.
        fs::remove_dir(at.join("a_files")).expect("removed");
        let token = CancelToken::new();
        token.cancel();
        assert!(matches!(create_files_atomically(at, &files, &token), Err(OutputError::Canceled(_))));
        assert_eq!(names(at), [""; 0]);
    }

    #[test]
    fn only_stale_folders_are_removed() {
        let directory = tempfile::tempdir().expect("a folder");
        let at = directory.path();
        let living = StagingFolder::create(at, OsStr::new("a.toml")).expect("a folder");
        let [stale, foreign] = [stale_temporary_name("a.toml"), temporary_name_of_other_machine("a.toml")]
            .map(|name| at.join(name));
        let other = at.join(".a.toml.tmp");
        for folder in [&stale, &foreign, &other] {
            fs::create_dir_all(folder.join("a_files")).expect("a folder");
        }
        create_files_atomically(at, &[(PathBuf::from("b.toml"), b"text")], &CancelToken::new())
            .expect("written");
        assert!(living.path.exists() && other.exists() && foreign.exists() && !stale.exists());
    }
}
