//! Disks, cylinders, cones and tori against their distance functions, which have a Lipschitz constant of 1.

use glimt::geometry::Ray;
use glimt::geometry::ray::offset_origin;
use glimt::lights::GeometryOfLight;
use glimt::math::DVec3;
use glimt::math::random::TestRandom;
use glimt::scene::description::Shape;
use glimt::world::Geometry;

use super::robust::{places, ray_leaving, self_hits};
use super::scenes::{matte, scene};
use super::v;

pub fn geometry(shape: &Shape) -> std::sync::Arc<Geometry> {
    scene().shape(shape.clone(), matte(0.5)).world().geometry
}

/// The dimensions of a closed shape around an axis.
#[derive(Clone, Copy)]
enum Profile {
    Cylinder { half: f64, radius: f64 },
    Cone { height: f64, radius: f64 },
    Torus { radius: f64, tube: f64 },
}

impl Profile {
    /// Returns a point on the shape's axis, the axis as a unit vector, and the dimensions relative to them.
    fn of(shape: &Shape) -> (DVec3, DVec3, Self) {
        match *shape {
            Shape::Cylinder { a, b, radius, .. } => {
                let half = (b - a).length() * 0.5;
                ((a + b) * 0.5, (b - a).normalize(), Self::Cylinder { half, radius })
            }
            Shape::Cone { base, tip, radius, .. } => {
                let height = (base - tip).length();
                (tip, (base - tip).normalize(), Self::Cone { height, radius })
            }
            Shape::Torus { center, axis, radius, tube } => {
                (center, axis.normalize(), Self::Torus { radius, tube })
            }
            _ => unreachable!("not a closed shape"),
        }
    }

    /// Signed distance bound at a position along the axis and a distance from it.
    fn distance(self, along: f64, across: f64) -> f64 {
        match self {
            Self::Cylinder { half, radius } => (across - radius).max(along.abs() - half),
            Self::Cone { height, radius } => {
                ((across * height - along * radius) / height.hypot(radius)).max(along - height)
            }
            Self::Torus { radius, tube } => (across - radius).hypot(along) - tube,
        }
    }
}

/// Signed distance bound: a lower bound on the distance to the surface, negative inside the closed shape and
/// 0 on its surface.
fn distance(shape: &Shape, p: DVec3) -> f64 {
    let (origin, axis, profile) = Profile::of(shape);
    profile.distance((p - origin).dot(axis), (p - origin).cross(axis).length())
}

/// A line relative to a shape's axis. Its coordinates are plain numbers, which are fast without optimization.
struct AxialLine {
    profile: Profile,
    /// Size of the shape's smallest feature.
    size: f64,
    /// Coordinates along the axis and across it, and their change per unit of t.
    start: [f64; 3],
    step: [f64; 3],
    /// Length per unit of t.
    length: f64,
}

impl AxialLine {
    fn new(shape: &Shape, ray: &Ray) -> Self {
        let (origin, axis, profile) = Profile::of(shape);
        let (x, y) = axis.any_orthonormal_pair();
        let coordinates = |vector: DVec3| [axis, x, y].map(|axis| vector.dot(axis));
        let (start, step) = (ray.origin.as_dvec3() - origin, ray.direction.as_dvec3());
        let (start, step, length) = (coordinates(start), coordinates(step), step.length());
        Self { profile, size: size(shape), start, step, length }
    }

    /// The distance bound at t.
    fn distance(&self, t: f64) -> f64 {
        let along = self.start[0] + self.step[0] * t;
        let (x, y) = (self.start[1] + self.step[1] * t, self.start[2] + self.step[2] * t);
        self.profile.distance(along, (x * x + y * y).sqrt())
    }
}

/// Upper bound on the distance from the origin to any point of the shape.
fn reach(shape: &Shape) -> f64 {
    match *shape {
        Shape::Disk { center, radius, .. } => center.length() + radius,
        Shape::Cylinder { a, b, radius, .. } => a.length() + b.length() + radius,
        Shape::Cone { base, tip, radius, .. } => base.length() + tip.length() + radius,
        Shape::Torus { center, radius, tube, .. } => center.length() + radius + tube,
        _ => unreachable!("not a round shape"),
    }
}

/// Size of the shape's smallest feature.
fn size(shape: &Shape) -> f64 {
    match *shape {
        Shape::Cylinder { a, b, radius, .. } => radius.min((b - a).length()),
        Shape::Cone { base, tip, radius, .. } => radius.min((base - tip).length()),
        Shape::Torus { radius, tube, .. } => tube.min(radius - tube),
        _ => unreachable!("not a closed shape"),
    }
}

