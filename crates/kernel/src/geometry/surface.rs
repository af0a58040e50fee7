//! Surface points and their error bounds.

use crate::math::{DVec2, DVec3, Vec2, Vec3};

/// Nearest intersection of a ray and a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeHit {
    /// Ray parameter: distance in units of the direction's length.
    pub t: f32,
    /// Index of the part, for example a mesh triangle or a box face, or 0 for shapes with a single part.
    pub primitive: u32,
    /// Barycentric weight of a triangle's second corner; 0 for other shapes.
    pub u: f32,
    /// Barycentric weight of a triangle's third corner; 0 for other shapes.
    pub v: f32,
}

impl ShapeHit {
    /// A hit on a shape with a single part.
    pub fn from_t(t: f32) -> Self {
        Self { t, primitive: 0, u: 0.0, v: 0.0 }
    }
}

/// A surface point in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The point. It is on the surface up to rounding.
    pub point: Vec3,
    /// Bound on each component's error, including the error of the shape's intersection test.
    pub error: Vec3,
    /// Unit geometric normal on the front side.
    pub normal: Vec3,
    /// Origin of shadow rays on the camera's side. It is `point` itself, or a point above `point` if flat
    /// triangles approximate a convex surface. Only valid if nothing obstructs the segment from `point` to
    /// it.
    pub shadow_point: Vec3,
    /// Unit interpolated normal on the same side as `normal`.
    pub shading_normal: Vec3,
    /// Texture coordinates. They may be large on a plane, where only the fractional part matters.
    pub uv: DVec2,
    /// Derivative of the point with respect to u, up to scale; 0 without a parametrization.
    pub dpdu: Vec3,
    /// Derivative of the point with respect to v, up to scale.
    pub dpdv: Vec3,
    /// Barycentric weights of a triangle's corners. For other shapes, (1 − u − v, u, v) from the texture
    /// coordinates.
    pub barycentric: Vec3,
}

/// Optional fields of a [`SurfacePoint`]. Fields that are not requested may be 0 or equal to the point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceRequest {
    /// Texture coordinates and tangents.
    pub uv: bool,
    /// [`SurfacePoint::shadow_point`].
    pub shadow_point: bool,
}

impl SurfaceRequest {
    /// Requests all optional fields.
    pub const ALL: Self = Self { uv: true, shadow_point: true };
}

/// A point sampled on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// The point.
    pub point: DVec3,
    /// Unit normal on the front side.
    pub normal: DVec3,
}

impl SurfacePoint {
    /// Creates a surface point from a double-precision point, without a separate shading normal. Its error
    /// bound accounts for rounding to `f32` and for the double-precision error. `reach` is the largest
    /// magnitude among the lengths used to compute the point and the next hit.
    pub fn from_f64(point: DVec3, normal: DVec3, uv: Vec2, dpdu: DVec3, dpdv: DVec3, reach: f64) -> Self {
        let normal = normal.normalize().as_vec3();
        let point = point.as_vec3();
        Self {
            point,
            shadow_point: point,
            error: point_error_bound(point, reach),
            normal,
            shading_normal: normal,
            uv: uv.as_dvec2(),
            dpdu: dpdu.as_vec3(),
            dpdv: dpdv.as_vec3(),
            barycentric: Vec3::new(1.0 - uv.x - uv.y, uv.x, uv.y),
        }
    }
}

/// Bound on the error of each component of a point that was computed in double precision and rounded.
/// Includes the error of the next intersection test from that point. `reach` is the largest absolute value of
/// all lengths in these computations.
#[inline(always)]
pub fn point_error_bound(point: Vec3, reach: f64) -> Vec3 {
    doubled_point_rounding_error(point) + Vec3::splat(absolute_f64_error_bound(reach))
}

/// Bound on the error of `f64` arithmetic for a hit, its surface point, and the next intersection test from
/// that point. `reach` is the largest absolute value of all lengths in these computations.
#[inline(always)]
pub fn absolute_f64_error_bound(reach: f64) -> f32 {
    (reach * (32.0 * f64::EPSILON)) as f32
}

/// Twice the error due to rounding a point to `f32`.
#[inline(always)]
pub fn doubled_point_rounding_error(point: Vec3) -> Vec3 {
    point.abs() * f32::EPSILON + Vec3::splat(f32::MIN_POSITIVE)
}

/// Tangents (u, v) of a flat surface with unit normal `n`, such that u × v = n. v points up on vertical
/// surfaces, and toward −z on horizontal surfaces that face up.
pub fn tangents_from_normal(n: DVec3) -> (DVec3, DVec3) {
    let across = DVec3::Y.cross(n);
    let u = if across.length_squared() > 1e-12 { across } else { DVec3::X - n * n.x };
    let u = u.normalize();
    (u, n.cross(u))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangents_are_perpendicular_near_vertical() {
        for tilt in [0.0, 1e-9, 9e-7, 1.1e-6, 0.3, 1.0] {
            for n in [DVec3::new(tilt, 1.0, 0.0), DVec3::new(-tilt, -1.0, tilt)].map(DVec3::normalize) {
                let (u, v) = tangents_from_normal(n);
                let off = [u.dot(n), v.dot(n), u.dot(v), u.length() - 1.0, u.cross(v).dot(n) - 1.0];
                assert!(off.iter().all(|off| off.abs() < 1e-15), "{n}: {off:?}");
            }
        }
        assert_eq!(tangents_from_normal(DVec3::Y), (DVec3::X, DVec3::NEG_Z));
    }
}
