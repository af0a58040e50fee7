//! Surfaces of revolution: local frames, lines in local coordinates, and intersections with a shape's parts.

use std::f64::consts::PI;

use super::surface::tangents_from_normal;
use super::{Aabb, RayF64, ShapeHit};
use crate::math::{DMat3, DVec2, DVec3};

/// An origin and orthonormal axes. The z axis is the axis of revolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxialFrame {
    /// Origin in world coordinates.
    pub origin: DVec3,
    /// Axes as columns of the local-to-world matrix.
    axes: DMat3,
}

impl AxialFrame {
    /// Creates a frame from an origin and a nonzero axis.
    pub fn new(origin: DVec3, axis: DVec3) -> Self {
        let n = axis.normalize();
        let (u, v) = tangents_from_normal(n);
        Self { origin, axes: DMat3::from_cols(u, v, n) }
    }

    /// Unit vector along the axis.
    pub fn axis(&self) -> DVec3 {
        self.axes.z_axis
    }

    /// Transforms a point to world coordinates.
    pub fn point_to_world(&self, local: DVec3) -> DVec3 {
        self.origin + self.axes * local
    }

    /// Transforms a direction to world coordinates.
    pub fn vector_to_world(&self, local: DVec3) -> DVec3 {
        self.axes * local
    }

    /// Transforms a point to local coordinates.
    #[inline(always)]
    pub fn point_to_local(&self, point: DVec3) -> DVec3 {
        self.axes.transpose() * (point - self.origin)
    }

    /// Height of a world-space point along the axis (its local z).
    #[inline(always)]
    pub fn height(&self, point: DVec3) -> f64 {
        self.axes.z_axis.dot(point - self.origin)
    }

    /// Unit tangent of the circle around the axis through a point.
    pub fn tangent_around(&self, point: DVec3) -> DVec3 {
        self.axis().cross(point - self.origin).normalize_or(self.axes.x_axis)
    }

    /// The line through a ray in local coordinates, parametrized from its closest point to the frame's
    /// origin.
    #[inline(always)]
    pub fn line_to_local(&self, ray: &RayF64) -> LocalLine {
        let origin = self.point_to_local(ray.origin);
        let direction = self.axes.transpose() * ray.direction;
        let start = -origin.dot(direction) / direction.length_squared();
        LocalLine { foot: origin + direction * start, direction, start }
    }

    /// Bounding box of a circle around the axis at a given height.
    pub fn circle_bounds(&self, height: f64, radius: f64) -> Aabb {
        self.sphere_swept_circle_bounds(height, radius, 0.0)
    }

    /// Bounding box of all balls of radius `ball` whose centers are on a circle around the axis, expanded to
    /// account for rounding.
    pub fn sphere_swept_circle_bounds(&self, height: f64, radius: f64, ball: f64) -> Aabb {
        let center = self.point_to_world(DVec3::new(0.0, 0.0, height));
        let across = |i: usize| DVec2::new(self.axes.x_axis[i], self.axes.y_axis[i]).length() * radius + ball;
        let extent = DVec3::new(across(0), across(1), across(2));
        let rounding = self.origin.abs() + extent + DVec3::splat(height.abs());
        let extent = extent + rounding * (4.0 * f64::EPSILON);
        Aabb::from_points_f64([center - extent, center + extent])
    }
}

/// A line in local coordinates, parametrized from its closest point to the origin. This keeps coordinates as
/// small as the shape, so rays from far away remain precise.
#[derive(Clone, Copy, Debug)]
pub struct LocalLine {
    /// Point on the line closest to the origin.
    pub foot: DVec3,
    /// Direction of the ray.
    pub direction: DVec3,
    /// The ray's t at `foot`.
    pub start: f64,
}

/// Interval on a line, relative to the line's closest point to the origin. Each end is stored with the index
/// of its part.
#[derive(Clone, Copy, Debug)]
pub struct LineInterval {
    /// Start of the interval.
    pub enter: (f64, u32),
    /// End of the interval.
    pub leave: (f64, u32),
}

impl LineInterval {
    /// The whole line.
    pub const WHOLE: Self = Self { enter: (f64::NEG_INFINITY, 0), leave: (f64::INFINITY, 0) };

    /// Interval between two points on the side (part 0).
    pub fn from_side_crossings(enter: f64, leave: f64) -> Self {
        Self { enter: (enter, 0), leave: (leave, 0) }
    }

