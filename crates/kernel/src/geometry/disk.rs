//! Disks in double precision.

use std::f64::consts::PI;

use super::local_geometry::{FlatOrRoundExtent, NearbyGeometry, NearestSurface};
use super::packet::{F32x16, HitPacket, RayPacket, round_t_to_f32_or_nan};
use super::surface_of_revolution::{AxialFrame, to_shape_hit, unrounded_t};
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64};
use super::{Aabb, RayF64, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::{DVec2, DVec3, Vec2};
use crate::sampling::warp;

/// Margin around a border, relative to the size of the shape. It closes gaps between surfaces that share the
/// border, and is far below the resolution of `f32` rays.
pub const BORDER: f64 = 1e-14;

/// A flat disk. Texture coordinates span the enclosing square, with (½, ½) at the center. Images are upright
/// on a vertical disk. On a horizontal disk that faces up, their tops point toward −z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    frame: AxialFrame,
    radius: f64,
}

impl SurfacePointsInF64 for Disk {
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        self.closest_point_f64(ray.at(unrounded_t(hit, self.intersect_f64(ray))), self.coordinate_bound())
    }
}

impl Disk {
    /// Creates a disk from its center, the nonzero normal of its front, and a positive radius.
    pub fn new(center: DVec3, normal: DVec3, radius: f64) -> Self {
        Self { frame: AxialFrame::new(center, normal), radius }
    }