/// Whether the line crosses the surface by more than `allowed` between two distances. Bisects until the
/// distance bound at the center of an interval excludes a crossing. Intervals smaller than 10⁻⁵ of the
/// shape's size are tested only at their center, as bisection would not terminate for a line within the
/// surface.
fn crosses(line: &AxialLine, from: f64, to: f64, sign: f64, allowed: f64) -> bool {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from) * line.length);
    let here = sign * line.distance(middle);
    if here < -allowed {
        return true;
    }
    if here > half || half < 1e-5 * line.size + allowed {
        return false;
    }
    crosses(line, from, middle, sign, allowed) || crosses(line, middle, to, sign, allowed)
}

/// Checks that the hit is on the surface and that the ray does not cross the surface before it, or at all if
/// there is no hit. Returns whether there is a hit.
#[track_caller]
fn check(shape: &Shape, geometry: &Geometry, ray: &Ray, sign: f64) -> bool {
    let far = reach(shape) + ray.origin.as_dvec3().length();
    let allowed = 64.0 * f64::EPSILON * far;
    let length = ray.direction.as_dvec3().length();
    let (hit, line) = (geometry.closest_hit(ray), AxialLine::new(shape, ray));
    assert_eq!(
        geometry.is_occluded_except_by_light(ray, GeometryOfLight::Nothing),
        hit.is_some(),
        "{shape:?} {ray:?}"
    );
    let Some(hit) = hit else {
        assert!(!crosses(&line, 0.0, 2.0 * far / length, sign, allowed), "missed {shape:?} {ray:?}");
        return false;
    };
    let t = f64::from(hit.shape.t);
    let rounding = t * length * f64::from(f32::EPSILON);
    let off = distance(shape, ray.origin.as_dvec3() + ray.direction.as_dvec3() * t);
    assert!(off.abs() <= rounding + allowed, "hit is {off} away from {shape:?} {ray:?} {hit:?}");
    let before = t * (1.0 - f64::from(f32::EPSILON));
    assert!(!crosses(&line, 0.0, before, sign, allowed), "passed through {shape:?} {ray:?} {hit:?}");
    let surface = geometry.surface(ray, &hit);
    let off = distance(shape, surface.point.as_dvec3());
    let error = f64::from(surface.error.length());
    assert!(off.abs() <= error, "distance {off} exceeds error bound {error}: {shape:?} {ray:?}");
    assert!((surface.normal.length() - 1.0).abs() < 1e-6);
    // The normal points outward. Skip the check where the shape is too thin relative to the error.
    let out = surface.point.as_dvec3() + surface.normal.as_dvec3() * (4.0 * error);
    let tells = error < 0.05 * size(shape);
    assert!(!tells || distance(shape, out) > 0.0, "{shape:?} {ray:?} {surface:?}");
    true
}

pub fn torus(random: &mut TestRandom, center: DVec3, size: f64, slimness: f64) -> Shape {
    Shape::Torus { center, axis: random.direction() * 3.0, radius: size, tube: size * slimness }
}

pub fn cylinder(random: &mut TestRandom, center: DVec3, size: f64, caps: bool) -> Shape {
    let half = random.direction() * (size * random.unit().max(0.01));
    Shape::Cylinder { a: center - half, b: center + half, radius: size * random.unit().max(0.01), caps }
}

pub fn cone(random: &mut TestRandom, center: DVec3, size: f64, cap: bool) -> Shape {
    let half = random.direction() * (size * random.unit().max(0.01));
    Shape::Cone { base: center - half, tip: center + half, radius: size * random.unit().max(0.01), cap }
}

/// A line parallel to the tangent plane at a surface point, at a random distance from it.
fn grazing(random: &mut TestRandom, point: DVec3, normal: DVec3, size: f64) -> Ray {
    let tangent = random.direction().cross(normal).normalize();
    let off = normal * (size * random.signed().signum() * 10.0_f64.powf(-9.0 * random.unit()));
    let start = point + off - tangent * (size * 4.0 * random.unit());
    Ray::new(start.as_vec3(), tangent.as_vec3())
}

pub fn random_in(random: &mut TestRandom, center: DVec3, size: f64) -> DVec3 {
    center + v(random.signed(), random.signed(), random.signed()) * size
}

