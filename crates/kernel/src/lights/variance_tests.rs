//! Tests the variance and distribution of light samples. The variance is compared with a sphere of the same
//! solid angle, and the distribution with the pdf.

use super::area::quad::QuadEmitter;
use super::area::textured_quad::TexturedQuadEmitter;
use super::tests::light_hit;
use super::*;
use crate::geometry::Shape;
use crate::geometry::cone::Cone;
use crate::geometry::cuboid::OrientedBox;
use crate::geometry::cylinder::Cylinder;
use crate::geometry::disk::Disk;
use crate::geometry::parallelogram::Parallelogram;
use crate::geometry::sphere::Sphere;
use crate::geometry::torus::Torus;
use crate::geometry::triangle::Triangle;
use crate::math::frame::Frame;
use crate::math::random::TestRandom;
use crate::math::{DVec3, Vec3};

const OBJECT: u32 = 7;

/// Samples of the irradiance from a light with radiance 1, at a point on the floor y = 0.
fn irradiance_samples(light: &AreaLight, from: Vec3, count: u32) -> Vec<f64> {
    let mut random = TestRandom::new(5);
    let mut one = || {
        let sample = light.sample(from, Vec3::Y, [random.unit_f32(), random.unit_f32()]);
        sample.map_or(0.0, |sample| f64::from(sample.weight.x * sample.direction.y.max(0.0)))
    };
    (0..count).map(|_| one()).collect()
}

/// The mean, and the relative standard deviation of a single sample.
fn mean_and_relative_deviation(samples: &[f64]) -> (f64, f64) {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / n;
    (mean, variance.sqrt() / mean)
}

/// Shapes about 1 unit in size, at a distance of `gap` above or next to the origin.
fn named_light_shapes(gap: f64) -> Vec<(&'static str, Shape)> {
    let at = |x: f64, y: f64| DVec3::new(x, y + gap, 0.0);
    let slant = DVec3::new(0.1, 1.0, 0.05).normalize();
    vec![
        ("disk, facing down", Shape::Disk(Disk::new(at(0.2, 0.0), DVec3::NEG_Y, 0.5))),
        ("disk, upright", Shape::Disk(Disk::new(at(-gap, 0.5), DVec3::new(1.0, -0.1, 0.0), 0.5))),
        ("cylinder, lying", Shape::Cylinder(Cylinder::new(at(-0.7, 0.3), at(0.5, 0.3), 0.3, true))),
        ("cylinder, thin", Shape::Cylinder(Cylinder::new(at(-0.7, 0.02), at(0.5, 0.02), 0.02, false))),
        (
            "cylinder, standing",
            Shape::Cylinder(Cylinder::new(at(-0.3 - gap, 0.0), at(-0.3 - gap, 1.0), 0.3, true)),
        ),
        ("cylinder, above", Shape::Cylinder(Cylinder::new(at(0.1, 0.0), at(0.1, 0.4) + slant, 0.4, true))),
        ("coin", Shape::Cylinder(Cylinder::new(at(-0.02, 0.5), at(0.02, 0.5), 0.5, true))),
        ("cone, tip down", Shape::Cone(Cone::new(at(0.1, 1.0), at(0.0, 0.0), 0.5, true))),
        ("cone, tip up", Shape::Cone(Cone::new(at(-0.5 - gap, 0.0), at(-0.5 - gap, 1.0), 0.5, true))),
        ("cone, lying", Shape::Cone(Cone::new(at(0.6, 0.4), at(-0.6, 0.1), 0.38, true))),
        ("torus, lying", Shape::Torus(Torus::new(at(0.5, 0.2), DVec3::Y, 0.5, 0.2))),
        ("torus, slim", Shape::Torus(Torus::new(at(0.5, 0.03), DVec3::Y, 0.5, 0.03))),
        ("torus, above", Shape::Torus(Torus::new(at(0.0, 0.2), DVec3::Y, 0.5, 0.2))),
        ("torus, standing", Shape::Torus(Torus::new(at(0.0, 0.7), DVec3::X, 0.5, 0.2))),
        (
            "triangle",
            Shape::Triangle(Triangle { a: at(-0.3, 0.0), b: at(0.6, 0.1), c: at(0.0, 0.4) - DVec3::Z }),
        ),
        ("quad", Shape::Quad(Parallelogram::new(at(-0.3, 0.0) - DVec3::Z * 0.4, DVec3::X, DVec3::Z))),
        ("box", Shape::Box(OrientedBox::new(at(0.1, 0.5), DVec3::new(1.0, 1.0, 0.6), DVec3::ZERO))),
    ]
}

