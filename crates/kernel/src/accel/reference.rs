//! SIMD bounding boxes, and triangle references clipped to a cell.

use rayon::prelude::*;

use crate::control::{CancelToken, Canceled};
use crate::geometry::Aabb;
use crate::geometry::mesh::TriangleMesh;
use crate::math::{DVec3, Vec3, Vec4};

/// An axis-aligned box in SIMD vectors. The last lane of each corner is not part of the box. The maximum
/// corner is stored negated, so growing a box needs only minima.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct SimdBounds {
    pub min: Vec4,
    pub minus_max: Vec4,
}

impl SimdBounds {
    pub const EMPTY: Self = Self { min: Vec4::INFINITY, minus_max: Vec4::INFINITY };

    /// Creates a box from its corners.
    #[inline(always)]
    pub fn new(min: Vec4, max: Vec4) -> Self {
        Self { min, minus_max: -max }
    }

    /// Bounding box of a slice of references.
    #[inline]
    pub fn around_references(references: &[TriangleReference]) -> Self {
        references.iter().fold(Self::EMPTY, |mut all, reference| {
            all.grow(&reference.bounds);
            all
        })
    }

    /// Maximum corner.
    #[inline(always)]
    pub fn max_corner(&self) -> Vec4 {
        -self.minus_max
    }

    /// Edge lengths.
    #[inline(always)]
    pub fn extent(&self) -> Vec4 {
        self.max_corner() - self.min
    }

    #[inline(always)]
    pub fn grow(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.minus_max = self.minus_max.min(other.minus_max);
    }

    /// Half the surface area.
    #[inline(always)]
    pub fn half_area(&self) -> f32 {
        let e = self.extent();
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    #[inline]
    pub fn aabb(&self) -> Aabb {
        Aabb { min: self.min.truncate(), max: self.max_corner().truncate() }
    }

    /// Parts of the box below and above a plane.
    #[inline]
    pub fn split_at_plane(&self, axis: usize, at: f32) -> [Self; 2] {
        let (mut left, mut right) = (*self, *self);
        left.minus_max[axis] = -at;
        right.min[axis] = at;
        [left, right]
    }
}

/// A bit that is set in every id stored as float bits. Without it, the floats would be denormals, which are
/// slow on some processors.
const NORMAL: u32 = 1 << 29;

const _: () = assert!(TriangleMesh::MAX_TRIANGLES < 1 << 29);

/// A triangle id and the bounding box of the triangle clipped to a cell.
#[derive(Clone, Copy, Debug)]
pub struct TriangleReference {
    /// Bounds. The last lane of `min` contains the bits of the id.
    pub bounds: SimdBounds,
}

impl TriangleReference {
    /// Creates references to all triangles in order, skipping triangles that cannot be hit or have non-finite
    /// boxes.
    ///
    /// # Errors
    /// [`Canceled`] if the build was canceled.
    pub fn collect_finite(
        count: u32,
        corners: &(impl Fn(u32) -> [Vec3; 3] + Sync),
        token: &CancelToken,
    ) -> Result<Vec<Self>, Canceled> {
        let mut references: Vec<Self> =
            (0..count).into_par_iter().map(|id| Self::new(id, corners(id))).collect();
        token.check_pause_and_cancel()?;
        if !references.par_iter().all(Self::has_finite_extent) {
            references.retain(Self::has_finite_extent);
        }
        Ok(references)
    }

    /// Reference to a whole triangle.
    #[inline]
    pub fn new(id: u32, corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners.map(|corner| corner.extend(0.0));
        // `min` and `max` ignore NaN, so restore NaN coordinates.
        let poison = (a + b + c).truncate().to_array().map(|sum| if sum.is_nan() { f32::NAN } else { 0.0 });
        let mut min = a.min(b).min(c) + Vec3::from(poison).extend(0.0);
        min.w = f32::from_bits(id | NORMAL);
        Self { bounds: SimdBounds::new(min, a.max(b).max(c)) }
    }

    #[inline(always)]
    pub fn centroid(&self) -> Vec4 {
        self.bounds.min * 0.5 - self.bounds.minus_max * 0.5
    }

    pub fn id(&self) -> u32 {
        self.bounds.min.w.to_bits() & !NORMAL
    }

    /// Whether the triangle can be hit and its box is finite.
    fn has_finite_extent(&self) -> bool {
        self.bounds.extent().truncate().is_finite()
    }

    /// Splits the reference at a plane through its box. Each new box bounds the part of the triangle on its
    /// side, rounded outward and clipped to the old box. If this part is empty due to rounding, the new box
    /// is the entire half of the old box.
    #[inline]
    pub fn split(&self, axis: usize, at: f32, corners: [Vec3; 3]) -> [Self; 2] {
        let mut parts = [SimdBounds::EMPTY; 2];
        let mut before = corners[2];
        for corner in corners {
            let (from, to) = (before.to_array()[axis], corner.to_array()[axis]);
            if (from < at && at < to) || (to < at && at < from) {
                let (start, way) = (before.as_dvec3(), corner.as_dvec3() - before.as_dvec3());
                let part = (f64::from(at) - f64::from(from)) / (f64::from(to) - f64::from(from));
                let crossing = outward_rounded_bounds_of_point(start + way * part);
                parts[0].grow(&crossing);
                parts[1].grow(&crossing);
            }
            let own = SimdBounds::new(corner.extend(0.0), corner.extend(0.0));
            if to <= at {
                parts[0].grow(&own);
            }
            if to >= at {
                parts[1].grow(&own);
            }
            before = corner;
        }
        let [left, right] = self.bounds.split_at_plane(axis, at);
        [self.with_intersection_or_half(left, &parts[0]), self.with_intersection_or_half(right, &parts[1])]
    }

