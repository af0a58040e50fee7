//! Temporary files beside a target: named after their writer's machine and process, locked while it lives, removed when it has
//! died. Locks alone do not protect them: many network file systems do not share locks between machines.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, ErrorKind};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use nix::fcntl::OFlag;

use super::move_new::move_new;
use crate::system::folder::{names, remove_all};
use crate::system::machine::ProcessIdentity;

/// Longest file name of nearly every file system.
const NAME_BYTES: usize = 255;
/// Names to try before giving up; a second one is needed only if another program removes the first at the wrong moment.
pub(super) const ATTEMPTS: usize = 64;

/// A file that is removed unless it gets its final name.
#[derive(Debug)]
pub(super) struct Temporary {
    pub(super) file: File,
    path: PathBuf,
    kept: bool,
}

impl Temporary {
    /// Creates an empty, locked file `.NAME.glimt-<machine>-<process>-<number>.tmp` for a target called `name`.
    pub(super) fn create(directory: &Path, name: &OsStr, mode: u32) -> io::Result<Self> {
        for _ in 0..ATTEMPTS {
            let path = directory.join(next_name(name));
            match OpenOptions::new().write(true).create_new(true).mode(mode).open(&path) {
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
                Ok(file) => {
                    let temporary = Self { file, path, kept: false };
                    if temporary.claim()? {
                        return Ok(temporary);
                    }
                }
            }
        }
        Err(io::Error::new(ErrorKind::AlreadyExists, "no free name for a temporary file"))
    }

    /// Locks it. False if another writer took it for a stale file before that.
    fn claim(&self) -> io::Result<bool> {
        match self.file.try_lock() {
            Err(TryLockError::WouldBlock) => Ok(false),
            // On a file system without locks, nobody can take it for stale.
            Err(TryLockError::Error(_)) => Ok(true),
            Ok(()) => is_same(&self.file, &self.path),
        }
    }

    /// Gives it its final name, replacing any file of that name. Returns the file, still locked.
    pub(super) fn rename_to(mut self, target: &Path) -> io::Result<File> {
        // A lock is that of the open file, whatever the number of its descriptors.
        let file = self.file.try_clone()?;
        fs::rename(&self.path, target)?;
        self.kept = true;
        Ok(file)
    }

    /// Gives it a name that no file has.
    pub(super) fn move_to_new(&mut self, target: &Path) -> io::Result<()> {
        move_new(&self.path, target)?;
        self.kept = true;
        Ok(())
    }

