//! Spheres in double precision.

use std::f64::consts::PI;

use super::local_geometry::{FlatOrRoundExtent, NearbyGeometry, NearestSurface};
use super::packet::{F32x16, HitPacket, PACKET_SIZE, RayPacket, round_t_to_f32_or_nan};
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64};
use super::{Aabb, RayF64, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::lanes::{Simd, TRUE};
use crate::math::{DVec2, DVec3, Vec2};

/// All points whose distance from a center equals the radius. The front is outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Center.
    pub center: DVec3,
    /// Radius. Must be positive.
    pub radius: f64,
}

impl Sphere {
    /// Finds the nearest root in the ray's interval. Computes the discriminant from the distance between
    /// center and ray instead of b² − ac, and the roots without cancellation (Haines, Günther,
    /// Akenine-Möller, *Precision Improvements for Ray/Sphere Intersection*, Ray Tracing Gems, chapter 7).
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        let to_origin = ray.origin - self.center;
        let a = ray.direction.length_squared();
        let b = -to_origin.dot(ray.direction);
        let foot = to_origin + ray.direction * (b / a);
        let discriminant = self.radius * self.radius - foot.length_squared();
        if discriminant.is_nan() || discriminant < 0.0 {
            return None;
        }
        let distance = to_origin.length();
        let c = (distance - self.radius) * (distance + self.radius);
        let q = b + (a * discriminant).sqrt().copysign(b);
        let (t0, t1) = (c / q, q / a);
        let (near, far) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
        ray.round_t_if_in_range(near).or_else(|| ray.round_t_if_in_range(far)).map(ShapeHit::from_t)
    }

    /// [`Sphere::intersect`] for a packet.
    #[inline(always)]
    pub fn intersect_packet(&self, rays: &RayPacket, ends: &F32x16, hits: &mut HitPacket, simd: impl Simd) {
        let (mut discriminants, mut may_hit) = ([0.0; PACKET_SIZE], [0; PACKET_SIZE]);
        for lane in 0..PACKET_SIZE {
            let ray = rays.ray_f64(lane);
            let to_origin = ray.origin - self.center;
            let a = ray.direction.length_squared();
            let b = -to_origin.dot(ray.direction);
            let foot = to_origin + ray.direction * (b / a);
            discriminants[lane] = self.radius * self.radius - foot.length_squared();
            may_hit[lane] = if (discriminants[lane] >= 0.0) & (ends[lane] >= 0.0) { TRUE } else { 0 };
        }
        if simd.movemask(&may_hit) == 0 {
            return;
        }
        for lane in 0..PACKET_SIZE {
            let ray = rays.ray_f64(lane);
            let to_origin = ray.origin - self.center;
            let a = ray.direction.length_squared();
            let b = -to_origin.dot(ray.direction);
            let distance = to_origin.length();
            let c = (distance - self.radius) * (distance + self.radius);
            let q = b + (a * discriminants[lane]).sqrt().copysign(b);
            let (t0, t1) = (c / q, q / a);
            let is_in_order = t0 < t1;
            let near = round_t_to_f32_or_nan(if is_in_order { t0 } else { t1 }, ends[lane]);
            let far = round_t_to_f32_or_nan(if is_in_order { t1 } else { t0 }, ends[lane]);
            let t = if near.is_nan() { far } else { near };
            hits.t[lane] = if discriminants[lane] >= 0.0 { t } else { f32::NAN };
        }
    }

    /// Surface point at a hit.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let SurfacePointF64 { point, normal, reach } = self.surface_point_f64(ray, hit);
        let (uv, dpdu, dpdv) = sphere_parametrization(normal);
        SurfacePoint::from_f64(point, normal, uv, dpdu * self.radius, dpdv * self.radius, reach)
    }

    /// Texture coordinates of a point on the surface.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        sphere_parametrization((point - self.center).normalize_or(DVec3::Y)).0.as_dvec2()
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points_f64([
            self.center - DVec3::splat(self.radius),
            self.center + DVec3::splat(self.radius),
        ])
    }

    /// Area of each part.
    pub fn local_part_areas(&self) -> [f64; 1] {
        [4.0 * PI * self.radius * self.radius]
    }

    /// Samples a point uniformly over the area.
    pub fn sample_point_on_part(&self, _: u32, u: Vec2) -> SurfaceSample {
        let (x, y) = (f64::from(u.x), f64::from(u.y));
        let height = 1.0 - 2.0 * x;
        let across = (1.0 - height * height).max(0.0).sqrt();
        let (sin, cos) = libm::sincos(2.0 * PI * y);
        let normal = DVec3::new(across * cos, height, across * sin);
        SurfaceSample { point: self.center + normal * self.radius, normal }
    }

    /// Centroid.
    pub fn centroid(&self) -> DVec3 {
        self.center
    }

    /// Distance from a point to the surface.
    pub fn distance_from_point(&self, point: DVec3) -> f64 {
        ((point - self.center).length() - self.radius).abs()
    }

    /// The polygons or the surface of the sphere near a point, for density estimation.
    pub fn polygons_or_surface_near(&self, point: DVec3) -> NearbyGeometry {
        let (distance, out) = (self.distance_from_point(point), (point - self.center).normalize_or_zero());
        let ground =
            NearestSurface { normal: out, height: distance, extent: FlatOrRoundExtent::Round(self.radius) };
        NearbyGeometry::Surface { distance, ground: Some(ground) }
    }

    /// Whether a point is inside.
    pub fn volume_contains(&self, point: DVec3) -> bool {
        let (distance, radius) = ((point - self.center).length_squared(), self.radius * self.radius);
        // The slow square root is only needed if rounding errors could change the result.
        if (distance - radius).abs() > radius * (16.0 * f64::EPSILON) {
            return distance < radius;
        }
        (point - self.center).length() < self.radius
    }

    /// Projected area, which is the area enclosed by a great circle, whatever the direction.
    pub fn projected_area(&self, _: DVec3) -> f64 {
        PI * self.radius * self.radius
    }
}

