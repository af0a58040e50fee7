//! Tests of light-sampling pdfs and of the mapping from hits to lights.

use super::*;
use crate::control::CancelToken;
use crate::geometry::cone::Cone;
use crate::geometry::cuboid::OrientedBox;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::plane::Plane;
use crate::geometry::sphere::Sphere;
use crate::geometry::torus::Torus;
use crate::geometry::transformed::tests::sheared;
use crate::geometry::triangle::Triangle;
use crate::geometry::{Ray, Shape, ShapeHit};
use crate::lights::delta::{Falloff, PointLight};
use crate::math::lanes::{F32x16, PACKET_SIZE, Vec3x16, lane};
use crate::math::random::unit_generator;
use crate::math::{DVec3, Vec2, Vec3};
use crate::sampling::{Dimension, PixelSampler};

/// Shapes for all sampling methods. Rectangles are sampled by solid angle, other parallelograms and distant
/// rectangles by area.
fn shapes() -> Vec<Shape> {
    let plain = untransformed_shapes();
    let transformed: Vec<Shape> =
        plain.iter().flat_map(|shape| [1.0, -1.0].map(|mirror| sheared(shape.clone(), mirror))).collect();
    plain.into_iter().chain(transformed).collect()
}

fn untransformed_shapes() -> Vec<Shape> {
    let (p, q) = (DVec3::new(0.3, -0.2, 0.1), DVec3::new(1.0, 0.5, -0.4));
    vec![
        Shape::Sphere(Sphere { center: p, radius: 0.7 }),
        Shape::Quad(Parallelogram::new(p, DVec3::X, DVec3::new(0.0, 1.0, -0.5))),
        Shape::Quad(Parallelogram::new(p, DVec3::X * 0.01, DVec3::Y * 0.01)),
        Shape::Quad(Parallelogram::new(p, DVec3::X, q)),
        Shape::Box(OrientedBox::new(p, DVec3::new(1.0, 0.4, 2.0), DVec3::new(10.0, 70.0, -30.0))),
        Shape::Triangle(Triangle { a: p, b: q, c: DVec3::Y }),
        Shape::Disk(Disk::new(p, q, 0.6)),
        Shape::Cylinder(Cylinder::new(p, q, 0.5, true)),
        Shape::Cone(Cone::new(p, q, 0.4, true)),
        Shape::Torus(Torus::new(p, q, 1.0, 0.4)),
    ]
}

const OBJECT: u32 = 7;

fn lights_of(shape: &Shape) -> Lights {
    let lights = new_front_area_light(shape, Vec3::ONE, OBJECT).map(Light::Area);
    Lights::new(std::iter::once(Light::Point(POINT)).chain(lights).collect(), &CancelToken::new())
        .expect("never canceled")
}

const POINT: PointLight =
    PointLight { position: DVec3::ZERO, intensity: Vec3::ONE, falloff: Falloff::Square };

/// Finds the point where a ray hits a shape.
pub fn light_hit(shape: &Shape, from: Vec3, direction: Vec3) -> Option<(LightHitPoint, ShapeHit)> {
    let ray = Ray::new(from, direction).to_f64();
    let hit = shape.intersect(&ray)?;
    let normal = shape.surface_point_at_hit(&ray, &hit).normal;
    Some((LightHitPoint { direction, distance: hit.t, normal, primitive: hit.primitive }, hit))
}

/// Samples a light from a point. Returns directions, targets, and inverse pdfs.
fn samples(light: &Light, number: u32, from: Vec3, count: u32) -> Vec<(Vec3, Vec3, f32)> {
    let one = |sample: u32| {
        let u = PixelSampler::new(1, 2, 3, sample).pair(1, Dimension::Light(number));
        let sample = light.sample(from, Vec3::Y, u.to_array())?;
        let ShadowRayEnd::At(target) = sample.end else { return None };
        Some((sample.direction, target, sample.weight.x))
    };
    (0..count).filter_map(one).collect()
}

