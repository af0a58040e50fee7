//! Steps of `glimt import` shared by all readers for scenes from other renderers.

use std::path::{Path, PathBuf};

use super::super::{ForeignScene, scene_from_document};
use super::ForeignError;
use crate::assets::AssetError;
use crate::control::CancelToken;
use crate::scene::SceneDocumentValue;

/// The keys and values of a table.
pub(crate) type TableEntries = Vec<(&'static str, SceneDocumentValue)>;

/// A file to copy during an import.
#[derive(Clone, Debug)]
pub(crate) struct CopiedFile {
    /// Path of the copy, relative to the new scene.
    pub(crate) name: String,
    /// Path of the original.
    pub(crate) source: PathBuf,
}

/// Rejects a scene that `glimt check` would reject. `scene` must reference the original files, because the
/// copies do not exist yet.
pub(crate) fn check_scene_before_import(scene: ForeignScene, path: &Path) -> Result<(), ForeignError> {
    let ForeignScene { document, companions, .. } = scene;
    scene_from_document(document, path, &[])
        .map(|_| ())
        .map_err(|diagnostics| ForeignError::Scene { diagnostics, companions })
}

/// Reads the files to copy, and returns the names and contents of the copies.
pub(crate) fn read_files_to_copy(
    copies: Vec<CopiedFile>,
    token: &CancelToken,
) -> Result<Vec<(PathBuf, Vec<u8>)>, AssetError> {
    let read = |copy: CopiedFile| {
        token.check_pause_and_cancel()?;
        let bytes = std::fs::read(&copy.source).map_err(|error| AssetError::from_io(&copy.source, &error))?;
        Ok((PathBuf::from(copy.name), bytes))
    };
    copies.into_iter().map(read).collect()
}