    /// Interval between two heights, each with its part index.
    pub fn between_heights(line: &LocalLine, low: (f64, u32), high: (f64, u32)) -> Option<Self> {
        let (z, dz) = (line.foot.z, line.direction.z);
        if dz == 0.0 {
            return (low.0..=high.0).contains(&z).then_some(Self::WHOLE);
        }
        let at = |(height, part): (f64, u32)| ((height - z) / dz, part);
        let (enter, leave) = if dz > 0.0 { (at(low), at(high)) } else { (at(high), at(low)) };
        Some(Self { enter, leave })
    }

    fn contains_position(&self, along: f64) -> bool {
        self.enter.0 <= along && along <= self.leave.0
    }
}

/// First hit of a ray on a closed solid, or on the side of an open shape: t and the part's index. `starts_on`
/// returns whether the ray starts on a part, within rounding error. The ray's start does not count as a hit.
pub fn first_hit(
    ray: &RayF64,
    line: &LocalLine,
    side: LineInterval,
    ends: LineInterval,
    closed: bool,
    starts_on: impl Fn(u32) -> bool,
) -> Option<(f64, u32)> {
    // If the ray starts on the side, the closer of its two intersections with the side is the start itself.
    let other_on_side = |along: f64| {
        let other = if along == side.enter.0 { side.leave.0 } else { side.enter.0 };
        (line.start + other).abs()
    };
    let is_start = |along: f64, part: u32| {
        let t = line.start + along;
        let near =
            NEAR_START * (line.foot.length_squared() + along * along * line.direction.length_squared());
        t * t * line.direction.length_squared() <= near
            && starts_on(part)
            && (part > 0 || t.abs() <= other_on_side(along))
    };
    let accepted = |(along, part): (f64, u32)| {
        let t = line.start + along;
        ray.round_t_if_in_range(t).filter(|_| !is_start(along, part)).map(|_| (t, part))
    };
    if !closed {
        let bare = [side.enter, side.leave].into_iter().filter(|end| ends.contains_position(end.0));
        return bare.into_iter().find_map(accepted);
    }
    let enter = if side.enter.0 > ends.enter.0 { side.enter } else { ends.enter };
    let leave = if side.leave.0 < ends.leave.0 { side.leave } else { ends.leave };
    if !(enter.0 <= leave.0) {
        return None;
    }
    [enter, leave].into_iter().find_map(accepted)
}

/// Maximum squared distance between a hit and the ray's origin at which they may be the same point, relative
/// to the squared distance from the shape's origin. At grazing angles, rounding moves the hit by the square
/// root of a unit in the last place.
const NEAR_START: f64 = 1e-12;

/// Whether a distance from a surface is within the rounding error of numbers with magnitudes up to `size`.
pub fn is_within_rounding_error(distance: f64, size: f64) -> bool {
    distance.abs() <= 8.0 * f64::EPSILON * size
}

/// Sine of the angle to an axis, from its cosine.
pub fn sine_from_cosine(cosine: f64) -> f64 {
    (1.0 - cosine * cosine).max(0.0).sqrt()
}

/// Projected area of a surface whose normals are uniformly distributed on a ring around an axis: the integral
/// of max(0, a·cos φ + b) over the area. Here a·cos φ + b is the cosine of the angle between the normal at
/// azimuth φ and the direction.
pub fn projected_area_of_normal_ring(area: f64, a: f64, b: f64) -> f64 {
    if b >= a {
        area * b
    } else if b <= -a {
        0.0
    } else {
        area / PI * (((a - b) * (a + b)).sqrt() + b * libm::acos(-b / a))
    }
}

/// Converts t and the part index to a hit.
pub fn to_shape_hit((t, primitive): (f64, u32)) -> ShapeHit {
    ShapeHit { primitive, ..ShapeHit::from_t(t as f32) }
}

/// The unrounded t of a hit, taken from `again`, the result of intersecting the ray a second time. Returns
/// the rounded t if the second intersection found a different hit.
pub fn unrounded_t(hit: &ShapeHit, again: Option<(f64, u32)>) -> f64 {
    match again {
        Some((t, part)) if t as f32 == hit.t && part == hit.primitive => t,
        _ => f64::from(hit.t),
    }
}

/// The unrounded hit point. Intersects the ray again unless exactly one of the crossings is at the hit's
/// distance.
pub fn unrounded_hit_point(
    (ray, line): (&RayF64, &LocalLine),
    hit: &ShapeHit,
    crossings: Option<LineInterval>,
    again: impl FnOnce() -> Option<(f64, u32)>,
) -> DVec3 {
    let fitting = crossings.and_then(|LineInterval { enter, leave }| {
        let [first, second] = [enter, leave].map(|(along, _)| line.start + along);
        match [first, second].map(|t| t as f32 == hit.t) {
            [true, true] => (first == second).then_some(first),
            [true, false] => Some(first),
            [false, true] => Some(second),
            [false, false] => None,
        }
    });
    ray.at(fitting.unwrap_or_else(|| unrounded_t(hit, again())))
}

