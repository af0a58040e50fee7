//! Tori in double precision.

mod crossing;

use std::f64::consts::{PI, TAU};

use super::surface::SurfacePoint;
use super::surface_of_revolution::{
    self, AxialFrame, LocalLine, direction_at_u, radial_direction_toward, u_from_direction, unrounded_t,
};
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64};
use super::{Aabb, RayF64, ShapeHit, SurfaceSample};
use crate::math::{DVec2, DVec3, Vec2};
use crossing::UnitTorusLine;

/// Margin around a torus, relative to the tube radius. It ensures that the searched interval of a line starts
/// outside the torus.
const MARGIN: f64 = 0.01;

/// All points whose distance from a circle around an axis equals the tube radius. The front is outside.
///
/// Texture coordinate u wraps once around the axis, and v once around the tube. On the outermost circle, v is
/// ½ and increases along the axis, so images are not mirrored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Torus {
    frame: AxialFrame,
    radius: f64,
    tube: f64,
}

impl SurfacePointsInF64 for Torus {
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let (out, from_circle) =
            self.directions_from_axis_and_circle(ray.at(unrounded_t(hit, self.intersect_f64(ray))));
        self.surface_f64_from_directions(out, from_circle)
    }
}

impl Torus {
    /// Creates a torus from its center, a nonzero axis, the radius of the circle, and the radius of the tube.
    /// Requires 0 < tube < radius.
    pub fn new(center: DVec3, axis: DVec3, radius: f64, tube: f64) -> Self {
        Self { frame: AxialFrame::new(center, axis), radius, tube }
    }

