//! Handles the removal and re-creation of the working directory, for example by a checkout or when a backup
//! is restored. The process is then still in the removed directory, so it must change to the new directory of
//! the same name.

use std::env;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The working directory at the time the watcher was started.
static HOME: OnceLock<PathBuf> = OnceLock::new();

/// Remembers the working directory.
pub(super) fn remember_working_folder() {
    if let Ok(folder) = env::current_dir() {
        HOME.get_or_init(|| folder);
    }
}

/// Whether the working directory exists. If it was removed, tries to change to a new directory of the same
/// name.
pub(super) fn reenter_working_folder_if_removed() -> bool {
    !is_working_folder_removed() || HOME.get().is_some_and(|home| env::set_current_dir(home).is_ok())
}

fn is_working_folder_removed() -> bool {
    env::current_dir().is_err_and(|error| error.kind() == ErrorKind::NotFound)
}

/// Returns a missing folder that the file needs: the working directory or the file's own folder.
pub fn find_missing_folder(file: &Path) -> Option<PathBuf> {
    if is_working_folder_removed() && file.is_relative() {
        return HOME.get().cloned();
    }
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty())?;
    (!folder.exists()).then(|| folder.to_owned())
}
