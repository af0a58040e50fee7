//! A mesh file's triangles under their tree, shared by every instance.

use std::sync::{Arc, OnceLock};

use crate::accel::Bvh;
use crate::assets::LoadedMesh;
use crate::control::{CancelToken, Cancelled};
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Aabb, Ray, ShapeHit};
use crate::math::Vec3;

/// Triangles in the order of the tree's leaves, in the mesh's own coordinates.
#[derive(Debug)]
pub struct MeshTree {
    loaded: Arc<LoadedMesh>,
    corners: Vec<[Vec3; 3]>,
    tree: Bvh,
    /// Vertex normals, computed at their first use where the file has none.
    computed_normals: OnceLock<Vec<Vec3>>,
}

impl MeshTree {
    /// Build it.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn build(loaded: Arc<LoadedMesh>, token: &CancelToken) -> Result<Self, Cancelled> {
        let mesh = &loaded.mesh;
        let boxes: Vec<Aabb> =
            (0..mesh.triangles.len() as u32).map(|id| Aabb::around(mesh.corners(id))).collect();
        token.check()?;
        let tree = Bvh::build(&boxes, token)?;
        let corners = tree.order().iter().map(|&id| mesh.corners(id)).collect();
        Ok(Self { loaded, corners, tree, computed_normals: OnceLock::new() })
    }

    /// The file's content.
    pub fn loaded(&self) -> &LoadedMesh {
        &self.loaded
    }

    /// The box around all triangles.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// Vertex normals: the file's, or computed ones.
    pub fn normals(&self) -> &[Vec3] {
        if self.loaded.mesh.normals.is_empty() {
            self.computed_normals.get_or_init(|| crate::assets::mesh::vertex_normals(&self.loaded.mesh))
        } else {
            &self.loaded.mesh.normals
        }
    }

    /// Bytes held by the tree and its copy of the triangles.
    pub fn memory_bytes(&self) -> usize {
        self.tree.memory_bytes() + size_of_val(self.corners.as_slice())
    }

    /// The nearest hit of a ray in the mesh's coordinates; of hits at one distance the triangle of the lowest number.
    pub fn closest(&self, ray: &Ray) -> Option<ShapeHit> {
        let sheared = ShearedRay::new(ray.origin, ray.direction);
        let mut best: Option<ShapeHit> = None;
        self.tree.closest(ray, |place, id, t_max| {
            let hit = sheared.intersect(&self.corners[place as usize], t_max)?;
            let nearer = best.is_none_or(|best| (hit.t, id) < (best.t, best.primitive));
            nearer.then(|| {
                best = Some(ShapeHit { primitive: id, ..hit });
                hit.t
            })
        });
        best
    }

    /// Whether the ray hits any triangle but `except`.
    pub fn any(&self, ray: &Ray, except: Option<u32>) -> bool {
        let sheared = ShearedRay::new(ray.origin, ray.direction);
        self.tree.any(ray, |place, id| {
            sheared.intersect(&self.corners[place as usize], ray.t_max).is_some() && Some(id) != except
        })
    }
}
