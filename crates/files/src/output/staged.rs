//! New files that appear together: written into a hidden folder beside their places, then moved there.

use std::ffi::OsStr;
use std::fs::{self, DirBuilder, File};
use std::io::{self, ErrorKind};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use super::move_new::move_new;
use super::temporary::{ATTEMPTS, next_name, remove_stale_folders};
use super::{OutputError, stoppable};
use crate::control::CancelToken;
use crate::system::folder::remove_all;

/// Writes files that are not there yet, each with its path below a folder: all of them, or none. They go into a hidden folder first;
/// then each first part of a path gets its place, in the order of the files, never in place of anything. Hidden folders of killed
/// writers are removed.
///
/// # Errors
/// Names the path that could not be written, [`ErrorKind::AlreadyExists`] among the reasons; or the token is cancelled.
pub fn new_files(folder: &Path, files: &[(PathBuf, &[u8])], token: &CancelToken) -> Result<(), OutputError> {
    super::write::prepare_process();
    let at = |name: &Path| {
        let path = folder.join(name);
        move |error: io::Error| OutputError::file(&path, error)
    };
    let Some((last, _)) = files.last() else { return Ok(()) };
    // Write all of them where nobody looks.
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    remove_stale_folders(here);
    let hidden = Hidden::create(here, last.as_os_str()).map_err(at(last))?;
    for (name, bytes) in files {
        stoppable::or_cancelled(hidden.write(name, bytes, token), at(name))?;
    }
    // Move them into their places; take them back if one is taken by now.
    let mut placed: Vec<&OsStr> = Vec::new();
    for (name, _) in files {
        let Some(first) = name.iter().next().filter(|first| !placed.contains(first)) else { continue };
        if let Err(error) = move_new(&hidden.path.join(first), &here.join(first)) {
            take_back(here, &placed, files);
            return Err(at(Path::new(first))(error));
        }
        placed.push(first);
    }
    Ok(())
}

/// Removes files that were placed, and their folders unless somebody else has put a file there. The caller reports the error that led
/// to it in any case.
fn take_back(folder: &Path, placed: &[&OsStr], files: &[(PathBuf, &[u8])]) {
    for (name, _) in
        files.iter().filter(|(name, _)| name.iter().next().is_some_and(|first| placed.contains(&first)))
    {
        let _ = fs::remove_file(folder.join(name));
    }
    for first in placed {
        let _ = fs::remove_dir(folder.join(first));
    }
}

/// A hidden folder, locked while its writer lives, removed with what is left in it.
struct Hidden {
    path: PathBuf,
    _lock: File,
}

impl Hidden {
    fn create(folder: &Path, name: &OsStr) -> io::Result<Self> {
        for _ in 0..ATTEMPTS {
            let path = folder.join(next_name(name));
            match DirBuilder::new().mode(0o700).create(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
                Ok(()) => {
                    let lock = File::open(&path)?;
                    // Without locks, nobody takes it for stale.
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
        stoppable::write_all(&file, bytes, token)?;
        file.sync_all()
    }
}

impl Drop for Hidden {
    fn drop(&mut self) {
        // Ignore a failure: the next writer tries again.
        let _ = remove_all(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::super::temporary::tests::{dead_name, foreign_name};
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
    fn all_files_appear_or_none() {
        let directory = tempfile::tempdir().expect("a folder");
        let at = directory.path();
        let files = [
            (PathBuf::from("a_files/x.ply"), &b"x"[..]),
            (PathBuf::from("a_files/y.ply"), b"y"),
            (PathBuf::from("a.toml"), b"text"),
        ];
        new_files(at, &files, &CancelToken::new()).expect("written");
        assert_eq!(names(at), ["a.toml", "a_files"]);
        assert_eq!(names(&at.join("a_files")), ["x.ply", "y.ply"]);
        // Whatever is there stays: a file, and even an empty folder.
        fs::remove_dir_all(at.join("a_files")).expect("removed");
        let said = new_files(at, &files, &CancelToken::new()).expect_err("taken").to_string();
        assert!(said.contains("a.toml"), "{said}");
        assert_eq!(
            (names(at), fs::read(at.join("a.toml")).expect("a file")),
            (vec!["a.toml".to_owned()], b"text".to_vec())
        );
        fs::remove_file(at.join("a.toml")).expect("removed");
        fs::create_dir(at.join("a_files")).expect("a folder");
        assert!(new_files(at, &files, &CancelToken::new()).is_err());
        assert_eq!((names(at), names(&at.join("a_files"))), (vec!["a_files".to_owned()], Vec::new()));
        // A cancelled write leaves nothing.
        fs::remove_dir(at.join("a_files")).expect("removed");
        let token = CancelToken::new();
        token.cancel();
        assert!(matches!(new_files(at, &files, &token), Err(OutputError::Cancelled(_))));
        assert_eq!(names(at), [""; 0]);
    }

    #[test]
    fn only_hidden_folders_of_dead_writers_of_this_machine_are_removed() {
        let directory = tempfile::tempdir().expect("a folder");
        let at = directory.path();
        let living = Hidden::create(at, OsStr::new("a.toml")).expect("a folder");
        let [stale, foreign] = [dead_name("a.toml"), foreign_name("a.toml")].map(|name| at.join(name));
        let other = at.join(".a.toml.tmp");
        for folder in [&stale, &foreign, &other] {
            fs::create_dir_all(folder.join("a_files")).expect("a folder");
        }
        new_files(at, &[(PathBuf::from("b.toml"), b"text")], &CancelToken::new()).expect("written");
        assert!(living.path.exists() && other.exists() && foreign.exists() && !stale.exists());
    }
}
