//! Cones in double precision.

use std::f64::consts::{PI, TAU};

use super::disk::{BORDER, Disk};
use super::surface_of_revolution::{
    self, AxialFrame, LineInterval, LocalLine, direction_at_u, is_within_rounding_error,
    projected_area_of_normal_ring, radial_direction_toward, sine_from_cosine, u_from_direction,
};
use super::surface_packet::{SurfacePointF64, SurfacePointsInF64};
use super::{Aabb, RayF64, ShapeHit, SurfacePoint, SurfaceSample};
use crate::math::{DVec2, DVec3, Vec2};

/// A cone with a round base, or only its side. The front is outside. Part 0 is the side and part 1 is the cap
/// at the base.
///
/// On the side, u wraps around once, and v increases from 0 at the base to 1 at the tip. Images appear
/// upright and not mirrored if the base is at the bottom. The cap is mapped like a [`Disk`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Frame with its origin at the tip and its axis toward the base.
    frame: AxialFrame,
    height: f64,
    radius: f64,
    /// Length of the side from the tip to the base's rim.
    slant: f64,
    capped: bool,
}

impl SurfacePointsInF64 for Cone {
    fn surface_point_f64(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePointF64 {
        let point = self.unrounded_hit_point(ray, hit);
        if hit.primitive > 0 {
            return self.base_disk().closest_point_f64(point, self.coordinate_bound());
        }
        let local = self.frame.point_to_local(point);
        self.side_point_from_slant_f64(
            radial_direction_toward(local.truncate()),
            self.slant_vector_and_tip_distance(local),
        )
    }
}

impl Cone {
    /// Creates a cone from its base center, its tip, and its base radius. The tip must not be the base
    /// center, and the radius must be positive.
    pub fn new(base: DVec3, tip: DVec3, radius: f64, capped: bool) -> Self {
        let height = (base - tip).length();
        let slant = libm::hypot(height, radius);
        Self { frame: AxialFrame::new(tip, base - tip), height, radius, slant, capped }
    }

    /// Finds the nearest hit, from outside or inside.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        self.intersect_f64(ray).map(surface_of_revolution::to_shape_hit)
    }

    fn intersect_f64(&self, ray: &RayF64) -> Option<(f64, u32)> {
        let line = self.frame.line_to_local(ray);
        let base = if self.capped { self.height } else { self.height * (1.0 + BORDER) };
        let ends = LineInterval::between_heights(&line, (0.0, 0), (base, 1))?;
        let starts_on = |part| self.starts_on_part(ray, part);
        surface_of_revolution::first_hit(
            ray,
            &line,
            self.double_cone_interval(&line)?,
            ends,
            self.capped,
            starts_on,
        )
    }

    /// Whether a ray starts on a part, within rounding error.
    fn starts_on_part(&self, ray: &RayF64, part: u32) -> bool {
        let local = self.frame.point_to_local(ray.origin);
        let distance = match part {
            0 => (local.truncate().length() * self.height - local.z * self.radius) / self.slant,
            _ => local.z - self.height,
        };
        is_within_rounding_error(distance, self.coordinate_bound())
    }

    /// Interval in which the line is inside the double cone |p| ≤ k|z|, which extends past the base and the
    /// tip. The quadratic A·s² − 2B·s + C is relative to the point on the line that is closest to the tip, so
    /// B is a single product. B² − AC is computed as a difference of squares of the line's moment about the
    /// tip, which is precise even for lines that graze the side near the tip.
    fn double_cone_interval(&self, line: &LocalLine) -> Option<LineInterval> {
        let k = self.radius / self.height;
        let (p, d) = (line.foot, line.direction);
        let factors = |x: DVec3| {
            let (across, along) = (x.truncate().length(), k * x.z.abs());
            (across - along) * (across + along)
        };
        let (a, b, c) = (factors(d), (1.0 + k * k) * p.z * d.z, factors(p));
        let moment = p.cross(d);
        let discriminant = factors(DVec3::new(k * moment.x, k * moment.y, moment.z / k));
        let crosses_both = a <= 0.0;
        if discriminant.is_nan() || discriminant < 0.0 && !crosses_both {
            return None;
        }
        let q = b + discriminant.max(0.0).sqrt().copysign(b);
        // A line parallel to the side crosses it once. Put the other root at infinity, on the same side as
        // for slightly steeper lines.
        let a = if a == 0.0 { -0.0 } else { a };
        let (s0, s1) = if q == 0.0 { (0.0, 0.0) } else { (c / q, q / a) };
        Some(match (crosses_both, d.z > 0.0) {
            (false, _) => LineInterval::from_side_crossings(s0.min(s1), s0.max(s1)),
            (true, true) => LineInterval::from_side_crossings(s0.max(s1), f64::INFINITY),
            (true, false) => LineInterval::from_side_crossings(f64::NEG_INFINITY, s0.min(s1)),
        })
    }