fn light_from_shape(shape: &Shape) -> AreaLight {
    new_front_area_light(shape, Vec3::ONE, OBJECT).expect("the shape should have an area")
}

#[test]
fn area_light_variance_is_bounded() {
    let mut worse = Vec::new();
    for gap in [1e-4, 0.01, 0.1, 1.0, 10.0] {
        for (name, shape) in named_light_shapes(gap) {
            for from in [Vec3::ZERO, Vec3::new(0.05, 0.0, 0.1)] {
                let samples = irradiance_samples(&light_from_shape(&shape), from, 20_000);
                let (mean, scatter) = mean_and_relative_deviation(&samples);
                if !(mean > 1e-9) {
                    continue;
                }
                let (ball, cosines) = sphere_cosine_deviations(&shape, from);
                // For elongated lights, cosines at the receiver vary regardless of the sampling method.
                let verdict = if scatter > (2.0 * ball).max(1.2 * cosines) + 0.04 { "TOO HIGH" } else { "" };
                let line = format!(
                    "{gap:7} {name:20} E {mean:8.5} scatter {scatter:.3}, ball {ball:.3}, cosines {cosines:.3} {verdict}"
                );
                println!("{line}");
                if !verdict.is_empty() {
                    worse.push(line);
                }
            }
        }
    }
    assert!(worse.is_empty(), "{}", worse.join("\n"));
}

/// Computes two relative standard deviations. The first is for a sphere with the same mean direction and
/// solid angle as the shape (above and below the floor). The second is for the cosine at the receiver if
/// directions are uniform over the shape's solid angle.
fn sphere_cosine_deviations(shape: &Shape, from: Vec3) -> (f64, f64) {
    // Trace rays in a cone around the shape's center, and keep the rays that hit its front.
    let frame = Frame::from_normal((shape.centroid().as_vec3() - from).normalize());
    let (mut solid_angle, mut sum, mut cosines) = (0.0, Vec3::ZERO, Vec::new());
    let around = shape.bounds().expect("expected a finite shape");
    let reach = around.extent().length() * 0.5 / (around.center() - from).length();
    let one_minus_cos = if reach < 0.9 { 1.02 * (1.0 - (1.0 - reach * reach).sqrt()) } else { 2.0 };
    let n = 20_000;
    for i in 0..n {
        let u = [(i as f32 + 0.5) / n as f32, (f64::from(i) * 0.618_033_988_75).fract() as f32];
        let direction = frame.to_world(crate::sampling::warp::cone(u, one_minus_cos));
        if light_hit(shape, from, direction).is_some_and(|(hit, _)| hit.normal.dot(direction) < 0.0) {
            solid_angle += std::f64::consts::TAU * f64::from(one_minus_cos) / f64::from(n);
            sum += direction;
            cosines.push(f64::from(direction.y.max(0.0)));
        }
    }
    let cos = 1.0 - (solid_angle / std::f64::consts::TAU).min(0.9999);
    let radius = (1.0 - cos * cos).sqrt();
    let Some(towards) = sum.try_normalize() else { return (0.0, 0.0) };
    let ball = Shape::Sphere(Sphere { center: from.as_dvec3() + towards.as_dvec3(), radius });
    (
        mean_and_relative_deviation(&irradiance_samples(&light_from_shape(&ball), from, 20_000)).1,
        mean_and_relative_deviation(&cosines).1,
    )
}

