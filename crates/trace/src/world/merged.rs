//! Small meshes merged into one tree, so that a ray that crosses many of them traverses only one tree. If
//! there are few triangles in total, packets test them using a [`BruteForceTriangles`] without a tree.
//!
//! Triangles are transformed to world coordinates and rounded. [`contact`](super::contact) and
//! [`Geometry::visit_nodes_hit_by_ray`](super::Geometry::visit_nodes_hit_by_ray) use the per-mesh trees. Hits
//! on untransformed instances are bit-identical to hits on unmerged meshes.

mod packets;

use super::triangle_tree::TriangleTree;
use super::{MeshInstance, Object};
use crate::control::{CancelToken, Canceled};
use crate::geometry::triangle_list::{self, BruteForceTriangles};
use crate::geometry::{Aabb, Ray, ShapeHit};
use crate::math::Vec3;

/// Maximum triangle count of a merged mesh. For a larger mesh, a separate tree is worthwhile because it does
/// not need to be rebuilt when the mesh moves.
const MAX_PER_MESH: usize = 1 << 14;

/// Maximum total triangle count of merged meshes. Building a tree of this size takes about 10 ms.
const MAX_TOTAL: usize = 1 << 17;

/// Maximum triangle count at which packets test all triangles without a tree.
const MAX_FACETS: usize = triangle_list::MAX_TRIANGLES;

/// Maximum coordinate of a merged mesh, relative to its size. Beyond this, rounding would distort the mesh.
const MAX_RELATIVE_COORDINATE: f32 = 1024.0;

/// Maximum size of a transformed mesh, relative to the scene's smallest object. Rounding would move the
/// corners of a larger mesh by more than 1/256 of the smallest object's size.
const MAX_RELATIVE_SIZE: f32 = (1 << 17) as f32;

/// Identifies the object and primitive of a triangle in the merged tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MergedTriangle {
    /// Object id.
    pub object: u32,
    /// Index of the triangle in the object's mesh.
    pub primitive: u32,
}

/// Instances of small meshes in one tree.
#[derive(Debug)]
pub struct MergedMeshes {
    tree: TriangleTree,
    /// The triangles that packets test without the tree, or `None` if there are too many.
    facets: Option<BruteForceTriangles>,
    /// Triangles sorted by object, so that at equal distances the lowest object id wins.
    triangles: Vec<MergedTriangle>,
    /// Index of each object's first triangle, or [`MergedMeshes::NOT_HERE`] if the object is not merged.
    first: Vec<u32>,
}

impl MergedMeshes {
    /// Entry of `first` for an object that is not merged.
    const NOT_HERE: u32 = u32::MAX;

    /// Merges the small meshes among `objects`. Returns `None` if merging is not worthwhile.
    ///
    /// # Errors
    /// [`Canceled`] if the token is canceled.
    pub fn merge_small_meshes(objects: &mut [Object], token: &CancelToken) -> Result<Option<Self>, Canceled> {
        // Choose the smallest meshes first, up to the maximum number of triangles to rebuild after each edit.
        let count = |object: &Object| object.mesh().map_or(0, MeshInstance::triangle_count);
        let smallest = smallest_object_size(objects);
        let mut chosen: Vec<usize> =
            (0..objects.len()).filter(|&id| may_be_merged(&objects[id], smallest)).collect();
        chosen.sort_by_key(|&id| (count(&objects[id]), id));
        let mut total = 0;
        chosen.retain(|&id| {
            let with_it = total + count(&objects[id]);
            let has_room = with_it <= MAX_TOTAL;
            total = if has_room { with_it } else { total };
            has_room
        });
        let Some(accel) = chosen.first().and_then(|&id| Some(objects[id].mesh()?.tree.accel_kind())) else {
            return Ok(None);
        };
        if chosen.len() < 2 && total > MAX_FACETS {
            return Ok(None);
        }
        // A small number of triangles is worth merging only if packets can test them without a tree.
        let rounded = |&id: &usize| {
            let mesh = objects[id].mesh();
            mesh.into_iter().flat_map(|mesh| {
                (0..mesh.triangle_count() as u32).map(|own| mesh.world_corners_rounded_to_f32(own))
            })
        };
        chosen.sort_unstable();
        let facets = if total > MAX_FACETS {
            None
        } else {
            BruteForceTriangles::new(chosen.iter().flat_map(rounded).collect())
        };
        if total <= MAX_FACETS && facets.is_none() {
            return Ok(None);
        }
        // Number the triangles by object.
        let mut triangles = Vec::with_capacity(total);
        let mut first = vec![Self::NOT_HERE; objects.len()];
        for &id in &chosen {
            first[id] = triangles.len() as u32;
            let object = id as u32;
            triangles.extend(
                (0..count(&objects[id]) as u32).map(|primitive| MergedTriangle { object, primitive }),
            );
            if let Object::Mesh(mesh) = &mut objects[id] {
                mesh.is_merged = true;
            }
        }
        // Build the tree.
        let corners = |number: u32| {
            let MergedTriangle { object, primitive } = triangles[number as usize];
            objects[object as usize]
                .mesh()
                .map_or([Vec3::NAN; 3], |mesh| mesh.world_corners_rounded_to_f32(primitive))
        };
        let number = triangles.len() as u32;
        let tree = TriangleTree::build(accel, number, corners, token)?;
        Ok(Some(Self { tree, facets, triangles, first }))
    }

