//! glTF files that a request has open: each is read once, however many parts and images the scene names.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::assets::gltf::{Container, ImageBytes, is_gltf};
use crate::assets::mesh::load;
use crate::assets::{AssetError, FileHash, LoadedMesh};
use crate::control::{CancelToken, Progress, ignore_progress};

/// The slot of a file, which is filled by whoever needs it first.
type Slot = Arc<Mutex<Option<Arc<Container>>>>;

/// Open glTF files, and meshes that were read ahead.
#[derive(Debug, Default)]
pub(crate) struct Containers {
    gltf: Mutex<HashMap<PathBuf, Slot>>,
    /// Meshes that were read before the stage that needs them, each for one who asks.
    ahead: Mutex<HashMap<PathBuf, LoadedMesh>>,
}

impl Containers {
    /// The open file of a path.
    ///
    /// # Errors
    /// As for [`Container::open`]; the next call tries again.
    pub(crate) fn open(
        &self,
        path: &Path,
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<Arc<Container>, AssetError> {
        let slot = {
            let mut files = self.gltf.lock().unwrap_or_else(PoisonError::into_inner);
            Arc::clone(files.entry(path.to_owned()).or_default())
        };
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(container) = &*slot {
            return Ok(Arc::clone(container));
        }
        let container = Arc::new(Container::open(path, progress, token)?);
        *slot = Some(Arc::clone(&container));
        Ok(container)
    }

    /// A mesh file, or a part of a glTF file. The whole of a glTF file is its scene as one mesh.
    pub(crate) fn mesh(
        &self,
        (path, part): (&Path, Option<u32>),
        progress: Progress<'_>,
        token: &CancelToken,
    ) -> Result<LoadedMesh, AssetError> {
        if !is_gltf(path) {
            let ahead = self.ahead.lock().unwrap_or_else(PoisonError::into_inner).remove(&canonical(path));
            return ahead.map_or_else(|| load(path, progress, token), Ok);
        }
        let container = self.open(path, progress, token)?;
        match part {
            Some(part) => container.part(part as usize, &ignore_progress, token),
            None => container.whole(token),
        }
    }

    /// Keeps a mesh that [`Containers::mesh`] has given for whoever asks for it next.
    pub(crate) fn keep(&self, path: &Path, mesh: LoadedMesh) {
        self.ahead.lock().unwrap_or_else(PoisonError::into_inner).insert(canonical(path), mesh);
    }

    /// The bytes of an image of a glTF file, or the file that holds them, and the hash of the glTF file.
    pub(crate) fn image(
        &self,
        (path, number): (&Path, u32),
        token: &CancelToken,
    ) -> Result<(ImageInput, FileHash), AssetError> {
        let container = self.open(path, &ignore_progress, token)?;
        let input = match container.image(number as usize)? {
            ImageBytes::Inside(bytes) => ImageInput::Bytes(bytes.into()),
            ImageBytes::File(path) => ImageInput::File(path),
        };
        Ok((input, container.hash()))
    }
}

/// Source of an image's bytes.
#[derive(Debug)]
pub(crate) enum ImageInput {
    /// An image file.
    File(PathBuf),
    /// Bytes of another file.
    Bytes(Arc<[u8]>),
}

/// One file by whatever name; a name that leads nowhere stands for itself.
pub(super) fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}