    /// Gives it its temporary name back.
    pub(super) fn take_back(&mut self, from: &Path) -> io::Result<()> {
        move_new(from, &self.path)?;
        self.kept = false;
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.kept {
            // Ignore a failure: the next write tries again.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Tests whether a file can be made in a directory. It makes a file without a name, or, if that is not possible, one that
/// it removes at once. A directory may allow writing and still take no files, such as /proc.
pub(super) fn probe(directory: &Path) -> io::Result<()> {
    if nameless(directory).is_ok() {
        return Ok(());
    }
    Temporary::create(directory, OsStr::new("probe"), 0o600).map(drop)
}

#[cfg(target_os = "linux")]
fn nameless(directory: &Path) -> io::Result<()> {
    OpenOptions::new().write(true).mode(0o600).custom_flags(OFlag::O_TMPFILE.bits()).open(directory).map(drop)
}

#[cfg(not(target_os = "linux"))]
fn nameless(_: &Path) -> io::Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// Removes the temporary files of this machine's killed writers from a directory. Files of other machines, of earlier boots and
/// of living writers stay, and so do kept ones. A file that cannot be removed stays too: it must not prevent the write.
pub(super) fn remove_stale(directory: &Path, is_kept: &dyn Fn(&Path) -> bool) {
    for path in stale(directory) {
        if path.symlink_metadata().is_ok_and(|found| found.is_file()) && !is_kept(&path) {
            let _ = remove_if_stale(&path, |path| fs::remove_file(path));
        }
    }
}

/// Removes the temporary folders of this machine's killed writers from a directory, with their contents.
pub(super) fn remove_stale_folders(directory: &Path) {
    for path in stale(directory) {
        if path.symlink_metadata().is_ok_and(|found| found.is_dir()) {
            let _ = remove_if_stale(&path, remove_all);
        }
    }
}

/// Everything in a directory that is named after a dead writer.
fn stale(directory: &Path) -> Vec<PathBuf> {
    let names = names(directory).into_iter().flatten();
    names.filter(|name| has_dead_writer(name)).map(|name| directory.join(name)).collect()
}

fn has_dead_writer(name: &OsStr) -> bool {
    writer(name).is_some_and(|writer| writer.has_ended())
}

fn remove_if_stale(path: &Path, remove: impl Fn(&Path) -> io::Result<()>) -> io::Result<()> {
    // Since the check it may have become a link or a pipe.
    let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
    let file = OpenOptions::new().read(true).custom_flags(flags.bits()).open(path)?;
    if file.try_lock().is_ok() && is_same(&file, path)? {
        remove(path)?;
    }
    Ok(())
}

/// Whether the open file still has this name.
fn is_same(file: &File, path: &Path) -> io::Result<bool> {
    let opened = file.metadata()?;
    match fs::symlink_metadata(path) {
        Ok(named) => Ok((opened.dev(), opened.ino()) == (named.dev(), named.ino())),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

pub(super) fn next_name(name: &OsStr) -> OsString {
    name_of(name, &ProcessIdentity::current())
}

fn name_of(name: &OsStr, writer: &ProcessIdentity) -> OsString {
    static NUMBER: AtomicU64 = AtomicU64::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let ending = format!(".glimt-{:016x}-{}-{number}.tmp", writer.machine, writer.process);
    let kept = name.len().min(NAME_BYTES - 1 - ending.len());
    let mut result = OsString::from(".");
    result.push(OsStr::from_bytes(&name.as_bytes()[..kept]));
    result.push(ending);
    result
}

/// The writer that a temporary name states. `None` for other names, and for those of older versions (`.NAME.glimt-PID-N.tmp`),
/// which do not say on which machine their writer is.
fn writer(name: &OsStr) -> Option<ProcessIdentity> {
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

    /// A temporary name of a process of this machine that has ended.
    pub(in crate::output) fn dead_name(name: &str) -> OsString {
        name_of(OsStr::new(name), &dead_process())
    }

    /// A temporary name of another machine, whose processes cannot be seen from here.
    pub(in crate::output) fn foreign_name(name: &str) -> OsString {
        let dead = dead_process();
        name_of(OsStr::new(name), &ProcessIdentity { machine: dead.machine ^ 1, ..dead })
    }

    fn dead_process() -> ProcessIdentity {
        let mut child = Command::new("true").spawn().expect("true starts");
        let process = child.id();
        child.wait().expect("it ends");
        ProcessIdentity { process, ..ProcessIdentity::current() }
    }

    #[test]
    fn names() {
        for name in ["out.png", "a.glimt-b.png", "a.glimt-1-2.tmp", &"ä".repeat(127)] {
            let temporary = next_name(OsStr::new(name));
            assert_eq!(writer(&temporary), Some(ProcessIdentity::current()), "{temporary:?}");
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
            assert_eq!(writer(OsStr::new(&other)), None, "{other}");
        }
    }

    #[test]
    fn only_files_of_dead_writers_of_this_machine_are_removed() {
        let directory = tempfile::tempdir().expect("a directory");
        let living = Temporary::create(directory.path(), OsStr::new("a.png"), 0o666).expect("a file");
        let write = |name: OsString| {
            let path = directory.path().join(name);
            fs::write(&path, "half").expect("a file");
            path
        };
        let stale = write(dead_name("b.png"));
        // The writers of these may be alive, though nobody has locked them as seen from here.
        let kept = [
            write(foreign_name("b.png")),
            write(next_name(OsStr::new("b.png"))),
            write(".b.png.glimt-123-4.tmp".into()),
            write(".b.png.tmp".into()),
        ];
        remove_stale(directory.path(), &|_| false);
        assert!(living.path.exists());
        assert!(!stale.exists());
        for path in kept {
            assert!(path.exists(), "{}", path.display());
        }
    }

    #[test]
    fn a_probe_leaves_nothing() {
        let directory = tempfile::tempdir().expect("a directory");
        probe(directory.path()).expect("it takes files");
        assert_eq!(fs::read_dir(directory.path()).expect("a directory").count(), 0);
        assert!(probe(&directory.path().join("none")).is_err());
        #[cfg(target_os = "linux")]
        assert!(probe(Path::new("/proc")).is_err());
    }

    #[test]
    fn a_panic_leaves_nothing() {
        let directory = tempfile::tempdir().expect("a directory");
        let result = std::panic::catch_unwind(|| {
            let _file = Temporary::create(directory.path(), OsStr::new("a.png"), 0o666).expect("a file");
            panic!("while writing");
        });
        assert!(result.is_err());
        assert_eq!(fs::read_dir(directory.path()).expect("a directory").count(), 0);
    }

    #[test]
    fn a_file_that_was_cleared_away_is_not_claimed() {
        let directory = tempfile::tempdir().expect("a directory");
        let file = Temporary::create(directory.path(), OsStr::new("a.png"), 0o666).expect("a file");
        fs::remove_file(&file.path).expect("removed");
        assert!(!file.claim().expect("no error"));
        fs::write(&file.path, "another").expect("a file");
        assert!(!file.claim().expect("no error"));
    }
}