    /// Hit point before rounding.
    fn unrounded_hit_point(&self, ray: &RayF64, hit: &ShapeHit) -> DVec3 {
        let line = self.frame.line_to_local(ray);
        let crossings = match hit.primitive {
            0 => self.double_cone_interval(&line),
            cap => LineInterval::between_heights(&line, (self.height, cap), (self.height, cap)),
        };
        surface_of_revolution::unrounded_hit_point((ray, &line), hit, crossings, || self.intersect_f64(ray))
    }

    /// Surface point at a hit.
    pub fn surface_point_at_hit(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let point = self.unrounded_hit_point(ray, hit);
        if hit.primitive > 0 {
            return self.base_disk().closest_surface_point(point, self.coordinate_bound());
        }
        let local = self.frame.point_to_local(point);
        let out = radial_direction_toward(local.truncate());
        let (down, along) = self.slant_vector_and_tip_distance(local);
        let around = out.perp() * (-TAU * down.x * along);
        let SurfacePointF64 { point, normal, reach } = self.side_point_from_slant_f64(out, (down, along));
        SurfacePoint::from_f64(
            point,
            normal,
            Vec2::new(u_from_direction(mirror_y(out)) as f32, (1.0 - along / self.slant) as f32),
            self.frame.vector_to_world(around.extend(0.0)),
            self.frame.vector_to_world((out * -self.radius).extend(-self.height)),
            reach,
        )
    }

    /// Computes the point on the side from a direction perpendicular to the axis and the result of
    /// [`Cone::slant_vector_and_tip_distance`].
    fn side_point_from_slant_f64(&self, out: DVec2, (down, along): (DVec2, f64)) -> SurfacePointF64 {
        SurfacePointF64 {
            point: self.frame.point_to_world((out * (down.x * along)).extend(down.y * along)),
            normal: self.frame.vector_to_world((out * down.y).extend(-down.x)),
            reach: self.coordinate_bound(),
        }
    }

    /// Unit vector down the side from the tip, as (outward, along the axis), and the distance of `local` from
    /// the tip along the side.
    fn slant_vector_and_tip_distance(&self, local: DVec3) -> (DVec2, f64) {
        let down = DVec2::new(self.radius, self.height) / self.slant;
        (down, DVec2::new(local.truncate().length(), local.z).dot(down).clamp(0.0, self.slant))
    }

    /// Texture coordinates of a point on the surface.
    pub fn uv_at_point(&self, point: DVec3) -> DVec2 {
        let local = self.frame.point_to_local(point);
        let (across, below) = (local.truncate().length(), self.height - local.z);
        let off_side = (across * self.height - local.z * self.radius) / self.slant;
        if self.capped && below.abs() < off_side.abs() {
            return self.base_disk().uv_at_point(point);
        }
        let (_, along) = self.slant_vector_and_tip_distance(local);
        DVec2::new(
            u_from_direction(mirror_y(radial_direction_toward(local.truncate()))),
            1.0 - along / self.slant,
        )
    }

    /// Mean curvature at a point on a part. The side curves only around the axis, and its curvature is
    /// unbounded at the tip.
    pub fn mean_curvature(&self, part: u32, point: DVec3) -> f64 {
        let across = self.frame.point_to_local(point).truncate().length();
        if part == 0 && across > 0.0 { 0.5 * self.height / (self.slant * across) } else { 0.0 }
    }

    /// Unit tangents of the side, pointing away from the tip and around the axis.
    pub(super) fn meridian_and_azimuth_tangents(&self, point: DVec3) -> [DVec3; 2] {
        let along = (point - self.frame.origin).normalize_or(self.frame.axis());
        [along, self.frame.tangent_around(point)]
    }

    fn coordinate_bound(&self) -> f64 {
        self.frame.origin.abs().max_element() + self.height + self.radius
    }

