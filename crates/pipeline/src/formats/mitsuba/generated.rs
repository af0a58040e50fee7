//! Meshes and images that exist only in memory.

use std::sync::Arc;

use super::graph::PluginInstance;
use super::reader::SceneReader;
use super::shapes::ShapeTarget;
use crate::formats::foreign::meshes::MeshData;
use crate::formats::foreign::transform::matrix_value;
use crate::math::DMat4;
use crate::scene::InMemoryFile;

impl<'a> SceneReader<'a> {
    /// Adds a file that exists only in memory, and returns the value of the key `file`.
    pub(super) fn add_generated_file(&mut self, stem: &str, extension: &str, bytes: Vec<u8>) -> String {
        let hash = *blake3::hash(&bytes).as_bytes();
        if let Some(known) = self.generated_names.get(&hash) {
            return known.clone();
        }
        // The name depends only on the content, so that edits elsewhere in the file keep what is cached.
        let digest = &blake3::Hash::from(hash).to_hex()[..16];
        let name = match self.asset_folder {
            Some(folder) => format!("{folder}/{stem}-{digest}.{extension}"),
            None => {
                let file = self.path.file_name().unwrap_or_default().to_string_lossy();
                format!("{file}/{stem}-{digest}.{extension}")
            }
        };
        let bytes: Arc<[u8]> = bytes.into();
        self.document.add_in_memory_file(name.clone(), InMemoryFile { bytes, hash });
        self.generated_names.insert(hash, name.clone());
        name
    }

    /// Adds a shape whose mesh exists only in memory. Returns whether it has an area.
    pub(super) fn add_generated_mesh(
        &mut self,
        mut mesh: MeshData,
        object: &'a PluginInstance,
        target: ShapeTarget<'_>,
        material: String,
        matrix: &DMat4,
    ) -> bool {
        mesh.drop_slivers();
        if mesh.triangles.is_empty() {
            self.notes.note("a mesh without area", "left out", object.span.clone());
            return false;
        }
        let file = self.add_generated_file(&object.plugin, "ply", mesh.encode_ply());
        self.start_shape(object, target, "mesh", material);
        self.document.set("file", file);
        if mesh.normals.is_empty() {
            self.document.set("smooth", false);
        }
        if !mesh.colors.is_empty() {
            self.document.set("vertex_colors", true);
        }
        if *matrix != DMat4::IDENTITY {
            self.document.set("matrix", matrix_value(matrix));
        }
        true
    }
}
