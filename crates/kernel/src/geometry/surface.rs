//! Surface of a shape at a hit.

use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// The nearest intersection of a ray and a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Distance along the ray in units of its direction's length.
    pub t: f32,
    /// Part of the shape: triangle of a mesh, face of a box; else 0.
    pub primitive: u32,
    /// Weight of a triangle's second corner; else 0.
    pub u: f32,
    /// Weight of a triangle's third corner; else 0.
    pub v: f32,
}

impl ShapeHit {
    /// A hit of a shape with a single part.
    pub fn at(t: f32) -> Self {
        Self { t, primitive: 0, u: 0.0, v: 0.0 }
    }
}

/// A point of a surface, in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point, on the surface but for rounding.
    pub point: Vec3,
    /// Bound on each component's error, including that of the shape's own intersection test.
    pub error: Vec3,
    /// Unit geometric normal of the front side.
    pub normal: Vec3,
    /// Start of shadow rays on the side of the camera, if nothing is on the way there: the point, or a place above it if
    /// facets stand for a surface that bulges.
    pub shadow_point: Vec3,
    /// Unit interpolated normal on the same side.
    pub shading_normal: Vec3,
    /// Texture coordinates. For a plane they are large far from its point, and count by their fractions.
    pub uv: DVec2,
    /// Change of the point with u, of any length; 0 if there is no parametrisation.
    pub dpdu: Vec3,
    /// Change of the point with v.
    pub dpdv: Vec3,
    /// Weights of a triangle's corners; for other shapes (1 − u − v, u, v) of the texture coordinates.
    pub barycentric: Vec3,
}

/// Requested parts of a [`SurfacePoint`] beside the point and its normals. Other parts may stay 0, or be the point
/// itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    /// Texture coordinates and their tangents.
    pub uv: bool,
    /// [`SurfacePoint::shadow_point`].
    pub shadow_point: bool,
}

impl Asked {
    /// Everything.
    pub const ALL: Self = Self { uv: true, shadow_point: true };
}

/// A point of a surface that emits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AreaPoint {
    /// The point.
    pub point: DVec3,
    /// Unit normal of the front side.
    pub normal: DVec3,
}

impl SurfacePoint {
    /// A point computed in double precision on a surface without shading normals. Its error is that of rounding to
    /// `f32`. If the point is small beside the lengths from which it and the next hit are computed, their error counts
    /// too: `reach` is the greatest of these lengths.
    pub fn exact(point: DVec3, normal: DVec3, uv: Vec2, dpdu: DVec3, dpdv: DVec3, reach: f64) -> Self {
        let normal = normal.normalize().as_vec3();
        let point = point.as_vec3();
        Self {
            point,
            shadow_point: point,
            error: error(point, reach),
            normal,
            shading_normal: normal,
            uv: uv.as_dvec2(),
            dpdu: dpdu.as_vec3(),
            dpdv: dpdv.as_vec3(),
            barycentric: Vec3::new(1.0 - uv.x - uv.y, uv.x, uv.y),
        }
    }
}

/// Bound on each component's error, for a point that was computed in double precision from lengths up to `reach`, and
/// for the next test from there.
#[inline(always)]
pub fn error(point: Vec3, reach: f64) -> Vec3 {
    rounding_error(point) + Vec3::splat(double_error(reach))
}

/// Bound on the error of the `f64` arithmetic of a hit, its surface and the next test from there, with lengths up to `reach`.
#[inline(always)]
pub fn double_error(reach: f64) -> f32 {
    (reach * (32.0 * f64::EPSILON)) as f32
}

/// Twice the error of rounding a point to `f32`.
#[inline(always)]
pub fn rounding_error(point: Vec3) -> Vec3 {
    point.abs() * f32::EPSILON + Vec3::splat(f32::MIN_POSITIVE)
}

/// Tangents (u, v) of a flat surface with unit normal `n`, such that u × v = n: v goes up if the surface stands, and
/// towards −z if it lies and faces up.
pub fn flat_axes(n: DVec3) -> (DVec3, DVec3) {
    let across = DVec3::Y.cross(n);
    let u = if across.length_squared() > 1e-12 { across } else { DVec3::X - n * n.x };
    let u = u.normalize();
    (u, n.cross(u))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangents_are_perpendicular_also_next_to_the_vertical() {
        for tilt in [0.0, 1e-9, 9e-7, 1.1e-6, 0.3, 1.0] {
            for n in [DVec3::new(tilt, 1.0, 0.0), DVec3::new(-tilt, -1.0, tilt)].map(DVec3::normalize) {
                let (u, v) = flat_axes(n);
                let off = [u.dot(n), v.dot(n), u.dot(v), u.length() - 1.0, u.cross(v).dot(n) - 1.0];
                assert!(off.iter().all(|off| off.abs() < 1e-15), "{n}: {off:?}");
            }
        }
        assert_eq!(flat_axes(DVec3::Y), (DVec3::X, DVec3::NEG_Z));
    }
}
