//! A mesh file's triangles under their tree, shared by every instance.

use std::sync::{Arc, OnceLock};

use super::triangle_tree::TriangleTree;
use crate::assets::LoadedMesh;
use crate::assets::mesh::vertex_normals;
use crate::control::{CancelToken, Cancelled};
use crate::geometry::Aabb;
use crate::math::Vec3;
use crate::scene::description::Accel;

/// Triangles in the mesh's own coordinates, in the leaves of a tree.
#[derive(Debug)]
pub struct MeshTree {
    loaded: Arc<LoadedMesh>,
    tree: TriangleTree,
    accel: Accel,
    /// Vertex normals, computed at their first use if the file has none.
    computed_normals: OnceLock<Vec<Vec3>>,
}

impl MeshTree {
    /// Builds a tree of the requested kind.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn build(loaded: Arc<LoadedMesh>, accel: Accel, token: &CancelToken) -> Result<Self, Cancelled> {
        let mesh = &loaded.mesh;
        let (count, corners) = (mesh.triangles.len() as u32, |id| mesh.corners(id));
        let tree = TriangleTree::build(accel, count, corners, token)?;
        Ok(Self { loaded, tree, accel, computed_normals: OnceLock::new() })
    }

    /// The file's content.
    pub fn loaded(&self) -> &LoadedMesh {
        &self.loaded
    }

    /// The tree over the triangles, in the mesh's coordinates.
    pub fn triangles(&self) -> &TriangleTree {
        &self.tree
    }

    /// The kind of its tree.
    pub fn accel(&self) -> Accel {
        self.accel
    }

    /// The box around all triangles.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// Vertex normals: the file's, or computed ones, at once if [`MeshTree::prepare_normals`] was called.
    pub fn normals(&self) -> &[Vec3] {
        if !self.loaded.mesh.normals.is_empty() {
            return &self.loaded.mesh.normals;
        }
        // A token that nobody cancels.
        let compute = || vertex_normals(&self.loaded.mesh, &CancelToken::new()).unwrap_or_default();
        self.computed_normals.get_or_init(compute)
    }

    /// Computes the normals if the file has none.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn prepare_normals(&self, token: &CancelToken) -> Result<(), Cancelled> {
        if self.loaded.mesh.normals.is_empty() && self.computed_normals.get().is_none() {
            // Another thread may have been faster: then both have the same.
            let _ = self.computed_normals.set(vertex_normals(&self.loaded.mesh, token)?);
        }
        Ok(())
    }

    /// Bytes of the tree with its copy of the triangles.
    pub fn memory_bytes(&self) -> usize {
        self.tree.memory_bytes()
    }
}