/// Unit vector in the plane from the origin toward a point, or the x axis if the point is the origin.
pub fn radial_direction_toward(p: DVec2) -> DVec2 {
    p.try_normalize().unwrap_or(DVec2::X)
}

/// Texture coordinate u = ½ + angle/2π of a direction in the plane, in [0, 1].
pub fn u_from_direction(p: DVec2) -> f64 {
    0.5 + libm::atan2(p.y, p.x) / std::f64::consts::TAU
}

/// Inverse of [`u_from_direction`]: the direction for a value of `u`.
pub fn direction_at_u(u: f64) -> DVec2 {
    let (sin, cos) = libm::sincos((u - 0.5) * std::f64::consts::TAU);
    DVec2::new(cos, sin)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::geometry::Ray;
    use crate::geometry::cone::Cone;
    use crate::geometry::cylinder::Cylinder;
    use crate::geometry::torus::Torus;
    use crate::math::Vec3;
    use crate::math::random::unit_generator;

    #[test]
    fn rays_do_not_rehit_curved_shapes_at_origin() {
        // All of these shapes touch the origin and have z ≥ 0.
        let cylinder = |a, b, radius| Cylinder::new(a, b, radius, true);
        let mut next = unit_generator(7);
        for _ in 0..2000 {
            let [x, y, z] = std::array::from_fn(|_| next() - 0.5);
            let out = Vec3::new(x, y, -z.abs() - 1e-6);
            // Orient the axis in arbitrary directions.
            let [x, y] = std::array::from_fn(|_| f64::from(next()) - 0.5);
            let along = DVec3::new(x, y, 0.0);
            let middle = DVec3::Z;
            let ray = |direction: Vec3| Ray::new(Vec3::ZERO, direction).to_f64();
            let bar = cylinder(middle - along, middle + along, 1.0);
            let ring = Torus::new(middle, along, 0.75, 0.25);
            let standing = cylinder(DVec3::ZERO, DVec3::Z * (1.0 + x), 0.3);
            let cone = Cone::new(DVec3::ZERO, DVec3::Z * (1.0 + x), 0.3, true);
            let all = |ray: &RayF64| {
                [bar.intersect(ray), ring.intersect(ray), standing.intersect(ray), cone.intersect(ray)]
            };
            assert_eq!(all(&ray(out)).map(|hit| hit.map(|hit| hit.t)), [None; 4], "{along} {out}");
            // Rays that pass through the shape hit the other side.
            for hit in all(&ray(-out)) {
                let t = hit.map_or(0.0, |hit| hit.t);
                assert!(t > 1e-7, "{along} {out}: {t}");
            }
        }
    }

    /// A slender shape around the z axis from −1 to 1, used by [`check_hits_from_afar`].
    pub trait SlenderShape {
        /// Creates a thin shape with the given radius.
        fn slender(radius: f64, capped: bool) -> Self;

        /// Nearest hit.
        fn intersect_nearest(&self, ray: &RayF64) -> Option<(f64, u32)>;

        /// Interval of the ray inside the unbounded side surface.
        fn interval_inside_side(&self, ray: &RayF64) -> Option<LineInterval>;

        /// Hit point before rounding.
        fn unrounded_point(&self, ray: &RayF64, hit: &ShapeHit) -> DVec3;
    }

    /// Checks hit points of rays so distant that both crossings of the side round to the same distance.
    pub fn check_hits_from_afar<T: SlenderShape + std::fmt::Debug>() {
        let mut ambiguous = 0;
        for (i, capped) in (0..4000_u32).flat_map(|i| [(i, true), (i, false)]) {
            let thin = T::slender(0.01, capped);
            let across = f64::from(i) * 0.618_034 % 1.0 - 0.5;
            let along = f64::from(i) * 0.754_877_7 % 1.0 * 3.0 - 1.5;
            let at = DVec3::new(0.0, across * 0.02, along);
            let from = at + DVec3::new(2e5, 0.0, f64::from(i % 7) * 2e5 - 6e5);
            let ray = Ray::new(from.as_vec3(), (at - from).normalize().as_vec3()).to_f64();
            let Some((t, part)) = thin.intersect_nearest(&ray) else { continue };
            assert_eq!(thin.unrounded_point(&ray, &to_shape_hit((t, part))), ray.at(t), "{thin:?} {ray:?}");
            let size =
                thin.interval_inside_side(&ray).map_or(f64::INFINITY, |side| side.leave.0 - side.enter.0);
            ambiguous += u32::from((t + size) as f32 == t as f32);
        }
        assert!(ambiguous > 100, "{ambiguous}");
    }
}
