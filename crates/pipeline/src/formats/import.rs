//! `glimt import`: converts foreign files to scene files.

use std::path::Path;

use super::foreign::{ForeignError, ForeignOptions};
use super::model::ModelViewOptions;
use super::{FORMATS, ForeignFormat, ForeignReadContext, ImportedScene};
use crate::assets::AssetError;
use crate::control::CancelToken;
use crate::scene::diagnostic::Diagnostic;
use crate::stages::containers::OpenAssetFiles;
use crate::system::threads::start_logical_cpu_pool;

/// Reasons why a file cannot be imported.
#[derive(Debug)]
pub enum ImportError {
    /// The file or the command line is invalid.
    File(String),
    /// The file has errors.
    Scene(Vec<Diagnostic>),
    /// There is not enough memory, or a thread cannot be started.
    Work(String),
}

/// Imports a foreign file as a scene that stores its meshes and images in `folder`.
///
/// # Errors
/// Returns an error if the file is invalid, memory runs out, a thread cannot be started, or the token is
/// canceled.
pub fn import_scene(
    path: &Path,
    folder: &str,
    options: &ForeignOptions,
    token: &CancelToken,
) -> Result<ImportedScene, ImportError> {
    let Some(convert) = ForeignFormat::from_extension(path).and_then(|format| format.convert) else {
        let importable = FORMATS.iter().filter(|format| format.convert.is_some());
        let list: Vec<_> =
            importable.flat_map(|format| format.extensions).map(|one| format!(".{one}")).collect();
        let list = list.join(", ");
        let list = list.rsplit_once(", ").map_or(list.clone(), |(first, last)| format!("{first} and {last}"));
        let path = path.display();
        return Err(ImportError::File(format!("cannot import {path}: only {list} files are supported")));
    };
    let pool = start_logical_cpu_pool().map_err(ImportError::Work)?;
    let (view, containers) = (ModelViewOptions::default(), OpenAssetFiles::default());
    let context = ForeignReadContext { view, options, containers: &containers, token };
    pool.install(|| convert(path, folder, &context)).map_err(|error| match error {
        ForeignError::Scene { diagnostics, companions: _ } => ImportError::Scene(diagnostics),
        ForeignError::Asset(error) => import_error(&error),
    })
}

fn import_error(error: &AssetError) -> ImportError {
    match error {
        AssetError::OutOfMemory { .. }
        | AssetError::MemoryLimit { .. }
        | AssetError::TooManyOpenFiles { .. } => ImportError::Work(error.to_string()),
        AssetError::Unreadable { .. } | AssetError::Malformed { .. } | AssetError::Canceled(_) => {
            ImportError::File(error.to_string())
        }
    }
}
