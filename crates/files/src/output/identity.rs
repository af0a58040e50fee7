//! Identifies the file that a path refers to.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use super::resolve_path::{directory_of, follow_links};

/// Identity of a regular file, existing or not. Two paths with the same identity refer to the same file, even
/// if links or `..` are involved, or if they differ only in case on a case-insensitive file system.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum FileIdentity {
    /// An existing file.
    Existing {
        /// Device of the file system.
        device: u64,
        /// Inode number.
        inode: u64,
    },
    /// A file that does not exist yet, in an existing folder.
    New {
        /// Device of the folder's file system.
        device: u64,
        /// Inode number of the folder.
        inode: u64,
        /// File name in the folder.
        name: OsString,
    },
}

impl FileIdentity {
    /// Returns the identity of the file at a path, or `None` for paths that cannot be a regular file:
    /// folders, devices, pipes, and unresolvable paths.
    pub fn from_existing_or_new_path(path: &Path) -> Option<Self> {
        match fs::metadata(path) {
            Ok(found) if found.is_file() => Some(Self::Existing { device: found.dev(), inode: found.ino() }),
            Err(error) if error.kind() == ErrorKind::NotFound => Self::from_new_path(path),
            Ok(_) | Err(_) => None,
        }
    }

    /// Whether an open file has this identity.
    pub fn matches_open_file(&self, file: &File) -> bool {
        let found = |found: fs::Metadata| Self::Existing { device: found.dev(), inode: found.ino() };
        file.metadata().is_ok_and(|metadata| found(metadata) == *self)
    }

    fn from_new_path(path: &Path) -> Option<Self> {
        let (target, _) = follow_links(path).ok()?;
        let folder = fs::metadata(directory_of(&target)).ok()?;
        let name = target.file_name()?.to_owned();
        Some(Self::New { device: folder.dev(), inode: folder.ino(), name })
    }
}

/// Properties that help to identify an existing file where [`FileIdentity`] is not sufficient. Some
/// case-insensitive file systems, such as FAT and some network file systems, have no stable inode numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ApproximateFileIdentity {
    real: PathBuf,
    /// Folder in lowercase.
    folder: PathBuf,
    /// Name in lowercase.
    name: OsString,
    length: u64,
    modified: (i64, i64),
}

impl ApproximateFileIdentity {
    /// Returns the approximate identity of the file at a path, or `None` if there is no regular file.
    pub fn from_path(path: &Path) -> Option<Self> {
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

    /// Whether the two may identify the same file: they are in the same folder, and either their names match,
    /// ignoring case, or their lengths, modification times and contents are equal.
    pub fn may_equal(&self, other: &Self) -> bool {
        let is_stamp_same = || (self.length, self.modified) == (other.length, other.modified);
        self.folder == other.folder
            && (self.name == other.name || is_stamp_same() && have_same_content(&self.real, &other.real))
    }
}

fn have_same_content(a: &Path, b: &Path) -> bool {
    let hash = |path: &Path| {
        let mut hasher = blake3::Hasher::new();
        hasher.update_reader(File::open(path).ok()?).ok()?;
        Some(hasher.finalize())
    };
    hash(a).is_some_and(|hash_of_a| Some(hash_of_a) == hash(b))
}

/// Whether two paths refer to the same file, existing or not. Also true if they may refer to the same file
/// according to their [`ApproximateFileIdentity`].
pub fn may_be_same_file(a: &Path, b: &Path) -> bool {
    let Some(identity) = FileIdentity::from_existing_or_new_path(a) else { return false };
    let are_alike =
        || Some(ApproximateFileIdentity::from_path(a)?.may_equal(&ApproximateFileIdentity::from_path(b)?));
    FileIdentity::from_existing_or_new_path(b) == Some(identity) || are_alike().unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn all_paths_of_a_file_have_the_same_identity() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("far/away")).expect("folders");
        fs::write(at("a"), "").expect("written");
        fs::write(at("far/b"), "").expect("written");
        symlink("a", at("link")).expect("a link");
        fs::hard_link(at("a"), at("hard")).expect("a link");
        symlink("far/away", at("near")).expect("a link");
        let of = |name: &str| FileIdentity::from_existing_or_new_path(&at(name)).expect(name);
        for name in ["./a", "far/../a", "link", "hard", "far/away/../../a"] {
            assert_eq!(of(name), of("a"), "{name}");
        }
        assert_eq!(of("near/../b"), of("far/b"), "`..` applies to the link's target");
        assert_ne!(of("far/b"), of("a"));
    }

    #[test]
    fn missing_files_have_an_identity() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("far/away")).expect("folders");
        symlink("far/away", at("near")).expect("a link");
        symlink("second", at("first")).expect("a link");
        symlink("near/new", at("second")).expect("a link");
        let of = |name: &str| FileIdentity::from_existing_or_new_path(&at(name));
        for name in ["near/new", "./far/away/new", "first", "second"] {
            assert_eq!(of(name), of("far/away/new"), "{name}");
            assert!(matches!(of(name), Some(FileIdentity::New { .. })), "{name}");
        }
        assert_ne!(of("new"), of("far/away/new"));
        assert_ne!(of("near/../new"), of("new"));
        assert_eq!(of("nowhere/new"), None, "nothing can be written there");
    }

    #[test]
    fn possibly_identical_files_count_as_the_same() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("other")).expect("a folder");
        // Simulate a file system without stable inode numbers.
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
            assert_eq!(may_be_same_file(&at(name), &at("t.png")), is_one, "{name}");
        }
        assert!(!may_be_same_file(folder.path(), folder.path()), "folders are not files");
        assert!(may_be_same_file(&at("none"), &at("other/../none")), "a file that does not exist yet");
    }

    #[test]
    fn special_files_have_no_identity() {
        let folder = tempfile::tempdir().expect("a folder");
        let circle = folder.path().join("circle");
        symlink("circle", &circle).expect("a link");
        for path in
            [folder.path(), Path::new("/dev/null"), Path::new("/dev/null/x"), &circle, Path::new("..")]
        {
            assert_eq!(FileIdentity::from_existing_or_new_path(path), None, "{}", path.display());
        }
    }
}