    /// Bounding box of all triangles.
    pub fn bounds(&self) -> Aabb {
        self.tree.bounds()
    }

    /// The tree over all triangles.
    pub fn tree(&self) -> &TriangleTree {
        &self.tree
    }

    /// Whether an object is merged.
    pub fn contains_object(&self, object: u32) -> bool {
        self.first.get(object as usize).is_some_and(|&first| first != Self::NOT_HERE)
    }

    /// Triangle with this index in the tree.
    #[inline(always)]
    pub fn triangle(&self, number: u32) -> MergedTriangle {
        self.triangles[number as usize]
    }

    /// Tree index of an object's triangle, or `None` if the object is not merged.
    #[inline(always)]
    pub fn merged_triangle_index(&self, object: u32, primitive: u32) -> Option<u32> {
        let first = self.first.get(object as usize).copied().filter(|&first| first != Self::NOT_HERE)?;
        Some(first + primitive)
    }

    /// Returns the nearest hit. The hit's primitive is a triangle index into the tree.
    pub fn closest_hit_with_merged_index(&self, ray: &Ray) -> Option<ShapeHit> {
        self.tree.closest_hit(ray)
    }

    /// Whether the ray hits any triangle except `except`.
    pub fn any_hit(&self, ray: &Ray, except: Option<u32>) -> bool {
        self.tree.any_hit(ray, except)
    }

    /// Invalid triangle number.
    pub const NO_TRIANGLE: u32 = u32::MAX;

    /// Memory used by the tree and its tables, in bytes.
    pub fn memory_bytes(&self) -> usize {
        let facets = self.facets.as_ref().map_or(0, BruteForceTriangles::memory_bytes);
        self.tree.memory_bytes() + facets + size_of_val(&*self.triangles) + size_of_val(&*self.first)
    }
}

/// Size of the smallest finite object, or infinity if there is none.
fn smallest_object_size(objects: &[Object]) -> f32 {
    let bounds = objects.iter().filter_map(Object::bounds).filter(|bounds| !bounds.is_empty());
    let sizes = bounds.map(|bounds| bounds.extent().max_element());
    sizes.filter(|size| *size > 0.0).fold(f32::INFINITY, f32::min)
}

/// Whether an object is a mesh that is small enough to merge and whose world coordinates are accurate enough
/// in `f32`. `smallest` is the size of the scene's smallest object.
fn may_be_merged(object: &Object, smallest: f32) -> bool {
    let Some(mesh) = object.mesh() else { return false };
    let Some(bounds) = object.bounds().filter(|bounds| !bounds.is_empty()) else { return false };
    let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
    let size = bounds.extent().max_element();
    if mesh.is_transformed() && size > MAX_RELATIVE_SIZE * smallest {
        return false;
    }
    let count = mesh.triangle_count();
    (1..=MAX_PER_MESH).contains(&count) && largest.is_finite() && largest <= MAX_RELATIVE_COORDINATE * size
}

#[cfg(test)]
pub(super) mod tests;
