//! Mesh-to-world maps. Most meshes are not transformed, and skipping the matrix makes their surfaces cheaper.

use crate::math::DVec3;
use crate::math::transform::Transform;

/// A map from mesh to world coordinates.
pub trait MeshPlacement: Copy {
    /// Transforms a point to world coordinates.
    fn point(self, local: DVec3) -> DVec3;

    /// Bounds the absolute components of a transformed direction, given bounds on its components in the mesh.
    fn reach(self, local: DVec3) -> DVec3;

    /// Transforms a normal; the result is not normalized.
    fn normal(self, local: DVec3) -> DVec3;

    /// The mesh's origin in world coordinates.
    fn shift(self) -> DVec3;
}

impl MeshPlacement for &Transform {
    #[inline(always)]
    fn point(self, local: DVec3) -> DVec3 {
        Transform::point(self, local)
    }

    #[inline(always)]
    fn reach(self, local: DVec3) -> DVec3 {
        Transform::reach(self, local)
    }

    #[inline(always)]
    fn normal(self, local: DVec3) -> DVec3 {
        Transform::normal(self, local)
    }

    #[inline(always)]
    fn shift(self) -> DVec3 {
        self.translation
    }
}

/// The identity: mesh coordinates are world coordinates.
#[derive(Clone, Copy)]
pub struct IdentityPlacement;

impl MeshPlacement for IdentityPlacement {
    #[inline(always)]
    fn point(self, local: DVec3) -> DVec3 {
        // Match the matrix version, which adds the translation: −0 becomes +0.
        local + DVec3::ZERO
    }

    #[inline(always)]
    fn reach(self, local: DVec3) -> DVec3 {
        local
    }

    #[inline(always)]
    fn normal(self, local: DVec3) -> DVec3 {
        // Match the signs of zeros in the matrix product; tangents depend on them.
        let DVec3 { x, y, z } = local;
        local + (DVec3::new(y, z, x) * 0.0 + DVec3::new(z, x, y) * 0.0)
    }

    #[inline(always)]
    fn shift(self) -> DVec3 {
        DVec3::ZERO
    }
}
