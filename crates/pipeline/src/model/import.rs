//! Imports glTF files as scene files.

use std::path::{Path, PathBuf};

use super::gltf::{GltfPartOrImage, SceneAssetLocation};
use super::{GeneratedScene, ModelViewOptions, mark_diagnostic_as_generated};
use crate::assets::AssetError;
use crate::assets::gltf::is_gltf;
use crate::assets::mesh::ply::write;
use crate::control::{CancelToken, ignore_progress};
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::load_generated;
use crate::stages::containers::GltfContainers;
use crate::system::threads::logical_cpu_pool;

/// An imported scene, ready to be written.
#[derive(Debug)]
pub struct ImportedScene {
    /// Scene text. Its paths are relative to the scene file.
    pub text: String,
    /// Files referenced by the text, with paths relative to the scene file.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// Approximations made, each with its location in the file.
    pub notes: Vec<String>,
}

/// Reasons why a file cannot be imported.
#[derive(Debug)]
pub enum ImportError {
    /// The file or the command line is invalid.
    File(String),
    /// There is not enough memory, or a thread cannot be started.
    Work(String),
}

/// Imports a glTF file as a scene whose meshes and images are stored in `folder`.
///
/// # Errors
/// Returns an error if the file is invalid, memory runs out, a thread cannot be started, or the token is
/// canceled.
pub fn import_gltf(path: &Path, folder: &str, token: &CancelToken) -> Result<ImportedScene, ImportError> {
    if !is_gltf(path) {
        let message = format!("cannot import {}: only .gltf and .glb files are supported", path.display());
        return Err(ImportError::File(message));
    }
    let pool = logical_cpu_pool().map_err(ImportError::Work)?;
    let containers = GltfContainers::default();
    let naming = SceneAssetLocation::Folder(folder.to_owned());
    let read = || {
        let GeneratedScene { text, notes, assets, .. } =
            super::gltf::scene_text(path, (ModelViewOptions::default(), &naming), &containers, token)?;
        check_generated_scene(path, &containers, token)?;
        let container = containers.open(path, &ignore_progress, token)?;
        let mut files = Vec::new();
        for asset in assets {
            let bytes = match asset.content {
                GltfPartOrImage::Part(part) => {
                    write::encode_ply(&container.build_part(part, &ignore_progress, token)?.mesh)
                }
                GltfPartOrImage::Image(image) => {
                    // Check the content. Otherwise, a malicious glTF file could make the import copy
                    // arbitrary files as images.
                    container.check_image_decodes(image, token)?;
                    container.read_embedded_or_external_image(image, token)?
                }
            };
            files.push((PathBuf::from(asset.name), bytes));
        }
        Ok(ImportedScene { text, files, notes })
    };
    pool.install(read).map_err(|error: AssetError| match error {
        AssetError::OutOfMemory { .. } | AssetError::TooManyOpenFiles { .. } => {
            ImportError::Work(error.to_string())
        }
        AssetError::Unreadable { .. } | AssetError::Malformed { .. } | AssetError::Cancelled(_) => {
            ImportError::File(error.to_string())
        }
    })
}

/// Rejects a scene that `glimt check` would reject. Checks the text that `glimt MODEL` would render, because
/// the files referenced by that text already exist.
fn check_generated_scene(
    path: &Path,
    containers: &GltfContainers,
    token: &CancelToken,
) -> Result<(), AssetError> {
    let shown = super::gltf::scene_text(
        path,
        (ModelViewOptions::default(), &SceneAssetLocation::Inside),
        containers,
        token,
    )?;
    let Err(errors) = load_generated(shown.text.into(), path, &[]) else { return Ok(()) };
    // Ignore errors about file names, because the imported scene uses different file names.
    let counts = |one: &&Diagnostic| one.severity == Severity::Error && !one.message.contains("`file`");
    let Some(first) = errors.into_iter().find(|one| counts(&one)) else { return Ok(()) };
    Err(AssetError::Malformed {
        path: path.to_owned(),
        line: None,
        reason: mark_diagnostic_as_generated(first).message,
    })
}
