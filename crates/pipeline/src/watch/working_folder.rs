//! The working directory, which may be removed and recreated (by a checkout or a restored backup). The process then
//! stays in the removed directory, so it changes to the new one of the same name.

use std::env;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The working directory when watching began.
static HOME: OnceLock<PathBuf> = OnceLock::new();

/// Remembers the working directory.
pub(super) fn remember() {
    if let Ok(folder) = env::current_dir() {
        HOME.get_or_init(|| folder);
    }
}

/// Whether the working directory exists. If it was removed, changes to a new one of the same name.
pub(super) fn has_working_folder() -> bool {
    !is_removed() || HOME.get().is_some_and(|home| env::set_current_dir(home).is_ok())
}

fn is_removed() -> bool {
    env::current_dir().is_err_and(|error| error.kind() == ErrorKind::NotFound)
}

/// Returns the missing folder that a file needs: the working directory or the file's own folder.
pub fn missing_folder(file: &Path) -> Option<PathBuf> {
    if is_removed() && file.is_relative() {
        return HOME.get().cloned();
    }
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty())?;
    (!folder.exists()).then(|| folder.to_owned())
}
