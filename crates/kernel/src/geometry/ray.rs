//! Rays, segments, and robust ray origins on surfaces.

use crate::math::{DVec3, Vec3};

/// The points `origin + t·direction` for t in (0, `t_max`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Origin of the ray.
    pub origin: Vec3,
    /// Direction, of any nonzero length. t is measured in units of this length.
    pub direction: Vec3,
    /// Upper end of the t interval; ∞ for a half-line.
    pub t_max: f32,
    /// Index of the triangle on which the ray starts, or [`Ray::NO_TRIANGLE`]. A ray that leaves a flat
    /// triangle cannot hit it again, so intersection tests skip this triangle.
    pub start: u32,
}

impl Ray {
    /// Value of [`Ray::start`] for rays that do not start on a triangle.
    pub const NO_TRIANGLE: u32 = u32::MAX;

    /// Creates a half-line.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_max: f32::INFINITY, start: Self::NO_TRIANGLE }
    }

    /// Sets the ray's start triangle.
    #[inline(always)]
    pub fn with_start_triangle(self, start: u32) -> Self {
        Self { start, ..self }
    }

    /// Creates a segment that ends just before `to`. It is shortened by the rounding errors of its endpoints
    /// so that it does not hit a surface that contains `to`. The point `to` itself is at t = 1.
    #[inline(always)]
    pub fn segment_ending_before_point(from: Vec3, to: Vec3) -> Self {
        let direction = to - from;
        let size = from.abs().max_element() + to.abs().max_element();
        let relative = size / direction.abs().max_element().max(f32::MIN_POSITIVE);
        let shortening = 4.0 * f32::EPSILON * (1.0 + relative);
        Self { t_max: 1.0 - shortening.min(0.5), ..Self::new(from, direction) }
    }

    /// Extends the segment by the error bound of its endpoint.
    #[inline(always)]
    pub fn extended_by_endpoint_error(self, error: Vec3) -> Self {
        let relative = 4.0 * error.max_element() / self.direction.abs().max_element();
        Self { t_max: self.t_max + relative, ..self }
    }

    /// Point at parameter `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }

    /// Converts the ray to double precision.
    pub fn to_f64(&self) -> RayF64 {
        RayF64 {
            origin: self.origin.as_dvec3(),
            direction: self.direction.as_dvec3(),
            t_max: f64::from(self.t_max),
        }
    }
}

/// A double-precision [`Ray`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayF64 {
    /// Origin of the ray.
    pub origin: DVec3,
    /// Direction.
    pub direction: DVec3,
    /// Upper end of the t interval.
    pub t_max: f64,
}

impl RayF64 {
    /// Point at parameter `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// `t` rounded to `f32`, or `None` if the result is not finite or is outside the ray's interval.
    pub fn round_t_if_in_range(&self, t: f64) -> Option<f32> {
        let single = t as f32;
        (single > 0.0 && single < f32::INFINITY && f64::from(single) <= self.t_max).then_some(single)
    }
}

/// Moves the origin of a ray off the surface at `point`. If `error` bounds the errors of the components of
/// `point`, the new origin is guaranteed to be on the side of the surface toward which the direction points
/// (Pharr, Jakob, Humphreys, *Physically Based Rendering*, 4th ed., section 6.8.6).
#[inline(always)]
pub fn offset_origin(point: Vec3, error: Vec3, normal: Vec3, direction: Vec3) -> Vec3 {
    let distance = normal.abs().dot(error);
    let offset = if normal.dot(direction) < 0.0 { -normal * distance } else { normal * distance };
    let moved = point + offset;
    let round = |moved: f32, offset: f32| {
        if offset > 0.0 {
            moved.next_up()
        } else if offset < 0.0 {
            moved.next_down()
        } else {
            moved
        }
    };
    Vec3::new(round(moved.x, offset.x), round(moved.y, offset.y), round(moved.z, offset.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_origin_exceeds_the_error() {
        let (p, error) = (Vec3::new(1e4, -3.0, 0.25), Vec3::splat(1e-3));
        let n = Vec3::new(0.6, 0.0, 0.8);
        assert!((offset_origin(p, error, n, n) - p).as_dvec3().dot(n.as_dvec3()) >= 0.0013);
        assert!((offset_origin(p, error, n, -n) - p).as_dvec3().dot(n.as_dvec3()) <= -0.0013);
    }

    #[test]
    fn segments_end_before_their_target() {
        for scale in [1e-8_f32, 1.0, 1e8] {
            let (from, to) = (Vec3::new(3.0, 4.0, 5.0) * scale, Vec3::new(3.0, 4.5, 5.0) * scale);
            let ray = Ray::segment_ending_before_point(from, to);
            assert!(ray.at(ray.t_max).y < to.y && ray.at(ray.t_max).y > 4.4999 * scale);
        }
    }
}
