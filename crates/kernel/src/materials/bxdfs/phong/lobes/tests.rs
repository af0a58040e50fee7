//! Tests that compare samples with pdfs, and the means of samples with exact albedos.

use super::*;
use crate::materials::phong::PhongPoint;
use crate::math::random::unit_generator as random;

fn bsdf(diffuse: f32, specular: f32, shininess: f32) -> PhongPoint {
    let [diffuse, specular] = [diffuse, specular].map(Vec3::splat);
    PhongPoint { diffuse, specular, shininess, ambient: Vec3::ZERO }
}

/// Unit normals. One of them is near a frame's pole.
fn normals() -> [Vec3; 3] {
    [Vec3::Z, Vec3::new(3.85e-4, 3.85e-4, -0.999_999_9).normalize(), Vec3::new(0.6, -0.48, 0.64)]
}

/// A direction at an angle from a normal.
fn at_angle(normal: Vec3, degrees: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let frame = Frame::from_normal(normal);
    frame.to_world(Vec3::new(0.8 * sin, -0.6 * sin, cos)).normalize()
}

const SAMPLES: u32 = 200_000;

fn sample(lobes: &PhongLobes, next: &mut impl FnMut() -> f32) -> Vec3 {
    let lobe = next();
    lobes.sample(lobe, [next(), next()])
}

/// χ² test of counts. The statistic may be at most six standard deviations above its mean, which is exceeded
/// with a probability of 1e-9.
fn assert_counts(what: &str, counts: &[u32], expected: &[f64]) {
    let (mut sum, mut cells, mut rest) = (0.0, 0, [0.0; 2]);
    for (count, expected) in counts.iter().zip(expected) {
        if *expected >= 5.0 {
            sum += (f64::from(*count) - expected).powi(2) / expected;
            cells += 1;
        } else {
            rest = [rest[0] + f64::from(*count), rest[1] + expected];
        }
    }
    if rest[1] >= 5.0 {
        sum += (rest[0] - rest[1]).powi(2) / rest[1];
        cells += 1;
    } else {
        assert!(rest[0] <= 5.0 * rest[1] + 8.0, "{what}: {rest:?} in cells with tiny expected counts");
    }
    let free = f64::from(cells - 1);
    assert!(sum < free + 6.0 * (2.0 * free).sqrt(), "{what}: χ² {sum} with {free} degrees of freedom");
}

#[test]
fn glossy_samples_follow_the_pdf() {
    let mut next = random(7);
    for (i, normal) in normals().into_iter().enumerate() {
        for (j, shininess) in [0.0_f32, 1.0, 4.5, 30.0, 1e3, 1e4, 1e5].into_iter().enumerate() {
            // Two angles per pair, such that each angle occurs with every normal and every shininess.
            for degrees in [0.0, 45.0, 80.0, 89.9].into_iter().skip((i + j) % 2).step_by(2) {
                let lobes = bsdf(0.0, 0.5, shininess).lobes(normal, at_angle(normal, degrees));
                let frame = Frame::from_normal(lobes.mirrored_eye.normalize());
                let n = f64::from(shininess) + 1.0;
                let mut counts = vec![0; 256];
                for number in 0..2 * SAMPLES {
                    let direction = sample(&lobes, &mut next);
                    let offset = (direction - lobes.mirrored_eye).as_dvec3();
                    let cosine = 1.0 - 0.5 * offset.length_squared();
                    // cos^(α + 1) and the azimuth are uniformly distributed.
                    let power = cosine.max(0.0).powf(n - 1.0);
                    let ring = (power * cosine * 16.0) as usize;
                    let phi = frame.t.dot(direction).atan2(frame.s.dot(direction)) / (2.0 * PI) + 0.5;
                    counts[ring.min(15) * 16 + ((phi * 16.0) as usize).min(15)] += 1;
                    // The value of the pdf is slow to compute, so check it only for some of the samples.
                    if number % 8 != 0 {
                        continue;
                    }
                    let density =
                        lobes.pdf(direction, phong_cosine_power(lobes.mirrored_eye, direction, shininess));
                    let exact = n / std::f64::consts::TAU * power;
                    let is_near = (f64::from(density) - exact).abs() <= 2e-3 * exact + 1e-6 * n;
                    assert!(is_near, "α {shininess} at {degrees}°: {density} instead of {exact}");
                }
                let what = format!("α {shininess} at {degrees}° from {normal}");
                assert_counts(&what, &counts, &[f64::from(SAMPLES) / 128.0; 256]);
                let rings: Vec<u32> = counts.chunks(16).map(|ring| ring.iter().sum()).collect();
                assert_counts(&what, &rings, &[f64::from(SAMPLES) / 8.0; 16]);
            }
        }
    }
}

const RINGS: usize = 24;
const STEPS: usize = 24;

