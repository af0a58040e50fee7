use std::f64::consts::{PI, TAU};

use super::sun::{OrientedSunDisk, SUN_ANGLE_DEGREES};
use super::*;
use crate::lights::Light;
use crate::lights::infinite::{DirectionalLight, Environment};
use crate::math::random::TestRandom;

fn parameters(turbidity: f64, degrees: f64, ground: [f32; 3]) -> SkyModelInputs {
    SkyModelInputs {
        sun_elevation: degrees.to_radians(),
        turbidity,
        ground: Vec3::from_array(ground),
        sun_angle: SUN_ANGLE_DEGREES.to_radians(),
        sun_scale: 1.0,
        sky_scale: 1.0,
        ground_scale: 1.0,
    }
}

/// Unit direction at an elevation and at an azimuth relative to the sun, which is toward +x.
fn direction(elevation: f64, azimuth: f64) -> DVec3 {
    DVec3::new(elevation.cos() * azimuth.cos(), elevation.sin(), elevation.cos() * azimuth.sin())
}

fn frame(parameters: &SkyModelInputs) -> SkyFrame {
    SkyFrame::new(direction(parameters.sun_elevation, 0.0), DVec3::Y)
}

fn assert_near(what: &str, found: Vec3, expected: [f64; 3], tolerance: f64) {
    let expected = DVec3::from_array(expected);
    let off = (found.as_dvec3() - expected).abs().max_element();
    assert!(off <= tolerance * expected.max_element(), "{what}: {found}, not {expected}");
}

/// The expected radiances are the authors' tables and formula, evaluated in double precision with another
/// program.
#[test]
fn radiances_match_the_published_model() {
    for (turbidity, ground, sun, elevation, azimuth, expected) in [
        (2.0, [0.3; 3], 60.0, 90.0, 0.0, [0.026_435_573_8, 0.046_140_105_1, 0.098_348_583_3]),
        (3.25, [0.1, 0.5, 0.9], 30.0, 30.0, 0.0, [0.270_820_341, 0.301_310_841, 0.305_894_535]),
        (3.25, [0.1, 0.5, 0.9], 30.0, 1.0, 140.0, [0.128_640_804, 0.205_468_24, 0.251_408_697]),
        (8.5, [0.0; 3], 5.0, 20.0, 75.0, [0.045_330_448_3, 0.044_781_710_5, 0.038_342_997_4]),
        (10.0, [1.0; 3], 85.0, 45.0, 10.0, [0.209_743_221, 0.233_904_221, 0.270_142_499]),
        (1.0, [0.3; 3], 2.0, 0.2, 5.0, [0.100_997_843, 0.071_853_798_1, 0.022_209_570_8]),
    ] {
        let parameters = parameters(turbidity, sun, ground);
        let dome = Sky::new(&parameters).dome.expect("a sky");
        let direction = direction(f64::to_radians(elevation), f64::to_radians(azimuth)).as_vec3();
        let found = dome.radiance_and_pdf(&frame(&parameters), direction).0;
        assert_near(&format!("turbidity {turbidity}, sun at {sun}°"), found, expected, 1e-5);
    }
}

/// The expected means are the authors' spectral tables of the sun, times the mean limb darkening at each
/// wavelength, integrated in double precision with the CIE color matching functions. The expected limb
/// darkening is for the spectrum at 60° and turbidity 2.
#[test]
fn sun_matches_the_published_model() {
    for (turbidity, degrees, expected) in [
        (2.0, 60.0, [21_164.35, 17_357.69, 13_231.43]),
        (3.25, 30.0, [19_013.84, 14_616.82, 9_681.393]),
        (3.0, 5.0, [8_807.306, 3_896.851, 583.575_6]),
        (8.5, 5.0, [973.686_5, 359.386_9, 57.114_29]),
        (10.0, 85.0, [14_188.27, 11_298.19, 9_028.51]),
    ] {
        let found = model::sun_radiance(turbidity, f64::to_radians(degrees)).as_vec3();
        assert_near(&format!("turbidity {turbidity}, sun at {degrees}°"), found, expected, 1e-6);
    }
    let parameters = parameters(2.0, 60.0, [0.3; 3]);
    let (light, to_sun) = sun_light(&parameters);
    // At μ = ½, the sine of the angle is √¾ of its value at the edge.
    let edge = parameters.sun_angle / 2.0 * 0.75_f64.sqrt();
    let [center, half] = [0.0, edge].map(|angle| light.radiance(turned(to_sun, angle).as_vec3()));
    assert_near("center", center, [25_507.96, 21_688.16, 17_489.02], 2e-3);
    assert_near("μ = ½", half, [19_092.05, 15_274.69, 11_146.86], 2e-3);
}

