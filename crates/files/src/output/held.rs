//! Replaces a user's text file only if it still has the expected content. Every saved version always exists
//! under either the file's name or the backup name. Backups that differ from the file are never removed
//! automatically; they are reported at the next start.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use super::move_new::rename_no_replace;
use super::resolve_path;
use super::temporary::TemporaryFile;

/// Extension of the backup name.
const EXTENSION: &str = ".glimt-saved";
/// Maximum number of attempts to restore the old text while other programs save the file.
const ATTEMPTS: usize = 16;

/// Result of looking for a backup when a file is opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BackupRecovery {
    /// There was no backup, or it had the same content as the file.
    None,
    /// The file was missing and has been restored from the backup.
    Restored,
    /// The backup differs from the file. The user must compare them.
    Differs(PathBuf),
}

/// Looks for a backup left by an interrupted replacement, and restores it if the file is missing.
pub fn recover_backup(path: &Path) -> BackupRecovery {
    let Ok((target, existing)) = resolve_path::follow_links(path) else { return BackupRecovery::None };
    let held = backup_path(&target);
    let Ok(text) = fs::read(&held) else { return BackupRecovery::None };
    if existing.is_none() && rename_no_replace(&held, &target).is_ok() {
        return BackupRecovery::Restored;
    }
    if fs::read(&target).is_ok_and(|current| current == text) {
        // If the backup cannot be removed, report it.
        return fs::remove_file(&held).map_or(BackupRecovery::Differs(held), |()| BackupRecovery::None);
    }
    BackupRecovery::Differs(held)
}

fn backup_path(target: &Path) -> PathBuf {
    let mut name = target.as_os_str().to_owned();
    name.push(EXTENSION);
    name.into()
}

/// A replacement in progress. The steps are [`Self::stage_at_backup_path`], [`Self::swap`] and
/// [`Self::finish_or_restore_old`].
pub(super) struct FileReplacement<'a> {
    target: &'a Path,
    held: PathBuf,
    expected: &'a [u8],
    new: TemporaryFile,
}

impl<'a> FileReplacement<'a> {
    /// Moves the new text to the backup name.
    ///
    /// # Errors
    /// A backup already exists, or a system call fails.
    pub(super) fn stage_at_backup_path(
        mut new: TemporaryFile,
        target: &'a Path,
        expected: &'a [u8],
    ) -> io::Result<Self> {
        let held = backup_path(target);
        new.rename_no_replace(&held).map_err(|error| explain_if_backup_exists(&held, error))?;
        Ok(Self { target, held, expected, new })
    }

    /// Swaps the new text with the old text, which becomes the backup.
    ///
    /// # Errors
    /// A system error. Also returns the new text if it has been renamed back to its temporary name.
    pub(super) fn swap(mut self) -> Result<Self, (io::Error, Option<TemporaryFile>)> {
        match exchange_files(&self.held, self.target) {
            Ok(()) => Ok(self),
            Err(error) => {
                let is_back = self.new.rename_back(&self.held).is_ok();
                Err((error, is_back.then_some(self.new)))
            }
        }
    }

    /// Removes the old text and returns the new file. If the old text is not the expected text, restores it
    /// and returns `None`.
    ///
    /// # Errors
    /// A system error. A backup may remain.
    pub(super) fn finish_or_restore_old(self) -> io::Result<Option<File>> {
        let text = fs::read(&self.held)?;
        if text == self.expected {
            // If this fails, the backup is handled at the next start.
            let _ = fs::remove_file(&self.held);
            return self.new.file.try_clone().map(Some);
        }
        self.restore_old(text)?;
        Ok(None)
    }

    /// Restores the old text, unless another program has saved a newer version in the meantime.
    fn restore_old(&self, mut older: Vec<u8>) -> io::Result<()> {
        for _ in 0..ATTEMPTS {
            exchange_files(&self.held, self.target)?;
            if self.is_new_at_backup_path() {
                return fs::remove_file(&self.held);
            }
            // The backup is not our new text, so another program saved it after the first exchange. Swap it
            // back in and take out the older text.
            let newer = fs::read(&self.held)?;
            exchange_files(&self.held, self.target)?;
            if fs::read(&self.held)? == older {
                return fs::remove_file(&self.held);
            }
            older = newer;
        }
        Err(io::Error::new(ErrorKind::AlreadyExists, backup_exists_message(&self.held)))
    }

    /// Whether the backup name refers to the new file.
    fn is_new_at_backup_path(&self) -> bool {
        super::FileIdentity::from_existing_or_new_path(&self.held)
            .is_some_and(|held| held.matches_open_file(&self.new.file))
    }
}

/// Fallback for file systems that cannot exchange two names. Moves the old text to the backup name, checks
/// it, and moves the new text to the file's name if that name is still unused.
pub(super) struct ReplacementWithoutExchange<'a> {
    target: &'a Path,
    held: PathBuf,
    expected: &'a [u8],
}

