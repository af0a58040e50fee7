//! Mesh-to-world transforms. Most meshes are not transformed, and skipping the matrix makes computing their
//! surfaces cheaper.

use crate::math::DVec3;
use crate::math::transform::Transform;

/// A transform from mesh coordinates to world coordinates.
pub trait MeshPlacement: Copy {
    /// Transforms a point to world coordinates.
    fn mesh_point_to_world(self, local: DVec3) -> DVec3;

    /// Bounds the absolute components of a direction in world coordinates. `local` contains bounds on its
    /// components in mesh coordinates.
    fn vector_abs_bound_to_world(self, local: DVec3) -> DVec3;

    /// Transforms a normal. The result is not normalized.
    fn normal_to_world(self, local: DVec3) -> DVec3;

    /// The mesh's origin in world coordinates.
    fn mesh_origin_in_world(self) -> DVec3;
}

impl MeshPlacement for &Transform {
    #[inline(always)]
    fn mesh_point_to_world(self, local: DVec3) -> DVec3 {
        Transform::point(self, local)
    }

    #[inline(always)]
    fn vector_abs_bound_to_world(self, local: DVec3) -> DVec3 {
        Transform::transform_abs_bound(self, local)
    }

    #[inline(always)]
    fn normal_to_world(self, local: DVec3) -> DVec3 {
        Transform::normal(self, local)
    }

    #[inline(always)]
    fn mesh_origin_in_world(self) -> DVec3 {
        self.translation
    }
}

/// The identity: mesh coordinates are world coordinates.
#[derive(Clone, Copy)]
pub struct IdentityPlacement;

impl MeshPlacement for IdentityPlacement {
    #[inline(always)]
    fn mesh_point_to_world(self, local: DVec3) -> DVec3 {
        // Adding the translation in the matrix version converts −0 to +0. Do the same here.
        local + DVec3::ZERO
    }

    #[inline(always)]
    fn vector_abs_bound_to_world(self, local: DVec3) -> DVec3 {
        local
    }

    #[inline(always)]
    fn normal_to_world(self, local: DVec3) -> DVec3 {
        // Match the signs of zeros in the matrix product because tangents depend on them.
        let DVec3 { x, y, z } = local;
        local + (DVec3::new(y, z, x) * 0.0 + DVec3::new(z, x, y) * 0.0)
    }

    #[inline(always)]
    fn mesh_origin_in_world(self) -> DVec3 {
        DVec3::ZERO
    }
}