/// Number of direction cells along each axis.
const SIDE: usize = 20;
/// Number of samples per light.
const COUNT: usize = 200_000;

/// Distances from the floor to the lights, and points on the floor for which the lights are sampled.
const PLACES: [(f64, Vec3); 2] = [(0.02, Vec3::ZERO), (0.8, Vec3::new(0.3, 0.0, -0.2))];

#[test]
fn shape_samples_follow_their_pdf() {
    let mut checked = 0;
    for (gap, from) in PLACES {
        let ball = ("ball", Shape::Sphere(Sphere { center: DVec3::Y * (0.5 + gap), radius: 0.5 }));
        for (name, shape) in named_light_shapes(gap).into_iter().chain([ball]) {
            // Squares must be narrow compared with the shape.
            let fine = if name.ends_with("thin") { 30 } else { 16 };
            let name = format!("{name} at {gap}");
            checked += u32::from(follows_its_pdf(&name, &shape, &light_from_shape(&shape), from, fine));
        }
    }
    assert!(checked >= 30, "{checked}");
}

#[test]
fn textured_quad_samples_follow_their_pdf() {
    for (gap, from) in PLACES {
        // If the quad were closer, the edges of bright areas would be too slanted relative to the squares.
        for (name, shape, light) in textured_quads(gap + 0.3) {
            let name = format!("{name} at {gap}");
            // Use finer squares to resolve the edges between texels.
            assert!(follows_its_pdf(&name, &shape, &light, from, 30), "{name}");
        }
    }
}

/// Checks that samples follow their pdf, which is evaluated once in each of `fine` × `fine` squares of a
/// cell. Returns false if there are too few samples to decide.
fn follows_its_pdf(name: &str, shape: &Shape, light: &AreaLight, from: Vec3, fine: usize) -> bool {
    let Some((directions, bins)) = histogram(light, from) else { return false };
    check_bins(name, &bins, &expected_counts(shape, light, from, &directions, fine))
}

/// Quads with emission textures, placed above the origin.
fn textured_quads(gap: f64) -> Vec<(&'static str, Shape, AreaLight)> {
    let at = |x: f64, z: f64| DVec3::new(x, gap, z);
    let spot =
        |[x, y]: [f64; 2]| Vec3::splat(if x > 0.25 && x < 0.5 && y > 0.6 && y < 0.8 { 1.0 } else { 0.0 });
    let steps = |[x, y]: [f64; 2]| Vec3::new((x * 3.0).floor() as f32, 0.2, (y * 2.0).floor() as f32 * 4.0);
    let square = Parallelogram::new(at(-0.3, -0.4), DVec3::X, DVec3::Z);
    let skew = Parallelogram::new(at(-0.6, -0.4), DVec3::new(1.0, 0.1, 0.2), DVec3::new(0.4, 0.0, 0.9));
    let far = Parallelogram::new(at(-0.3, 9.0), DVec3::new(-0.2, 0.2, 0.3), DVec3::new(0.5, 0.5, 0.0));
    let with_texture = |name, quad: Parallelogram, texels, color: &dyn Fn([f64; 2]) -> Vec3| {
        let emitter = QuadEmitter::new(quad.corner, quad.u, quad.v);
        let textured = TexturedQuadEmitter::new(emitter, texels, color).expect("a textured quad");
        let shape = Shape::Quad(quad);
        let light = light_from_shape(&shape);
        (name, shape, AreaLight { shape: Emitter::TexturedQuad(Box::new(textured)), ..light })
    };
    vec![
        with_texture("spot", square, [4.0, 5.0], &spot),
        with_texture("steps", square, [3.0, 2.0], &steps),
        with_texture("skew steps", skew, [3.0, 2.0], &steps),
        with_texture("skew spot", skew, [20.0, 20.0], &spot),
        with_texture("far steps", far, [6.0, 4.0], &steps),
    ]
}

