//! Axis-aligned bounding boxes.

use crate::math::float::gamma;
use crate::math::{DVec3, Vec3};

/// An axis-aligned box, including its faces. Empty if `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Aabb {
    /// Minimum corner.
    pub min: Vec3,
    /// Maximum corner.
    pub max: Vec3,
}

impl Aabb {
    /// The empty box, the identity element of [`Aabb::union`].
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Smallest box that contains the given points.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Self {
        points
            .into_iter()
            .fold(Self::EMPTY, |bounds, p| Self { min: bounds.min.min(p), max: bounds.max.max(p) })
    }

    /// Smallest `f32` box around double-precision points, rounded outward.
    pub fn from_points_f64(points: impl IntoIterator<Item = DVec3>) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in points {
            (min, max) = (min.min(p), max.max(p));
        }
        Self { min: min.as_vec3().map(f32::next_down), max: max.as_vec3().map(f32::next_up) }
    }

    /// Smallest box that contains both boxes.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether the box is empty.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// Whether the two boxes overlap or touch.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Expands the box by `margin` on every side.
    pub fn expanded(self, margin: Vec3) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Edge lengths; negative or NaN if empty.
    pub fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// Center of the box.
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Half the surface area; 0 if empty.
    pub fn half_area(&self) -> f32 {
        let e = self.extent().max(Vec3::ZERO);
        e.x * e.y + e.y * e.z + e.z * e.x
    }
}

/// Factor applied to distances to compensate for rounding in [`SlabRay::entry_distance`].
pub const SLAB_PAD: f32 = 1.0 + 2.0 * gamma(3);

/// [`SLAB_PAD`] for slab tests that premultiply the inverse direction by it, which adds a rounding error.
pub const FAR_PAD: f32 = 1.0 + 2.0 * gamma(4);

/// Bound on the watertight triangle test's error perpendicular to a ray, relative to the distance. The error
/// of the projected coordinates is below 13 unit roundoffs.
pub const TRIANGLE_ERROR: f32 = 16.0 * f32::EPSILON;

/// A ray preprocessed for the slab test.
#[derive(Clone, Copy, Debug)]
pub struct SlabRay {
    origin: Vec3,
    /// Margin by which boxes are expanded on every side.
    margin: f32,
    inverse: Vec3,
}

impl SlabRay {
    /// Preprocesses a ray.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, margin: 0.0, inverse: direction.recip() }
    }

    /// Preprocesses a ray for testing the bounding boxes of triangles inside the box `whole`. The slab test
    /// then never misses a box with a triangle that the watertight test may hit.
    pub fn for_triangles(origin: Vec3, direction: Vec3, whole: &Aabb) -> Self {
        Self { margin: triangle_margin(origin, whole), ..Self::new(origin, direction) }
    }

    /// Distance at which the ray enters the box, or `None` if it is outside the box for all t in [0,
    /// `t_max`]. Never misses a box that the exact ray hits: the far distance is padded to account for
    /// rounding in the slab test (Ize, *Robust BVH Ray Traversal*, JCGT 2013). If the ray is in the plane of
    /// a face, 0·∞ = NaN. Comparisons with NaN keep the current interval, so positive and negative zeros in a
    /// direction behave the same. The ray's end is also padded to avoid missing a box with a hit exactly at
    /// the end.
    #[inline(always)]
    pub fn entry_distance(&self, min: Vec3, max: Vec3, t_max: f32) -> Option<f32> {
        let a = (min - (self.origin + self.margin)) * self.inverse;
        let b = (max - (self.origin - self.margin)) * self.inverse;
        let mut near = 0.0_f32;
        let mut far = t_max * SLAB_PAD;
        for axis in 0..3 {
            let (lo, hi) = if self.inverse[axis] < 0.0 { (b[axis], a[axis]) } else { (a[axis], b[axis]) };
            near = if lo > near { lo } else { near };
            let hi = hi * SLAB_PAD;
            far = if hi < far { hi } else { far };
        }
        (near <= far).then_some(near)
    }
}

/// Margin by which the boxes of triangles inside the box `whole` must be expanded for a ray from `origin`.
pub fn triangle_margin(origin: Vec3, whole: &Aabb) -> f32 {
    (whole.min - origin).abs().max((whole.max - origin).abs()).max_element() * TRIANGLE_ERROR
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::signed_number_generator;

    fn enters(origin: Vec3, direction: Vec3, min: Vec3, max: Vec3) -> Option<f32> {
        SlabRay::new(origin, direction).entry_distance(min, max, f32::INFINITY)
    }

    #[test]
    fn signed_zeros_are_equivalent() {
        let (min, max) = (Vec3::ZERO, Vec3::ONE);
        for x in [0.0, 1.0] {
            for zero in [0.0, -0.0] {
                let hit = enters(Vec3::new(x, 0.5, -1.0), Vec3::new(zero, 0.0, 1.0), min, max);
                assert_eq!(hit, Some(1.0), "x = {x}, direction {zero:?}");
            }
        }
        assert_eq!(enters(Vec3::new(1.5, 0.5, -1.0), Vec3::Z, min, max), None);
    }

    #[test]
    fn corners_of_flat_boxes_are_never_missed() {
        let mut next = signed_number_generator(7);
        let mut misses = 0;
        for _ in 0..400_000 {
            let origin = Vec3::new(next(), next(), next()) * 10.0;
            let min = Vec3::new(next(), next(), next());
            let mut max = min + Vec3::new(next().abs(), next().abs(), next().abs());
            max.y = min.y;
            let corner = Vec3::new(min.x, min.y, max.z);
            misses += u32::from(enters(origin, corner - origin, min, max).is_none());
        }
        assert_eq!(misses, 0);
    }

    #[test]
    fn nan_and_infinite_rays_do_not_panic() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let _ = enters(Vec3::splat(bad), Vec3::ONE, Vec3::ZERO, Vec3::ONE);
            let _ = enters(Vec3::ZERO, Vec3::splat(bad), Vec3::ZERO, Vec3::ONE);
        }
    }
}
