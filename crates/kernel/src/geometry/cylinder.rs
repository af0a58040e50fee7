//! Cylinders in double precision.

use std::f64::consts::{PI, TAU};

use super::disk::{BORDER, Disk};
use super::surface_of_revolution::{
    self, AxialFrame, LineInterval, LocalLine, direction_at_u, is_within_rounding_error,
    projected_area_of_normal_ring, radial_direction_toward, sine_from_cosine, u_from_direction,
};
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64};
use super::{Aabb, RayF64, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::{DVec2, DVec3, Vec2};

/// A solid cylinder between two end points, or an open tube. The front is outside. Part 0 is the side, part 1
/// is the cap at the first end, and part 2 is the cap at the second end.
///
/// On the side, u wraps around once, and v increases from 0 at the first end to 1 at the second. Images
/// appear upright and not mirrored if the first end is at the bottom. The caps are mapped like a [`Disk`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    /// Frame with its origin at the center and its axis from the first end to the second.
    frame: AxialFrame,
    half_length: f64,
    radius: f64,
    capped: bool,
}

impl SurfacePointsInF64 for Cylinder {
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let point = self.unrounded_hit_point(ray, hit);
        if hit.primitive > 0 {
            return self.cap_disk(hit.primitive).closest_point_f64(point, self.coordinate_bound());
        }
        let (out, z) = self.closest_side_direction_and_height(point);
        self.side_point_at_height_f64(out, z)
    }
}

impl Cylinder {
    /// Creates a cylinder from two end points, which must differ, and a positive radius.
    pub fn new(a: DVec3, b: DVec3, radius: f64, capped: bool) -> Self {
        let frame = AxialFrame::new((a + b) * 0.5, b - a);
        Self { frame, half_length: (b - a).length() * 0.5, radius, capped }
    }

