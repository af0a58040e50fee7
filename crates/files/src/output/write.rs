//! Atomic writes. The old file is kept until the new one is complete.

use std::cell::RefCell;
use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Once};

use nix::errno::Errno;
use nix::fcntl::{FcntlArg, OFlag, fcntl};

use super::attributes::{AttributeCopyOutcome, FileAttributes};
use super::resolve_path::{self, TargetFile, WriteTarget};
use super::temporary::{self, TemporaryFile};
use super::{AttributeLossPolicy, FileIdentity, OutputError, WriteWarning, cancelable, held};
use crate::control::CancelToken;
use crate::system::describe_io_error;

/// Path for standard output. The path is not opened, because opening fails for sockets.
pub const STDOUT: &str = "/dev/stdout";

/// Writes a file atomically: writes and synchronizes a locked temporary file in the same directory, renames
/// the temporary file, and synchronizes the directory. Even if the process is killed, either the old
/// or the new file exists. The permissions, access list, attributes and flags are kept. The owner is also
/// kept if this process may change owners. If the path is a link, the target is replaced. Also removes
/// temporary files in the same directory left by killed processes on this machine.
///
/// Devices, pipes and open descriptors ([`STDOUT`]) are written in place.
///
/// # Errors
/// The file cannot be written. The error contains the path, the system's message and advice. The old file is
/// unchanged, and the temporary file is removed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let losses = AttributeLossPolicy::Report(&|_| ());
    let guard = ExistingFilePolicy { is_kept: &|_| false, may_replace: &|_| Ok(()), sweep: None, losses };
    write_atomically_with_policy(path, bytes, &guard, &CancelToken::new())
}

/// Creates a file without overwriting an existing one. Leaves no partial file on failure.
///
/// # Errors
/// System errors such as [`ErrorKind::AlreadyExists`].
pub fn write_new_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = OpenOptions::new().write(true).create_new(true).open(path)?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    if written.is_err()
        && FileIdentity::from_existing_or_new_path(path).is_some_and(|found| found.matches_open_file(&file))
    {
        // The file is still ours. Ignore errors because the caller reports the original error.
        let _ = fs::remove_file(path);
    }
    written
}

/// Policy for existing files. `may_replace` is called just before the replacement, with the resolved path.
pub struct ExistingFilePolicy<'a> {
    /// Whether to keep a file whose name looks like a temporary file left by a killed process.
    pub is_kept: &'a dyn Fn(&Path) -> bool,
    /// Decides whether a file, existing or not, may be replaced or written in place.
    pub may_replace: &'a dyn Fn(&Path) -> Result<(), OutputError>,
    /// Folders already searched for temporary files left by killed processes. If `None`, every write searches
    /// the folder again.
    pub sweep: Option<&'a SweptFolders>,
    /// What to do if a file's owner, access list or attributes cannot be kept.
    pub losses: AttributeLossPolicy<'a>,
}

/// Folders already searched for temporary files left by killed processes. Avoids searching a folder again at
/// every write.
#[derive(Debug, Default)]
pub struct SweptFolders(RefCell<HashSet<PathBuf>>);

impl SweptFolders {
    /// Returns true if the folder has not been searched yet, and marks it as searched.
    fn mark_if_unsearched(&self, folder: &Path) -> bool {
        let mut searched = self.0.borrow_mut();
        !searched.contains(folder) && searched.insert(folder.to_owned())
    }
}

/// Like [`write_atomically`], but with a policy. Can be canceled until the new file is complete.
///
/// # Errors
/// Any error from [`write_atomically`] or `guard`, or [`OutputError::Canceled`].
pub fn write_atomically_with_policy(
    path: &Path,
    bytes: &[u8],
    guard: &ExistingFilePolicy<'_>,
    token: &CancelToken,
) -> Result<(), OutputError> {
    let content = |file: &mut dyn Write| cancelable::write_all(file, bytes, token);
    write_atomically_from_callback(path, &content, guard, token, Durability::Power).map(drop)
}

