//! Visits the tree nodes intersected by a ray.

use super::{Geometry, Object};
use crate::accel::{RayBoxInterval, VisitedNode};
use crate::geometry::Ray;

impl Geometry {
    /// Visits every node, in any tree, whose box the ray intersects. `visit` receives the ray in the
    /// coordinates of the node's tree, with t unchanged, and returns whether to descend. Depth is counted
    /// across both levels: a mesh's root is one below the leaf that contains the mesh.
    pub fn visit_nodes_hit_by_ray(
        &self,
        ray: &Ray,
        mut visit: impl FnMut(&Ray, &VisitedNode, &RayBoxInterval) -> bool,
    ) {
        let mut below = Vec::new();
        self.traced_tree().visit_nodes_hit_by_ray(
            ray,
            |cell, stretch| visit(ray, cell, stretch),
            |id, depth| below.push((id, depth)),
        );
        for (id, above) in below {
            let (local, tree) = match (
                self.merged_meshes_if_proxy_id(id),
                self.objects().get(id as usize).and_then(Object::mesh),
            ) {
                (Some(merged), _) => (*ray, merged.tree()),
                (None, Some(mesh)) => (mesh.local_ray(ray), mesh.tree.triangle_tree()),
                (None, None) => continue,
            };
            tree.visit_nodes_hit_by_ray(&local, |cell, stretch| {
                visit(&local, &VisitedNode { depth: above + cell.depth, ..*cell }, stretch)
            });
        }
    }

    /// Traversal cost of a ray: the number of intersected boxes, plus the number of shapes in intersected
    /// leaves, plus the number of infinite objects.
    pub fn ray_traversal_cost(&self, ray: &Ray) -> u32 {
        let mut count = self.unbounded().len() as u32;
        self.visit_nodes_hit_by_ray(ray, |_, cell, _| {
            count += 1 + cell.shapes;
            true
        });
        count
    }
}
