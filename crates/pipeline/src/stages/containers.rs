//! glTF files opened by a request. Each file is read only once, even if the scene uses many of its parts and
//! images.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::assets::gltf::{GltfFile, ImageLocation, has_gltf_extension};
use crate::assets::mesh::{load, load_from_bytes, serialized};
use crate::assets::{AssetError, FileHash, LoadedMesh};
use crate::control::{CancelToken, Progress, ignore_progress};

/// Slot for a glTF file, which is filled by its first user.
type GltfFileSlot = Arc<Mutex<Option<Arc<GltfFile>>>>;

/// Open glTF files, preloaded meshes, and files that an importer has generated.
#[derive(Debug, Default)]
pub(crate) struct OpenAssetFiles {
    gltf: Mutex<HashMap<PathBuf, GltfFileSlot>>,
    /// Meshes loaded before the meshes stage. Each can be taken only once.
    ahead: Mutex<HashMap<PathBuf, LoadedMesh>>,
    /// Bytes of the files that an importer has generated.
    generated: Mutex<HashMap<PathBuf, Arc<[u8]>>>,
}

impl OpenAssetFiles {
    /// Returns a glTF file, opening it if necessary.
    ///
    /// # Errors
    /// See [`GltfFile::open`]. After an error, the next call tries again.
    pub(crate) fn open(
        &self,
        path: &Path,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<Arc<GltfFile>, AssetError> {
        let slot = {
            let mut files = self.gltf.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(files.entry(path.to_owned()).or_default())
        };
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(container) = &*slot {
            return Ok(Arc::clone(container));
        }
        let container = Arc::new(GltfFile::open(path, progress, token)?);
        *slot = Some(Arc::clone(&container));
        Ok(container)
    }

    /// Reads a mesh file, a part of a glTF file, or a whole glTF file as a single mesh.
    pub(crate) fn load_any_mesh(
        &self,
        path: &Path,
        part: Option<u32>,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<LoadedMesh, AssetError> {
        if let Some(bytes) = self.importer_generated_file(path) {
            return load_from_bytes(path, &bytes, progress, token);
        }
        if serialized::has_serialized_extension(path) {
            return serialized::load(path, part, progress, token);
        }
        if !has_gltf_extension(path) {
            let ahead =
                self.ahead.lock().unwrap_or_else(PoisonError::into_inner).remove(&canonical_path(path));
            return ahead.map_or_else(|| load(path, progress, token), Ok);
        }
        let container = self.open(path, progress, token)?;
        match part {
            Some(part) => container.build_part_mesh(part as usize, &ignore_progress, token),
            None => container.merge_scene_into_mesh(token),
        }
    }

    /// Adds the files that an importer has generated.
    pub(crate) fn add_importer_generated_files(&self, files: impl Iterator<Item = (PathBuf, Arc<[u8]>)>) {
        self.generated.lock().unwrap_or_else(PoisonError::into_inner).extend(files);
    }

    /// Returns the bytes of a file that an importer has generated, or `None` for other files.
    pub(crate) fn importer_generated_file(&self, path: &Path) -> Option<Arc<[u8]>> {
        self.generated.lock().unwrap_or_else(PoisonError::into_inner).get(path).cloned()
    }

    /// Stores a mesh returned by [`OpenAssetFiles::load_any_mesh`] for the next call.
    pub(crate) fn store_mesh_for_next_load(&self, path: &Path, mesh: LoadedMesh) {
        self.ahead.lock().unwrap_or_else(PoisonError::into_inner).insert(canonical_path(path), mesh);
    }

    /// Returns the bytes or the path of an image used by a glTF file, plus the glTF file's hash.
    pub(crate) fn image_input(
        &self,
        path: &Path,
        number: u32,
        token: &CancelToken,
    ) -> Result<(ImageInput, FileHash), AssetError> {
        let container = self.open(path, &ignore_progress, token)?;
        let input = match container.locate_image(number as usize)? {
            ImageLocation::Inside(bytes) => ImageInput::Bytes(bytes.into()),
            ImageLocation::File(path) => ImageInput::File(path),
        };
        Ok((input, container.main_file_hash()))
    }
}

/// Where an image's bytes are stored.
#[derive(Debug)]
pub(crate) enum ImageInput {
    /// An image file.
    File(PathBuf),
    /// Bytes embedded in another file.
    Bytes(Arc<[u8]>),
}

/// Canonicalizes a path, so that all paths to a file compare equal. Returns a nonexistent path unchanged.
pub(super) fn canonical_path(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}