#[test]
fn packet_samples_match_single_samples() {
    let mut next = unit_generator(1);
    for shape in shapes() {
        for (_, light) in lights_of(&shape).iter() {
            let points: Vec3x16 = std::array::from_fn(|_| std::array::from_fn(|_| next() * 6.0 - 3.0));
            let normals: Vec3x16 = [[0.0; PACKET_SIZE], [1.0; PACKET_SIZE], [0.0; PACKET_SIZE]];
            let u: [F32x16; 2] = std::array::from_fn(|_| std::array::from_fn(|_| next()));
            let row = light.sample_unmodulated_packet(&points, &normals, u32::MAX, &u);
            for i in 0..PACKET_SIZE {
                let alone = light.sample(lane(&points, i), lane(&normals, i), [u[0][i], u[1][i]]);
                let weight = lane(&row.weights, i);
                let Some(alone) = alone else {
                    assert_eq!(weight, Vec3::ZERO, "{shape:?}");
                    continue;
                };
                assert_eq!((weight, lane(&row.directions, i)), (alone.weight, alone.direction), "{shape:?}");
                assert_eq!(ShadowRayEnd::At(lane(&row.targets, i)), alone.end, "{shape:?}");
            }
        }
    }
}

#[test]
fn per_lane_lights_match_single_samples() {
    let quad = |at: f64| {
        let corner = |x: f64, y: f64| DVec3::new(at + x, y, 2.0);
        mesh_light(&[
            [corner(0.0, 0.0), corner(0.0, 1.0), corner(1.0, 0.0)],
            [corner(1.0, 1.0), corner(1.0, 0.0), corner(0.0, 1.0)],
        ])
    };
    let facets = mesh_light(&[[DVec3::ZERO, DVec3::Y, DVec3::X], [DVec3::Z, DVec3::X, DVec3::Y]]);
    let shapes = shapes()
        .into_iter()
        .filter_map(|shape| new_front_area_light(&shape, Vec3::new(1.0, 2.0, 0.5), OBJECT));
    let areas = shapes.chain([quad(0.0), facets, quad(-2.0)]);
    let all: Vec<Light> = std::iter::once(Light::Point(POINT)).chain(areas.map(Light::Area)).collect();
    let lights = Lights::new(all.clone(), &CancelToken::new()).expect("never canceled");
    let mut seen = 0;
    for round in 0..200_u32 {
        let at = |i: usize, decision| PixelSampler::new(5, round, i as u32, 0).pair(1, decision);
        let picked: [u32; PACKET_SIZE] =
            std::array::from_fn(|i| (at(i, Dimension::LightChoice).x * all.len() as f32) as u32);
        let used = 0xffff & !(round * 37 % 97);
        let u: [F32x16; 2] = [
            std::array::from_fn(|i| at(i, Dimension::ChosenLight).x),
            std::array::from_fn(|i| at(i, Dimension::ChosenLight).y),
        ];
        let points: Vec3x16 = std::array::from_fn(|axis| {
            std::array::from_fn(|i| 6.0 * at(axis * PACKET_SIZE + i, Dimension::Lobe).x - 3.0)
        });
        let normals: Vec3x16 = [[0.0; PACKET_SIZE], [1.0; PACKET_SIZE], [0.0; PACKET_SIZE]];
        let (row, inverse, _) = lights.sample_per_lane(&picked, (&points, &normals), used, &u);
        for i in (0..PACKET_SIZE).filter(|i| used & 1 << i != 0) {
            let light = &all[picked[i] as usize];
            let alone = light.sample(lane(&points, i), lane(&normals, i), [u[0][i], u[1][i]]);
            let Some(alone) = alone else {
                assert_eq!(lane(&row.weights, i), Vec3::ZERO, "{light:?}");
                continue;
            };
            assert_eq!((lane(&row.weights, i), lane(&row.directions, i)), (alone.weight, alone.direction));
            assert_eq!(
                (ShadowRayEnd::At(lane(&row.targets, i)), row.sources.geometry(i)),
                (alone.end, alone.source)
            );
            assert_eq!(inverse[i] > 0.0, picked[i] > 0, "the inverse pdf should be 0 for point lights only");
            seen += 1;
        }
    }
    assert!(seen > 1000, "{seen}");
}

fn points() -> [Vec3; 3] {
    [Vec3::new(2.0, 1.5, 3.0), Vec3::new(-3.0, 0.4, 1.0), Vec3::new(0.5, 4.0, -1.5)]
}

