//! Resolves the path of a file before it is written. Follows links, and detects special files and missing
//! permissions.

use std::fs::{self, Metadata};
use std::io::{self, ErrorKind};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};

use nix::errno::Errno;
use nix::unistd::{AccessFlags, access};

use super::protection::{self, ProtectionFlag};
use super::{OutputError, temporary};

/// Maximum number of links to follow, as in Linux.
const MAX_LINKS: usize = 40;

/// Destination for the bytes written to a path.
#[derive(Debug)]
pub(super) enum WriteTarget {
    /// A regular file, existing or not, to be replaced atomically.
    File(TargetFile),
    /// A device, a pipe or an open descriptor, to be written in place.
    InPlace(PathBuf),
}

/// A regular file after following all links.
#[derive(Debug)]
pub(super) struct TargetFile {
    pub(super) path: PathBuf,
    /// Metadata of the file, if it exists.
    pub(super) existing: Option<Metadata>,
}

impl TargetFile {
    /// Directory of the file.
    pub(super) fn directory(&self) -> &Path {
        directory_of(&self.path)
    }
}

/// Resolves a path and checks that it is writable, without writing anything.
pub(super) fn resolve_writable(path: &Path) -> Result<WriteTarget, OutputError> {
    if path.file_name().is_none() || path.as_os_str().as_bytes().ends_with(b"/") {
        return Err(target_is_directory_error(path));
    }
    match follow_links(path).map_err(|error| OutputError::from_io(path, error))? {
        (target, None) => checked_target_for_new_file(path, target),
        (_, Some(metadata)) if metadata.is_symlink() => Ok(WriteTarget::InPlace(path.to_owned())),
        (target, Some(metadata)) => checked_target_for_existing(path, target, metadata),
    }
}

/// Like [`resolve_writable`], but also checks that files can be created in the directory.
pub(super) fn check_writable(path: &Path) -> Result<(), OutputError> {
    match resolve_writable(path)? {
        WriteTarget::File(target) => {
            let directory = target.directory();
            temporary::check_can_create(directory).map_err(|error| match error.kind() {
                // The directory exists, so the error comes from creating the file. This happens in /proc.
                ErrorKind::NotFound if directory.is_dir() => OutputError::Target {
                    path: path.to_owned(),
                    why: format!("files cannot be created in the directory {}", directory.display()),
                    advice: "choose another location",
                },
                _ => OutputError::from_io(path, error),
            })
        }
        WriteTarget::InPlace(_) => Ok(()),
    }
}

/// Follows symbolic links. Returns the final path and its file's metadata. Links to open descriptors (such as
/// /dev/stdout) are not followed, because an open descriptor may have no path.
pub(super) fn follow_links(path: &Path) -> io::Result<(PathBuf, Option<Metadata>)> {
    let mut target = path.to_owned();
    for _ in 0..MAX_LINKS {
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

fn checked_target_for_new_file(path: &Path, target: PathBuf) -> Result<WriteTarget, OutputError> {
    check_directory_is_writable(path, directory_of(&target))?;
    Ok(WriteTarget::File(TargetFile { path: target, existing: None }))
}

fn checked_target_for_existing(
    path: &Path,
    target: PathBuf,
    metadata: Metadata,
) -> Result<WriteTarget, OutputError> {
    let kind = metadata.file_type();
    if kind.is_dir() {
        return Err(target_is_directory_error(path));
    }
    if kind.is_block_device() || kind.is_socket() {
        let what = if kind.is_socket() { "a socket" } else { "a block device" };
        let why = format!("it is {what}");
        return Err(OutputError::Target { path: path.to_owned(), why, advice: "name a file" });
    }
    if !kind.is_file() {
        check_access(path, &target, AccessFlags::W_OK)?;
        return Ok(WriteTarget::InPlace(target));
    }
    check_no_protection_flag(path, "it", &target)?;
    // Replacing the file requires only write permission for the directory. Check the file itself anyway,
    // because it may be read-only on purpose.
    check_access(path, &target, AccessFlags::W_OK)?;
    let directory = check_directory_is_writable(path, directory_of(&target))?;
    if protection::is_protected_by_sticky_bit(&directory, &metadata) {
        let directory = directory_of(&target).display();
        return Err(OutputError::Target {
            path: path.to_owned(),
            why: format!(
                "it belongs to another user, and in the sticky directory {directory} only its owner may replace it"
            ),
            advice: "choose another name or location",
        });
    }
    Ok(WriteTarget::File(TargetFile { path: target, existing: Some(metadata) }))
}

fn check_directory_is_writable(path: &Path, directory: &Path) -> Result<Metadata, OutputError> {
    match fs::metadata(directory) {
        Ok(metadata) if metadata.is_dir() => {
            check_no_protection_flag(path, &format!("the directory {}", directory.display()), directory)?;
            check_access(path, directory, AccessFlags::W_OK | AccessFlags::X_OK)?;
            Ok(metadata)
        }
        Ok(_) => Err(OutputError::from_io(path, io::Error::from(Errno::ENOTDIR))),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(OutputError::Target {
            path: path.to_owned(),
            why: format!("the directory {} does not exist", directory.display()),
            advice: "create it or choose another location",
        }),
        Err(error) => Err(OutputError::from_io(path, error)),
    }
}

/// Checks that no flag protects the file or directory from changes. Such a flag would also keep the new file
/// from being renamed or removed.
fn check_no_protection_flag(path: &Path, name: &str, what: &Path) -> Result<(), OutputError> {
    let Some(flag) = ProtectionFlag::from_path(what) else { return Ok(()) };
    let why = format!("{name} is {}", flag.description());
    Err(OutputError::Target { path: path.to_owned(), why, advice: flag.removal_advice() })
}

fn check_access(path: &Path, what: &Path, how: AccessFlags) -> Result<(), OutputError> {
    access(what, how).map_err(|errno| OutputError::from_io(path, errno))
}

fn target_is_directory_error(path: &Path) -> OutputError {
    let why = "it is a directory".to_owned();
    OutputError::Target { path: path.to_owned(), why, advice: "specify a file in it" }
}

/// Directory of a path, or the working directory for a bare file name.
pub(super) fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(directory) if !directory.as_os_str().is_empty() => directory,
        _ => Path::new("."),
    }
}