    /// Intersects the plane and checks that the hit is inside the border. Returns `None` for rays in the
    /// plane.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        self.intersect_f64(ray).map(to_shape_hit)
    }

    /// [`Disk::intersect`] for a packet.
    #[inline(always)]
    pub fn intersect_packet(&self, rays: &RayPacket, ends: &F32x16, hits: &mut HitPacket) {
        let radius = self.radius * (1.0 + BORDER);
        for (lane, &end) in ends.iter().enumerate() {
            let line = self.frame.line_to_local(&rays.ray_f64(lane));
            let along = -line.foot.z / line.direction.z;
            let across = (line.foot + line.direction * along).truncate().length();
            let t = round_t_to_f32_or_nan(line.start + along, end);
            hits.t[lane] = if across <= radius { t } else { f32::NAN };
        }
    }

    fn intersect_f64(&self, ray: &RayF64) -> Option<(f64, u32)> {
        let line = self.frame.line_to_local(ray);
        let along = -line.foot.z / line.direction.z;
        let across = (line.foot + line.direction * along).truncate().length();
        let t = line.start + along;
        (across <= self.radius * (1.0 + BORDER) && ray.round_t_if_in_range(t).is_some()).then_some((t, 0))
    }

    /// Surface point at a hit.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let t = unrounded_t(hit, self.intersect_f64(ray));
        self.closest_surface_point(ray.at(t), self.coordinate_bound())
    }

    /// Surface point nearest to `point`. `reach` is an upper bound on the magnitudes of the lengths used to
    /// compute `point`.
    pub fn closest_surface_point(&self, point: DVec3, reach: f64) -> SurfacePoint {
        let SurfacePointF64 { point: near, normal, .. } = self.closest_point_f64(point, reach);
        let edge = 2.0 * self.radius;
        let [across, up] = [DVec3::X, DVec3::Y].map(|axis| self.frame.vector_to_world(axis * edge));
        SurfacePoint::from_f64(near, normal, self.uv_at_point(point).as_vec2(), across, up, reach)
    }

    /// Point on the disk nearest to `point`, before rounding. `reach` is an upper bound on the magnitudes of
    /// the lengths used to compute `point`.
    pub fn closest_point_f64(&self, point: DVec3, reach: f64) -> SurfacePointF64 {
        let (p, _) = self.nearest_local_point_and_uv(point);
        SurfacePointF64 { point: self.frame.point_to_world(p.extend(0.0)), normal: self.normal(), reach }
    }

    fn coordinate_bound(&self) -> f64 {
        self.frame.origin.abs().max_element() + self.radius
    }

    /// Plane coordinates of the nearest point on the disk, and its texture coordinates.
    fn nearest_local_point_and_uv(&self, point: DVec3) -> (DVec2, DVec2) {
        let p = self.frame.point_to_local(point).truncate().clamp_length_max(self.radius);
        (p, DVec2::splat(0.5) + p / (2.0 * self.radius))
    }

    /// Texture coordinates of a point on the disk.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        self.nearest_local_point_and_uv(point).1
    }

    /// Maps a point from the unit disk to this disk.
    pub fn point_from_unit_disk(&self, of_unit_disk: DVec2) -> DVec3 {
        self.frame.point_to_world((of_unit_disk * self.radius).extend(0.0))
    }

    /// Centroid.
    pub fn centroid(&self) -> DVec3 {
        self.frame.origin
    }

    /// Radius of the disk.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Unit normal on the front side.
    pub fn normal(&self) -> DVec3 {
        self.frame.axis()
    }

    /// Area of each part.
    pub fn local_part_areas(&self) -> [f64; 1] {
        [PI * self.radius * self.radius]
    }

    /// Samples a point uniformly over the area.
    pub fn sample_point_on_part(&self, _: u32, u: Vec2) -> SurfaceSample {
        SurfaceSample { point: self.point_from_unit_disk(warp::disk(u).as_dvec2()), normal: self.normal() }
    }

    /// Distance from a point to the disk.
    pub fn distance_from_point(&self, point: DVec3) -> f64 {
        let local = self.frame.point_to_local(point);
        DVec2::new((local.truncate().length() - self.radius).max(0.0), local.z).length()
    }

    /// The polygons or the surface of the disk near a point, for density estimation.
    pub fn polygons_or_surface_near(&self, point: DVec3) -> NearbyGeometry {
        let (normal, from) = (self.normal(), point - self.centroid());
        let extent = FlatOrRoundExtent::Flat(self.radius - from.length());
        let ground = NearestSurface { normal, height: from.dot(normal).abs(), extent };
        NearbyGeometry::Surface { distance: self.distance_from_point(point), ground: Some(ground) }
    }

    /// Whether a point is inside. Always false because a disk has no volume.
    pub fn volume_contains(&self, _: DVec3) -> bool {
        false
    }

    /// Projected area of the front: the area times the cosine of the angle between the normal and a unit
    /// direction.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        let [area] = self.local_part_areas();
        area * self.normal().dot(direction).max(0.0)
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        self.frame.circle_bounds(0.0, self.radius)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::{Vec2, Vec3};

    #[test]
    fn hits_from_both_sides_are_inside_the_border() {
        let disk = Disk::new(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.0, 0.0, 4.0), 0.5);
        for (x, is_hit) in [(0.0, true), (0.5, true), (-0.5, true), (0.500_001, false)] {
            for z in [-2.0_f32, 2.0] {
                let ray = Ray::new(Vec3::new(1.0 + x, 2.0, 3.0 + z), Vec3::new(0.0, 0.0, -z)).to_f64();
                assert_eq!(disk.intersect(&ray).map(|hit| hit.t), is_hit.then_some(1.0), "{x} {z}");
            }
        }
        let coplanar = Ray::new(Vec3::new(-4.0, 2.0, 3.0), Vec3::X).to_f64();
        assert_eq!(disk.intersect(&coplanar), None);
    }

    #[test]
    fn images_are_upright() {
        let disk = Disk::new(DVec3::ZERO, DVec3::Z, 2.0);
        let ray = Ray::new(Vec3::new(1.0, -0.5, 5.0), Vec3::NEG_Z).to_f64();
        let hit = disk.intersect(&ray).expect("the ray should hit the disk");
        let surface = disk.surface_point_at_hit(&ray, &hit);
        assert_eq!((surface.uv.as_vec2(), surface.normal), (Vec2::new(0.75, 0.375), Vec3::Z));
        assert_eq!((surface.dpdu, surface.dpdv), (Vec3::X * 4.0, Vec3::Y * 4.0));
    }

    #[test]
    fn bounds_are_tight() {
        let disk = Disk::new(DVec3::new(5.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.0), 1.0);
        let (bounds, half) = (disk.bounds(), 0.5_f32.sqrt());
        assert!((bounds.min - Vec3::new(5.0 - half, -half, -1.0)).abs().max_element() < 2e-6);
        assert!((bounds.max - Vec3::new(5.0 + half, half, 1.0)).abs().max_element() < 2e-6);
        assert!(bounds.max.z > 1.0 && bounds.min.y < -half);
    }
}
