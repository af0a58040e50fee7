//! Vertex normals for meshes that have none.

use crate::geometry::mesh::TriangleMesh;
use crate::math::Vec3;

/// Placeholder.
pub fn vertex_normals(mesh: &TriangleMesh) -> Vec<Vec3> {
    vec![Vec3::ZERO; mesh.positions.len()]
}