#[test]
fn sample_pdf_equals_pdf_of_hit() {
    for shape in shapes() {
        let lights = lights_of(&shape);
        let (mut compared, mut hidden) = (0, 0);
        for from in points() {
            // Skip the point light, which rays cannot hit.
            for (number, light) in lights.iter().skip(1) {
                for (direction, target, factor) in samples(light, number, from, 64) {
                    let Some((light_hit, hit)) = light_hit(&shape, from, direction) else { continue };
                    // A torus may occlude the point, and a ray may miss the edge of a shape.
                    if (from + direction * light_hit.distance - target).length() > 1e-3 {
                        hidden += 1;
                        continue;
                    }
                    let (found, light_at) = lights
                        .light_on_primitive(OBJECT, hit.primitive, Side::Front)
                        .expect("expected a light");
                    assert_eq!(found, number, "{shape:?}");
                    let product = light_at.pdf_of_hit(from, Vec3::Y, &light_hit) * factor;
                    assert!((product - 1.0).abs() < 2e-3, "{shape:?} {from}: {product}");
                    compared += 1;
                }
            }
        }
        assert!(compared >= 64 && hidden * 3 < compared, "{shape:?}: {compared} compared, {hidden} hidden");
    }
}

/// Lights on both sides of a shape. The first is on the front.
fn two_sided(shape: &Shape) -> Lights {
    let both =
        [new_front_area_light(shape, Vec3::ONE, OBJECT), new_back_area_light(shape, Vec3::ONE, OBJECT)];
    let all = both.into_iter().flatten().map(Light::Area).collect();
    Lights::new(all, &CancelToken::new()).expect("never canceled")
}

#[test]
fn two_sided_samples_cover_the_visible_shape() {
    let open = |cylinder| {
        if cylinder {
            Shape::Cylinder(Cylinder::new(DVec3::ZERO, DVec3::Z, 0.5, false))
        } else {
            Shape::Cone(Cone::new(DVec3::ZERO, DVec3::Z, 0.5, false))
        }
    };
    for shape in shapes().into_iter().chain([open(true), open(false)]) {
        let lights = two_sided(&shape);
        // Use points around the shape and one point inside.
        let is_flat =
            new_front_area_light(&shape, Vec3::ONE, 0).is_some_and(|light| light.bounds.cone.cos == 1.0);
        let inner = shape.sample_point_on_part(0, Vec2::splat(0.5));
        let inner = (inner.point - inner.normal * 0.1).as_vec3();
        for from in points().into_iter().chain((!is_flat).then_some(inner)) {
            let (n, mut seen, mut sum) = (25_000_u32, 0.0, 0.0);
            let around = SphereCone::around(&shape, from);
            for i in 0..n {
                let direction = around.direction(i, n);
                let Some((light_hit, hit)) = light_hit(&shape, from, direction) else { continue };
                let side = if light_hit.normal.dot(direction) < 0.0 { Side::Front } else { Side::Back };
                let Some((_, light)) = lights.light_on_primitive(OBJECT, hit.primitive, side) else {
                    continue;
                };
                let part = f64::from(around.solid_angle()) / f64::from(n);
                seen += part;
                sum += if light.pdf_of_hit(from, Vec3::Y, &light_hit) > 0.0 { part } else { 0.0 };
            }
            assert!(
                (sum - seen).abs() <= 1e-3 * seen,
                "{shape:?} from {from}: only {sum} of {seen} sr are sampled"
            );
            // The sum of the sample weights must equal the same solid angle.
            let found: f64 = lights
                .iter()
                .map(|(number, light)| {
                    let all = samples(light, number, from, 4096);
                    all.iter().map(|(.., factor)| f64::from(*factor)).sum::<f64>() / 4096.0
                })
                .sum();
            assert!(
                (found - seen).abs() < 0.02 * seen + 2e-4,
                "{shape:?} from {from}: {found} instead of {seen}"
            );
        }
    }
}