    /// Finds the nearest hit, from outside or inside.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        self.intersect_f64(ray).map(surface_of_revolution::to_shape_hit)
    }

    fn intersect_f64(&self, ray: &RayF64) -> Option<(f64, u32)> {
        let line = self.frame.line_to_local(ray);
        let end = if self.capped { self.half_length } else { self.half_length * (1.0 + BORDER) };
        let ends = LineInterval::between_heights(&line, (-end, 1), (end, 2))?;
        let starts_on = |part| self.starts_on_part(ray, part);
        surface_of_revolution::first_hit(ray, &line, self.side_interval(&line)?, ends, self.capped, starts_on)
    }

    /// Whether a ray starts on a part, within rounding error.
    fn starts_on_part(&self, ray: &RayF64, part: u32) -> bool {
        let local = self.frame.point_to_local(ray.origin);
        let distance = match part {
            0 => local.truncate().length() - self.radius,
            _ => local.z.abs() - self.half_length,
        };
        is_within_rounding_error(distance, self.coordinate_bound())
    }

    /// Interval in which the line is inside the infinite cylinder. Uses the distance of the projected line
    /// from the axis to avoid cancellation, as for spheres (Haines, Günther, Akenine-Möller, Ray Tracing
    /// Gems, chapter 7).
    fn side_interval(&self, line: &LocalLine) -> Option<LineInterval> {
        let (p, d) = (line.foot.truncate(), line.direction.truncate());
        let factors = |distance: f64| (distance - self.radius) * (distance + self.radius);
        let (a, c) = (d.length_squared(), factors(p.length()));
        if a == 0.0 {
            return (c <= 0.0).then_some(LineInterval::WHOLE);
        }
        let b = -p.dot(d);
        let discriminant = -factors(p.perp_dot(d).abs() / a.sqrt());
        if !(discriminant >= 0.0) {
            return None;
        }
        let q = b + (a * discriminant).sqrt().copysign(b);
        let (t0, t1) = (if q == 0.0 { 0.0 } else { c / q }, q / a);
        Some(LineInterval::from_side_crossings(t0.min(t1), t0.max(t1)))
    }

    /// Hit point before rounding.
    fn unrounded_hit_point(&self, ray: &RayF64, hit: &ShapeHit) -> DVec3 {
        let line = self.frame.line_to_local(ray);
        let height = if hit.primitive == 1 { -self.half_length } else { self.half_length };
        let crossings = match hit.primitive {
            0 => self.side_interval(&line),
            cap => LineInterval::between_heights(&line, (height, cap), (height, cap)),
        };
        surface_of_revolution::unrounded_hit_point((ray, &line), hit, crossings, || self.intersect_f64(ray))
    }

    /// Surface point at a hit.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let point = self.unrounded_hit_point(ray, hit);
        if hit.primitive > 0 {
            return self.cap_disk(hit.primitive).closest_surface_point(point, self.coordinate_bound());
        }
        let (out, z) = self.closest_side_direction_and_height(point);
        let SurfacePointF64 { point, normal, reach } = self.side_point_at_height_f64(out, z);
        SurfacePoint::from_f64(
            point,
            normal,
            Vec2::new(u_from_direction(out) as f32, self.height_to_v(z) as f32),
            self.frame.vector_to_world((out.perp() * (TAU * self.radius)).extend(0.0)),
            self.frame.vector_to_world(DVec3::Z * (2.0 * self.half_length)),
            reach,
        )
    }

    /// The point on the side that is closest to `point`, as a direction from the axis and a height.
    fn closest_side_direction_and_height(&self, point: DVec3) -> (DVec2, f64) {
        let local = self.frame.point_to_local(point);
        (radial_direction_toward(local.truncate()), local.z.clamp(-self.half_length, self.half_length))
    }

    /// Computes the point on the side from a height and a direction perpendicular to the axis.
    fn side_point_at_height_f64(&self, out: DVec2, z: f64) -> SurfacePointF64 {
        SurfacePointF64 {
            point: self.frame.point_to_world((out * self.radius).extend(z)),
            normal: self.frame.vector_to_world(out.extend(0.0)),
            reach: self.coordinate_bound(),
        }
    }

    /// Texture coordinate v of a point on the side.
    fn height_to_v(&self, z: f64) -> f64 {
        0.5 + z / (2.0 * self.half_length)
    }

    /// Texture coordinates of a point on the surface.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        let local = self.frame.point_to_local(point);
        let (inwards, below) = (self.radius - local.truncate().length(), self.half_length - local.z.abs());
        if self.capped && below.abs() < inwards.abs() {
            return self.cap_disk(if local.z < 0.0 { 1 } else { 2 }).uv_at_point(point);
        }
        DVec2::new(u_from_direction(radial_direction_toward(local.truncate())), self.height_to_v(local.z))
    }

    /// Mean curvature of a part.
    pub fn mean_curvature(&self, part: u32) -> f64 {
        if part == 0 { 0.5 / self.radius } else { 0.0 }
    }

    /// Unit tangents along the axis and around it.
    pub(super) fn meridian_and_azimuth_tangents(&self, point: DVec3) -> [DVec3; 2] {
        [self.frame.axis(), self.frame.tangent_around(point)]
    }

    fn coordinate_bound(&self) -> f64 {
        self.frame.origin.abs().max_element() + self.half_length + self.radius
    }

    /// Point and unit normal on the side at the given texture coordinates.
    pub fn side_point_and_normal_from_uv(&self, u: f64, v: f64) -> (DVec3, DVec3) {
        let (out, z) = (direction_at_u(u), (2.0 * v - 1.0) * self.half_length);
        (
            self.frame.point_to_world((out * self.radius).extend(z)),
            self.frame.vector_to_world(out.extend(0.0)),
        )
    }

    /// The cap with index 1 or 2, facing outward.
    pub fn cap_disk(&self, number: u32) -> Disk {
        let side = if number == 1 { -1.0 } else { 1.0 };
        let center = self.frame.point_to_world(DVec3::Z * (side * self.half_length));
        Disk::new(center, self.frame.axis() * side, self.radius)
    }

    /// Areas of the parts.
    pub fn local_part_areas(&self) -> [f64; 3] {
        let cap = if self.capped { PI * self.radius * self.radius } else { 0.0 };
        [TAU * self.radius * 2.0 * self.half_length, cap, cap]
    }

    /// Samples a point uniformly over the area of a part.
    pub fn sample_point_on_part(&self, part: u32, u: Vec2) -> SurfaceSample {
        match part {
            0 => {
                let (point, normal) = self.side_point_and_normal_from_uv(f64::from(u.x), f64::from(u.y));
                SurfaceSample { point, normal }
            }
            cap => self.cap_disk(cap).sample_point_on_part(0, u),
        }
    }

    /// Centroid.
    pub fn centroid(&self) -> DVec3 {
        self.frame.origin
    }

    /// Projected area: the surface area facing a unit direction, weighted by the cosine.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        let along = self.frame.axis().dot(direction);
        let [side, cap, _] = self.local_part_areas();
        projected_area_of_normal_ring(side, sine_from_cosine(along), 0.0) + cap * along.abs()
    }

    /// Whether the cylinder has caps.
    pub fn is_capped(&self) -> bool {
        self.capped
    }

    /// Distance from a point to the surface.
    pub fn distance_from_point(&self, point: DVec3) -> f64 {
        let local = self.frame.point_to_local(point);
        let (across, along) = (local.truncate().length(), local.z.abs());
        let from = |dx: f64, dy: f64| DVec2::new(dx, dy).length();
        let side = from(across - self.radius, (along - self.half_length).max(0.0));
        if self.capped {
            side.min(from((across - self.radius).max(0.0), along - self.half_length))
        } else {
            side
        }
    }

    /// Whether a point is inside.
    pub fn volume_contains(&self, point: DVec3) -> bool {
        // The height test rejects most points.
        self.frame.height(point).abs() < self.half_length
            && self.frame.point_to_local(point).truncate().length() < self.radius
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        let end = |z| self.frame.circle_bounds(z, self.radius);
        end(-self.half_length).union(end(self.half_length))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::geometry::surface_of_revolution::tests::{SlenderShape, check_hits_from_afar};
    use crate::math::Vec3;

    /// A cylinder around the axis x = 1, z = 0, from y = 0 to y = 4.
    fn bar(capped: bool) -> Cylinder {
        Cylinder::new(DVec3::X, DVec3::new(1.0, 4.0, 0.0), 0.5, capped)
    }

    fn first_hit(cylinder: &Cylinder, origin: [f32; 3], direction: Vec3) -> Option<(f32, u32, Vec3)> {
        let ray = Ray::new(Vec3::from_array(origin), direction).to_f64();
        let hit = cylinder.intersect(&ray)?;
        Some((hit.t, hit.primitive, cylinder.surface_point_at_hit(&ray, &hit).normal))
    }

    #[test]
    fn side_and_caps_are_hit_from_both_sides() {
        let closed = bar(true);
        let (down, up) = (Vec3::NEG_Y, Vec3::Y);
        assert_eq!(first_hit(&closed, [-3.0, 1.0, 0.0], Vec3::X), Some((3.5, 0, Vec3::NEG_X)));
        assert_eq!(first_hit(&closed, [1.0, 1.0, 0.0], Vec3::X), Some((0.5, 0, Vec3::X)));
        assert_eq!(first_hit(&closed, [1.25, 9.0, 0.25], down), Some((5.0, 2, up)));
        assert_eq!(first_hit(&closed, [1.25, 3.0, 0.25], down), Some((3.0, 1, down)));
        assert_eq!(first_hit(&closed, [1.25, -3.0, 0.25], up), Some((3.0, 1, down)));
        assert_eq!(first_hit(&closed, [1.25, 5.0, 0.25], up), None);
        assert_eq!(first_hit(&closed, [1.6, -3.0, 0.0], up), None);
        assert_eq!(first_hit(&closed, [-3.0, 4.5, 0.0], Vec3::X), None);
    }

    #[test]
    fn rays_pass_through_open_tubes() {
        let tube = bar(false);
        assert_eq!(first_hit(&tube, [1.25, 9.0, 0.25], Vec3::NEG_Y), None);
        // The ray enters through the open upper end and hits the side from inside at x = 1.5. The front is
        // still outside.
        let slanting = first_hit(&tube, [0.5, 5.0, 0.0], Vec3::new(1.0, -2.0, 0.0));
        assert_eq!(slanting, Some((1.0, 0, Vec3::X)));
    }

    #[test]
    fn side_uvs_match_the_angle_and_the_height() {
        let ray = Ray::new(Vec3::new(9.0, 3.0, 0.0), Vec3::NEG_X).to_f64();
        let hit = bar(true).intersect(&ray).expect("aimed at it");
        let surface = bar(true).surface_point_at_hit(&ray, &hit);
        assert_eq!(surface.uv.as_vec2(), Vec2::new(0.5, 0.75));
        assert!((surface.dpdv - Vec3::Y * 4.0).length() < 1e-6);
        assert!((surface.dpdu - Vec3::NEG_Z * std::f32::consts::PI).length() < 1e-6);
        let (point, normal) = bar(true).side_point_and_normal_from_uv(0.5, 0.75);
        assert!((point - DVec3::new(1.5, 3.0, 0.0)).length() < 1e-14 && (normal - DVec3::X).length() < 1e-14);
    }

    #[test]
    fn bounds_are_tight() {
        let slanting = Cylinder::new(DVec3::ZERO, DVec3::new(3.0, 4.0, 0.0), 1.0, true).bounds();
        // A disk of radius 1 extends to √(1 − n²) along an axis.
        assert!((slanting.min - Vec3::new(-0.8, -0.6, -1.0)).abs().max_element() < 1e-6);
        assert!((slanting.max - Vec3::new(3.8, 4.6, 1.0)).abs().max_element() < 1e-6);
    }

    impl SlenderShape for Cylinder {
        fn slender(radius: f64, capped: bool) -> Self {
            Self::new(DVec3::NEG_Z, DVec3::Z, radius, capped)
        }

        fn intersect_nearest(&self, ray: &RayF64) -> Option<(f64, u32)> {
            self.intersect_f64(ray)
        }

        fn interval_inside_side(&self, ray: &RayF64) -> Option<LineInterval> {
            self.side_interval(&self.frame.line_to_local(ray))
        }

        fn unrounded_point(&self, ray: &RayF64, hit: &ShapeHit) -> DVec3 {
            self.unrounded_hit_point(ray, hit)
        }
    }

    #[test]
    fn distant_hits_use_the_correct_crossing() {
        check_hits_from_afar::<Cylinder>();
    }
}
