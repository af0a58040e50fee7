//! Objects and triangles around a small part of a surface.

use super::{Geometry, MeshInstance, Object};
use crate::geometry::Aabb;

impl Geometry {
    /// Visits the objects that may have a point in a box, until `visit` returns false; returns whether it visited all.
    pub fn around(&self, bounds: &Aabb, mut visit: impl FnMut(u32, &Object) -> bool) -> bool {
        let mut goes_on = self.unbounded().iter().all(|&id| visit(id, &self.objects()[id as usize]));
        self.tree().meeting(bounds, |id| goes_on = goes_on && visit(id, &self.objects()[id as usize]));
        goes_on
    }
}

impl MeshInstance {
    /// Visits every triangle that has a point in a box of the world, and maybe others near it, some maybe more than once, until
    /// `visit` returns false; returns whether it visited all.
    pub fn around(&self, bounds: &Aabb, visit: impl FnMut(u32) -> bool) -> bool {
        self.tree.triangles().meeting_while(&self.local_box(bounds), visit)
    }
}