#[test]
fn back_sample_pdf_equals_pdf_of_hit() {
    let tube = Shape::Cylinder(Cylinder::new(DVec3::ZERO, DVec3::Z, 0.5, false));
    for shape in shapes().into_iter().chain([tube]) {
        let light = Light::Area(new_back_area_light(&shape, Vec3::ONE, OBJECT).expect("a light"));
        let mut compared = 0;
        let inner = shape.sample_point_on_part(0, Vec2::splat(0.5));
        let inner = (inner.point - inner.normal * 0.1).as_vec3();
        for from in points().into_iter().chain([inner]) {
            for (direction, target, factor) in samples(&light, 0, from, 256) {
                let Some((light_hit, _)) = light_hit(&shape, from, direction) else { continue };
                if (from + direction * light_hit.distance - target).length() > 1e-3 {
                    continue;
                }
                assert!(light_hit.normal.dot(direction) > 0.0, "{shape:?}: a sample is on the front");
                let product = light.pdf_of_hit(from, Vec3::Y, &light_hit) * factor;
                assert!((product - 1.0).abs() < 2e-3, "{shape:?} {from}: {product}");
                compared += 1;
            }
        }
        assert!(compared >= 100, "{shape:?}: {compared}");
    }
}

#[test]
fn pdfs_integrate_to_one_over_the_light() {
    for shape in shapes() {
        let lights = lights_of(&shape);
        for from in points() {
            let cone = SphereCone::around(&shape, from);
            let (mut sums, n) = (vec![0.0; lights.len()], 50_000);
            for i in 0..n {
                let direction = cone.direction(i, n);
                let Some((light_hit, hit)) = light_hit(&shape, from, direction) else { continue };
                let Some((number, light)) = lights.light_on_primitive(OBJECT, hit.primitive, Side::Front)
                else {
                    continue;
                };
                sums[number as usize] +=
                    f64::from(light.pdf_of_hit(from, Vec3::Y, &light_hit) * cone.solid_angle())
                        / f64::from(n);
            }
            for (sum, (number, light)) in sums.iter().zip(lights.iter()).skip(1) {
                let all = samples(light, number, from, 1024);
                // With area sampling, samples on the back are lost, so the integral over visible samples is
                // the fraction that faces the point.
                let expected = all.len() as f64 / 1024.0;
                assert!(
                    (sum - expected).abs() < 0.03,
                    "{shape:?} {number} from {from}: {sum} instead of {expected}"
                );
            }
        }
    }
}

/// Directions in a cone or in the whole sphere, stratified by solid angle.
struct SphereCone {
    frame: crate::math::frame::Frame,
    one_minus_cos: f32,
}

impl SphereCone {
    fn new(axis: Vec3, sin: f32) -> Self {
        let one_minus_cos = 1.0 - (1.0 - sin * sin).max(0.0).sqrt();
        Self { frame: crate::math::frame::Frame::from_normal(axis.normalize()), one_minus_cos }
    }

    /// The directions from a point to a shape, or all directions if the shape may enclose the point.
    fn around(shape: &Shape, from: Vec3) -> Self {
        let bounds = shape.bounds().expect("a finite shape");
        let to_middle = bounds.center() - from;
        let sin = bounds.extent().length() * 0.5 / to_middle.length();
        let cone = Self::new(to_middle, sin.min(1.0));
        if sin < 1.0 { cone } else { Self { one_minus_cos: 2.0, ..cone } }
    }

    fn solid_angle(&self) -> f32 {
        std::f32::consts::TAU * self.one_minus_cos
    }

    fn direction(&self, i: u32, n: u32) -> Vec3 {
        let cos = 1.0 - self.one_minus_cos * (i as f32 + 0.5) / n as f32;
        let (sin_phi, cos_phi) = ((f64::from(i) * 2.399_963_229_728_653) as f32).sin_cos();
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let crate::math::frame::Frame { s, t, n } = self.frame;
        (s * (sin * cos_phi) + t * (sin * sin_phi) + n * cos).normalize()
    }
}