    /// Point and unit normal on the side at the given texture coordinates.
    pub fn side_point_and_normal_from_uv(&self, u: f64, v: f64) -> (DVec3, DVec3) {
        let out = mirror_y(direction_at_u(u));
        let point = (out * self.radius).extend(self.height) * (1.0 - v);
        let normal = (out * self.height).extend(-self.radius) / self.slant;
        (self.frame.point_to_world(point), self.frame.vector_to_world(normal))
    }

    /// The cap, facing outward.
    pub fn base_disk(&self) -> Disk {
        Disk::new(self.frame.point_to_world(DVec3::Z * self.height), self.frame.axis(), self.radius)
    }

    /// Areas of the parts.
    pub fn local_part_areas(&self) -> [f64; 2] {
        let cap = if self.capped { PI * self.radius * self.radius } else { 0.0 };
        [PI * self.radius * self.slant, cap]
    }

    /// Samples a point uniformly over the area of a part.
    pub fn sample_point_on_part(&self, part: u32, u: Vec2) -> SurfaceSample {
        match part {
            0 => {
                let (point, normal) =
                    self.side_point_and_normal_from_uv(f64::from(u.x), 1.0 - (1.0 - f64::from(u.y)).sqrt());
                SurfaceSample { point, normal }
            }
            _ => self.base_disk().sample_point_on_part(0, u),
        }
    }

    /// Centroid of the surface.
    pub fn centroid(&self) -> DVec3 {
        let [side, cap] = self.local_part_areas();
        self.frame.point_to_world(DVec3::Z * (self.height * (side * 2.0 / 3.0 + cap) / (side + cap)))
    }

    /// Projected area: the surface area facing a unit direction, weighted by the cosine.
    pub fn projected_area(&self, direction: DVec3) -> f64 {
        let along = self.frame.axis().dot(direction);
        let [side, cap] = self.local_part_areas();
        // Components of the side's normals perpendicular to the axis and toward the tip.
        let (cosine, sine) = (self.height / self.slant, self.radius / self.slant);
        projected_area_of_normal_ring(side, cosine * sine_from_cosine(along), -sine * along)
            + cap * along.max(0.0)
    }

    /// The tip.
    pub fn tip(&self) -> DVec3 {
        self.frame.origin
    }

    /// Whether the cone has a cap.
    pub fn is_capped(&self) -> bool {
        self.capped
    }

    /// Distance from a point to the surface.
    pub fn distance_from_point(&self, point: DVec3) -> f64 {
        let local = self.frame.point_to_local(point);
        let point = DVec2::new(local.truncate().length(), local.z);
        let rim = DVec2::new(self.radius, self.height);
        let along = (point.dot(rim) / rim.length_squared()).clamp(0.0, 1.0);
        let side = (point - rim * along).length();
        let cap = DVec2::new((point.x - self.radius).max(0.0), point.y - self.height).length();
        if self.capped { side.min(cap) } else { side }
    }

    /// Whether a point is inside.
    pub fn volume_contains(&self, point: DVec3) -> bool {
        let p = self.frame.point_to_local(point);
        p.z < self.height && p.truncate().length() < self.radius / self.height * p.z
    }

    /// Bounding box.
    pub fn bounds(&self) -> Aabb {
        self.frame.circle_bounds(0.0, 0.0).union(self.frame.circle_bounds(self.height, self.radius))
    }
}

