//! The acceleration structure of a mesh file, shared by all its instances.

use std::sync::{Arc, OnceLock};

use super::triangle_tree::TriangleTree;
use crate::assets::LoadedMesh;
use crate::assets::mesh::vertex_normals;
use crate::control::{CancelToken, Canceled};
use crate::geometry::Aabb;
use crate::math::Vec3;
use crate::scene::description::Accel;

/// A mesh and its tree, in mesh coordinates.
#[derive(Debug)]
pub struct MeshTree {
    loaded: Arc<LoadedMesh>,
    tree: TriangleTree,
    accel: Accel,
    /// Vertex normals, computed on first use if the file has none.
    computed_normals: OnceLock<Vec<Vec3>>,
}

impl MeshTree {
    /// Builds a tree of this type over the mesh.
    pub fn build(loaded: Arc<LoadedMesh>, accel: Accel, token: &CancelToken) -> Result<Self, Canceled> {
        let mesh = &loaded.mesh;
        let (count, corners) = (mesh.triangles.len() as u32, |id| mesh.corners(id));
        let tree = TriangleTree::build(accel, count, corners, token)?;
        Ok(Self { loaded, tree, accel, computed_normals: OnceLock::new() })
    }

    /// The mesh file's contents.
    pub fn loaded_mesh(&self) -> &LoadedMesh {
        &self.loaded
    }

    /// The tree over the triangles, in mesh coordinates.
    pub fn triangle_tree(&self) -> &TriangleTree {
        &self.tree
    }

    /// Tree type.
    pub fn accel_kind(&self) -> Accel {
        self.accel
    }

    /// Bounding box of all triangles.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// Vertex normals from the file, or computed normals. Returns immediately if
    /// [`MeshTree::prepare_normals`] has already been called.
    pub fn file_or_computed_normals(&self) -> &[Vec3] {
        if !self.loaded.mesh.normals.is_empty() {
            return &self.loaded.mesh.normals;
        }
        // This token is never canceled.
        let compute = || vertex_normals(&self.loaded.mesh, &CancelToken::new()).unwrap_or_default();
        self.computed_normals.get_or_init(compute)
    }

    /// Computes vertex normals if the file has none.
    pub fn prepare_normals(&self, token: &CancelToken) -> Result<(), Canceled> {
        if self.loaded.mesh.normals.is_empty() && self.computed_normals.get().is_none() {
            // If another thread finishes first, its result is identical.
            let _ = self.computed_normals.set(vertex_normals(&self.loaded.mesh, token)?);
        }
        Ok(())
    }

    /// Memory used by the tree, in bytes, including its copy of the triangles.
    pub fn memory_bytes(&self) -> usize {
        self.tree.memory_bytes()
    }
}