#[test]
fn mesh_triangles_map_to_their_lights() {
    let corners = |z: f64| [DVec3::new(0.0, 0.0, z), DVec3::new(1.0, 0.0, z), DVec3::new(0.0, 1.0, z)];
    let light = |numbers: &[u32], radiance: f32| {
        let triangles = numbers.iter().map(|&number| (corners(f64::from(number)), number)).collect();
        let mesh =
            MeshEmitter::new(triangles, &CancelToken::new()).expect("never canceled").expect("an area");
        let bounds = mesh.light_bounds().scaled_by(Vec3::splat(radiance));
        Light::Area(AreaLight {
            bounds,
            shape: Emitter::Mesh(mesh),
            radiance: Vec3::splat(radiance),
            modulation: None,
            object: 3,
            part: EmittingPart::Listed,
            side: Side::Front,
        })
    };
    let lights =
        Lights::new(vec![light(&[0, 4], 1.0), Light::Point(POINT), light(&[2], 2.0)], &CancelToken::new())
            .expect("never canceled");
    let light_at = |object, primitive| {
        lights.light_on_primitive(object, primitive, Side::Front).map(|(number, _)| number)
    };
    assert_eq!(
        [0, 1, 2, 3, 4, 5].map(|triangle| light_at(3, triangle)),
        [Some(0), None, Some(2), None, Some(0), None]
    );
    assert_eq!(light_at(4, 0), None);
    let light_hit = LightHitPoint { direction: Vec3::NEG_Z, distance: 2.0, normal: Vec3::Z, primitive: 2 };
    let (_, light) = lights.light_on_primitive(3, 2, Side::Front).expect("a light");
    // d²/(A·cos) = 4/½.
    assert!((light.pdf_of_hit(Vec3::ZERO, Vec3::Z, &light_hit) - 8.0).abs() < 1e-5);
    assert_eq!(
        light.pdf_of_hit(Vec3::ZERO, Vec3::Z, &LightHitPoint { normal: Vec3::NEG_Z, ..light_hit }),
        0.0,
        "from behind"
    );
    assert_eq!(Light::Point(POINT).pdf_of_hit(Vec3::ONE, Vec3::Z, &light_hit), 0.0);
}

/// A mesh light with the given triangles. Their primitive indices start at 5.
fn mesh_light(triangles: &[[DVec3; 3]]) -> AreaLight {
    let numbered = triangles.iter().copied().zip(5..).collect();
    let mesh = MeshEmitter::new(numbered, &CancelToken::new()).expect("never canceled").expect("an area");
    let bounds = mesh.light_bounds();
    let (shape, radiance) = (Emitter::Mesh(mesh), Vec3::ONE);
    let (side, part) = (Side::Front, EmittingPart::Listed);
    AreaLight { shape, side, radiance, bounds, modulation: None, object: OBJECT, part }
}

#[test]
fn triangle_pairs_are_sampled_like_quads() {
    let (p, u, v) = (DVec3::new(0.3, -0.2, 0.1), DVec3::X, DVec3::new(0.0, 1.0, -0.5));
    let quad = Shape::Quad(Parallelogram::new(p, u, v));
    let quad = new_front_area_light(&quad, Vec3::ONE, OBJECT).expect("a light");
    let far = p + u + v;
    let (mut parts, mut seen) = ([0; 2], 0);
    for (first, second) in [
        ([p, p + u, p + v], [far, p + v, p + u]),
        ([p + u, p + v, p], [p + u, far, p + v]),
        ([p + v, p, p + u], [p + v, p + u, far]),
    ] {
        let light = mesh_light(&[first, second]);
        assert!(light.shape.as_quad().is_some());
        for sample in 0..400 {
            let at = |decision| PixelSampler::new(9, 2, 3, sample).pair(1, decision);
            let (a, b) = (at(Dimension::LightChoice), at(Dimension::ChosenLight));
            let from = Vec3::new(4.0 * a.x - 2.0, 4.0 * a.y - 2.0, 3.0 * b.x);
            let own = light.sample(from, Vec3::Z, [b.x, b.y]);
            let expected = quad.sample(from, Vec3::Z, [b.x, b.y]);
            let (Some(own), Some(expected)) = (own, expected) else {
                assert_eq!(own.is_some(), expected.is_some());
                continue;
            };
            assert_eq!(
                (own.direction, own.weight, own.end),
                (expected.direction, expected.weight, expected.end)
            );
            let (GeometryOfLight::Primitive(OBJECT, part), ShadowRayEnd::At(target)) = (own.source, own.end)
            else {
                panic!("expected a point on a triangle")
            };
            let corners = if part == 5 { first } else { second };
            let triangle = Shape::Triangle(Triangle { a: corners[0], b: corners[1], c: corners[2] });
            let way = target - from;
            let inside = triangle.intersect(&Ray::new(from - 0.01 * way, way).to_f64()).is_some();
            let on_edge = (target.as_dvec3() - p).dot(u + v - u.dot(v) * u);
            assert!(inside || (on_edge - 1.0).abs() < 0.3, "{target} is not on triangle {part}");
            seen += u32::from(inside);
            parts[(part - 5) as usize] += 1;
            let light_hit = LightHitPoint {
                direction: own.direction,
                distance: way.length(),
                normal: u.cross(v).as_vec3(),
                primitive: part,
            };
            assert_eq!(light.pdf(from, Vec3::Z, &light_hit), quad.pdf(from, Vec3::Z, &light_hit));
        }
    }
    assert!(seen > 400 && parts.iter().all(|&count| count > 100), "{seen} {parts:?}");
}

