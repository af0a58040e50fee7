//! Box queries: objects and triangles near a small region.

use super::{Geometry, MeshInstance, Object};
use crate::geometry::Aabb;

impl Geometry {
    /// Calls `visit` for every object that may intersect the box until `visit` returns false. Returns whether
    /// all objects were visited.
    pub fn visit_objects_in_box(&self, bounds: &Aabb, mut visit: impl FnMut(u32, &Object) -> bool) -> bool {
        let mut continues = self.unbounded().iter().all(|&id| visit(id, &self.objects()[id as usize]));
        self.finite_object_tree()
            .visit_overlapping(bounds, |id| continues = continues && visit(id, &self.objects()[id as usize]));
        continues
    }
}

impl MeshInstance {
    /// Calls `visit` for every triangle that intersects a world-space box until `visit` returns false. Nearby
    /// triangles may also be visited, and triangles may be visited more than once. Returns whether all
    /// triangles were visited.
    pub fn visit_triangles_in_box(&self, bounds: &Aabb, visit: impl FnMut(u32) -> bool) -> bool {
        self.tree.triangle_tree().all_triangles_in_box_satisfy(&self.box_to_local(bounds), visit)
    }
}