impl<'a> ReplacementWithoutExchange<'a> {
    /// Moves the old text to the backup name.
    ///
    /// # Errors
    /// A backup already exists, or a system call fails.
    pub(super) fn move_old_to_backup_path(target: &'a Path, expected: &'a [u8]) -> io::Result<Self> {
        let held = backup_path(target);
        rename_no_replace(target, &held).map_err(|error| explain_if_backup_exists(&held, error))?;
        Ok(Self { target, held, expected })
    }

    /// Moves the new text to the file's name and returns the file. If the old text is not the expected text,
    /// restores it and returns `None`.
    ///
    /// # Errors
    /// A system error. A backup may remain.
    pub(super) fn place_new_if_old_unchanged(self, mut new: TemporaryFile) -> io::Result<Option<File>> {
        if fs::read(&self.held)? != self.expected {
            return rename_no_replace(&self.held, self.target).map(|()| None);
        }
        let file = new.file.try_clone()?;
        match new.rename_no_replace(self.target) {
            // Another program has saved the file in the meantime. Keep that version and remove the older
            // backup.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                fs::remove_file(&self.held)?;
                Ok(None)
            }
            Err(error) => rename_no_replace(&self.held, self.target).and(Err(error)),
            Ok(()) => {
                // If this fails, the backup is handled at the next start.
                let _ = fs::remove_file(&self.held);
                Ok(Some(file))
            }
        }
    }
}

/// Replaces a file and returns the new file. If the file does not have the expected content, keeps it and
/// returns `None`.
///
/// # Errors
/// A system error.
pub(super) fn replace_if_unchanged(
    new: TemporaryFile,
    target: &Path,
    expected: &[u8],
) -> io::Result<Option<File>> {
    match FileReplacement::stage_at_backup_path(new, target, expected)?.swap() {
        Ok(replacement) => replacement.finish_or_restore_old(),
        // The file system cannot exchange names, or the file no longer exists.
        Err((error, Some(new))) if error.kind() != ErrorKind::PermissionDenied => {
            ReplacementWithoutExchange::move_old_to_backup_path(target, expected)?
                .place_new_if_old_unchanged(new)
        }
        Err((error, _)) => Err(error),
    }
}

/// Adds an explanation if the backup already exists.
fn explain_if_backup_exists(held: &Path, error: io::Error) -> io::Error {
    match error.kind() {
        ErrorKind::AlreadyExists => io::Error::new(ErrorKind::AlreadyExists, backup_exists_message(held)),
        _ => error,
    }
}

fn backup_exists_message(held: &Path) -> String {
    format!(
        "{} contains text from an interrupted save; compare it with the file, then remove it",
        held.display()
    )
}

#[cfg(target_os = "linux")]
fn exchange_files(a: &Path, b: &Path) -> io::Result<()> {
    use rustix::fs::{CWD, RenameFlags, renameat_with};
    Ok(renameat_with(CWD, a, CWD, b, RenameFlags::EXCHANGE)?)
}

#[cfg(not(target_os = "linux"))]
fn exchange_files(_: &Path, _: &Path) -> io::Result<()> {
    Err(ErrorKind::Unsupported.into())
}