#[test]
fn non_parallelograms_are_sampled_by_area() {
    let (o, x, y) = (DVec3::ZERO, DVec3::X, DVec3::Y);
    let first = [o, x, y];
    for (second, what) in [
        ([x + y * 1.2, y, x], "a trapezoid"),
        ([x + y + DVec3::Z * 0.1, y, x], "a fold"),
        ([x + y, x, y], "opposite orientations"),
        ([x + y, y + x * 1e-3, x], "no common edge"),
        ([x + y, x * 2.0, y * 2.0], "no common corner"),
    ] {
        assert!(mesh_light(&[first, second]).shape.as_quad().is_none(), "{what}");
    }
    assert!(mesh_light(&[first]).shape.as_quad().is_none());
    assert!(mesh_light(&[first, [x + y, y, x]]).shape.as_quad().is_some());
    assert!(mesh_light(&[first, [x + y, y, x], first.map(|p| p + x * 3.0)]).shape.as_quad().is_none());
}

#[test]
fn area_samples_are_proportional_to_area() {
    let triangle = |at: f64, size: f64| {
        let p = DVec3::new(at, 0.0, 0.0);
        [p, p + DVec3::X * size, p + DVec3::Y * size]
    };
    let light = mesh_light(&[triangle(0.0, 1.0), triangle(2.0, 2.0), triangle(5.0, 0.5)]);
    let (from, mut counts, mut flux) = (Vec3::new(1.0, 0.5, 2.0), [0_u32; 3], 0.0);
    const COUNT: u32 = 1 << 14;
    for sample in 0..COUNT {
        let u = PixelSampler::new(3, 1, 4, sample).pair(1, Dimension::ChosenLight);
        let Some(sample) = light.sample(from, Vec3::NEG_Z, [u.x, u.y]) else { panic!("expected a sample") };
        let GeometryOfLight::Primitive(OBJECT, part) = sample.source else { panic!("expected a triangle") };
        counts[(part - 5) as usize] += 1;
        flux += f64::from(sample.weight.x * -sample.direction.z) / f64::from(COUNT);
    }
    for (count, area) in counts.iter().zip([0.5, 2.0, 0.125]) {
        let expected = area / 2.625 * f64::from(COUNT);
        assert!((f64::from(*count) - expected).abs() < 5.0, "{counts:?}");
    }
    // Lambert's formula for the irradiance from a polygon: ½ Σ Θᵢ (Γᵢ · n).
    let of = |corners: [DVec3; 3]| {
        let ways = corners.map(|corner| (corner - from.as_dvec3()).normalize());
        let edge = |i: usize| {
            let (a, b) = (ways[i], ways[(i + 1) % 3]);
            a.angle_between(b) * a.cross(b).normalize().z
        };
        0.5 * (edge(0) + edge(1) + edge(2)).abs()
    };
    let expected = of(triangle(0.0, 1.0)) + of(triangle(2.0, 2.0)) + of(triangle(5.0, 0.5));
    assert!((flux / expected - 1.0).abs() < 1e-3, "{flux} instead of {expected}");
}

#[test]
fn planes_cannot_be_lights() {
    assert_eq!(new_front_area_light(&Shape::Plane(Plane::new(DVec3::ZERO, DVec3::Y)), Vec3::ONE, 0), None);
}
