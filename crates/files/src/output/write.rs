//! Atomic writes: the old file stays until the new one is whole.

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

use super::attributes::{Attributes, Carried};
use super::place::{self, Place, Target};
use super::temporary::{self, Temporary};
use super::{FileIdentity, Losses, OutputError, held, stoppable};
use crate::control::CancelToken;
use crate::system::describe_error;

/// Standard output. It is already open: opening it by this name would fail for a socket.
pub const STDOUT: &str = "/dev/stdout";

/// Writes a file as a whole: a locked temporary file beside it, synchronised, renamed, the directory synchronised. At any moment,
/// whatever ends the process, the file is the old one or the new one. Its permissions, access list, attributes and flags stay, as
/// does its owner if this process may give files away. A link stays, and its target is replaced. Temporary files of this
/// machine's killed writers in the same directory are removed.
///
/// Devices, pipes and open descriptors ([`STDOUT`]) are written in place.
///
/// # Errors
/// Names the path, the system's message and the way out. The old file is then untouched, and no temporary file is left.
pub fn atomic(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let losses = Losses::Told(&|_| ());
    let guard = Guard { is_kept: &|_| false, may_replace: &|_| Ok(()), sweep: None, losses };
    atomic_until(path, bytes, &guard, &CancelToken::new())
}

/// Makes a new file, never in place of another one; leaves no part of it on failure.
///
/// # Errors
/// The system's, [`ErrorKind::AlreadyExists`] among them.
pub fn new_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = OpenOptions::new().write(true).create_new(true).open(path)?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    if written.is_err() && FileIdentity::of(path).is_some_and(|there| there.is_of(&file)) {
        // The file is still ours; the caller reports the error in any case.
        let _ = fs::remove_file(path);
    }
    written
}

/// Files that a write must not touch. Both functions are called at the last moment, with the real path, links followed.
pub struct Guard<'a> {
    /// Whether to keep a file with the name of a killed writer's temporary file.
    pub is_kept: &'a dyn Fn(&Path) -> bool,
    /// Whether the new file may replace this one, existing or not; or whether it may be written in place.
    pub may_replace: &'a dyn Fn(&Path) -> Result<(), OutputError>,
    /// Folders already searched for temporary files of killed writers. `None` to search at every write.
    pub sweep: Option<&'a FolderSweep>,
    /// Policy for a file whose owner, access list or attributes cannot be kept.
    pub losses: Losses<'a>,
}

/// Folders from which temporary files of killed writers were removed: writing many files to a folder searches it once.
#[derive(Debug, Default)]
pub struct FolderSweep(RefCell<HashSet<PathBuf>>);

impl FolderSweep {
    /// Whether the folder has not been searched yet. Then it counts as searched.
    fn is_due(&self, folder: &Path) -> bool {
        let mut searched = self.0.borrow_mut();
        !searched.contains(folder) && searched.insert(folder.to_owned())
    }
}

/// [`atomic`] with a guard; it can be stopped until the new file is whole.
///
/// # Errors
/// As [`atomic`], the guard's errors, and [`OutputError::Cancelled`].
pub fn atomic_until(
    path: &Path,
    bytes: &[u8],
    guard: &Guard<'_>,
    token: &CancelToken,
) -> Result<(), OutputError> {
    atomic_by(path, &|file| stoppable::write_all(file, bytes, token), guard, (token, Durability::Power))
        .map(drop)
}

/// [`atomic_until`] in place of a file with this content alone: if it has another one in the moment of the replacement, it stays,
/// and the guard tells the reason.
///
/// # Errors
/// As [`atomic_until`].
pub fn atomic_in_place_of(
    path: &Path,
    (expected, bytes): (&[u8], &[u8]),
    guard: &Guard<'_>,
    token: &CancelToken,
) -> Result<(), OutputError> {
    let content: &dyn Fn(&mut dyn Write) -> io::Result<()> = &|file| stoppable::write_all(file, bytes, token);
    replace(path, content, guard, (token, Durability::Power, Some(expected))).map(drop)
}

/// Events that a file survives from the moment at which it has its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// The end of the process: the system writes the bytes to the disk when it likes.
    Process,
    /// A loss of power: the bytes are on the disk.
    Power,
}

/// [`atomic_until`] of bytes that are made while they are written: `content` writes all of them, as often as it is called. Returns the
/// new file, which stays locked against other processes until it is closed. `None` if it was written in place.
///
/// # Errors
/// As [`atomic_until`], and the errors of `content`.
pub fn atomic_by(
    path: &Path,
    content: &dyn Fn(&mut dyn Write) -> io::Result<()>,
    guard: &Guard<'_>,
    (token, durability): (&CancelToken, Durability),
) -> Result<Option<File>, OutputError> {
    replace(path, content, guard, (token, durability, None))
}