/// A sun with its direction.
fn sun_light(parameters: &SkyModelInputs) -> (DirectionalLight, DVec3) {
    let frame = frame(parameters);
    let disk = OrientedSunDisk { disk: Sky::new(parameters).sun.expect("a sun"), up: frame.up() };
    (DirectionalLight::from_sun(frame.sun(), disk), direction(parameters.sun_elevation, 0.0))
}

/// Moves a direction horizontally by an angle.
fn turned(direction: DVec3, angle: f64) -> DVec3 {
    direction * angle.cos() + DVec3::Z * angle.sin()
}

#[test]
fn sun_irradiance_is_radiance_times_solid_angle() {
    let model = model::sun_radiance(3.0, 40_f64.to_radians())
        * TAU
        * 2.0
        * (SUN_ANGLE_DEGREES.to_radians() / 4.0).sin().powi(2);
    for degrees in [SUN_ANGLE_DEGREES, 5.0, 30.0] {
        let parameters = SkyModelInputs {
            sun_angle: degrees.to_radians(),
            sun_scale: 0.5,
            ..parameters(3.0, 40.0, [0.3; 3])
        };
        let (light, to_sun) = sun_light(&parameters);
        // Rings of equal solid angle.
        let (half, mut sum, mut horizontal) = (parameters.sun_angle / 2.0, DVec3::ZERO, DVec3::ZERO);
        let [rings, sectors] = [400, 32];
        for (ring, sector) in (0..rings).flat_map(|ring| (0..sectors).map(move |sector| (ring, sector))) {
            let cos = 1.0 - (1.0 - half.cos()) * (f64::from(ring) + 0.5) / f64::from(rings);
            let (y, z) = ((f64::from(sector) + 0.5) / f64::from(sectors) * TAU).sin_cos();
            let up = DVec3::new(-to_sun.y, to_sun.x, 0.0);
            let at = to_sun * cos + (up * y + DVec3::Z * z) * (1.0 - cos * cos).sqrt();
            let part = light.radiance(at.as_vec3()).as_dvec3() * TAU * (1.0 - half.cos())
                / f64::from(rings * sectors);
            (sum, horizontal) = (sum + part, horizontal + part * at.y);
        }
        // The irradiance does not depend on the size of the disk, except that the radiance varies with
        // height.
        let tolerance = if degrees > 1.0 { 4e-3 } else { 1e-4 };
        assert_near(&format!("{degrees}"), (sum * 2.0).as_vec3(), model.to_array(), tolerance);
        assert_near("irradiance", light.irradiance, sum.to_array(), 1e-3);
        let disk = Sky::new(&parameters).sun.expect("a sun");
        assert_near("ground", disk.horizontal_irradiance().as_vec3(), horizontal.to_array(), 1e-3);
    }
}

#[test]
fn horizon_hides_the_lower_part_of_the_sun() {
    let parameters = parameters(2.0, 0.1, [0.3; 3]);
    let (light, to_sun) = sun_light(&parameters);
    let at = |offset: f64| direction(to_sun.y.asin() + f64::to_radians(offset), 0.0).as_vec3();
    assert!(light.radiance(at(-0.09)).x > 0.0 && light.pdf(at(-0.09)) > 0.0);
    assert_eq!(light.radiance(at(-0.11)), Vec3::ZERO);
    assert!(light.radiance(at(0.09)).x > light.radiance(at(-0.09)).x, "the air dims a lower sun");
    let mut random = TestRandom::new(3);
    let mut sample = || light.sample([random.unit_f32(), random.unit_f32()]);
    let (count, mut hidden) = (20_000, 0);
    for _ in 0..count {
        match sample() {
            Some(sample) => assert!(sample.direction.y >= 0.0),
            None => hidden += 1,
        }
    }
    // A segment of the unit disk below the height −h has the area acos h − h·√(1 − h²).
    let h = 0.1 / (SUN_ANGLE_DEGREES / 2.0);
    let expected = (h.acos() - h * (1.0 - h * h).sqrt()) / PI;
    let error = (expected * (1.0 - expected) / f64::from(count)).sqrt();
    assert!((f64::from(hidden) / f64::from(count) - expected).abs() < 4.0 * error, "{hidden} of {count}");
}