/// Integral of the pdf over each of the sphere's equal-area cells.
fn integrals(lobes: &PhongLobes) -> Vec<f64> {
    const FINE: usize = 24;
    let cell = |ring: usize, step: usize| {
        let places = (0..FINE * FINE).map(|i| {
            let part = |place: usize, i: usize, of: usize| {
                (place as f64 + (i as f64 + 0.5) / FINE as f64) / of as f64
            };
            let z = 2.0 * part(ring, i / FINE, RINGS) - 1.0;
            let (sin, cos) = libm::sincos(std::f64::consts::TAU * part(step, i % FINE, STEPS));
            let r = (1.0 - z * z).sqrt();
            let direction = Vec3::new((r * cos) as f32, (r * sin) as f32, z as f32);
            f64::from(
                lobes.pdf(direction, phong_cosine_power(lobes.mirrored_eye, direction, lobes.shininess)),
            )
        });
        places.sum::<f64>() / (FINE * FINE) as f64 * 2.0 * std::f64::consts::TAU / (RINGS * STEPS) as f64
    };
    (0..RINGS * STEPS).map(|i| cell(i / STEPS, i % STEPS)).collect()
}

#[test]
fn combined_lobe_samples_follow_the_pdf() {
    let mut next = random(11);
    for normal in normals() {
        for (diffuse, specular, shininess) in
            [(0.5, 0.0, 9.0), (0.5, 0.3, 1.0), (0.2, 0.7, 12.0), (0.6, 0.3, 50.0)]
        {
            for degrees in [0.0, 60.0, 89.0] {
                let lobes = bsdf(diffuse, specular, shininess).lobes(normal, at_angle(normal, degrees));
                let integrals = integrals(&lobes);
                let what = format!("{diffuse}, {specular}, α {shininess} at {degrees}° from {normal}");
                let whole = integrals.iter().sum::<f64>();
                assert!((whole - 1.0).abs() < 2e-3, "{what}: the pdf integrates to {whole}");
                let mut counts = vec![0; RINGS * STEPS];
                for _ in 0..SAMPLES {
                    let direction = sample(&lobes, &mut next);
                    let phi = direction.y.atan2(direction.x).rem_euclid(2.0 * PI) / (2.0 * PI);
                    let ring = ((direction.z + 1.0) * 0.5 * RINGS as f32) as usize;
                    let step = (phi * STEPS as f32) as usize;
                    counts[ring.min(RINGS - 1) * STEPS + step.min(STEPS - 1)] += 1;
                }
                let expected: Vec<f64> =
                    integrals.iter().map(|part| part / whole * f64::from(SAMPLES)).collect();
                assert_counts(&what, &counts, &expected);
            }
        }
    }
}

/// Albedo, estimated as the mean of f·cos/pdf over samples.
fn albedo(bsdf: &PhongPoint, degrees: f32) -> f64 {
    let (mut next, normal) = (random(3), normals()[2]);
    let lobes = bsdf.lobes(normal, at_angle(normal, degrees));
    let one = |_| {
        let direction = sample(&lobes, &mut next);
        let gloss = phong_cosine_power(lobes.mirrored_eye, direction, lobes.shininess);
        let cosine = normal.dot(direction).max(0.0);
        assert!(
            (lobes.gray_f_of_all_lobes(gloss) - bsdf.f(normal, at_angle(normal, degrees), direction).x).abs()
                <= 1e-6 * lobes.gray_f_of_all_lobes(gloss)
        );
        f64::from(lobes.gray_f_of_all_lobes(gloss) * cosine / lobes.pdf(direction, gloss))
    };
    (0..SAMPLES).map(one).sum::<f64>() / f64::from(SAMPLES)
}

#[test]
fn sampled_albedos_match_exact_values() {
    // Compute (n + 2)/2π ∫cosⁿα cosθ dω.
    for (shininess, known) in [(10.0, [1.0, 0.8661, 0.5047, 0.2281]), (100.0, [1.0, 0.8660, 0.5, 0.1752])] {
        for (degrees, known) in [0.0, 30.0, 60.0, 80.0].into_iter().zip(known) {
            let found = albedo(&bsdf(0.0, 1.0, shininess), degrees);
            assert!((found - known).abs() < 3e-3, "α {shininess} at {degrees}°: {found} instead of {known}");
            let both = albedo(&bsdf(0.4, 0.6, shininess), degrees);
            assert!((both - 0.4 - 0.6 * known).abs() < 4e-3, "with a diffuse lobe: {both}");
        }
    }
    // For narrow lobes, the albedo approaches cosθ.
    for degrees in [0.0_f32, 45.0, 80.0, 89.0] {
        let found = albedo(&bsdf(0.0, 1.0, 1e5), degrees);
        let known = f64::from(degrees.to_radians().cos());
        assert!((found - known).abs() < 2e-3, "α 1e5 at {degrees}°: {found} instead of {known}");
    }
}

#[test]
fn values_are_reciprocal() {
    let mut next = random(5);
    for shininess in [1.0, 20.0, 1e4] {
        let bsdf = bsdf(0.3, 0.6, shininess);
        for _ in 0..10_000 {
            let normal = normals()[2];
            let [eye, light] = [(); 2].map(|()| at_angle(normal, 89.0 * next()));
            let near = Frame::from_normal(bsdf.lobes(normal, eye).mirrored_eye)
                .to_world(Vec3::new(0.01 * next(), 0.0, 1.0))
                .normalize();
            for light in [light, near] {
                let there = bsdf.f(normal, eye, light).x;
                let back = bsdf.f(normal, light, eye).x;
                assert!((there - back).abs() <= 3e-3 * there, "α {shininess}: {there}, reversed {back}");
            }
        }
    }
}
