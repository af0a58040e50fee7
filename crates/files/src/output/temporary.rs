//! Temporary files next to a target. Their names identify the writer's machine and process. They are locked
//! while the writer is running, and removed by other processes after it has died. Locks are not
//! sufficient on their own, because many network file systems do not share them between machines.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use nix::fcntl::OFlag;

use super::move_new::rename_no_replace;
use crate::system::folder::{entry_names, remove_folder_and_contents};
use crate::system::machine::ProcessIdentity;

/// Maximum length of a file name on nearly all file systems.
const NAME_BYTES: usize = 255;
/// Number of names to try. More than one name is needed only if another process removes a file before it is
/// locked.
pub(super) const ATTEMPTS: usize = 64;

/// A file that is removed on drop unless it has been renamed to its final name.
#[derive(Debug)]
pub(super) struct TemporaryFile {
    pub(super) file: File,
    path: PathBuf,
    kept: bool,
}

impl TemporaryFile {
    /// Creates an empty, locked file for a target called `name`. The file is called
    /// `.NAME.glimt-<machine>-<process>-<number>.tmp`.
    pub(super) fn create_locked(directory: &Path, name: &OsStr, mode: u32) -> io::Result<Self> {
        for _ in 0..ATTEMPTS {
            let path = directory.join(next_temporary_name(name));
            match OpenOptions::new().write(true).create_new(true).mode(mode).open(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
                Ok(file) => {
                    let temporary = Self { file, path, kept: false };
                    if temporary.try_lock()? {
                        return Ok(temporary);
                    }
                }
            }
        }
        Err(io::Error::new(ErrorKind::AlreadyExists, "no free name for a temporary file"))
    }

    /// Locks the file. Returns false if another process has locked it or has removed it as stale.
    fn try_lock(&self) -> io::Result<bool> {
        match self.file.try_lock() {
            Err(TryLockError::WouldBlock) => Ok(false),
            // If locking is not supported, no process treats the file as stale and removes it.
            Err(TryLockError::Error(_)) => Ok(true),
            Ok(()) => still_refers_to(&self.file, &self.path),
        }
    }

    /// Renames the file to its final name, replacing any existing file. Returns the file, still locked.
    pub(super) fn rename_to(mut self, target: &Path) -> io::Result<File> {
        // The lock belongs to the open file, so a duplicate descriptor keeps the lock.
        let file = self.file.try_clone()?;
        fs::rename(&self.path, target)?;
        self.kept = true;
        Ok(file)
    }

    /// Renames the file without overwriting an existing file.
    pub(super) fn rename_no_replace(&mut self, target: &Path) -> io::Result<()> {
        rename_no_replace(&self.path, target)?;
        self.kept = true;
        Ok(())
    }

    /// Renames the file back to its temporary name.
    pub(super) fn rename_back(&mut self, from: &Path) -> io::Result<()> {
        rename_no_replace(from, &self.path)?;
        self.kept = false;
        Ok(())
    }
}