    /// Replaces the reference's box with the intersection of `half` and `part`, or with `half` if the two do
    /// not overlap.
    #[inline(always)]
    fn with_intersection_or_half(&self, half: SimdBounds, part: &SimdBounds) -> Self {
        let mut both =
            SimdBounds { min: half.min.max(part.min), minus_max: half.minus_max.max(part.minus_max) };
        both = if both.extent().truncate().cmpge(Vec3::ZERO).all() { both } else { half };
        both.min.w = self.bounds.min.w;
        Self { bounds: both }
    }
}

/// `f32` box around a double-precision point, rounded outward.
#[inline(always)]
fn outward_rounded_bounds_of_point(exact: DVec3) -> SimdBounds {
    let near = exact.as_vec3();
    let off = exact - near.as_dvec3();
    let [mut min, mut max] = [near; 2];
    for axis in 0..3 {
        if off[axis] < 0.0 {
            min[axis] = near[axis].next_down();
        } else if off[axis] > 0.0 {
            max[axis] = near[axis].next_up();
        }
    }
    SimdBounds::new(min.extend(0.0), max.extend(0.0))
}

/// A triangle clipped by up to six planes in double precision (Sutherland, Hodgman, *Reentrant Polygon
/// Clipping*, 1974).
#[derive(Clone, Copy)]
pub struct ClippedPolygon {
    points: [DVec3; 9],
    count: usize,
}

impl ClippedPolygon {
    const NOTHING: Self = Self { points: [DVec3::ZERO; 9], count: 0 };

    /// Clips a triangle to a box, keeping the parts in the box's faces.
    pub fn clip_triangle_to_box(corners: [Vec3; 3], bounds: &Aabb) -> Self {
        let (least, greatest) =
            (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
        let (mut whole, mut other) = (Self::NOTHING, Self::NOTHING);
        let (mut from, mut to) = (&mut whole, &mut other);
        for corner in corners {
            from.push(corner.as_dvec3());
        }
        for axis in 0..3 {
            if least[axis] < bounds.min[axis] {
                from.clip_by_plane(axis, f64::from(bounds.min[axis]), 1.0, to);
                std::mem::swap(&mut from, &mut to);
            }
            if greatest[axis] > bounds.max[axis] {
                from.clip_by_plane(axis, f64::from(bounds.max[axis]), -1.0, to);
                std::mem::swap(&mut from, &mut to);
            }
        }
        *from
    }

    /// Keeps the part above the plane, or below it if `side` is −1.
    fn clip_by_plane(&self, axis: usize, at: f64, side: f64, kept: &mut Self) {
        kept.count = 0;
        let Some(mut before) = self.points().last().copied() else { return };
        let mut before_height = (before[axis] - at) * side;
        for &point in self.points() {
            let height = (point[axis] - at) * side;
            if (height > 0.0 && before_height < 0.0) || (height < 0.0 && before_height > 0.0) {
                let mut crossing = before + (point - before) * (before_height / (before_height - height));
                crossing[axis] = at;
                kept.push(crossing);
            }
            if height >= 0.0 {
                kept.push(point);
            }
            (before, before_height) = (point, height);
        }
    }

    /// Adds a vertex. Clipping a triangle by six planes produces at most nine vertices. Additional vertices
    /// are due to rounding and are dropped, because they would not extend the polygon.
    fn push(&mut self, point: DVec3) {
        if let Some(place) = self.points.get_mut(self.count) {
            *place = point;
            self.count += 1;
        }
    }

    /// Vertices of the polygon.
    pub fn points(&self) -> &[DVec3] {
        &self.points[..self.count]
    }

    /// Bounding box of the polygon. The corners are ∞ and −∞ if the polygon is empty.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.points().iter().fold(none, |(min, max), &p| (min.min(p), max.max(p)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipped_triangles_have_tight_bounds() {
        let corners = [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 4.0, 4.0)];
        let whole = TriangleReference::new(7, corners);
        let [left, right] = whole.split(0, 3.0, corners);
        assert_eq!((left.id(), right.id()), (7, 7));
        assert_eq!(
            right.bounds.aabb(),
            Aabb { min: Vec3::new(3.0, 0.0, 0.0), max: Vec3::new(4.0, 1.0, 1.0) }
        );
        assert_eq!(left.bounds.aabb(), Aabb { min: Vec3::ZERO, max: Vec3::new(3.0, 4.0, 4.0) });
    }

    #[test]
    fn bounds_are_rounded_outward() {
        let corners = [Vec3::ZERO, Vec3::new(3.0, 1.0, 0.1), Vec3::new(3.0, 1.0, 0.7)];
        let [left, right] = TriangleReference::new(0, corners).split(0, 1.0, corners);
        for (low, exact, high) in [
            (right.bounds.min.y, 1.0 / 3.0, left.bounds.max_corner().y),
            (right.bounds.min.z, f64::from(0.1_f32) / 3.0, f32::INFINITY),
            (f32::NEG_INFINITY, f64::from(0.7_f32) / 3.0, left.bounds.max_corner().z),
        ] {
            assert!(f64::from(low) <= exact && exact <= f64::from(high), "{low} {exact} {high}");
        }
    }
}
