//! Identity of the file that a path leads to, whatever its name.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::place::{directory_of, follow};

/// Identity of a regular file, existing or not: two paths with the same identity lead to the same file. It resolves
/// links of both kinds, `..`, and file systems that do not distinguish small letters from capitals.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum FileIdentity {
    /// A file that exists.
    Existing {
        /// Device of its file system.
        device: u64,
        /// Its inode there.
        inode: u64,
    },
    /// A file that does not exist yet, in a folder that does.
    New {
        /// Device of the folder's file system.
        device: u64,
        /// The folder's inode there.
        inode: u64,
        /// Its name in that folder.
        name: OsString,
    },
}

impl FileIdentity {
    /// The identity of the path's file. `None` if a write would replace nothing: folders, devices, pipes, and paths
    /// that cannot be followed.
    pub fn of(path: &Path) -> Option<Self> {
        match fs::metadata(path) {
            Ok(found) if found.is_file() => Some(Self::Existing { device: found.dev(), inode: found.ino() }),
            Err(error) if error.kind() == ErrorKind::NotFound => Self::of_new(path),
            Ok(_) | Err(_) => None,
        }
    }

    /// Whether it is the identity of an open file.
    pub fn is_of(&self, file: &File) -> bool {
        let found = |found: fs::Metadata| Self::Existing { device: found.dev(), inode: found.ino() };
        file.metadata().is_ok_and(|metadata| found(metadata) == *self)
    }

    fn of_new(path: &Path) -> Option<Self> {
        let (target, _) = follow(path).ok()?;
        let folder = fs::metadata(directory_of(&target)).ok()?;
        let name = target.file_name()?.to_owned();
        Some(Self::New { device: folder.dev(), inode: folder.ino(), name })
    }
}

/// Properties of an existing file by which it is known where its identity is not enough: some file systems that ignore case have no
/// stable inodes, such as FAT and some network mounts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Likeness {
    real: PathBuf,
    /// The folder in lower case.
    folder: PathBuf,
    /// The name in lower case.
    name: OsString,
    length: u64,
    modified: (i64, i64),
}

impl Likeness {
    /// The likeness of the path's file. `None` if it is not an existing regular file.
    pub fn of(path: &Path) -> Option<Self> {
        let found = fs::metadata(path).ok().filter(fs::Metadata::is_file)?;
        let real = path.canonicalize().ok()?;
        let lower = PathBuf::from(real.to_string_lossy().to_lowercase());
        Some(Self {
            folder: lower.parent()?.to_owned(),
            name: lower.file_name()?.to_owned(),
            length: found.len(),
            modified: (found.mtime(), found.mtime_nsec()),
            real,
        })
    }

    /// Whether both have to be taken for one file: they are in one folder, and their names differ in case at most, or they have the same
    /// length, time and content.
    pub fn is_like(&self, other: &Self) -> bool {
        let is_stamp_same = || (self.length, self.modified) == (other.length, other.modified);
        self.folder == other.folder
            && (self.name == other.name || is_stamp_same() && have_one_content(&self.real, &other.real))
    }
}

fn have_one_content(one: &Path, other: &Path) -> bool {
    let hash = |path: &Path| {
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(File::open(path).ok()?).ok()?;
        Some(hasher.finalize())
    };
    hash(one).is_some_and(|hash_of_one| Some(hash_of_one) == hash(other))
}

/// Whether two paths lead to one file, existing or not, or to files that have to be taken for one ([`Likeness`]).
pub fn is_one_file(one: &Path, other: &Path) -> bool {
    let Some(identity) = FileIdentity::of(one) else { return false };
    let are_alike = || Some(Likeness::of(one)?.is_like(&Likeness::of(other)?));
    FileIdentity::of(other) == Some(identity) || are_alike().unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn one_file_has_one_identity_by_all_its_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("far/away")).expect("folders");
        fs::write(at("a"), "").expect("written");
        fs::write(at("far/b"), "").expect("written");
        symlink("a", at("link")).expect("a link");
        fs::hard_link(at("a"), at("hard")).expect("a link");
        symlink("far/away", at("near")).expect("a link");
        let of = |name: &str| FileIdentity::of(&at(name)).expect(name);
        for name in ["./a", "far/../a", "link", "hard", "far/away/../../a"] {
            assert_eq!(of(name), of("a"), "{name}");
        }
        assert_eq!(of("near/../b"), of("far/b"), "`..` is the folder above that which the link leads to");
        assert_ne!(of("far/b"), of("a"));
    }

    #[test]
    fn a_file_that_is_not_there_yet_has_one_too() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("far/away")).expect("folders");
        symlink("far/away", at("near")).expect("a link");
        symlink("second", at("first")).expect("a link");
        symlink("near/new", at("second")).expect("a link");
        let of = |name: &str| FileIdentity::of(&at(name));
        for name in ["near/new", "./far/away/new", "first", "second"] {
            assert_eq!(of(name), of("far/away/new"), "{name}");
            assert!(matches!(of(name), Some(FileIdentity::New { .. })), "{name}");
        }
        assert_ne!(of("new"), of("far/away/new"));
        assert_ne!(of("near/../new"), of("new"));
        assert_eq!(of("nowhere/new"), None, "nothing can be written there");
    }

    #[test]
    fn files_that_may_be_one_are_taken_for_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("other")).expect("a folder");
        // A file system that distinguishes case stands for one whose inodes do not tell.
        let files =
            [("t.png", "one"), ("T.PNG", "longer"), ("a.png", "one"), ("b.png", "two"), ("c.png", "one")];
        for (name, text) in files.into_iter().chain([("other/t.png", "one")]) {
            fs::write(at(name), text).expect("written");
        }
        let stamp = fs::metadata(at("t.png")).and_then(|found| found.modified()).expect("a time");
        let later = stamp + std::time::Duration::from_secs(1);
        for (name, time) in [("a.png", stamp), ("b.png", stamp), ("c.png", later), ("other/t.png", stamp)] {
            let file = File::options().write(true).open(at(name));
            file.and_then(|file| file.set_modified(time)).expect("set");
        }
        for (name, is_one) in [
            ("t.png", true),
            ("T.PNG", true),
            ("a.png", true),
            ("b.png", false),
            ("c.png", false),
            ("other/t.png", false),
            ("none", false),
        ] {
            assert_eq!(is_one_file(&at(name), &at("t.png")), is_one, "{name}");
        }
        assert!(!is_one_file(folder.path(), folder.path()), "a folder is not a file");
        assert!(is_one_file(&at("none"), &at("other/../none")), "one that does not exist yet");
    }

    #[test]
    fn what_is_not_replaced_has_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let circle = folder.path().join("circle");
        symlink("circle", &circle).expect("a link");
        for path in
            [folder.path(), Path::new("/dev/null"), Path::new("/dev/null/x"), &circle, Path::new("..")]
        {
            assert_eq!(FileIdentity::of(path), None, "{}", path.display());
        }
    }
}
