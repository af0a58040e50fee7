//! Tests that read small scenes and check the resulting documents and errors.

mod broken;
mod facts;
mod fuzz;

use std::io::Write;
use std::path::{Path, PathBuf};

use super::read;
use crate::assets::mesh::load_from_bytes;
use crate::control::{CancelToken, ignore_progress};
use crate::formats::foreign::{ForeignError, ForeignOptions};
use crate::formats::model::ModelViewOptions;
use crate::formats::{ForeignReadContext, ForeignScene, scene_from_document};
use crate::scene::LoadedScene;
use crate::scene::diagnostic::Diagnostic;
use crate::stages::containers::OpenAssetFiles;

/// A folder with a scene and its files.
pub(super) struct SceneFolder {
    folder: tempfile::TempDir,
}

impl SceneFolder {
    pub(super) fn new(text: &str) -> Self {
        let folder = Self { folder: tempfile::tempdir().expect("a folder") };
        folder.write("scene.pbrt", text.as_bytes());
        folder
    }

    pub(super) fn write(&self, name: &str, bytes: &[u8]) {
        let path = self.folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, bytes).expect("written");
    }

    pub(super) fn path(&self) -> PathBuf {
        self.folder.path().join("scene.pbrt")
    }

    /// Reads the scene. Returns the diagnostics if it has errors.
    pub(super) fn read(&self) -> Result<ForeignScene, Vec<Diagnostic>> {
        read_path(&self.path(), &ForeignOptions::default())
    }

    /// Reads and validates the scene.
    pub(super) fn scene_from_document(&self) -> Result<LoadedScene, Vec<Diagnostic>> {
        self.read().and_then(|scene| scene_from_document(scene.document, &self.path(), &[]))
    }
}

pub(super) fn read_path(path: &Path, options: &ForeignOptions) -> Result<ForeignScene, Vec<Diagnostic>> {
    let (containers, token) = (OpenAssetFiles::default(), CancelToken::new());
    let view = ModelViewOptions::default();
    let context = ForeignReadContext { view, options, containers: &containers, token: &token };
    read(path, &context).map_err(|error| match error {
        ForeignError::Asset(error) => panic!("{error}"),
        ForeignError::Scene { diagnostics, .. } => diagnostics,
    })
}

/// Returns the TOML of a scene whose world contains `world`, after validating it.
pub(super) fn toml_of_world(world: &str) -> String {
    toml_of(&format!("{CAMERA}WorldBegin\n{world}"))
}

/// Returns the TOML of a scene, after validating it.
pub(super) fn toml_of(text: &str) -> String {
    let folder = SceneFolder::new(text);
    folder.scene_from_document().unwrap_or_else(|errors| panic!("{text}\n{errors:?}"));
    folder.read().expect("a scene").document.to_toml()
}

/// Options block of a scene, with a camera.
pub(super) const CAMERA: &str = "LookAt 0 0 -5  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40\n";

/// The generated meshes of a scene.
pub(super) fn generated_meshes(scene: &ForeignScene) -> Vec<crate::assets::LoadedMesh> {
    let files = scene.document.added_in_memory_files().iter();
    let load = |(name, file): (&String, &crate::scene::InMemoryFile)| {
        load_from_bytes(Path::new(name), &file.bytes, &ignore_progress, &CancelToken::new()).expect("a mesh")
    };
    files.filter(|(name, _)| name.ends_with(".ply")).map(load).collect()
}

/// Encodes bytes as a gzip file with one stored (uncompressed) block.
pub(super) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];
    let mut crc = !0_u32;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    let length = bytes.len() as u16;
    out.push(1);
    out.extend(length.to_le_bytes());
    out.extend((!length).to_le_bytes());
    out.extend(bytes);
    out.extend((!crc).to_le_bytes());
    out.write_all(&u32::from(length).to_le_bytes()).expect("in memory");
    out
}

/// A PLY file of a triangle with the corners (0, 0, 0), (1, 0, 0) and (0, 1, 0).
pub(super) const TRIANGLE_PLY: &[u8] =
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