impl SurfacePointsInF64 for Sphere {
    #[inline(always)]
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let outwards = ray.at(f64::from(hit.t)) - self.center;
        // At the center, any normal is correct.
        let is_nonzero = outwards.length_squared() > 0.0;
        let n = (if is_nonzero { outwards } else { -ray.direction }).normalize();
        let reach = self.center.abs().max_element() + self.radius;
        SurfacePointF64 { point: self.center + n * self.radius, normal: n, reach }
    }
}

/// Texture coordinates u = ½ + atan2(z, x)/2π and v = ½ + asin(y)/π of a unit normal, and the normal's
/// derivatives with respect to u and v. At the poles, the derivatives are replaced by perpendicular tangents.
fn sphere_parametrization(n: DVec3) -> (Vec2, DVec3, DVec3) {
    let u = 0.5 + libm::atan2(n.z, n.x) / (2.0 * PI);
    let v = 0.5 + libm::asin(n.y.clamp(-1.0, 1.0)) / PI;
    let ring = (n.x * n.x + n.z * n.z).sqrt();
    let (east, north) = if ring > 1e-9 {
        let east = DVec3::new(-n.z, 0.0, n.x) / ring;
        (east, DVec3::new(-n.y * n.x / ring, ring, -n.y * n.z / ring))
    } else {
        (DVec3::Z, DVec3::new(-n.y.signum(), 0.0, 0.0))
    };
    (Vec2::new(u as f32, v as f32), east * (2.0 * PI * ring), north * PI)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::Vec3;

    fn unit() -> Sphere {
        Sphere { center: DVec3::ZERO, radius: 1.0 }
    }

    #[test]
    fn rays_hit_spheres_twice_once_or_not_at_all() {
        let ray = |x: f32| Ray::new(Vec3::new(x, 0.0, -3.0), Vec3::Z).to_f64();
        assert_eq!(unit().intersect(&ray(0.0)).map(|hit| hit.t), Some(2.0));
        assert_eq!(unit().intersect(&ray(1.0)).map(|hit| hit.t), Some(3.0));
        assert_eq!(unit().intersect(&ray(1.000_001)), None);
        let inside = Ray::new(Vec3::ZERO, Vec3::X).to_f64();
        assert_eq!(unit().intersect(&inside).map(|hit| hit.t), Some(1.0));
        let behind = Ray::new(Vec3::new(0.0, 0.0, 3.0), Vec3::Z).to_f64();
        assert_eq!(unit().intersect(&behind), None);
    }

    #[test]
    fn distant_hits_are_precise() {
        for distance in [2e1_f64, 2e2, 2e3, 2e4, 2e6] {
            let ray =
                RayF64 { origin: DVec3::new(0.5, 0.0, -distance), direction: DVec3::Z, t_max: f64::INFINITY };
            let exact = distance - 0.75_f64.sqrt();
            let hit = unit().intersect(&ray).expect("the ray should hit the sphere");
            assert!((f64::from(hit.t) - exact).abs() / exact < 6e-8, "at {distance}");
        }
    }

    #[test]
    fn hits_on_giant_spheres_are_precise() {
        let floor = Sphere { center: DVec3::new(0.0, -1e5, 0.0), radius: 1e5 };
        let ray = Ray::new(Vec3::Y, Vec3::new(0.6, -0.8, 0.0)).to_f64();
        let hit = floor.intersect(&ray).expect("the ray should hit the floor");
        // |o + t d − c| = R with |d| = 1 up to rounding: the smaller root of t² + 2bt + c.
        let (o, d) = (ray.origin - floor.center, ray.direction);
        let (a, b, c) = (d.length_squared(), o.dot(d), 2.0 * 1e5 + 1.0);
        let exact = c / (-b + (b * b - a * c).sqrt());
        assert!((f64::from(hit.t) - exact).abs() / exact < 1e-6);
    }

    #[test]
    fn texture_coordinates_have_expected_values() {
        let (uv, ..) = sphere_parametrization(DVec3::ONE.normalize());
        assert!((uv.x - 0.625).abs() < 1e-6 && (uv.y - 0.695_913_3).abs() < 1e-6);
        for pole in [DVec3::Y, DVec3::NEG_Y] {
            let (uv, _, north) = sphere_parametrization(pole);
            assert!(uv.is_finite() && north.length() > 1.0);
        }
    }

    #[test]
    fn tangents_are_derivatives_of_the_normal() {
        let point = |u: f64, v: f64| {
            let (azimuth, height) = ((u - 0.5) * 2.0 * PI, (v - 0.5) * PI);
            DVec3::new(height.cos() * azimuth.cos(), height.sin(), height.cos() * azimuth.sin())
        };
        let (u, v, h) = (0.3, 0.7, 1e-6);
        let (uv, dpdu, dpdv) = sphere_parametrization(point(u, v));
        assert!((uv - Vec2::new(0.3, 0.7)).length() < 1e-6);
        assert!(((point(u + h, v) - point(u - h, v)) / (2.0 * h) - dpdu).length() < 1e-6);
        assert!(((point(u, v + h) - point(u, v - h)) / (2.0 * h) - dpdv).length() < 1e-6);
    }
}