#[test]
fn torus_hits_match_distance_function() {
    let mut random = TestRandom::new(5);
    let (mut rays, mut hits) = (0, 0);
    for slimness in [1e-3, 0.03, 0.2, 0.5, 0.8, 0.97, 0.9999] {
        for center in [DVec3::ZERO, v(3.0, -2.0, 1.0), v(1e3, 2e3, -5e2)] {
            let shape = torus(&mut random, center, 1.3, slimness);
            let Shape::Torus { axis, radius, tube, .. } = shape else { unreachable!() };
            let n = axis.normalize();
            let geometry = geometry(&shape);
            for i in 0..6000 {
                let out = n.cross(random.direction()).normalize();
                let around = std::f64::consts::TAU * random.unit();
                let normal = out * around.cos() + n * around.sin();
                let on = center + out * radius + normal * tube;
                let aim = |from: DVec3, to: DVec3| Ray::new(from.as_vec3(), (to - from).as_vec3());
                let ray = match i % 6 {
                    0 => aim(random_in(&mut random, center, 9.0), on),
                    // From within the hole, and from inside the tube.
                    1 => aim(center + n * (0.3 * random.signed()), random_in(&mut random, center, 3.0)),
                    2 => aim(center + out * radius, random_in(&mut random, center, 3.0)),
                    3 => grazing(&mut random, on, normal, 1.3),
                    // Parallel to the axis, at and near the top circle and the silhouette circles.
                    4 => {
                        let across = [0.0, radius, radius - tube, radius + tube][i / 6 % 4];
                        let off = if i % 4 < 2 { 0.0 } else { 10.0_f64.powf(-8.0 * random.unit()) };
                        Ray::new((center + out * (across + off) - n * 5.0).as_vec3(), n.as_vec3())
                    }
                    // In the plane of the center circle, toward the center or a random point.
                    _ if i % 12 < 6 => aim(center + out * 6.0, center),
                    _ => aim(
                        center + n.cross(random.direction()) * 6.0,
                        center + out * (radius * random.unit()),
                    ),
                };
                let start = distance(&shape, ray.origin.as_dvec3());
                if start.abs() > 1e-12 * reach(&shape) {
                    rays += 1;
                    hits += u32::from(check(&shape, &geometry, &ray, start.signum()));
                }
            }
        }
    }
    assert!(rays > 120_000 && hits > rays / 3, "{hits} hits of {rays} rays");
}

#[test]
fn ray_from_torus_finds_next_intersection() {
    // From each hit, one ray goes outward (sometimes through the hole) and one goes into the tube.
    let mut random = TestRandom::new(29);
    for size in [1e-8, 1e-4, 1.0, 1e4, 1e8] {
        for center in places(&mut random, size) {
            for slimness in [0.05, 0.5, 0.9] {
                let shape = torus(&mut random, center, size, slimness);
                let geometry = geometry(&shape);
                let mut met = 0;
                for _ in 0..600 {
                    let from = random_in(&mut random, center, 3.0 * size).as_vec3();
                    let to = random_in(&mut random, center, size);
                    let ray = Ray::new(from, (to - from.as_dvec3()).as_vec3());
                    let Some(hit) = geometry.closest_hit(&ray) else { continue };
                    met += 1;
                    let surface = geometry.surface(&ray, &hit);
                    for side in [1.0_f32, -1.0] {
                        let ray = ray_leaving(&mut random, &surface, surface.normal * side);
                        assert!(f64::from(side) * distance(&shape, ray.origin.as_dvec3()) > 0.0);
                        let again = check(&shape, &geometry, &ray, f64::from(side));
                        assert!(again || side > 0.0, "no exit hit: {shape:?} {ray:?}");
                    }
                }
                assert!(met > 50, "{met} {shape:?}");
            }
        }
    }
}

#[test]
fn cylinder_and_cone_hits_match_distance_bound() {
    let mut random = TestRandom::new(13);
    let (mut rays, mut hits) = (0, 0);
    for i in 0..400 {
        let far = 10.0_f64.powf(3.0 * random.unit());
        let center = random_in(&mut random, DVec3::ZERO, far);
        let shape = if i % 2 == 0 {
            cylinder(&mut random, center, 1.0, true)
        } else {
            cone(&mut random, center, 1.0, true)
        };
        let (Shape::Cylinder { a: low, b: high, radius, .. }
        | Shape::Cone { base: low, tip: high, radius, .. }) = shape
        else {
            unreachable!()
        };
        let axis = (high - low).normalize();
        let geometry = geometry(&shape);
        for j in 0..300 {
            let out = axis.cross(random.direction()).normalize();
            let inside = low.lerp(high, random.unit());
            let aim = |from: DVec3, to: DVec3| Ray::new(from.as_vec3(), (to - from).as_vec3());
            let ray = match j % 6 {
                0 => aim(random_in(&mut random, center, 9.0), inside + out * (radius * random.unit())),
                1 => aim(inside, random_in(&mut random, center, 3.0)),
                // Toward the rim and the tip.
                2 => aim(random_in(&mut random, center, 5.0), low + out * radius),
                3 => aim(random_in(&mut random, center, 5.0), high),
                // Parallel to the axis and to the side.
                4 => Ray::new(
                    (low - axis * 5.0 + out * (2.0 * radius * random.unit())).as_vec3(),
                    axis.as_vec3(),
                ),
                _ => {
                    let edge = if i % 2 == 0 { high + out * radius } else { high };
                    let slope = (edge - (low + out * radius)).normalize();
                    let off = random.direction() * 10.0_f64.powf(-3.0 * random.unit());
                    Ray::new((edge + off - slope * 6.0).as_vec3(), slope.as_vec3())
                }
            };
            let start = distance(&shape, ray.origin.as_dvec3());
            if start.abs() > 1e-12 * reach(&shape) {
                rays += 1;
                hits += u32::from(check(&shape, &geometry, &ray, start.signum()));
            }
        }
    }
    assert!(rays > 100_000 && hits > rays / 3, "{hits} hits of {rays} rays");
}

