//! Objects and triangles around a small part of a surface.

use super::{Geometry, Hit, MeshInstance, Object};
use crate::geometry::{Aabb, Ray};

impl Geometry {
    /// Visits the objects that may have a point in a box, until `visit` returns false; returns whether it visited all.
    pub fn around(&self, bounds: &Aabb, mut visit: impl FnMut(u32, &Object) -> bool) -> bool {
        let mut goes_on = self.unbounded().iter().all(|&id| visit(id, &self.objects()[id as usize]));
        self.tree().meeting(bounds, |id| goes_on = goes_on && visit(id, &self.objects()[id as usize]));
        goes_on
    }

    /// The nearest hit of the objects for which `counts` is true; of hits at one distance, the object of the lowest
    /// number.
    pub fn closest_of(&self, ray: &Ray, counts: impl Fn(u32) -> bool) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut segment = *ray;
        let mut test = |id: u32, t_max: f32| {
            if !counts(id) {
                return None;
            }
            segment.t_max = t_max;
            let shape = self.objects()[id as usize].closest(&segment, &segment.to_f64())?;
            let nearer = best.is_none_or(|best| (shape.t, id) < (best.shape.t, best.object));
            nearer.then(|| {
                best = Some(Hit { shape, object: id });
                shape.t
            })
        };
        let mut end = ray.t_max;
        for &id in self.unbounded() {
            end = test(id, end).unwrap_or(end);
        }
        self.tree().closest(&Ray { t_max: end, ..*ray }, test);
        best
    }
}

impl MeshInstance {
    /// Visits every triangle that has a point in a box of the world, and maybe others near it, some maybe more than once, until
    /// `visit` returns false; returns whether it visited all.
    pub fn around(&self, bounds: &Aabb, visit: impl FnMut(u32) -> bool) -> bool {
        self.tree.triangles().meeting_while(&self.local_box(bounds), visit)
    }
}
