//! Infinite planes in double precision.

use super::local_geometry::{FlatOrRoundExtent, NearbyGeometry, NearestSurface};
use super::packet::{
    F32x16, HitPacket, PACKET_SIZE, RayPacket, can_quotient_be_in_range, round_t_to_f32_or_nan,
};
use super::surface::tangents_from_normal;
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64, UvMapped};
use super::{RayF64, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::lanes::{Simd, TRUE};
use crate::math::{DVec2, DVec3, Vec2};

/// All points p with (p − point)·normal = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point on the plane. Its texture coordinates are (0, 0).
    pub point: DVec3,
    /// Unit normal on the front side.
    normal: DVec3,
    u: DVec3,
    v: DVec3,
}

impl Plane {
    /// Creates a plane from a point and a nonzero normal.
    pub fn new(point: DVec3, normal: DVec3) -> Self {
        let normal = normal.normalize();
        let (u, v) = tangents_from_normal(normal);
        Self { point, normal, u, v }
    }

    /// Intersects the plane. Returns `None` for rays that are in the plane or parallel to it.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        let t = self.normal.dot(self.point - ray.origin) / self.normal.dot(ray.direction);
        (t < f64::from(f32::MAX)).then(|| ray.round_t_if_in_range(t)).flatten().map(ShapeHit::from_t)
    }

    /// [`Plane::intersect`] for a packet.
    #[inline(always)]
    pub fn intersect_packet(&self, rays: &RayPacket, ends: &F32x16, hits: &mut HitPacket, simd: impl Simd) {
        let (mut above, mut along, mut may_hit) = ([0.0; PACKET_SIZE], [0.0; PACKET_SIZE], [0; PACKET_SIZE]);
        for lane in 0..PACKET_SIZE {
            let ray = rays.ray_f64(lane);
            above[lane] = self.normal.dot(self.point - ray.origin);
            along[lane] = self.normal.dot(ray.direction);
            may_hit[lane] =
                if can_quotient_be_in_range(above[lane], along[lane], ends[lane]) { TRUE } else { 0 };
        }
        if simd.movemask(&may_hit) == 0 {
            return;
        }
        for lane in 0..PACKET_SIZE {
            let t = above[lane] / along[lane];
            let accepted = round_t_to_f32_or_nan(t, ends[lane]);
            hits.t[lane] = if t < f64::from(f32::MAX) { accepted } else { f32::NAN };
        }
    }

    /// Surface point at a hit. Each texture tile has an edge length of 1.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let SurfacePointF64 { point, normal, reach } = self.surface_point_f64(ray, hit);
        let uv = self.uv_at_hit(ray, hit);
        SurfacePoint { uv, ..SurfacePoint::from_f64(point, normal, uv.as_vec2(), self.u, self.v, reach) }
    }

    /// Coordinates of a hit along the plane's axes.
    #[inline(always)]
    fn coordinates_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> [f64; 2] {
        self.coordinates_of(ray.at(f64::from(hit.t)))
    }

    #[inline(always)]
    fn coordinates_of(&self, point: DVec3) -> [f64; 2] {
        let offset = point - self.point;
        [offset.dot(self.u), offset.dot(self.v)]
    }

    /// Texture coordinates of a point on the plane.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        DVec2::from_array(self.coordinates_of(point))
    }

    /// Areas of the parts. The array is empty because a plane's area is infinite.
    pub fn local_part_areas(&self) -> [f64; 0] {
        []
    }

    /// Returns the plane's reference point because an infinite area cannot be sampled uniformly.
    pub fn sample_point_on_part(&self, _: u32, _: Vec2) -> SurfaceSample {
        SurfaceSample { point: self.point, normal: self.normal }
    }

    /// The plane's reference point.
    pub fn centroid(&self) -> DVec3 {
        self.point
    }

    /// Unit normal on the front side.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Distance from a point to the plane.
    pub fn unsigned_distance(&self, point: DVec3) -> f64 {
        (point - self.point).dot(self.normal).abs()
    }

    /// The polygons or the surface of the plane near a point, for density estimation.
    pub fn polygons_or_surface_near(&self, point: DVec3) -> NearbyGeometry {
        let distance = self.unsigned_distance(point);
        let ground = NearestSurface {
            normal: self.normal,
            height: distance,
            extent: FlatOrRoundExtent::Flat(f64::INFINITY),
        };
        NearbyGeometry::Surface { distance, ground: Some(ground) }
    }

    /// Whether a point is inside. Unlike [`Plane::is_behind`], this is always false.
    pub fn volume_contains(&self, _: DVec3) -> bool {
        false
    }

    /// Whether a point is behind the plane.
    pub fn is_behind(&self, point: DVec3) -> bool {
        self.normal.dot(point - self.point) < 0.0
    }

    /// Projected area of the front, which is infinite if the front faces `direction` and 0 otherwise.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        if self.normal.dot(direction) > 0.0 { f64::INFINITY } else { 0.0 }
    }
}

impl SurfacePointsInF64 for Plane {
    #[inline(always)]
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let [s, t] = self.coordinates_at_hit(ray, hit);
        let reach = self.point.abs().max_element() + s.abs() + t.abs();
        SurfacePointF64 { point: self.point + self.u * s + self.v * t, normal: self.normal, reach }
    }
}

impl UvMapped for Plane {
    #[inline(always)]
    fn uv_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> DVec2 {
        DVec2::from_array(self.coordinates_at_hit(ray, hit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::Vec3;

    #[test]
    fn rays_hit_once_or_never() {
        let floor = Plane::new(DVec3::new(0.0, 1.0, 0.0), DVec3::new(0.0, 5.0, 0.0));
        let down = Ray::new(Vec3::new(2.25, 3.0, -1.5), Vec3::NEG_Y).to_f64();
        let hit = floor.intersect(&down).expect("the ray should hit the floor");
        assert_eq!(hit.t, 2.0);
        let surface = floor.surface_point_at_hit(&down, &hit);
        assert_eq!((surface.point, surface.uv.as_vec2()), (Vec3::new(2.25, 1.0, -1.5), Vec2::new(2.25, 1.5)));
        for parallel in [Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 2.0, 0.0)] {
            assert_eq!(floor.intersect(&Ray::new(parallel, Vec3::X).to_f64()), None);
        }
    }
}