/// Integrates a function of direction over the sky with the midpoint rule. The substitution for the height
/// makes the integrand smooth at the horizon.
fn over_sky(function: impl Fn(Vec3) -> DVec3) -> DVec3 {
    let [columns, rows] = [200, 400];
    let mut sum = DVec3::ZERO;
    for (column, row) in (0..columns).flat_map(|column| (0..rows).map(move |row| (column, row))) {
        let root = (f64::from(row) + 0.5) / f64::from(rows);
        let height = root * root;
        let azimuth = (f64::from(column) + 0.5) / f64::from(columns) * TAU;
        let solid_angle = TAU / f64::from(columns) * 2.0 * root / f64::from(rows);
        sum += function(direction(height.asin(), azimuth).as_vec3()) * solid_angle;
    }
    sum
}

#[test]
fn ground_reflects_the_light_of_sky_and_sun() {
    for (sun_scale, sky_scale) in [(0.0, 1.0), (0.5, 0.0), (2.0, 0.7)] {
        let ground = [0.1, 0.4, 0.8];
        let parameters = SkyModelInputs { sun_scale, sky_scale, ..parameters(4.0, 35.0, ground) };
        let (sky, frame) = (Sky::new(&parameters), frame(&parameters));
        let dome = sky.dome.expect("a ground");
        let of_sky =
            over_sky(|at| dome.radiance_and_pdf(&frame, at).0.as_dvec3() * f64::from(at.dot(frame.up())));
        let of_sun = sky.sun.map_or(DVec3::ZERO, |sun| {
            sun.mean().as_dvec3() * TAU * sun.one_minus_cos() * 35_f64.to_radians().sin()
        });
        let expected = (of_sky + of_sun) * Vec3::from_array(ground).as_dvec3() / PI;
        for below in [Vec3::NEG_Y, direction(-1e-3, 1.0).as_vec3()] {
            let found = dome.radiance_and_pdf(&frame, below).0;
            assert_near(&format!("{sun_scale} {sky_scale}"), found, expected.to_array(), 2e-3);
        }
        let mean = (over_sky(|at| dome.radiance_and_pdf(&frame, at).0.as_dvec3()) / TAU + expected) / 2.0;
        assert_near("mean", dome.mean(), mean.to_array(), 2e-3);
    }
}

#[test]
fn black_skies_and_suns_are_absent() {
    let black = SkyModelInputs { sun_scale: 0.0, sky_scale: 0.0, ..parameters(3.0, 45.0, [0.3; 3]) };
    assert_eq!(Sky::new(&black), Sky { dome: None, sun: None });
    let sun = Sky::new(&SkyModelInputs { sun_scale: 1.0, ground: Vec3::ZERO, ..black });
    assert!(sun.dome.is_none() && sun.sun.is_some());
}

/// The frame's axes are arbitrary: the radiance depends only on the angles from the sun and the zenith.
#[test]
fn sky_is_symmetric_about_the_sun_in_any_frame() {
    let parameters = parameters(6.0, 20.0, [0.3; 3]);
    let dome = Sky::new(&parameters).dome.expect("a sky");
    let up = DVec3::new(0.48, 0.6, -0.64);
    let (toward, side) = up.any_orthonormal_pair();
    let (sin, cos) = parameters.sun_elevation.sin_cos();
    let turned = SkyFrame::new(toward * cos + up * sin, up);
    let mut random = TestRandom::new(5);
    for _ in 0..2000 {
        let (elevation, azimuth) = (random.unit().asin(), random.signed() * PI);
        let plain = direction(elevation, azimuth);
        let mirrored = direction(elevation, -azimuth).as_vec3();
        let world = (toward * plain.x + up * plain.y + side * plain.z).as_vec3();
        let expected = dome.radiance_and_pdf(&frame(&parameters), plain.as_vec3()).0.as_dvec3().to_array();
        assert_near("mirrored", dome.radiance_and_pdf(&frame(&parameters), mirrored).0, expected, 1e-4);
        assert_near("turned", dome.radiance_and_pdf(&turned, world).0, expected, 1e-4);
    }
}

