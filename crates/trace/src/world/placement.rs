//! Placements of meshes in the scene. Most meshes are not moved, and their surfaces cost less then.

use crate::math::DVec3;
use crate::math::transform::Transform;

/// A map from a mesh's coordinates to the scene's.
pub trait Placement: Copy {
    /// The scene's coordinates of a point.
    fn point(self, local: DVec3) -> DVec3;

    /// Bounds on the components of a direction in the scene, by those in the mesh.
    fn reach(self, local: DVec3) -> DVec3;

    /// A normal in the scene, of any length.
    fn normal(self, local: DVec3) -> DVec3;

    /// The scene's coordinates of the mesh's origin.
    fn shift(self) -> DVec3;
}

impl Placement for &Transform {
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

/// The placement of a mesh whose coordinates are the scene's.
#[derive(Clone, Copy)]
pub struct Unmoved;

impl Placement for Unmoved {
    #[inline(always)]
    fn point(self, local: DVec3) -> DVec3 {
        // As a sum with the scene's origin: −0 becomes 0.
        local + DVec3::ZERO
    }

    #[inline(always)]
    fn reach(self, local: DVec3) -> DVec3 {
        local
    }

    #[inline(always)]
    fn normal(self, local: DVec3) -> DVec3 {
        // Zeros get the sign that a product with a matrix gives them, as tangents depend on it.
        let DVec3 { x, y, z } = local;
        local + (DVec3::new(y, z, x) * 0.0 + DVec3::new(z, x, y) * 0.0)
    }

    #[inline(always)]
    fn shift(self) -> DVec3 {
        DVec3::ZERO
    }
}