    /// Finds the nearest hit, from outside or inside.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        self.intersect_f64(ray).map(surface_of_revolution::to_shape_hit)
    }

    fn intersect_f64(&self, ray: &RayF64) -> Option<(f64, u32)> {
        let (line, unit_line, unit) = self.unit_line(ray);
        let (enter, leave) = unit_line.nearby_interval(MARGIN)?;
        let from = enter.max(-line.start / unit);
        if !(line.start + from * unit <= ray.t_max) {
            return None;
        }
        let t = line.start + unit_line.first_crossing(from, leave)? * unit;
        ray.round_t_if_in_range(t).map(|_| (t, 0))
    }

    /// The line through a ray, the same line in units of the circle's radius, and the length of that unit in
    /// terms of the ray's t.
    fn unit_line(&self, ray: &RayF64) -> (LocalLine, UnitTorusLine, f64) {
        let line = self.frame.line_to_local(ray);
        let length = line.direction.length();
        let unit_line = UnitTorusLine {
            foot: line.foot / self.radius,
            direction: line.direction / length,
            tube: self.tube / self.radius,
        };
        (line, unit_line, self.radius / length)
    }

    /// Values of t (at most two) at which a ray that starts outside enters the torus.
    pub fn entry_parameters(&self, ray: &RayF64) -> [Option<f64>; 2] {
        let (line, unit_line, unit) = self.unit_line(ray);
        let Some((enter, leave)) = unit_line.nearby_interval(MARGIN) else { return [None; 2] };
        let from = enter.max(-line.start / unit);
        unit_line.surface_entry_parameters(from, leave).map(|entry| entry.map(|s| line.start + s * unit))
    }

    /// Surface point at a hit.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let (out, from_circle) =
            self.directions_from_axis_and_circle(ray.at(unrounded_t(hit, self.intersect_f64(ray))));
        self.surface_from_directions(out, from_circle)
    }

    /// Direction of a point from the axis, and its direction from the circle in the plane through the axis.
    fn directions_from_axis_and_circle(&self, point: DVec3) -> (DVec2, DVec2) {
        let local = self.frame.point_to_local(point);
        let out = radial_direction_toward(local.truncate());
        (out, radial_direction_toward(DVec2::new(local.truncate().length() - self.radius, local.z)))
    }

    /// Texture coordinates of a point on the surface.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        let (out, from_circle) = self.directions_from_axis_and_circle(point);
        DVec2::new(u_from_direction(out), u_from_direction(from_circle))
    }

    /// Mean curvature at a point on the surface.
    pub fn mean_curvature(&self, point: DVec3) -> f64 {
        let across = self.directions_from_axis_and_circle(point).1.x;
        0.5 * (1.0 / self.tube + across / (self.radius + self.tube * across))
    }

    /// Unit tangents around the tube and around the axis.
    pub(super) fn meridian_and_azimuth_tangents(&self, point: DVec3) -> [DVec3; 2] {
        let (out, from_circle) = self.directions_from_axis_and_circle(point);
        let around_tube = self.frame.vector_to_world((out * -from_circle.y).extend(from_circle.x));
        [around_tube, self.frame.tangent_around(point)]
    }

    /// Radius of the tube.
    pub(super) fn tube_radius(&self) -> f64 {
        self.tube
    }

    /// Surface point for a direction from the axis and a direction from the circle, as returned by
    /// [`Torus::directions_from_axis_and_circle`].
    fn surface_from_directions(&self, out: DVec2, from_circle: DVec2) -> SurfacePoint {
        let (across, up) = (from_circle.x, from_circle.y);
        let ring = self.radius + self.tube * across;
        let SurfacePointF64 { point, normal, reach } = self.surface_f64_from_directions(out, from_circle);
        SurfacePoint::from_f64(
            point,
            normal,
            Vec2::new(u_from_direction(out) as f32, u_from_direction(from_circle) as f32),
            self.frame.vector_to_world((out.perp() * (TAU * ring)).extend(0.0)),
            self.frame.vector_to_world((out * -up).extend(across) * (TAU * self.tube)),
            reach,
        )
    }

    /// [`Torus::surface_from_directions`] without texture coordinates and tangents.
    fn surface_f64_from_directions(&self, out: DVec2, from_circle: DVec2) -> SurfacePointF64 {
        let (across, up) = (from_circle.x, from_circle.y);
        let ring = self.radius + self.tube * across;
        SurfacePointF64 {
            point: self.frame.point_to_world((out * ring).extend(self.tube * up)),
            normal: self.frame.vector_to_world((out * across).extend(up)),
            reach: self.coordinate_bound(),
        }
    }

    /// Point and unit normal at the given texture coordinates.
    pub fn point_and_normal_at_uv(&self, u: f64, v: f64) -> (DVec3, DVec3) {
        let (out, from_circle) = (direction_at_u(u), direction_at_u(v));
        let normal = (out * from_circle.x).extend(from_circle.y);
        (
            self.frame.point_to_world((out * self.radius).extend(0.0) + normal * self.tube),
            self.frame.vector_to_world(normal),
        )
    }

    fn coordinate_bound(&self) -> f64 {
        self.frame.origin.abs().max_element() + self.radius + self.tube
    }

    /// Samples a point uniformly over the area. The tube angle ψ has a pdf proportional to 1 +
    /// (tube/radius)·cos ψ. The pdf values at ψ and at the mirrored angle π − ψ have a constant sum, so a
    /// uniformly distributed ψ is either kept or mirrored, with probabilities proportional to these values.
    pub fn sample_point_on_part(&self, _: u32, u: Vec2) -> SurfaceSample {
        let (x, y) = (f64::from(u.x), f64::from(u.y));
        // cos ψ at v = y, where ψ = 0 corresponds to v = ½.
        let share = 0.5 - 0.5 * (self.tube / self.radius) * libm::cos(2.0 * PI * y);
        let (point, normal) = if x < share {
            self.point_and_normal_at_uv(x / share, y)
        } else {
            self.point_and_normal_at_uv((x - share) / (1.0 - share), 1.5 - y)
        };
        SurfaceSample { point, normal }
    }

    /// Signed distance to the surface, negative inside.
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        let p = self.frame.point_to_local(point);
        DVec2::new(p.truncate().length() - self.radius, p.z).length() - self.tube
    }

    /// Unit vector along the axis.
    pub fn axis(&self) -> DVec3 {
        self.frame.axis()
    }

    /// Radii of the circle and of the tube.
    pub fn radii(&self) -> (f64, f64) {
        (self.radius, self.tube)
    }

    /// Centroid.
    pub fn centroid(&self) -> DVec3 {
        self.frame.origin
    }

    /// Distance from a point to the surface.
    pub fn distance_from_point(&self, point: DVec3) -> f64 {
        let local = self.frame.point_to_local(point);
        let from_circle = DVec2::new(local.truncate().length() - self.radius, local.z).length();
        (from_circle - self.tube).abs()
    }

    /// Whether a point is inside.
    pub fn volume_contains(&self, point: DVec3) -> bool {
        self.signed_distance(point) < 0.0
    }

    /// Projected area averaged over all directions, which is a quarter of the area.
    pub fn projected_area(&self, _: DVec3) -> f64 {
        let [area] = self.local_part_areas();
        area / 4.0
    }

    /// Area of each part.
    pub fn local_part_areas(&self) -> [f64; 1] {
        [4.0 * PI * PI * self.radius * self.tube]
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        self.frame.sphere_swept_circle_bounds(0.0, self.radius, self.tube)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::math::Vec3;

    /// A torus around the y axis that extends from radius 1.5 to 2.5.
    fn ring() -> Torus {
        Torus::new(DVec3::ZERO, DVec3::Y * 7.0, 2.0, 0.5)
    }

    fn first_hit(origin: [f32; 3], direction: Vec3) -> Option<(f32, Vec3)> {
        let ray = Ray::new(Vec3::from_array(origin), direction).to_f64();
        let hit = ring().intersect(&ray)?;
        Some((hit.t, ring().surface_point_at_hit(&ray, &hit).normal))
    }

    #[test]
    fn lines_through_the_center_have_four_roots() {
        for (x, expected) in [
            (-9.0, Some((6.5, Vec3::NEG_X))),
            (-2.0, Some((0.5, Vec3::X))),
            (0.0, Some((1.5, Vec3::NEG_X))),
            (2.25, Some((0.25, Vec3::X))),
            (2.75, None),
        ] {
            assert_eq!(first_hit([x, 0.0, 0.0], Vec3::X), expected, "from {x}");
        }
    }

    #[test]
    fn entries_are_complete_and_in_order() {
        let entries = |origin: Vec3, direction: Vec3| {
            ring()
                .entry_parameters(&Ray::new(origin, direction).to_f64())
                .map(|entry| entry.map(|t| t as f32))
        };
        let x = |x: f32| Vec3::new(x, 0.0, 0.0);
        assert_eq!(entries(x(-9.0), Vec3::X), [Some(6.5), Some(10.5)]);
        assert_eq!(entries(x(0.0), Vec3::X), [Some(1.5), None]);
        assert_eq!(entries(x(-9.0), Vec3::NEG_X), [None; 2]);
        assert_eq!(entries(Vec3::new(2.0, 9.0, 0.0), Vec3::NEG_Y), [Some(8.5), None]);
        // Rays along x. One passes through the tube on both sides of the hole, the other only through its
        // outer part.
        let [first, second] = entries(Vec3::new(-9.0, 0.0, 1.0), Vec3::X);
        assert!((first.expect("first entry") - (9.0 - 5.25_f32.sqrt())).abs() < 1e-5);
        assert!((second.expect("second entry") - (9.0 + 1.25_f32.sqrt())).abs() < 1e-5);
        assert_eq!(entries(Vec3::new(-9.0, 0.0, 1.8), Vec3::X)[1], None);
    }

    #[test]
    fn lines_along_the_axis_hit_only_the_tube() {
        assert_eq!(first_hit([0.0, 9.0, 0.0], Vec3::NEG_Y), None);
        assert_eq!(first_hit([1.499, 9.0, 0.0], Vec3::NEG_Y), None);
        assert_eq!(first_hit([2.0, 9.0, 0.0], Vec3::NEG_Y), Some((8.5, Vec3::Y)));
        assert_eq!(first_hit([2.0, 0.25, 0.0], Vec3::NEG_Y), Some((0.75, Vec3::NEG_Y)));
        assert_eq!(first_hit([2.501, 9.0, 0.0], Vec3::NEG_Y), None);
    }

    #[test]
    fn rays_do_not_rehit_their_origin() {
        assert_eq!(first_hit([2.5, 0.0, 0.0], Vec3::X), None);
        assert_eq!(first_hit([2.5, 0.0, 0.0], Vec3::NEG_X).map(|hit| hit.0), Some(1.0));
        assert_eq!(first_hit([1.5, 0.0, 0.0], Vec3::NEG_X).map(|hit| hit.0), Some(3.0));
    }

    #[test]
    fn v_is_one_half_on_the_outermost_circle() {
        let ray = Ray::new(Vec3::new(9.0, 0.0, 0.0), Vec3::NEG_X).to_f64();
        let hit = ring().intersect(&ray).expect("the ray should hit the torus");
        let surface = ring().surface_point_at_hit(&ray, &hit);
        let pi = std::f32::consts::PI;
        assert_eq!(surface.uv.as_vec2(), Vec2::splat(0.5));
        assert!((surface.dpdu - Vec3::NEG_Z * (5.0 * pi)).length() < 1e-5);
        assert!((surface.dpdv - Vec3::Y * pi).length() < 1e-5);
        let (point, normal) = ring().point_and_normal_at_uv(0.5, 0.75);
        assert!((point - DVec3::new(2.0, 0.5, 0.0)).length() < 1e-14 && (normal - DVec3::Y).length() < 1e-14);
    }

    #[test]
    fn bounds_are_tight() {
        let slanting = Torus::new(DVec3::ZERO, DVec3::new(3.0, 4.0, 0.0), 2.0, 0.5).bounds();
        for corner in [-slanting.min, slanting.max] {
            assert!((corner - Vec3::new(2.1, 1.7, 2.5)).abs().max_element() < 1e-6);
        }
    }
}