/// Warning about a backup that differs from its file.
pub fn backup_differs_warning(held: &Path) -> String {
    format!(
        "{} contains another version of this scene, because glimt was interrupted while saving it",
        held.display()
    )
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::io::Write;

    use super::super::temporary::remove_stale_files;
    use super::*;

    const OLD: &str = "as glimt read it";
    const NEWER: &str = "saved by an editor meanwhile";
    const NEW: &str = "written by glimt";

    struct SceneDir {
        folder: tempfile::TempDir,
    }

    impl SceneDir {
        fn new() -> Self {
            let folder = Self { folder: tempfile::tempdir().expect("a folder") };
            fs::write(folder.scene(), OLD).expect("written");
            folder
        }

        fn scene(&self) -> PathBuf {
            self.folder.path().join("a.toml")
        }

        /// New text in a temporary file.
        fn new_text(&self) -> TemporaryFile {
            let new = TemporaryFile::create_locked(self.folder.path(), OsStr::new("a.toml"), 0o644)
                .expect("a file");
            (&new.file).write_all(NEW.as_bytes()).expect("written");
            new
        }

        /// Saves the scene like an editor: writes a temporary file, then renames it.
        fn save(&self, text: &str) {
            let other = self.folder.path().join("of the editor");
            fs::write(&other, text).expect("written");
            fs::rename(other, self.scene()).expect("renamed");
        }

        /// Returns all texts that exist after the process is killed, stale files are removed and glimt
        /// restarts.
        fn texts_after_kill(&self) -> Vec<String> {
            remove_stale_files(self.folder.path(), &|_| false);
            recover_backup(&self.scene());
            let entries = fs::read_dir(self.folder.path()).expect("a folder");
            let names = entries.map(|entry| entry.expect("an entry").path());
            let texts = names.filter(|path| path.extension().is_none_or(|extension| extension != "tmp"));
            texts.map(|path| fs::read_to_string(path).expect("a text")).collect()
        }

        fn has(&self, text: &str) -> bool {
            fs::read_to_string(self.scene()).is_ok_and(|now| now == text)
        }
    }

    #[test]
    fn only_the_expected_text_is_replaced() {
        let folder = SceneDir::new();
        assert!(
            replace_if_unchanged(folder.new_text(), &folder.scene(), OLD.as_bytes())
                .expect("replaced")
                .is_some()
        );
        assert!(folder.has(NEW));
        folder.save(NEWER);
        assert!(
            replace_if_unchanged(folder.new_text(), &folder.scene(), OLD.as_bytes())
                .expect("no error")
                .is_none()
        );
        assert!(folder.has(NEWER));
        assert_eq!(fs::read_dir(folder.folder.path()).expect("a folder").count(), 1, "no other files");
        // Repeat with stepwise replacement.
        let scene = folder.scene();
        let steps =
            ReplacementWithoutExchange::move_old_to_backup_path(&scene, OLD.as_bytes()).expect("taken");
        assert!(
            steps.place_new_if_old_unchanged(folder.new_text()).expect("no error").is_none()
                && folder.has(NEWER)
        );
        let steps =
            ReplacementWithoutExchange::move_old_to_backup_path(&scene, NEWER.as_bytes()).expect("taken");
        assert!(
            steps.place_new_if_old_unchanged(folder.new_text()).expect("no error").is_some()
                && folder.has(NEW)
        );
        assert_eq!(fs::read_dir(folder.folder.path()).expect("a folder").count(), 1, "no other files");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn killing_a_replacement_loses_no_text() {
        // The process is killed after `steps` steps. An editor saves at the steps in `saves`.
        for steps in 0..=2 {
            for saves in [vec![], vec![0], vec![1], vec![0, 1], vec![2], vec![0, 2]] {
                let folder = SceneDir::new();
                let scene = folder.scene();
                let mut newest = OLD.to_owned();
                let mut save = |at: usize| {
                    if saves.contains(&at) {
                        newest = format!("{NEWER} {at}");
                        folder.save(&newest);
                    }
                };
                save(0);
                let new = folder.new_text();
                if steps == 0 {
                    std::mem::forget(new);
                } else {
                    let mut replacement =
                        FileReplacement::stage_at_backup_path(new, &scene, OLD.as_bytes()).expect("begun");
                    save(1);
                    if steps == 2 {
                        replacement = replacement.swap().map_err(|(error, _)| error).expect("swapped");
                        save(2);
                    }
                    std::mem::forget(replacement);
                }
                let found = folder.texts_after_kill();
                let is_lost = newest != OLD && !found.contains(&newest);
                assert!(!is_lost, "{steps} {saves:?}: {newest:?} is not in {found:?}");
                assert!(scene.exists() && found.len() <= 2, "{steps} {saves:?}: {found:?}");
                // If there are two texts, every start reports them until the user removes one.
                let held = recover_backup(&scene);
                assert_eq!(
                    matches!(held, BackupRecovery::Differs(_)),
                    found.len() == 2,
                    "{steps} {saves:?}: {held:?}"
                );
                let again = replace_if_unchanged(folder.new_text(), &scene, newest.as_bytes());
                assert_eq!(again.is_err(), found.len() == 2, "the backup should be kept: {again:?}");
            }
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn text_saved_during_a_rollback_is_kept() {
        let folder = SceneDir::new();
        let scene = folder.scene();
        folder.save("first");
        let replacement =
            FileReplacement::stage_at_backup_path(folder.new_text(), &scene, OLD.as_bytes()).expect("begun");
        let replacement = replacement.swap().map_err(|(error, _)| error).expect("swapped");
        folder.save("second");
        assert!(replacement.finish_or_restore_old().expect("no error").is_none());
        assert!(folder.has("second"));
        assert_eq!(fs::read_dir(folder.folder.path()).expect("a folder").count(), 1);
    }

    #[test]
    fn missing_files_are_restored_from_backups() {
        let folder = SceneDir::new();
        let scene = folder.scene();
        std::mem::forget(
            ReplacementWithoutExchange::move_old_to_backup_path(&scene, OLD.as_bytes()).expect("taken"),
        );
        assert!(!scene.exists());
        assert_eq!(recover_backup(&scene), BackupRecovery::Restored);
        assert!(folder.has(OLD));
        // Repeat through a symbolic link.
        let link = folder.folder.path().join("link.toml");
        std::os::unix::fs::symlink(&scene, &link).expect("a link");
        std::mem::forget(
            ReplacementWithoutExchange::move_old_to_backup_path(&scene, OLD.as_bytes()).expect("taken"),
        );
        assert_eq!(recover_backup(&link), BackupRecovery::Restored);
        assert_eq!(recover_backup(&link), BackupRecovery::None);
        // An editor saves while the old text is at the backup path.
        let steps =
            ReplacementWithoutExchange::move_old_to_backup_path(&scene, OLD.as_bytes()).expect("taken");
        folder.save(NEWER);
        assert!(
            steps.place_new_if_old_unchanged(folder.new_text()).expect("no error").is_none()
                && folder.has(NEWER)
        );
    }
}