/// Like [`write_atomically_with_policy`], but replaces the file only if it has the expected content. If the
/// content has changed, the file is kept and `guard` determines the error.
///
/// # Errors
/// Same as [`write_atomically_with_policy`].
pub fn write_atomically_if_unchanged(
    path: &Path,
    expected: &[u8],
    bytes: &[u8],
    guard: &ExistingFilePolicy<'_>,
    token: &CancelToken,
) -> Result<(), OutputError> {
    let content = |file: &mut dyn Write| cancelable::write_all(file, bytes, token);
    let (durability, expected) = (Durability::Power, Some(expected));
    write_atomically_or_in_place(path, &content, guard, token, durability, expected, &sync_directory)
        .map(drop)
}

/// Events that a renamed file is guaranteed to survive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// Termination of the process. The operating system may not have written the data to disk yet.
    Process,
    /// A power failure, because the data has been flushed to disk.
    Power,
}

/// Like [`write_atomically_with_policy`], but for generated content. `content` must write all bytes each time
/// it is called. Returns the new file, which stays locked until it is closed, or `None` if the target was
/// written in place.
///
/// # Errors
/// Any error from [`write_atomically_with_policy`] or `content`.
pub fn write_atomically_from_callback(
    path: &Path,
    content: &dyn Fn(&mut dyn Write) -> io::Result<()>,
    guard: &ExistingFilePolicy<'_>,
    token: &CancelToken,
    durability: Durability,
) -> Result<Option<File>, OutputError> {
    write_atomically_or_in_place(path, content, guard, token, durability, None, &sync_directory)
}

/// Like [`write_atomically_from_callback`], but if `expected` is set, replaces only a file with this content.
/// `sync` synchronizes a directory.
pub(super) fn write_atomically_or_in_place(
    path: &Path,
    content: &dyn Fn(&mut dyn Write) -> io::Result<()>,
    guard: &ExistingFilePolicy<'_>,
    token: &CancelToken,
    durability: Durability,
    expected: Option<&[u8]>,
    sync: &dyn Fn(&Path) -> io::Result<()>,
) -> Result<Option<File>, OutputError> {
    ignore_file_size_signal();
    let named = |error| OutputError::from_io(path, error);
    match resolve_path::resolve_writable(path)? {
        WriteTarget::File(target) => {
            let (new, carried) = create_temporary(&target, guard).map_err(named)?;
            let lost = carried.as_ref().map_or(&[][..], |carried| &carried.lost);
            if let (AttributeLossPolicy::Refuse, false) = (guard.losses, lost.is_empty()) {
                let why = format!("the new file would lose {}", lost.join(" and "));
                return Err(OutputError::Target {
                    path: path.to_owned(),
                    why,
                    advice: "edit a copy instead",
                });
            }
            let written = write_content_and_mode(&new, content, carried.as_ref(), durability);
            cancelable::map_write_error(written, named)?;
            (guard.may_replace)(&target.path)?;
            let file = match expected {
                None => new.rename_to(&target.path).map_err(named)?,
                Some(expected) => {
                    match held::replace_if_unchanged(new, &target.path, expected).map_err(named)? {
                        Some(file) => file,
                        None => {
                            (guard.may_replace)(&target.path)?;
                            return Err(named(io::Error::other("it has changed in the meantime")));
                        }
                    }
                }
            };
            let synced = match durability {
                Durability::Process => Ok(()),
                Durability::Power => sync(target.directory()),
            };
            if let (Err(error), AttributeLossPolicy::Report(report)) = (synced, &guard.losses) {
                // The file has been renamed. Only a power failure could undo this.
                let why = describe_io_error(&error);
                report(WriteWarning::NotSynchronized { path: path.to_owned(), why });
            }
            if let (AttributeLossPolicy::Report(report), false) = (guard.losses, lost.is_empty()) {
                report(WriteWarning::AttributesLost { path: path.to_owned(), lost: lost.to_vec() });
            }
            Ok(Some(file))
        }
        WriteTarget::InPlace(device) => {
            (guard.may_replace)(&device)?;
            let mut bytes = Vec::new();
            cancelable::map_write_error(content(&mut bytes), named)?;
            cancelable::map_write_error(append_in_place(&device, &bytes, token), named)?;
            Ok(None)
        }
    }
}