#[test]
fn textured_quad_pdf_matches_its_samples() {
    let mut random = TestRandom::new(9);
    for (name, shape, light) in [0.02, 0.8].into_iter().flat_map(textured_quads) {
        let (mut compared, mut apart) = (0, 0);
        for _ in 0..4000 {
            let from = Vec3::new(random.unit_f32() - 0.5, 0.0, random.unit_f32() - 0.5);
            let Some(sample) = light.sample(from, Vec3::Y, [random.unit_f32(), random.unit_f32()]) else {
                continue;
            };
            let Some((hit, _)) = light_hit(&shape, from, sample.direction) else { continue };
            let product = light.pdf(from, Vec3::Y, &hit) * sample.weight.x;
            compared += 1;
            // A sample on the border between two texels may belong to either.
            apart += u32::from((product - 1.0).abs() > 2e-3);
        }
        assert!(compared > 3500 && apart < 10, "{name}: {apart} of {compared} differ");
    }
}

#[test]
fn small_bright_areas_have_low_variance() {
    // One hundredth of the square is bright. It causes the same irradiance as a square one tenth as wide.
    let bright =
        |[x, y]: [f64; 2]| -> f32 { if x > 0.3 && x < 0.4 && y > 0.6 && y < 0.7 { 1.0 } else { 0.0 } };
    for gap in [0.3, 2.0] {
        let quad = Parallelogram::new(DVec3::new(-0.5, gap, -0.5), DVec3::X, DVec3::Z);
        let emitter = QuadEmitter::new(quad.corner, quad.u, quad.v);
        let color = |at: [f64; 2]| Vec3::splat(bright(at));
        let textured = TexturedQuadEmitter::new(emitter, [10.0, 10.0], color).expect("a textured quad");
        let plain = light_from_shape(&Shape::Quad(quad));
        let with_texture = AreaLight { shape: Emitter::TexturedQuad(Box::new(textured)), ..plain.clone() };
        let small = Parallelogram::new(DVec3::new(-0.2, gap, 0.1), DVec3::X * 0.1, DVec3::Z * 0.1);
        let exact = mean_and_relative_deviation(&irradiance_samples(
            &light_from_shape(&Shape::Quad(small)),
            Vec3::ZERO,
            40_000,
        ))
        .0;
        let scatter = [(&plain, 0.06), (&with_texture, 3e-3)].map(|(light, max_relative_error)| {
            let mut random = TestRandom::new(5);
            let mut one = || {
                let sample = light.sample(Vec3::ZERO, Vec3::Y, [random.unit_f32(), random.unit_f32()]);
                sample.map_or(0.0, |sample| {
                    let ShadowRayEnd::At(target) = sample.end else { panic!("expected a finite light") };
                    let at = [target.x + 0.5, target.z + 0.5].map(f64::from);
                    f64::from(sample.weight.x * sample.direction.y.max(0.0) * bright(at))
                })
            };
            let samples: Vec<f64> = (0..40_000).map(|_| one()).collect();
            let (mean, scatter) = mean_and_relative_deviation(&samples);
            let error = mean * scatter / 200.0;
            assert!(error < max_relative_error * exact, "{gap}: too noisy: {mean} ± {error}");
            assert!((mean - exact).abs() < 4.0 * error, "{gap}: {mean} ± {error} instead of {exact}");
            scatter
        });
        assert!(scatter[0] > 5.0 && scatter[1] < 0.5, "{gap}: {scatter:?}");
    }
}

/// Computes the expected number of samples in each cell by integrating the pdf. Also returns the variance of
/// this estimate.
fn expected_counts(
    shape: &Shape,
    light: &AreaLight,
    from: Vec3,
    directions: &DirectionGrid,
    fine: usize,
) -> Vec<(f64, f64)> {
    let square = directions.total_solid_angle() / (SIDE * SIDE * fine * fine) as f64 * COUNT as f64;
    let mut random = TestRandom::new(3);
    let mut bins = vec![(0.0, 0.0); SIDE * SIDE];
    for i in 0..SIDE * fine {
        let mut before = 0.0;
        for j in 0..SIDE * fine {
            let place = [i, j].map(|k| (k as f32 + random.unit_f32()) / (SIDE * fine) as f32);
            let hit = light_hit(shape, from, directions.direction(place));
            let share = hit.map_or(0.0, |(hit, _)| f64::from(light.pdf(from, Vec3::Y, &hit)) * square);
            let (wanted, variance) = &mut bins[i / fine * SIDE + j / fine];
            *wanted += share;
            // A square on a border is counted either entirely or not at all.
            if (share - before).abs() > 0.2 * share.max(before) {
                *variance += (0.5 * (share - before)).powi(2);
            }
            before = share;
        }
    }
    bins
}