impl Drop for TemporaryFile {
    fn drop(&mut self) {
        if !self.kept {
            // Ignore errors, because the next write tries again.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Checks that files can be created in a directory. Creates an unnamed file or, if this is not supported, a
/// named file that is removed immediately. Some directories, such as /proc, reject files despite write
/// permission.
pub(super) fn check_can_create(directory: &Path) -> io::Result<()> {
    if probe_unnamed_creation(directory).is_ok() {
        return Ok(());
    }
    TemporaryFile::create_locked(directory, OsStr::new("probe"), 0o600).map(drop)
}

#[cfg(target_os = "linux")]
fn probe_unnamed_creation(directory: &Path) -> io::Result<()> {
    OpenOptions::new().write(true).mode(0o600).custom_flags(OFlag::O_TMPFILE.bits()).open(directory).map(drop)
}

#[cfg(not(target_os = "linux"))]
fn probe_unnamed_creation(_: &Path) -> io::Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// Removes temporary files left by killed processes on this machine, unless `is_kept` returns true. Keeps
/// files from other machines, earlier boots and running processes. Skips files that cannot be removed, so
/// that a failed cleanup never prevents a write.
pub(super) fn remove_stale_files(directory: &Path, is_kept: &dyn Fn(&Path) -> bool) {
    for path in stale_entries(directory) {
        if path.symlink_metadata().is_ok_and(|found| found.is_file()) && !is_kept(&path) {
            let _ = remove_if_unlocked(&path, |path| fs::remove_file(path));
        }
    }
}

/// Removes temporary folders left by killed processes on this machine, including their contents.
pub(super) fn remove_stale_folders(directory: &Path) {
    for path in stale_entries(directory) {
        if path.symlink_metadata().is_ok_and(|found| found.is_dir()) {
            let _ = remove_if_unlocked(&path, remove_folder_and_contents);
        }
    }
}

/// Lists the entries of a directory whose names identify a dead writer.
fn stale_entries(directory: &Path) -> Vec<PathBuf> {
    let names = entry_names(directory).into_iter().flatten();
    names.filter(|name| has_dead_writer(name)).map(|name| directory.join(name)).collect()
}

fn has_dead_writer(name: &OsStr) -> bool {
    parse_writer(name).is_some_and(|writer| writer.has_ended())
}

fn remove_if_unlocked(path: &Path, remove: impl Fn(&Path) -> io::Result<()>) -> io::Result<()> {
    // The file may have been replaced with a link or a pipe since it was checked.
    let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
    let file = OpenOptions::new().read(true).custom_flags(flags.bits()).open(path)?;
    if file.try_lock().is_ok() && still_refers_to(&file, path)? {
        remove(path)?;
    }
    Ok(())
}

/// Whether this path still refers to the open file.
fn still_refers_to(file: &File, path: &Path) -> io::Result<bool> {
    let opened = file.metadata()?;
    match fs::symlink_metadata(path) {
        Ok(named) => Ok((opened.dev(), opened.ino()) == (named.dev(), named.ino())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

pub(super) fn next_temporary_name(name: &OsStr) -> OsString {
    temporary_name(name, &ProcessIdentity::current())
}

fn temporary_name(name: &OsStr, writer: &ProcessIdentity) -> OsString {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let ending = format!(".glimt-{:016x}-{}-{number}.tmp", writer.machine, writer.process);
    let kept = name.len().min(NAME_BYTES - 1 - ending.len());
    let mut result = OsString::from(".");
    result.push(OsStr::from_bytes(&name.as_bytes()[..kept]));
    result.push(ending);
    result
}

/// Parses the identity of the writer from a temporary name. Returns `None` for other names, including those
/// from older versions (`.NAME.glimt-PID-N.tmp`), which do not identify the machine.
fn parse_writer(name: &OsStr) -> Option<ProcessIdentity> {
    let name = name.to_string_lossy();
    let (_, writer) = name.strip_prefix('.')?.strip_suffix(".tmp")?.rsplit_once(".glimt-")?;
    let (machine, numbers) = writer.split_once('-')?;
    let (process, number) = numbers.split_once('-')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let is_machine = machine.len() == 16 && machine.bytes().all(|byte| byte.is_ascii_hexdigit());
    if !is_machine || !is_number(process) || !is_number(number) {
        return None;
    }
    Some(ProcessIdentity { machine: u64::from_str_radix(machine, 16).ok()?, process: process.parse().ok()? })
}

#[cfg(test)]
pub(super) mod tests {
    use std::process::Command;

    use super::*;

    /// Returns a temporary name for a process that has ended on this machine.
    pub(in crate::output) fn stale_temporary_name(name: &str) -> OsString {
        temporary_name(OsStr::new(name), &dead_process())
    }

    /// A temporary name from a process on another machine.
    pub(in crate::output) fn temporary_name_of_other_machine(name: &str) -> OsString {
        let dead = dead_process();
        temporary_name(OsStr::new(name), &ProcessIdentity { machine: dead.machine ^ 1, ..dead })
    }

    fn dead_process() -> ProcessIdentity {
        let mut child = Command::new("true").spawn().expect("true starts");
        let process = child.id();
        child.wait().expect("it ends");
        ProcessIdentity { process, ..ProcessIdentity::current() }
    }

    #[test]
    fn only_temporary_names_have_a_writer() {
        for name in ["out.png", "a.glimt-b.png", "a.glimt-1-2.tmp", &"ä".repeat(127)] {
            let temporary = next_temporary_name(OsStr::new(name));
            assert_eq!(parse_writer(&temporary), Some(ProcessIdentity::current()), "{temporary:?}");
            assert!(temporary.len() <= NAME_BYTES);
        }
        let machine = "0123456789abcdef";
        for other in [
            "out.png".to_owned(),
            ".out.png.tmp".to_owned(),
            ".a.glimt-1-2.tmp".to_owned(),
            format!(".a.glimt-{machine}-1.tmp"),
            format!(".a.glimt-{machine}-1-x.tmp"),
            format!(".a.glimt-{machine}0-1-2.tmp"),
            format!(".a.glimt-{}g-1-2.tmp", &machine[1..]),
            format!(".a.glimt-+{}-1-2.tmp", &machine[1..]),
            format!(".a.glimt-{machine}-1-2-3.tmp"),
            format!(".a.glimt-{machine}-99999999999-2.tmp"),
            format!("a.glimt-{machine}-1-2.tmp"),
        ] {
            assert_eq!(parse_writer(OsStr::new(&other)), None, "{other}");
        }
    }

    #[test]
    fn only_stale_local_files_are_removed() {
        let directory = tempfile::tempdir().expect("a directory");
        let living =
            TemporaryFile::create_locked(directory.path(), OsStr::new("a.png"), 0o666).expect("a file");
        let write = |name: OsString| {
            let path = directory.path().join(name);
            fs::write(&path, "half").expect("a file");
            path
        };
        let stale = write(stale_temporary_name("b.png"));
        // The writers of these files may be alive.
        let kept = [
            write(temporary_name_of_other_machine("b.png")),
            write(next_temporary_name(OsStr::new("b.png"))),
            write(".b.png.glimt-123-4.tmp".into()),
            write(".b.png.tmp".into()),
        ];
        remove_stale_files(directory.path(), &|_| false);
        assert!(living.path.exists());
        assert!(!stale.exists());
        for path in kept {
            assert!(path.exists(), "{}", path.display());
        }
    }

    #[test]
    fn probing_leaves_no_file() {
        let directory = tempfile::tempdir().expect("a directory");
        check_can_create(directory.path()).expect("the directory should accept files");
        assert_eq!(fs::read_dir(directory.path()).expect("a directory").count(), 0);
        assert!(check_can_create(&directory.path().join("none")).is_err());
        #[cfg(target_os = "linux")]
        assert!(check_can_create(Path::new("/proc")).is_err());
    }

    #[test]
    fn a_panic_leaves_no_file() {
        let directory = tempfile::tempdir().expect("a directory");
        let result = std::panic::catch_unwind(|| {
            let _file =
                TemporaryFile::create_locked(directory.path(), OsStr::new("a.png"), 0o666).expect("a file");
            panic!("while writing");
        });
        assert!(result.is_err());
        assert_eq!(fs::read_dir(directory.path()).expect("a directory").count(), 0);
    }

    #[test]
    fn removed_temporary_files_are_not_claimed() {
        let directory = tempfile::tempdir().expect("a directory");
        let file =
            TemporaryFile::create_locked(directory.path(), OsStr::new("a.png"), 0o666).expect("a file");
        fs::remove_file(&file.path).expect("removed");
        assert!(!file.try_lock().expect("no error"));
        fs::write(&file.path, "another").expect("a file");
        assert!(!file.try_lock().expect("no error"));
    }
}