#[test]
fn samples_have_the_pdf_of_their_direction() {
    for (turbidity, degrees, sky_scale) in
        [(2.0, 5.0, 1.0), (10.0, 1.0, 1.0), (4.0, 90.0, 1.0), (4.0, 40.0, 0.0)]
    {
        let parameters = SkyModelInputs { sky_scale, ..parameters(turbidity, degrees, [0.3; 3]) };
        let (dome, frame) = (Sky::new(&parameters).dome.expect("a sky"), frame(&parameters));
        let light = Light::Environment(Environment::Sky { dome: dome.clone(), frame });
        let mut random = TestRandom::new(7);
        let (count, mut apart, mut sums) = (20_000, 0, [DVec3::ZERO; 2]);
        for _ in 0..count {
            let u = [random.unit_f32(), random.unit_f32()];
            let (direction, radiance, pdf) = dome.sample(&frame, u);
            // Rounding moves few directions into another cell.
            apart += u32::from(dome.radiance_and_pdf(&frame, direction) != (radiance, pdf));
            assert!((direction.length() - 1.0).abs() < 1e-6 && pdf > 0.0);
            let weight = (radiance / pdf).as_dvec3();
            sums = [sums[0] + weight, sums[1] + weight * weight];
            let sample = light.sample(Vec3::ZERO, Vec3::Y, u);
            let of_light = sample.map_or(Vec3::ZERO, |sample| sample.weight).as_dvec3();
            assert!((of_light - weight).length() <= 1e-6 * weight.length(), "{of_light} {weight}");
        }
        assert!(apart < count / 100, "{apart} of {count} pdfs differ");
        let mean = sums[0] / f64::from(count);
        let error =
            ((sums[1] / f64::from(count) - mean * mean) / f64::from(count)).max(DVec3::ZERO).powf(0.5);
        let exact = dome.mean().as_dvec3() * 4.0 * PI;
        assert!(error.max_element() < 0.01 * exact.max_element(), "{error}");
        assert!(
            ((mean - exact).abs() - error * 4.0).max_element() < 2e-3 * exact.max_element(),
            "{mean} {exact}"
        );
    }
}

#[test]
fn pdfs_integrate_to_one() {
    let parameters = parameters(3.0, 25.0, [0.5; 3]);
    let (dome, frame) = (Sky::new(&parameters).dome.expect("a sky"), frame(&parameters));
    let pdf = |at: Vec3| DVec3::splat(f64::from(dome.radiance_and_pdf(&frame, at).1));
    let below = f64::from(dome.radiance_and_pdf(&frame, Vec3::NEG_Y).1) * TAU;
    let total = over_sky(pdf).x + below;
    assert!((total - 1.0).abs() < 2e-3, "{total}");
}

#[test]
fn ground_scale_changes_only_the_ground() {
    let usual = parameters(3.0, 40.0, [0.3; 3]);
    let of = |ground_scale: f32| Sky::new(&SkyModelInputs { ground_scale, ..usual }).dome.expect("a dome");
    let (full, half, none) = (of(1.0), of(0.5), of(0.0));
    let frame = SkyFrame::new(direction(40_f64.to_radians(), 0.0), DVec3::Y);
    for elevation in [-1.2_f64, -0.1, 0.1, 1.2] {
        let toward = direction(elevation, 1.0).as_vec3();
        let [full, half, none] = [&full, &half, &none].map(|dome| dome.radiance(&frame, toward));
        let is_ground = elevation < 0.0;
        assert_eq!(half, if is_ground { full * 0.5 } else { full }, "{elevation}");
        assert_eq!(none, if is_ground { Vec3::ZERO } else { full }, "{elevation}");
    }
}
