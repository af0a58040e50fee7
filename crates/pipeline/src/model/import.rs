//! Scenes of glTF files as files of their own.

use std::path::{Path, PathBuf};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::gltf::{Content, Naming};
use super::{ModelText, Show, in_its_scene};
use crate::assets::AssetError;
use crate::assets::gltf::is_gltf;
use crate::assets::mesh::ply::write;
use crate::control::{CancelToken, ignore_progress};
use crate::plan::cores;
use crate::scene::diagnostic::{Diagnostic, Severity};
use crate::scene::load_generated;
use crate::stages::containers::Containers;
use crate::system::threads::{check_stack_space, start_failure};

/// A scene that can be written.
#[derive(Debug)]
pub struct Imported {
    /// Its text. Files that it names are relative to it.
    pub text: String,
    /// The files that the text names, each with its path relative to the text.
    pub files: Vec<(PathBuf, Vec<u8>)>,
    /// Approximations, each with its place in the file.
    pub notes: Vec<String>,
}

/// Reasons for which a file is not imported, in words.
#[derive(Debug)]
pub enum ImportError {
    /// Something is wrong with the file, or with the call.
    File(String),
    /// The work failed: there is no memory, or no thread.
    Work(String),
}

/// Reads a file of another program as a scene whose other files are in a folder of this name.
///
/// # Errors
/// What is wrong with the file or the machine; or the token is cancelled.
pub fn import(path: &Path, folder: &str, token: &CancelToken) -> Result<Imported, ImportError> {
    if !is_gltf(path) {
        let message = format!("{} is no file that can be imported: .gltf or .glb", path.display());
        return Err(ImportError::File(message));
    }
    let pool = pool().map_err(|error| ImportError::Work(start_failure("threads", false, &error)))?;
    let containers = Containers::default();
    let naming = Naming::Folder(folder.to_owned());
    let read = || {
        let ModelText { text, notes, assets, .. } =
            super::gltf::text(path, (Show::default(), &naming), &containers, token)?;
        check_scene(path, &containers, token)?;
        let container = containers.open(path, &ignore_progress, token)?;
        let mut files = Vec::new();
        for asset in assets {
            let bytes = match asset.content {
                Content::Part(part) => write::bytes(&container.part(part, &ignore_progress, token)?.mesh),
                Content::Image(image) => {
                    // Files from anywhere could be copied under the name of an image.
                    container.check_image(image, token)?;
                    container.image_content(image, token)?
                }
            };
            files.push((PathBuf::from(asset.name), bytes));
        }
        Ok(Imported { text, files, notes })
    };
    pool.install(read).map_err(|error: AssetError| match error {
        AssetError::OutOfMemory { .. } => ImportError::Work(error.to_string()),
        AssetError::Unreadable { .. } | AssetError::Malformed { .. } | AssetError::Cancelled(_) => {
            ImportError::File(error.to_string())
        }
    })
}

/// Threads to read with, one per core.
fn pool() -> Result<ThreadPool, String> {
    check_stack_space(cores()).map_err(|error| error.to_string())?;
    ThreadPoolBuilder::new().num_threads(cores()).build().map_err(|error| error.to_string())
}

/// Refuses a scene that `glimt check` would refuse. It reads the text that `glimt MODEL` shows, whose files are there.
fn check_scene(path: &Path, containers: &Containers, token: &CancelToken) -> Result<(), AssetError> {
    let shown = super::gltf::text(path, (Show::default(), &Naming::Inside), containers, token)?;
    let Err(errors) = load_generated(shown.text.into(), path, &[]) else { return Ok(()) };
    // Files have other names where the scene is written.
    let counts = |one: &&Diagnostic| one.severity == Severity::Error && !one.message.contains("`file`");
    let Some(first) = errors.into_iter().find(|one| counts(&one)) else { return Ok(()) };
    Err(AssetError::Malformed { path: path.to_owned(), line: None, reason: in_its_scene(first).message })
}