/// [`atomic_by`], in place of a file with the expected content if there is one.
fn replace(
    path: &Path,
    content: &dyn Fn(&mut dyn Write) -> io::Result<()>,
    guard: &Guard<'_>,
    (token, durability, expected): (&CancelToken, Durability, Option<&[u8]>),
) -> Result<Option<File>, OutputError> {
    prepare_process();
    let named = |error| OutputError::file(path, error);
    match place::find(path)? {
        Place::File(target) => {
            let (new, carried) = beside(&target, guard).map_err(named)?;
            let lost = carried.as_ref().map_or(&[][..], |carried| &carried.lost);
            if let (Losses::Refused, false) = (guard.losses, lost.is_empty()) {
                let why = format!("{} cannot be kept", lost.join(" and "));
                return Err(OutputError::Target {
                    path: path.to_owned(),
                    why,
                    way_out: "change a copy of it",
                });
            }
            stoppable::or_cancelled(fill(&new, content, carried.as_ref(), durability), named)?;
            (guard.may_replace)(&target.path)?;
            let file = match expected {
                None => new.rename_to(&target.path).map_err(named)?,
                Some(expected) => match held::replace(new, &target.path, expected).map_err(named)? {
                    Some(file) => file,
                    None => {
                        (guard.may_replace)(&target.path)?;
                        return Err(named(io::Error::other("it changed while it was written")));
                    }
                },
            };
            let synced = match durability {
                Durability::Process => Ok(()),
                Durability::Power => sync_directory(target.directory()),
            };
            if let (Err(error), Losses::Told(tell)) = (synced, &guard.losses) {
                // The file has its name: only a loss of power could take it back.
                tell(format!(
                    "{}: it is written, but its folder could not be synchronized: {}",
                    path.display(),
                    describe_error(&error)
                ));
            }
            if let (Losses::Told(tell), false) = (guard.losses, lost.is_empty()) {
                tell(format!("{}: {} could not be kept", path.display(), lost.join(" and ")));
            }
            Ok(Some(file))
        }
        Place::InPlace(place) => {
            (guard.may_replace)(&place)?;
            let mut bytes = Vec::new();
            stoppable::or_cancelled(content(&mut bytes), named)?;
            stoppable::or_cancelled(in_place(&place, &bytes, token), named)?;
            Ok(None)
        }
    }
}

/// Makes a file that would grow beyond `ulimit -f` an error instead of the end of the process (SIGXFSZ). [`atomic`]
/// does it by itself; it is needed once for files written in other ways.
pub fn prepare_process() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Any handler will do, as the write then fails. Without one, the signal ends the process as it did before.
        let unused = Arc::new(AtomicBool::new(false));
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, unused);
    });
}

/// Makes the new file, empty, beside the one that it is to replace, with the attributes of that. Until it is whole,
/// only its owner and users on its access list can read it.
fn beside(target: &Target, guard: &Guard<'_>) -> io::Result<(Temporary, Option<Carried>)> {
    let directory = target.directory();
    if guard.sweep.is_none_or(|sweep| sweep.is_due(directory)) {
        temporary::remove_stale(directory, guard.is_kept);
    }
    let mode = if target.existing.is_some() { 0o600 } else { 0o666 };
    let name = target.path.file_name().unwrap_or(OsStr::new("file"));
    let new = Temporary::create(directory, name, mode)?;
    let old = target.existing.as_ref().map(|existing| Attributes::of(&target.path, existing));
    let carried = old.map(|old| old.carry_over(&new.file));
    Ok((new, carried))
}

fn fill(
    new: &Temporary,
    content: &dyn Fn(&mut dyn Write) -> io::Result<()>,
    carried: Option<&Carried>,
    durability: Durability,
) -> io::Result<()> {
    content(&mut &new.file)?;
    if let Some(carried) = carried {
        carried.permit(&new.file)?;
    }
    match durability {
        Durability::Process => Ok(()),
        Durability::Power => new.file.sync_all(),
    }
}

/// Synchronises a directory, so that the rename survives a loss of power. Failures are ignored, as some file systems and
/// directories refuse: the file is there.
fn sync_directory(directory: &Path) -> io::Result<()> {
    use ErrorKind::{InvalidInput, PermissionDenied, Unsupported};
    match File::open(directory).and_then(|directory| directory.sync_all()) {
        Err(error) if !matches!(error.kind(), InvalidInput | PermissionDenied | Unsupported) => Err(error),
        _ => Ok(()),
    }
}

/// Writes in place. It appends, so that a descriptor of a file keeps its content.
fn in_place(path: &Path, bytes: &[u8], token: &CancelToken) -> io::Result<()> {
    if path == Path::new(STDOUT) {
        // Flush earlier output first; do not hold its lock while the reader takes its time.
        io::stdout().flush()?;
        let stdout = File::from(io::stdout().as_fd().try_clone_to_owned()?);
        return stoppable::write_as_taken(&stdout, bytes, token);
    }
    let mut options = OpenOptions::new();
    options.append(true);
    // A pipe that nobody reads would block the process for ever: do not wait, so that it is an error.
    let is_pipe = fs::metadata(path)?.file_type().is_fifo();
    if is_pipe {
        options.custom_flags(OFlag::O_NONBLOCK.bits());
    }
    let file = options.open(path).map_err(|error| match error.raw_os_error() {
        Some(number) if is_pipe && number == Errno::ENXIO as i32 => {
            io::Error::new(ErrorKind::NotConnected, "nobody reads this pipe")
        }
        _ => error,
    })?;
    if is_pipe {
        fcntl(&file, FcntlArg::F_SETFL(OFlag::O_APPEND))?;
    }
    stoppable::write_as_taken(&file, bytes, token)
}
