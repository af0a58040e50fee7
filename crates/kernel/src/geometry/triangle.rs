//! Single triangles in double precision.

use super::packet::{F32x16, HitPacket, RayPacket, round_t_to_f32_or_nan};
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64};
use super::{Aabb, RayF64, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::{DVec2, DVec3, Vec2};
use crate::sampling::warp;

/// A triangle is considered huge if its largest coordinate is more than this many times as large as the
/// coordinates of the ray's origin and of the hit.
const HUGE: f64 = 1024.0;

/// A triangle. The front faces along (b − a) × (c − a).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// First corner.
    pub a: DVec3,
    /// Second corner.
    pub b: DVec3,
    /// Third corner.
    pub c: DVec3,
}

impl Triangle {
    /// Intersects the triangle from either side. Tests the edges with triple products of the corners relative
    /// to the ray's origin. Triangles that share an edge compute the same value for it, up to sign, so there
    /// is no gap between them.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        let (a, b, c) = (self.a - ray.origin, self.b - ray.origin, self.c - ray.origin);
        let d = ray.direction;
        let (wa, wb, wc) = (d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a)));
        if (wa < 0.0 || wb < 0.0 || wc < 0.0) && (wa > 0.0 || wb > 0.0 || wc > 0.0) {
            return None;
        }
        let sum = wa + wb + wc;
        let normal = (b - a).cross(c - a);
        let t = ray.round_t_if_in_range(normal.dot(a) / normal.dot(d))?;
        (sum != 0.0).then(|| ShapeHit { t, primitive: 0, u: (wb / sum) as f32, v: (wc / sum) as f32 })
    }

    /// [`Triangle::intersect`] for a packet.
    #[inline(always)]
    pub fn intersect_packet(&self, rays: &RayPacket, ends: &F32x16, hits: &mut HitPacket) {
        for (lane, &end) in ends.iter().enumerate() {
            let ray = rays.ray_f64(lane);
            let (a, b, c) = (self.a - ray.origin, self.b - ray.origin, self.c - ray.origin);
            let d = ray.direction;
            let (wa, wb, wc) = (d.dot(c.cross(b)), d.dot(a.cross(c)), d.dot(b.cross(a)));
            let is_left = (wa < 0.0) | (wb < 0.0) | (wc < 0.0);
            let is_right = (wa > 0.0) | (wb > 0.0) | (wc > 0.0);
            let sum = wa + wb + wc;
            let normal = (b - a).cross(c - a);
            let t = round_t_to_f32_or_nan(normal.dot(a) / normal.dot(d), end);
            let is_hit = !(is_left & is_right) & (sum != 0.0);
            hits.t[lane] = if is_hit { t } else { f32::NAN };
            hits.u[lane] = (wb / sum) as f32;
            hits.v[lane] = (wc / sum) as f32;
        }
    }

    /// Surface point at a hit. The texture coordinates at the corners are (0, 0), (1, 0), and (0, 1).
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let SurfacePointF64 { point, normal, reach } = self.surface_point_f64(ray, hit);
        SurfacePoint::from_f64(
            point,
            normal,
            Vec2::new(hit.u, hit.v),
            self.b - self.a,
            self.c - self.a,
            reach,
        )
    }

    /// Texture coordinates of a point on the triangle.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        barycentric_weights_at_point([self.a, self.b, self.c], point)
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points_f64([self.a, self.b, self.c])
    }

    /// Unnormalized normal: the cross product of the edges at the first corner.
    fn unnormalized_normal(&self) -> DVec3 {
        (self.b - self.a).cross(self.c - self.a)
    }

    /// Area of each part.
    pub fn local_part_areas(&self) -> [f64; 1] {
        [0.5 * self.unnormalized_normal().length()]
    }

    /// Samples a point uniformly over the area.
    pub fn sample_point_on_part(&self, _: u32, u: Vec2) -> SurfaceSample {
        let w = warp::triangle(u).as_dvec3();
        SurfaceSample {
            point: self.a * w.x + self.b * w.y + self.c * w.z,
            normal: self.unnormalized_normal().normalize(),
        }
    }

    /// Centroid.
    pub fn centroid(&self) -> DVec3 {
        (self.a + self.b + self.c) / 3.0
    }

    /// Whether a point is inside, which is never the case because a triangle has no volume.
    pub fn volume_contains(&self, _: DVec3) -> bool {
        false
    }

    /// Projected area of the front: the area times the cosine of the angle between the normal and a unit
    /// direction.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        (0.5 * self.unnormalized_normal().dot(direction)).max(0.0)
    }
}