/// Mirrors a point, because angles are measured about the axis from base to tip, but the frame's axis points
/// from tip to base.
fn mirror_y(p: DVec2) -> DVec2 {
    DVec2::new(p.x, -p.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::geometry::surface_of_revolution::tests::{SlenderShape, check_hits_from_afar};
    use crate::math::Vec3;

    /// A cone with its tip at y = 2 and a base of radius 1 at y = 0.
    fn hat(capped: bool) -> Cone {
        Cone::new(DVec3::ZERO, DVec3::Y * 2.0, 1.0, capped)
    }

    fn first_hit(cone: &Cone, origin: [f32; 3], direction: Vec3) -> Option<(f32, u32, Vec3)> {
        let ray = Ray::new(Vec3::from_array(origin), direction).to_f64();
        let hit = cone.intersect(&ray)?;
        Some((hit.t, hit.primitive, cone.surface_point_at_hit(&ray, &hit).normal))
    }

    #[test]
    fn side_and_base_are_hit_from_both_sides() {
        let right = Vec3::new(2.0, 1.0, 0.0).normalize();
        let closed = hat(true);
        assert_eq!(first_hit(&closed, [9.0, 1.0, 0.0], Vec3::NEG_X), Some((8.5, 0, right)));
        assert_eq!(first_hit(&closed, [0.0, 1.0, 0.0], Vec3::X), Some((0.5, 0, right)));
        assert_eq!(first_hit(&closed, [0.5, -3.0, 0.0], Vec3::Y), Some((3.0, 1, Vec3::NEG_Y)));
        assert_eq!(first_hit(&closed, [0.5, 0.5, 0.0], Vec3::NEG_Y), Some((0.5, 1, Vec3::NEG_Y)));
        assert_eq!(first_hit(&closed, [0.5, 5.0, 0.0], Vec3::NEG_Y), Some((4.0, 0, right)));
        // The mirrored cone beyond the tip must not be hit.
        assert_eq!(first_hit(&closed, [-9.0, 3.0, 0.0], Vec3::X), None);
        assert_eq!(first_hit(&closed, [0.5, 2.5, 0.0], Vec3::Y), None);
    }

    #[test]
    fn lines_parallel_to_the_side_cross_it_once() {
        // The direction (−1, 2) is parallel to the left side. The ray passes through the right side and the
        // base.
        let slope = Vec3::new(-1.0, -2.0, 0.0);
        let right = Vec3::new(2.0, 1.0, 0.0).normalize();
        for capped in [true, false] {
            let into = first_hit(&hat(capped), [2.5, 5.0, 0.0], slope);
            assert_eq!(into, Some((2.0, 0, right)), "{capped}");
        }
        assert_eq!(first_hit(&hat(false), [-0.5, -1.0, 0.0], -slope), Some((1.0, 0, right)));
        assert_eq!(first_hit(&hat(false), [-1.5, 1.0, 0.0], slope), None);
        assert_eq!(first_hit(&hat(true), [-1.5, 1.0, 0.0], slope), None);
    }

    #[test]
    fn rays_near_the_tip_are_classified_precisely() {
        // Hits and misses are classified correctly to 1e-5 of the radius, however close to the tip the ray
        // passes.
        for below in [1e-3_f64, 1e-6, 1e-9] {
            let radius = below / 2.0;
            for (factor, is_hit) in [(1.0 - 1e-5, true), (1.0 + 1e-5, false)] {
                let origin = DVec3::new(radius * factor, 2.0 - below, -5.0);
                let ray = RayF64 { origin, direction: DVec3::Z, t_max: f64::INFINITY };
                assert_eq!(hat(true).intersect(&ray).is_some(), is_hit, "{below} {factor}");
            }
        }
    }

    #[test]
    fn v_increases_from_base_to_tip() {
        let ray = Ray::new(Vec3::new(9.0, 0.5, 0.0), Vec3::NEG_X).to_f64();
        let hit = hat(true).intersect(&ray).expect("aimed at it");
        let surface = hat(true).surface_point_at_hit(&ray, &hit);
        assert_eq!(surface.uv.as_vec2(), Vec2::new(0.5, 0.25));
        assert!((surface.dpdv - Vec3::new(-1.0, 2.0, 0.0)).length() < 1e-6);
        let (point, normal) = hat(true).side_point_and_normal_from_uv(0.5, 0.25);
        assert!((point - DVec3::new(0.75, 0.5, 0.0)).length() < 1e-14);
        assert!((normal.as_vec3() - surface.normal).length() < 1e-6);
    }

    #[test]
    fn bounds_are_tight() {
        let slanting = Cone::new(DVec3::ZERO, DVec3::new(3.0, 4.0, 0.0), 1.0, true).bounds();
        assert!((slanting.min - Vec3::new(-0.8, -0.6, -1.0)).abs().max_element() < 1e-6);
        assert!((slanting.max - Vec3::new(3.0, 4.0, 1.0)).abs().max_element() < 1e-6);
    }

    impl SlenderShape for Cone {
        fn slender(radius: f64, capped: bool) -> Self {
            Self::new(DVec3::NEG_Z, DVec3::Z, radius, capped)
        }

        fn intersect_nearest(&self, ray: &RayF64) -> Option<(f64, u32)> {
            self.intersect_f64(ray)
        }

        fn interval_inside_side(&self, ray: &RayF64) -> Option<LineInterval> {
            self.double_cone_interval(&self.frame.line_to_local(ray))
        }

        fn unrounded_point(&self, ray: &RayF64, hit: &ShapeHit) -> DVec3 {
            self.unrounded_hit_point(ray, hit)
        }
    }

    #[test]
    fn distant_hits_use_the_correct_crossing() {
        check_hits_from_afar::<Cone>();
    }
}
