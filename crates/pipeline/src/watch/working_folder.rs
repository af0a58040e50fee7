//! Handles the removal and re-creation of the working directory, for example by a checkout or by restoring a
//! backup. Afterwards the process is still in the removed directory and must change to the new directory with
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

/// Changes to the new directory with the same name if the working directory was removed. Returns whether the
/// process is now in an existing directory.
pub(super) fn reenter_working_folder_if_removed() -> bool {
    !is_working_folder_removed() || HOME.get().is_some_and(|home| env::set_current_dir(home).is_ok())
}

fn is_working_folder_removed() -> bool {
    env::current_dir().is_err_and(|error| error.kind() == ErrorKind::NotFound)
}

/// Returns the missing folder that makes the file inaccessible: the working directory or the file's parent.
pub fn find_missing_folder(file: &Path) -> Option<PathBuf> {
    if is_working_folder_removed() && file.is_relative() {
        return HOME.get().cloned();
    }
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty())?;
    (!folder.exists()).then(|| folder.to_owned())
}
