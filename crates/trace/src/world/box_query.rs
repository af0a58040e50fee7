//! Box queries: objects and triangles near a small region.

use super::{Geometry, MeshInstance, Object};
use crate::geometry::Aabb;

impl Geometry {
    /// Calls `visit` for every object that may intersect the box, until it returns false. Returns whether all were visited.
    pub fn visit_box(&self, bounds: &Aabb, mut visit: impl FnMut(u32, &Object) -> bool) -> bool {
        let mut goes_on = self.unbounded().iter().all(|&id| visit(id, &self.objects()[id as usize]));
        self.tree().meeting(bounds, |id| goes_on = goes_on && visit(id, &self.objects()[id as usize]));
        goes_on
    }
}

impl MeshInstance {
    /// Calls `visit` for every triangle that intersects a world-space box, until it returns false. It may also visit nearby
    /// triangles, and some more than once. Returns whether all were visited.
    pub fn visit_box(&self, bounds: &Aabb, visit: impl FnMut(u32) -> bool) -> bool {
        self.tree.triangles().meeting_while(&self.local_box(bounds), visit)
    }
}