#[test]
fn rays_pass_through_missing_caps() {
    let mut random = TestRandom::new(37);
    let mut through = 0;
    for i in 0..200 {
        let center = random_in(&mut random, DVec3::ZERO, 3.0);
        let closed = if i % 2 == 0 {
            cylinder(&mut random, center, 1.0, true)
        } else {
            cone(&mut random, center, 1.0, true)
        };
        let open = match closed.clone() {
            Shape::Cylinder { a, b, radius, .. } => Shape::Cylinder { a, b, radius, caps: false },
            Shape::Cone { base, tip, radius, .. } => Shape::Cone { base, tip, radius, cap: false },
            _ => unreachable!(),
        };
        let (closed, open) = (geometry(&closed), geometry(&open));
        for _ in 0..200 {
            let from = random_in(&mut random, center, 3.0).as_vec3();
            let ray = Ray::new(from, (random_in(&mut random, center, 0.7) - from.as_dvec3()).as_vec3());
            let bare = open.closest_hit(&ray).map(|hit| hit.shape);
            assert_eq!(open.is_occluded_except_by_light(&ray, GeometryOfLight::Nothing), bare.is_some());
            match closed.closest_hit(&ray).map(|hit| hit.shape) {
                Some(hit) if hit.primitive > 0 => {
                    let cap = closed.surface(&ray, &closed.closest_hit(&ray).expect("as before"));
                    let origin = offset_origin(cap.point, cap.error, cap.normal, ray.direction);
                    let inner = closed.closest_hit(&Ray::new(origin, ray.direction)).map(|hit| hit.shape);
                    let inner = inner.filter(|hit| hit.primitive == 0).map(|inner| inner.t + hit.t);
                    assert_eq!(inner.is_some(), bare.is_some(), "{ray:?}");
                    through += u32::from(inner.is_some());
                    if let (Some(inner), Some(bare)) = (inner, bare) {
                        assert!((inner - bare.t).abs() < 1e-4, "{inner} {bare:?} {ray:?}");
                    }
                }
                hit => assert_eq!(hit, bare, "{ray:?}"),
            }
        }
    }
    assert!(through > 1000, "{through}");
}

#[test]
fn convex_round_shapes_do_not_self_hit() {
    // A convex shape lies on one side of its tangent plane, even without caps.
    let mut random = TestRandom::new(19);
    for size in [1e-8, 1e-4, 1.0, 1e4, 1e8] {
        for center in places(&mut random, size) {
            for closed in [true, false] {
                for shape in
                    [cylinder(&mut random, center, size, closed), cone(&mut random, center, size, closed)]
                {
                    let build = scene().shape(shape.clone(), matte(0.5));
                    let (hits, _) = self_hits(&build, &mut random, center, size, 2000);
                    assert_eq!(hits, 0, "{shape:?}");
                }
            }
        }
    }
}

#[test]
fn ray_into_closed_round_shape_hits_its_back() {
    let mut random = TestRandom::new(43);
    for size in [1e-8, 1.0, 1e8] {
        for center in places(&mut random, size) {
            for shape in [cylinder(&mut random, center, size, true), cone(&mut random, center, size, true)] {
                let geometry = geometry(&shape);
                for _ in 0..500 {
                    let from = random_in(&mut random, center, 3.0 * size).as_vec3();
                    let to = random_in(&mut random, center, 0.5 * size);
                    let ray = Ray::new(from, (to - from.as_dvec3()).as_vec3());
                    let Some(hit) = geometry.closest_hit(&ray) else { continue };
                    let surface = geometry.surface(&ray, &hit);
                    let inner = ray_leaving(&mut random, &surface, -surface.normal);
                    // Near an edge, the offset for the point's error may leave the shape.
                    if distance(&shape, inner.origin.as_dvec3()) < 0.0 {
                        let back = geometry.closest_hit(&inner);
                        let back = back.unwrap_or_else(|| panic!("leak in {shape:?} {inner:?}"));
                        let normal = geometry.surface(&inner, &back).normal;
                        assert!(normal.dot(inner.direction) > 0.0, "{shape:?} {inner:?}");
                    }
                }
            }
        }
    }
}