/// Barycentric weights of the second and third corners at a point on the triangle.
pub fn barycentric_weights_at_point([a, b, c]: [DVec3; 3], point: DVec3) -> DVec2 {
    let (ab, ac, ap) = (b - a, c - a, point - a);
    let normal = ab.cross(ac);
    let of = |area: DVec3| area.dot(normal) / normal.length_squared();
    DVec2::new(of(ap.cross(ac)), of(ab.cross(ap)))
}

impl SurfacePointsInF64 for Triangle {
    #[inline(always)]
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let (ab, ac) = (self.b - self.a, self.c - self.a);
        let reach = (self.a.abs() + ab.abs() + ac.abs()).max_element();
        let (normal, by_weights) = (ab.cross(ac), self.a + ab * u + ac * v);
        // On huge triangles, points computed from the ray are more accurate than those from `f32` barycentric
        // coordinates.
        let by_ray = ray.at((self.a - ray.origin).dot(normal) / ray.direction.dot(normal));
        let is_huge = ray.origin.abs().max(by_ray.abs()).max_element() * HUGE < reach;
        SurfacePointF64 { point: if is_huge { by_ray } else { by_weights }, normal, reach }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::Vec3;

    #[test]
    fn hits_have_the_expected_barycentrics() {
        let triangle = Triangle {
            a: DVec3::new(0.1, 0.2, 0.3),
            b: DVec3::new(2.0, 0.0, 1.0),
            c: DVec3::new(0.0, 3.0, -1.0),
        };
        let target = (triangle.a * 0.5 + triangle.b * 0.2 + triangle.c * 0.3).as_vec3();
        for z in [-5.0_f32, 5.0] {
            let origin = Vec3::new(0.3, 0.4, z);
            let hit = triangle.intersect(&Ray::new(origin, target - origin).to_f64()).expect("aimed inside");
            assert!((hit.t - 1.0).abs() < 1e-6 && (hit.u - 0.2).abs() < 1e-6 && (hit.v - 0.3).abs() < 1e-6);
        }
    }

    #[test]
    fn points_of_huge_triangles_are_on_the_ray() {
        let corner = |x: f64, z: f64| DVec3::new(x, 0.3 * x - 0.2 * z, z);
        for size in [1e5, 1e7, 1e9] {
            let [a, b, c] = [corner(-size, size), corner(size, size), corner(0.1, -size)];
            let ray = Ray::new(Vec3::new(0.25, 3.0, -0.5), Vec3::new(0.3, -1.0, 0.1)).to_f64();
            let triangle = Triangle { a, b, c };
            let surface = triangle.surface_point_at_hit(&ray, &triangle.intersect(&ray).expect("below"));
            let t =
                (0.3 * 0.25 + 0.2 * 0.5 - 3.0) / (-1.0 - 0.3 * f64::from(0.3_f32) + 0.2 * f64::from(0.1_f32));
            let off = (surface.point.as_dvec3() - ray.at(t)).abs().max_element();
            assert!(off < 1e-6 + size * 1e-14, "{size}: {off}");
            assert!(surface.error.max_element() < 1e-5 + size as f32 * 1e-13, "{size}: {}", surface.error);
        }
    }

    #[test]
    fn degenerate_triangles_are_never_hit() {
        let flat = Triangle { a: DVec3::ZERO, b: DVec3::X, c: DVec3::X * 2.0 };
        for direction in [Vec3::NEG_Z, Vec3::X, Vec3::new(0.25, 0.0, -1.0)] {
            let ray = Ray::new(Vec3::new(0.5, 0.0, 1.0), direction).to_f64();
            assert_eq!(flat.intersect(&ray), None);
        }
    }
}
