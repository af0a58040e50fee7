//! Triangle lights. They are sampled by solid angle, or by area if they are distant.

use std::f64::consts::TAU;

use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::geometry::triangle::Triangle;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::warp;

/// Minimum solid angle in sr for solid-angle sampling. For smaller triangles, area sampling is equally good.
const MIN_SOLID_ANGLE: f64 = 1e-3;

/// The corners are considered to be on a great circle if the solid angle is within this many sr of a
/// hemisphere's.
const HEMISPHERE_TOLERANCE: f64 = 1e-4;

/// A triangle that emits toward (b − a) × (c − a).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleEmitter {
    corners: [DVec3; 3],
    /// Unit normal on the front side.
    normal: DVec3,
    area: f64,
}

/// A spherical triangle.
struct SphericalTriangle {
    /// Unit vectors to the corners.
    corners: [DVec3; 3],
    solid_angle: f64,
}

impl ShapeEmitter for TriangleEmitter {
    /// Samples uniformly over the solid angle, or over the area for small solid angles.
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let Some((offsets, spherical)) = self.spherical_triangle_if_in_front(point.as_dvec3()) else {
            return SampledLightPoint::NOTHING;
        };
        let (direction, distance, factor) = if spherical.has_accurate_solid_angle() {
            let direction = spherical.sample(u.map(f64::from));
            let distance = offsets[0].dot(self.normal) / direction.dot(self.normal);
            let farthest = offsets.iter().map(|offset| offset.length()).fold(0.0, f64::max);
            let is_near = distance > 0.0 && distance < farthest;
            (direction, if is_near { distance } else { farthest }, spherical.solid_angle)
        } else {
            let weights = warp::triangle(Vec2::from_array(u)).as_dvec3();
            let offset = offsets[0] * weights.x + offsets[1] * weights.y + offsets[2] * weights.z;
            let distance = offset.length();
            let direction = offset / distance;
            (direction, distance, -direction.dot(self.normal) * self.area / (distance * distance))
        };
        let direction = direction.as_vec3();
        SampledLightPoint { direction, target: point + direction * distance as f32, factor: factor as f32 }
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        match self.spherical_triangle_if_in_front(from.as_dvec3()) {
            Some((_, spherical)) if spherical.has_accurate_solid_angle() => {
                (1.0 / spherical.solid_angle) as f32
            }
            Some(_) => hit.uniform_area_solid_angle_pdf(self.area),
            None => 0.0,
        }
    }

    fn area_centroid(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (a + b + c) / 3.0
    }
}

impl TriangleEmitter {
    /// Creates an emitter for an entire triangle, or returns `None` if the triangle has no area.
    pub fn new(triangle: &Triangle) -> Option<Self> {
        let Triangle { a, b, c } = *triangle;
        let normal = (b - a).cross(c - a);
        let length = normal.length();
        (length > 0.0 && length.is_finite()).then(|| Self {
            corners: [a, b, c],
            normal: normal / length,
            area: 0.5 * length,
        })
    }

    /// The triangle seen from a point: the offsets to its corners and the spherical triangle, or `None` if
    /// the point is behind the triangle.
    fn spherical_triangle_if_in_front(&self, point: DVec3) -> Option<([DVec3; 3], SphericalTriangle)> {
        let offsets = self.corners.map(|corner| corner - point);
        let corners = offsets.map(DVec3::normalize);
        let [a, b, c] = corners;
        let is_front = offsets[0].dot(self.normal) < 0.0;
        // tan(Ω/2) (Van Oosterom and Strackee, *The Solid Angle of a Plane Triangle*, 1983).
        let volume = a.dot(b.cross(c)).abs();
        let solid_angle = 2.0 * libm::atan2(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        is_front.then_some((offsets, SphericalTriangle { corners, solid_angle }))
    }
}

impl SphericalTriangle {
    fn has_accurate_solid_angle(&self) -> bool {
        (MIN_SOLID_ANGLE..TAU - HEMISPHERE_TOLERANCE).contains(&self.solid_angle)
    }

    /// Samples uniformly over the solid angle (Arvo, *Stratified Sampling of Spherical Triangles*, 1995).
    /// Chooses a new corner on the side a–c, such that its triangle with a and b has the required fraction of
    /// the solid angle. Then chooses a point on the arc from b to the new corner, uniformly in height.
    fn sample(&self, u: [f64; 2]) -> DVec3 {
        let [a, b, c] = self.corners;
        // Angle at a, between the planes through b and c.
        let (to_b, to_c) = (b - a * a.dot(b), c - a * a.dot(c));
        let alpha = libm::atan2(a.dot(to_b.cross(to_c)).abs(), to_b.dot(to_c));
        let (sin_alpha, cos_alpha) = libm::sincos(alpha);
        // Let β and γ be the angles at b and at the new corner. Then α + β + γ = π + share. With ψ = share −
        // α and the cosine of the side a–b, the side from a to the new corner follows from the spherical law
        // of cosines.
        let (sin, cos) = libm::sincos(u[0] * self.solid_angle - alpha);
        let (p, q) = (cos - cos_alpha, sin + sin_alpha * a.dot(b));
        let cos_side = ((q * cos - p * sin) * cos_alpha - q) / ((q * sin + p * cos) * sin_alpha);
        let cos_side = cos_side.clamp(a.dot(c).min(1.0), 1.0);
        let corner = a * cos_side + to_c.normalize() * ((1.0 - cos_side) * (1.0 + cos_side)).sqrt();
        // Cosines are uniform along the arc from b to the new corner.
        let from_b = corner - b * b.dot(corner);
        let versine = u[1] * (1.0 - corner.dot(b)).max(0.0);
        let across = (versine * (2.0 - versine)).max(0.0).sqrt();
        from_b.try_normalize().map_or(b, |along| b * (1.0 - versine) + along * across)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn octant_samples_have_the_exact_mean() {
        let octant = SphericalTriangle { corners: [DVec3::X, DVec3::Y, DVec3::Z], solid_angle: PI / 2.0 };
        let n = 400;
        let mut sum = DVec3::ZERO;
        for i in 0..n * n {
            let direction = octant
                .sample([(f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n)]);
            assert!((direction.length() - 1.0).abs() < 1e-12 && direction.min_element() > -1e-12);
            sum += direction / f64::from(n * n);
        }
        // The mean of x over the octant is (π/4) / (π/2).
        assert!((sum - DVec3::splat(0.5)).abs().max_element() < 1e-5, "{sum}");
    }
}
