//! Quads (squares and other parallelograms) in double precision.

use super::packet::{
    F32x16, HitPacket, PACKET_SIZE, RayPacket, can_quotient_be_in_range, round_t_to_f32_or_nan,
};
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64, UvMapped};
use super::{Aabb, RayF64, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::lanes::{Simd, TRUE};
use crate::math::{DVec2, DVec3, Vec2};

/// Margin around the border, relative to the edge lengths. It closes gaps between quads that share an edge,
/// and is far below the resolution of `f32` rays.
const BORDER: f64 = 1e-14;

/// The points corner + s·u + t·v with s and t in [0, 1]. The front faces along u × v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parallelogram {
    /// Corner at s = t = 0.
    pub corner: DVec3,
    /// First edge.
    pub u: DVec3,
    /// Second edge.
    pub v: DVec3,
    /// Cross product u × v.
    normal: DVec3,
    /// Vectors whose dot products with point − corner are s and t.
    dual_u: DVec3,
    dual_v: DVec3,
}

impl Parallelogram {
    /// Creates a quad from a corner and two nonparallel edges.
    pub fn new(corner: DVec3, u: DVec3, v: DVec3) -> Self {
        let normal = u.cross(v);
        let area_squared = normal.length_squared();
        Self {
            corner,
            u,
            v,
            normal,
            dual_u: v.cross(normal) / area_squared,
            dual_v: normal.cross(u) / area_squared,
        }
    }

    /// Intersects the plane and checks that the hit is inside the quad.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        let to_corner = self.corner - ray.origin;
        let t = self.normal.dot(to_corner) / self.normal.dot(ray.direction);
        let accepted = ray.round_t_if_in_range(t)?;
        let from_corner = ray.direction * t - to_corner;
        let (s, t) = (from_corner.dot(self.dual_u), from_corner.dot(self.dual_v));
        (is_in_unit_interval_with_margin(s) && is_in_unit_interval_with_margin(t))
            .then(|| ShapeHit::from_t(accepted))
    }

    /// [`Parallelogram::intersect`] for a packet.
    #[inline(always)]
    pub fn intersect_packet(&self, rays: &RayPacket, ends: &F32x16, hits: &mut HitPacket, simd: impl Simd) {
        let (mut above, mut along, mut may_hit) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [0; PACKET_SIZE]);
        for lane in 0..PACKET_SIZE {
            let ray = rays.ray_f64(lane);
            above[lane] = self.normal.dot(self.corner - ray.origin);
            along[lane] = self.normal.dot(ray.direction);
            may_hit[lane] =
                if can_quotient_be_in_range(above[lane], along[lane], ends[lane]) { TRUE } else { 0 };
        }
        if simd.movemask(&may_hit) == 0 {
            return;
        }
        for lane in 0..PACKET_SIZE {
            let ray = rays.ray_f64(lane);
            let t = above[lane] / along[lane];
            let from_corner = ray.direction * t - (self.corner - ray.origin);
            let (s, r) = (from_corner.dot(self.dual_u), from_corner.dot(self.dual_v));
            let is_inside = is_in_unit_interval_with_margin(s) & is_in_unit_interval_with_margin(r);
            let accepted = round_t_to_f32_or_nan(t, ends[lane]);
            hits.t[lane] = if is_inside { accepted } else { f32::NAN };
        }
    }

    /// Surface point at a hit.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let SurfacePointF64 { point, normal, reach } = self.surface_point_f64(ray, hit);
        SurfacePoint::from_f64(point, normal, self.uv_at_hit(ray, hit).as_vec2(), self.u, self.v, reach)
    }

    /// Coordinates of a hit in terms of the two edges, each in [0, 1].
    #[inline(always)]
    fn coordinates_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> [f64; 2] {
        self.coordinates_of(ray.at(f64::from(hit.t)))
    }

    #[inline(always)]
    fn coordinates_of(&self, point: DVec3) -> [f64; 2] {
        let from_corner = point - self.corner;
        [self.dual_u, self.dual_v].map(|dual| from_corner.dot(dual).max(0.0).min(1.0))
    }

    /// Texture coordinates of a point on the quad.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        DVec2::from_array(self.coordinates_of(point))
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        let c = self.corner;
        Aabb::from_points_f64([c, c + self.u, c + self.v, c + self.u + self.v])
    }

    /// Area of the quad.
    pub fn area(&self) -> f64 {
        self.normal.length()
    }

    /// Area of each part.
    pub fn local_part_areas(&self) -> [f64; 1] {
        [self.normal.length()]
    }

    /// Samples a point uniformly over the area.
    pub fn sample_point_on_part(&self, _: u32, u: Vec2) -> SurfaceSample {
        let point = self.corner + self.u * f64::from(u.x) + self.v * f64::from(u.y);
        SurfaceSample { point, normal: self.normal.normalize() }
    }

    /// Centroid.
    pub fn centroid(&self) -> DVec3 {
        self.corner + (self.u + self.v) * 0.5
    }

    /// Whether a point is inside. Always false because a quad has no volume.
    pub fn volume_contains(&self, _: DVec3) -> bool {
        false
    }

    /// Projected area of the front: the area times the cosine of the angle between the normal and a unit
    /// direction.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        self.normal.dot(direction).max(0.0)
    }
}

impl SurfacePointsInF64 for Parallelogram {
    #[inline(always)]
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let [s, t] = self.coordinates_at_hit(ray, hit);
        let reach = (self.corner.abs() + self.u.abs() + self.v.abs()).max_element();
        SurfacePointF64 { point: self.corner + self.u * s + self.v * t, normal: self.normal, reach }
    }
}

impl UvMapped for Parallelogram {
    #[inline(always)]
    fn uv_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> DVec2 {
        let [s, t] = self.coordinates_at_hit(ray, hit);
        Vec2::new(s as f32, t as f32).as_dvec2()
    }
}

/// Whether an edge coordinate is in [0, 1], up to the border margin.
#[inline(always)]
fn is_in_unit_interval_with_margin(x: f64) -> bool {
    (-BORDER..=1.0 + BORDER).contains(&x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::Vec3;

    #[test]
    fn coordinates_follow_oblique_edges() {
        let quad = Parallelogram::new(
            DVec3::new(1.0, 2.0, 3.0),
            DVec3::new(2.0, 0.5, 0.0),
            DVec3::new(1.0, 3.0, 1.0),
        );
        let target = (quad.corner + quad.u * 0.25 + quad.v * 0.75).as_vec3();
        let origin = Vec3::new(4.0, 3.0, 20.0);
        let ray = Ray::new(origin, target - origin).to_f64();
        let hit = quad.intersect(&ray).expect("the ray should hit the quad");
        assert!((hit.t - 1.0).abs() < 1e-6);
        let surface = quad.surface_point_at_hit(&ray, &hit);
        assert!((surface.uv.as_vec2() - Vec2::new(0.25, 0.75)).length() < 1e-6);
        assert!((surface.point - target).length() < 1e-5);
        let outside = (quad.corner + quad.u * 1.01 + quad.v * 0.5).as_vec3();
        assert_eq!(quad.intersect(&Ray::new(origin, outside - origin).to_f64()), None);
    }

    #[test]
    fn parallel_and_coplanar_rays_miss() {
        let quad = Parallelogram::new(DVec3::ZERO, DVec3::X, DVec3::Y);
        for z in [0.0, 1.0] {
            let ray = Ray::new(Vec3::new(-1.0, 0.5, z), Vec3::X).to_f64();
            assert_eq!(quad.intersect(&ray), None);
        }
    }
}
