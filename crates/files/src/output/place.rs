//! The real place of a write: follows links, and recognises special files and places without write permission.

use std::fs::{self, Metadata};
use std::io::{self, ErrorKind};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::unistd::{AccessFlags, access};

use super::protection::{self, Flag};
use super::{OutputError, temporary};

/// Most links to follow, as in Linux.
const LINKS: usize = 40;

/// Place to which the bytes for a path go.
#[derive(Debug)]
pub(super) enum Place {
    /// A regular file, existing or not, to be replaced as a whole.
    File(Target),
    /// A device, a pipe or an open descriptor, to be written as it is.
    InPlace(PathBuf),
}

/// A regular file behind all links.
#[derive(Debug)]
pub(super) struct Target {
    pub(super) path: PathBuf,
    /// Metadata of the existing file.
    pub(super) existing: Option<Metadata>,
}

impl Target {
    /// The directory that the file is in.
    pub(super) fn directory(&self) -> &Path {
        directory_of(&self.path)
    }
}

/// Finds the place and checks that it can be written, as far as this is possible without writing.
pub(super) fn find(path: &Path) -> Result<Place, OutputError> {
    if path.file_name().is_none() || path.as_os_str().as_bytes().ends_with(b"/") {
        return Err(is_a_directory(path));
    }
    match follow(path).map_err(|error| OutputError::file(path, error))? {
        (target, None) => new_file(path, target),
        (_, Some(metadata)) if metadata.is_symlink() => Ok(Place::InPlace(path.to_owned())),
        (target, Some(metadata)) => existing(path, target, metadata),
    }
}

/// [`find`] before the work: also checks that the directory takes a file at all.
pub(super) fn check(path: &Path) -> Result<(), OutputError> {
    match find(path)? {
        Place::File(target) => {
            let directory = target.directory();
            temporary::probe(directory).map_err(|error| match error.kind() {
                // The directory existed a moment ago: /proc refuses files by this error.
                ErrorKind::NotFound if directory.is_dir() => OutputError::Target {
                    path: path.to_owned(),
                    why: format!("the directory {} takes no files", directory.display()),
                    way_out: "choose another place",
                },
                _ => OutputError::file(path, error),
            })
        }
        Place::InPlace(_) => Ok(()),
    }
}

/// Follows the links of a path; returns the last path and the metadata of the file there. A link to an open descriptor
/// (/dev/stdout leads to one) is not followed: it may lead to no path at all.
pub(super) fn follow(path: &Path) -> io::Result<(PathBuf, Option<Metadata>)> {
    let mut target = path.to_owned();
    for _ in 0..LINKS {
        let metadata = match fs::symlink_metadata(&target) {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok((target, None)),
            Err(error) => return Err(error),
        };
        if !metadata.is_symlink() || target.starts_with("/proc") {
            return Ok((target, Some(metadata)));
        }
        target = directory_of(&target).join(fs::read_link(&target)?);
    }
    Err(Errno::ELOOP.into())
}

fn new_file(path: &Path, target: PathBuf) -> Result<Place, OutputError> {
    check_directory(path, directory_of(&target))?;
    Ok(Place::File(Target { path: target, existing: None }))
}

fn existing(path: &Path, target: PathBuf, metadata: Metadata) -> Result<Place, OutputError> {
    let kind = metadata.file_type();
    if kind.is_dir() {
        return Err(is_a_directory(path));
    }
    if kind.is_block_device() || kind.is_socket() {
        let what = if kind.is_socket() { "a socket" } else { "a block device" };
        let why = format!("it is {what}");
        return Err(OutputError::Target { path: path.to_owned(), why, way_out: "name a file" });
    }
    if !kind.is_file() {
        may_write(path, &target, AccessFlags::W_OK)?;
        return Ok(Place::InPlace(target));
    }
    unflagged(path, "it", &target)?;
    // Check the file too, although its directory decides whether it can be replaced: it may be protected on purpose.
    may_write(path, &target, AccessFlags::W_OK)?;
    let directory = check_directory(path, directory_of(&target))?;
    if protection::is_kept_for_owner(&directory, &metadata) {
        let directory = directory_of(&target).display();
        return Err(OutputError::Target {
            path: path.to_owned(),
            why: format!(
                "it belongs to another user, and in the sticky directory {directory} only its owner may replace it"
            ),
            way_out: "choose another name or place",
        });
    }
    Ok(Place::File(Target { path: target, existing: Some(metadata) }))
}

fn check_directory(path: &Path, directory: &Path) -> Result<Metadata, OutputError> {
    match fs::metadata(directory) {
        Ok(metadata) if metadata.is_dir() => {
            unflagged(path, &format!("the directory {}", directory.display()), directory)?;
            may_write(path, directory, AccessFlags::W_OK | AccessFlags::X_OK)?;
            Ok(metadata)
        }
        Ok(_) => Err(OutputError::file(path, io::Error::from(Errno::ENOTDIR))),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(OutputError::Target {
            path: path.to_owned(),
            why: format!("the directory {} does not exist", directory.display()),
            way_out: "create it or choose another place",
        }),
        Err(error) => Err(OutputError::file(path, error)),
    }
}

/// Checks that no flag protects the file or directory from changes: the new file could be neither renamed nor removed.
fn unflagged(path: &Path, called: &str, what: &Path) -> Result<(), OutputError> {
    let Some(flag) = Flag::of(what) else { return Ok(()) };
    let why = format!("{called} is {}", flag.words());
    Err(OutputError::Target { path: path.to_owned(), why, way_out: flag.way_out() })
}

fn may_write(path: &Path, what: &Path, how: AccessFlags) -> Result<(), OutputError> {
    access(what, how).map_err(|errno| OutputError::file(path, errno))
}

fn is_a_directory(path: &Path) -> OutputError {
    let why = "it is a directory".to_owned();
    OutputError::Target { path: path.to_owned(), why, way_out: "name a file in it" }
}

/// The directory that a path is in; the working directory for a mere name.
pub(super) fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(directory) if !directory.as_os_str().is_empty() => directory,
        _ => Path::new("."),
    }
}
