//! A valid scene and the files it needs.

use std::path::PathBuf;
use std::sync::Arc;

use crate::control::Canceled;
use crate::scene::fingerprint::Fingerprint;
use crate::stages::FileReadContext;
use crate::stages::meshes::MeshesByFileIndex;
use crate::stages::parse::ParsedScene;
use crate::stages::textures::{LoadedTextures, NeededTextures};
use crate::watch::content::FilePathAndContentId;
use crate::world::GlassSolids;

/// A parsed scene and all loaded files needed for its image.
#[derive(Clone)]
pub(crate) struct SceneAssets {
    pub(crate) parsed: Arc<ParsedScene>,
    pub(crate) meshes: MeshesByFileIndex,
    pub(super) glass: Arc<GlassSolids>,
    pub(crate) textures: Arc<LoadedTextures>,
    /// Textures that were needed when `textures` was loaded.
    pub(super) needed: NeededTextures,
    /// All files that were read for the scene, with their contents.
    pub(crate) files: Vec<FilePathAndContentId>,
}

impl SceneAssets {
    /// Returns the key of each mesh file.
    pub(crate) fn mesh_keys(&self) -> Vec<Fingerprint> {
        self.meshes.iter().map(|mesh| mesh.key).collect()
    }

    /// Whether a file other than the scene file has changed since it was read.
    pub(super) fn have_files_changed(&self, reading: &FileReadContext<'_>) -> Result<bool, Canceled> {
        let loaded = &self.parsed.loaded;
        let is_mesh = |path: &PathBuf| loaded.scene.mesh_files.iter().any(|file| file.value == *path);
        for FilePathAndContentId { path, content } in &self.files {
            let is_scene_file = *path == loaded.path && !is_mesh(path);
            if !is_scene_file && reading.contents.first_seen_content_id(path, reading.token)? != *content {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
