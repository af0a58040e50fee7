//! A mesh file's triangles under their tree, shared by every instance.

use std::sync::{Arc, OnceLock};

use crate::accel::wide_bvh::Quality;
use crate::accel::{Cell, Ends, KdTree, Stretch, WideBvh};
use crate::assets::LoadedMesh;
use crate::assets::mesh::vertex_normals;
use crate::control::{CancelToken, Cancelled};
use crate::geometry::{Aabb, Ray, ShapeHit};
use crate::math::Vec3;
use crate::scene::description::Accel;

/// A tree of either kind; both give the same hits, bit for bit.
#[derive(Debug)]
enum Tree {
    Boxes(WideBvh),
    Planes(KdTree),
}

/// Triangles in the mesh's own coordinates, in the leaves of a tree.
#[derive(Debug)]
pub struct MeshTree {
    loaded: Arc<LoadedMesh>,
    tree: Tree,
    /// Vertex normals, computed at their first use where the file has none.
    computed_normals: OnceLock<Vec<Vec3>>,
}

impl MeshTree {
    /// Build it, a tree of the kind that is asked for.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn build(loaded: Arc<LoadedMesh>, accel: Accel, token: &CancelToken) -> Result<Self, Cancelled> {
        let mesh = &loaded.mesh;
        let (count, corners) = (mesh.triangles.len() as u32, |id| mesh.corners(id));
        let tree = match accel {
            Accel::Bvh => Tree::Boxes(WideBvh::build(count, corners, token)?),
            Accel::BvhHigh => Tree::Boxes(WideBvh::build_with(Quality::High, count, corners, token)?),
            Accel::KdTree => Tree::Planes(KdTree::build(count, corners, token)?),
        };
        Ok(Self { loaded, tree, computed_normals: OnceLock::new() })
    }

    /// The file's content.
    pub fn loaded(&self) -> &LoadedMesh {
        &self.loaded
    }

    /// The box around all triangles.
    pub fn bounds(&self) -> Aabb {
        match &self.tree {
            Tree::Boxes(tree) => tree.bounds(),
            Tree::Planes(tree) => tree.bounds(),
        }
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

    /// Compute the normals where the file has none.
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

    /// Bytes held by the tree with its copy of the triangles.
    pub fn memory_bytes(&self) -> usize {
        match &self.tree {
            Tree::Boxes(tree) => tree.memory_bytes(),
            Tree::Planes(tree) => tree.memory_bytes(),
        }
    }

    /// The nearest hit of a ray in the mesh's coordinates; of hits at one distance the triangle of the lowest number.
    pub fn closest(&self, ray: &Ray) -> Option<ShapeHit> {
        match &self.tree {
            Tree::Boxes(tree) => tree.closest(ray),
            Tree::Planes(tree) => tree.closest(ray),
        }
    }

    /// Whether the ray hits any triangle but `except`.
    pub fn any(&self, ray: &Ray, except: Option<u32>) -> bool {
        match &self.tree {
            Tree::Boxes(tree) => tree.any(ray, except),
            Tree::Planes(tree) => tree.any(ray, except),
        }
    }

    /// Visit the nodes of the tree whose boxes a ray in the mesh's coordinates meets, parents first; `visit` says whether to go on below.
    pub fn along(&self, ray: &Ray, visit: impl FnMut(&Cell, &Stretch) -> bool) {
        match &self.tree {
            Tree::Boxes(tree) => tree.along(ray, visit),
            Tree::Planes(tree) => tree.along(ray, visit),
        }
    }

    /// Visit every triangle that has a point in a box, and maybe others near it; some maybe more than once.
    pub fn meeting(&self, bounds: &Aabb, visit: impl FnMut(u32)) {
        match &self.tree {
            Tree::Boxes(tree) => tree.meeting(bounds, visit),
            Tree::Planes(tree) => tree.meeting(bounds, visit),
        }
    }

    /// The same until `visit` says that it has seen enough; whether it saw all of them.
    pub fn meeting_while(&self, bounds: &Aabb, visit: impl FnMut(u32) -> bool) -> bool {
        match &self.tree {
            Tree::Boxes(tree) => tree.meeting_while(bounds, visit),
            Tree::Planes(tree) => tree.meeting_while(bounds, visit),
        }
    }

    /// The nearest hits of at most [`PACKET`](crate::accel::PACKET) rays up to their ends.
    pub fn closest_packet(&self, rays: &[Ray], ends: &Ends, hits: &mut [Option<ShapeHit>]) {
        match &self.tree {
            Tree::Boxes(tree) => tree.closest_packet(rays, ends, hits),
            Tree::Planes(tree) => {
                hits.fill(None);
                for (lane, hit) in hits.iter_mut().enumerate().filter(|&(lane, _)| ends[lane] >= 0.0) {
                    *hit = tree.closest(&Ray { t_max: ends[lane], ..rays[lane] });
                }
            }
        }
    }

    /// A bit for each of at most [`PACKET`](crate::accel::PACKET) rays that hits any triangle up to its end but its own of `except`,
    /// which may be empty.
    pub fn any_packet(&self, rays: &[Ray], ends: &Ends, except: &[Option<u32>]) -> u32 {
        match &self.tree {
            Tree::Boxes(tree) => tree.any_packet(rays, ends, except),
            Tree::Planes(tree) => {
                let hit = |lane: usize| {
                    let ray = Ray { t_max: ends[lane], ..rays[lane] };
                    u32::from(tree.any(&ray, except.get(lane).copied().flatten())) << lane
                };
                (0..rays.len()).filter(|&lane| ends[lane] >= 0.0).map(hit).sum()
            }
        }
    }
}