/// Makes exceeding `ulimit -f` an error instead of a fatal signal (SIGXFSZ). [`write_atomically`] calls this
/// function. Call it once before writing files in other ways.
pub fn ignore_file_size_signal() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Without a signal handler, the signal terminates the process. With any handler, the write fails
        // instead.
        let unused = Arc::new(AtomicBool::new(false));
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, unused);
    });
}

/// Creates an empty temporary file next to its target, with the target's attributes. If the target exists,
/// only the owner and users on its access list can read the temporary file until it is complete.
fn create_temporary(
    target: &TargetFile,
    guard: &ExistingFilePolicy<'_>,
) -> io::Result<(TemporaryFile, Option<AttributeCopyOutcome>)> {
    let directory = target.directory();
    if guard.sweep.is_none_or(|sweep| sweep.mark_if_unsearched(directory)) {
        temporary::remove_stale_files(directory, guard.is_kept);
    }
    let mode = if target.existing.is_some() { 0o600 } else { 0o666 };
    let name = target.path.file_name().unwrap_or(OsStr::new("file"));
    let new = TemporaryFile::create_locked(directory, name, mode)?;
    let old = target.existing.as_ref().map(|existing| FileAttributes::read(&target.path, existing));
    let carried = old.map(|old| old.apply_except_permissions(&new.file));
    Ok((new, carried))
}

fn write_content_and_mode(
    new: &TemporaryFile,
    content: &dyn Fn(&mut dyn Write) -> io::Result<()>,
    carried: Option<&AttributeCopyOutcome>,
    durability: Durability,
) -> io::Result<()> {
    content(&mut &new.file)?;
    if let Some(carried) = carried {
        carried.apply_permissions(&new.file)?;
    }
    match durability {
        Durability::Process => Ok(()),
        Durability::Power => new.file.sync_all(),
    }
}

/// Synchronizes a directory, which makes a rename survive a power failure. Ignores file systems and
/// directories that do not support this.
fn sync_directory(directory: &Path) -> io::Result<()> {
    use ErrorKind::{InvalidInput, PermissionDenied, Unsupported};
    match File::open(directory).and_then(|directory| directory.sync_all()) {
        Err(error) if !matches!(error.kind(), InvalidInput | PermissionDenied | Unsupported) => Err(error),
        _ => Ok(()),
    }
}

/// Writes directly to the target, such as a pipe or an open descriptor, instead of replacing it. Appends, so
/// that the existing content of an open file is kept.
fn append_in_place(path: &Path, bytes: &[u8], token: &CancelToken) -> io::Result<()> {
    if path == Path::new(STDOUT) {
        // Flush earlier output first. Do not hold the lock, because the reader may block.
        io::stdout().flush()?;
        let stdout = File::from(io::stdout().as_fd().try_clone_to_owned()?);
        return cancelable::write_to_pipe(&stdout, bytes, token);
    }
    let mut options = OpenOptions::new();
    options.append(true);
    // Opening a pipe without a reader would block forever. Report an error instead.
    let is_pipe = fs::metadata(path)?.file_type().is_fifo();
    if is_pipe {
        options.custom_flags(OFlag::O_NONBLOCK.bits());
    }
    let file = options.open(path).map_err(|error| match error.raw_os_error() {
        Some(number) if is_pipe && number == Errno::ENXIO as i32 => {
            io::Error::new(ErrorKind::NotConnected, "the pipe has no reader")
        }
        _ => error,
    })?;
    if is_pipe {
        fcntl(&file, FcntlArg::F_SETFL(OFlag::O_APPEND))?;
    }
    cancelable::write_to_pipe(&file, bytes, token)
}
