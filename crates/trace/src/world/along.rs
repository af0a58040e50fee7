//! The trees of a scene along a ray.

use super::{Geometry, Object};
use crate::accel::{RayInterval, TreeNode};
use crate::geometry::Ray;

impl Geometry {
    /// Visits the nodes of all trees whose boxes a ray meets. `visit` gets the ray in the coordinates of the node's tree, in which
    /// the direction of a unit ray is as long as the scene's unit, and says whether to descend. Depths are counted through both
    /// trees: a mesh's root is a step below the leaf that holds the mesh.
    pub fn along(&self, ray: &Ray, mut visit: impl FnMut(&Ray, &TreeNode, &RayInterval) -> bool) {
        let mut below = Vec::new();
        self.visited().along(
            ray,
            |cell, stretch| visit(ray, cell, stretch),
            |id, depth| below.push((id, depth)),
        );
        for (id, above) in below {
            let (local, tree) =
                match (self.merged(id), self.objects().get(id as usize).and_then(Object::mesh)) {
                    (Some(merged), _) => (*ray, merged.tree()),
                    (None, Some(mesh)) => (mesh.local_ray(ray), mesh.tree.triangles()),
                    (None, None) => continue,
                };
            tree.along(&local, |cell, stretch| {
                visit(&local, &TreeNode { depth: above + cell.depth, ..*cell }, stretch)
            });
        }
    }

    /// Number of boxes that a ray meets up to its end, and of shapes that are tested on the way: those of leaves, and infinite
    /// ones.
    pub fn work(&self, ray: &Ray) -> u32 {
        let mut count = self.unbounded().len() as u32;
        self.along(ray, |_, cell, _| {
            count += 1 + cell.shapes;
            true
        });
        count
    }
}
