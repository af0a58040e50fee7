//! The working folder, which names without a `/` in front are of. Where it is removed and made again (a checkout, a restored
//! backup), the process stays in the one that is gone, in which nothing will ever be found.

use std::env;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The working folder when watching began.
static HOME: OnceLock<PathBuf> = OnceLock::new();

/// Remember where the process is.
pub(super) fn remember() {
    if let Ok(folder) = env::current_dir() {
        HOME.get_or_init(|| folder);
    }
}

/// Whether the working folder exists. If it is gone, the folder that has its name now replaces it.
pub(super) fn is_there() -> bool {
    !is_lost() || HOME.get().is_some_and(|home| env::set_current_dir(home).is_ok())
}

fn is_lost() -> bool {
    env::current_dir().is_err_and(|error| error.kind() == ErrorKind::NotFound)
}

/// The folder that has to be there before this file can be: the working folder, or that of the file.
pub fn missing_folder(file: &Path) -> Option<PathBuf> {
    if is_lost() && file.is_relative() {
        return HOME.get().cloned();
    }
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty())?;
    (!folder.exists()).then(|| folder.to_owned())
}