/// Compares sample counts with expected counts. Returns whether enough cells contain samples.
fn check_bins(name: &str, bins: &[usize], expected: &[(f64, f64)]) -> bool {
    let total: f64 = expected.iter().map(|(wanted, _)| wanted).sum();
    let off = total - bins.iter().sum::<usize>() as f64;
    assert!(off.abs() < 4e-3 * COUNT as f64, "{name}: expected {total} samples, {off} are missing");
    let (mut chi2, mut cells) = (0.0, 0);
    let (mut rest, mut rest_seen) = (0.0, 0.0);
    for ((wanted, variance), seen) in expected.iter().zip(bins) {
        if *wanted < 25.0 {
            (rest, rest_seen) = (rest + wanted, rest_seen + *seen as f64);
            continue;
        }
        chi2 += (*seen as f64 - wanted).powi(2) / (wanted + variance);
        cells += 1;
    }
    let allowed = 6.0 * (rest + 25.0).sqrt() + 0.05 * rest + 1e-4 * COUNT as f64;
    assert!(
        (rest - rest_seen).abs() < allowed,
        "{name}: expected {rest} samples in small cells, found {rest_seen}"
    );
    // Wilson–Hilferty approximation. The significance level is 1 % for all tests combined (Šidák correction).
    let k = f64::from(cells);
    let z = ((chi2 / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt();
    assert!(cells < 5 || z < 3.45, "{name}: χ² {chi2} for {cells} cells, z {z}");
    cells >= 5
}

/// Checks the irradiance from a light with radiance 1 at the origin, on the floor. Compares an estimate from
/// independent samples with the exact value. The difference must be within four standard errors, and the
/// standard error has an upper bound.
#[track_caller]
fn assert_irradiance(shape: &Shape, exact: f64, greatest_error: f64) {
    let count = 40_000;
    let (mean, scatter) =
        mean_and_relative_deviation(&irradiance_samples(&light_from_shape(shape), Vec3::ZERO, count));
    let error = mean * scatter / f64::from(count).sqrt();
    assert!(error <= greatest_error * exact, "{shape:?}: ± {error}");
    let allowed = 4.0 * error + 1e-5 * exact;
    assert!((mean - exact).abs() <= allowed, "{shape:?}: {mean} ± {error} instead of {exact}");
}

#[test]
fn irradiance_matches_closed_forms() {
    use std::f64::consts::PI;
    let error = 0.003;
    for (radius, height) in [(1.0, 1e-4), (1.0, 0.01), (0.5, 0.3), (1.0, 1.0), (0.1, 20.0), (1e-4, 20.0)] {
        let (r2, h2) = (radius * radius, height * height);
        let disk = |center, normal| Shape::Disk(Disk::new(center, normal, radius));
        assert_irradiance(&disk(DVec3::Y * height, DVec3::NEG_Y), PI * r2 / (r2 + h2), error);
        // A point that is not below the center of a parallel disk (Howell, *A Catalog of Radiation Heat
        // Transfer Configuration Factors*, B-13).
        let beside = 0.8 * radius;
        let (h, r) = (height / beside, radius / beside);
        let z = 1.0 + h * h + r * r;
        // Z² − 4R², computed without cancellation.
        let root = ((h * h + (1.0 - r) * (1.0 - r)) * (h * h + (1.0 + r) * (1.0 + r))).sqrt();
        let factor = if radius < 1e-3 * height {
            r2 * h2 / (h2 + beside * beside).powi(2)
        } else {
            0.5 * (1.0 - (z - 2.0 * r * r) / root)
        };
        assert_irradiance(&disk(DVec3::new(beside, height, 0.0), DVec3::NEG_Y), PI * factor, error);
        // A sphere that is entirely above the horizon.
        let distance = radius + height;
        let center = DVec3::new(0.6, 0.8, 0.0) * distance;
        if center.y >= radius {
            let ball = Shape::Sphere(Sphere { center, radius });
            assert_irradiance(&ball, PI * 0.8 * r2 / (distance * distance), error);
        }
    }
    for (height, exact) in [(0.1, 3.042_128), (1.0, 0.752_274_688_5), (4.0, 0.061_225_761_1)] {
        // A square as a quad, half of it as a triangle, and as the bottom face of a box.
        let at = |x: f64, z: f64| DVec3::new(x - 0.5, height, z - 0.5);
        assert_irradiance(&Shape::Quad(Parallelogram::new(at(0.0, 0.0), DVec3::X, DVec3::Z)), exact, error);
        let half = Triangle { a: at(0.0, 0.0), b: at(1.0, 0.0), c: at(1.0, 1.0) };
        assert_irradiance(&Shape::Triangle(half), 0.5 * exact, error);
        let center = DVec3::Y * (height + 0.5);
        assert_irradiance(&Shape::Box(OrientedBox::new(center, DVec3::ONE, DVec3::ZERO)), exact, error);
    }
    // The irradiance from a distant convex body is its radiance times its projected area: 2·R·h for a
    // cylinder seen from the side, and R·h for a cone.
    let up = DVec3::Y * 1e5;
    let far = |shown: f64| shown * 1e-10;
    let bar = Cylinder::new(up - DVec3::X, up + DVec3::X, 0.5, true);
    assert_irradiance(&Shape::Cylinder(bar), far(2.0), error);
    let cone = Cone::new(up - DVec3::X, up + DVec3::X, 0.5, true);
    assert_irradiance(&Shape::Cone(cone), far(1.0), error);
}

/// Directions around an axis, mapped to the unit square.
struct DirectionGrid {
    frame: Frame,
    one_minus_cos: f32,
}

impl DirectionGrid {
    fn total_solid_angle(&self) -> f64 {
        std::f64::consts::TAU * f64::from(self.one_minus_cos)
    }

    fn direction(&self, place: [f32; 2]) -> Vec3 {
        self.frame.to_world(crate::sampling::warp::cone(place, self.one_minus_cos))
    }

    fn to_unit_square(&self, direction: Vec3) -> [f32; 2] {
        let Frame { s, t, n } = self.frame;
        let turn = direction.dot(t).atan2(direction.dot(s)) / std::f32::consts::TAU;
        [(1.0 - direction.dot(n)) / self.one_minus_cos, if turn < 0.0 { turn + 1.0 } else { turn }]
    }
}

/// Counts the samples in each direction cell. Returns `None` if there are no samples.
fn histogram(light: &AreaLight, from: Vec3) -> Option<(DirectionGrid, Vec<usize>)> {
    let mut random = TestRandom::new(11);
    let samples: Vec<Vec3> = (0..COUNT)
        .filter_map(|_| light.sample(from, Vec3::Y, [random.unit_f32(), random.unit_f32()]))
        .map(|sample| sample.direction)
        .collect();
    let middle = samples.iter().sum::<Vec3>().try_normalize()?;
    let least = samples.iter().map(|direction| direction.dot(middle)).fold(1.0, f32::min);
    let directions =
        DirectionGrid { frame: Frame::from_normal(middle), one_minus_cos: (1.0 - least) * 1.01 + 1e-6 };
    let mut bins = vec![0; SIDE * SIDE];
    for direction in samples {
        let [i, j] = directions.to_unit_square(direction).map(|x| ((x * SIDE as f32) as usize).min(SIDE - 1));
        bins[i * SIDE + j] += 1;
    }
    Some((directions, bins))
}
