//! Environment light.

use std::f64::consts::{PI, TAU};

use glimt::integrators::ViewMode;
use glimt::math::random::TestRandom;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::DirectionalLight;
use glimt::scene::description::{Integrator, Light, ShadowMode, Sky};

use super::direct::at_origin;
use super::photons::{assert_same_light, path_and_photon_means};
use super::scenes::{Build, glass, matte, mirror, phong, receiver, scene};
use super::{assert_close, assert_mean, assert_same_mean, mean_and_error, v};

fn path(build: Build) -> Build {
    build.with(|scene| scene.render.integrator = Integrator::Path)
}

fn whitted_and_path(build: &Build) -> [Build; 2] {
    [build.clone(), path(build.clone())]
}

/// A gray environment map from a function of column and row.
fn map(width: u32, height: u32, radiance: impl Fn(u32, u32) -> f32) -> (u32, Vec<Vec3>) {
    let texel = |row| (0..width).map(move |column| (column, row));
    (width, (0..height).flat_map(texel).map(|(column, row)| Vec3::splat(radiance(column, row))).collect())
}

fn lit(build: Build, (width, texels): (u32, Vec<Vec3>), rotate: f64) -> Build {
    build.sky(width, texels, rotate)
}

#[test]
fn plane_under_constant_sky_shows_its_albedo() {
    for shadows in [ShadowMode::Soft, ShadowMode::Hard, ShadowMode::Off] {
        for build in whitted_and_path(&at_origin().environment(1.0).shadows(shadows, 1)) {
            assert_mean(&format!("{shadows:?}"), &build.values(64, 64), 0.7, 2.5e-4);
        }
        let white = lit(at_origin(), map(16, 8, |_, _| 1.0), 0.0).shadows(shadows, 4);
        assert_mean("as a map", &white.values(64, 64), 0.7, 1e-4);
    }
    // A wall next to the visible point hides half of the sky. `hard` behaves like `soft`, and `off` ignores
    // the wall.
    let wall = |shadows| {
        at_origin()
            .environment(1.0)
            .quad(v(1e-4, 0.0, -1e4), v(0.0, 1e4, 0.0), v(0.0, 0.0, 2e4), matte(0.0))
            .shadows(shadows, 4)
            .values(64, 64)
    };
    assert_mean("soft", &wall(ShadowMode::Soft), 0.35, 1.5e-4);
    assert_mean("hard", &wall(ShadowMode::Hard), 0.35, 1.5e-4);
    assert_mean("off", &wall(ShadowMode::Off), 0.7, 2.5e-5);
}

#[test]
fn half_sky_irradiance_is_exact() {
    let (height, rows) = (64, 128);
    let upper = map(rows, height, |_, row| f32::from(u8::from(row < height / 2)));
    let lower = map(rows, height, |_, row| f32::from(u8::from(row >= height / 2)));
    // u < ½ is toward −x.
    let left = map(rows, height, |column, _| f32::from(u8::from(column < rows / 2)));
    // Between rows 31 and 32, the radiance falls from 1 to 0 over one texel, which loses little light above
    // the horizon.
    for build in whitted_and_path(&lit(at_origin(), upper, 0.0)) {
        let values = build.values(64, 64);
        let lost = PI / f64::from(height);
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        assert!((0.7 * (1.0 - lost * lost)..0.7002).contains(&mean), "{mean}");
    }
    for build in whitted_and_path(&lit(at_origin(), lower, 0.0)) {
        let mean = build.values(64, 16).iter().sum::<f64>() / 16.0;
        assert!(mean < 1e-3, "{mean}");
    }
    for build in whitted_and_path(&lit(at_origin(), left.clone(), 0.0)) {
        assert_mean("left", &build.values(64, 64), 0.35, 2e-3);
    }
    // A wall in the dark half blocks no light, and a wall in the bright half blocks all of it.
    let wall = |x: f64, rotate: f64| {
        let build = at_origin().quad(v(x, 0.0, -1e5), v(0.0, 1e5, 0.0), v(0.0, 0.0, 2e5), matte(0.0));
        let values = lit(build, left.clone(), rotate).values(64, 64);
        values.iter().sum::<f64>() / values.len() as f64
    };
    assert!((wall(1e-3, 0.0) - 0.35).abs() < 0.005, "{}", wall(1e-3, 0.0));
    assert!(wall(-1e-3, 0.0) < 0.01, "{}", wall(-1e-3, 0.0));
    assert!((wall(-1e-3, 180.0) - 0.35).abs() < 0.005, "{}", wall(-1e-3, 180.0));
    assert!(wall(1e-3, 180.0) < 0.01, "{}", wall(1e-3, 180.0));
}

#[test]
fn bright_texel_appears_in_its_direction() {
    // In a 4 × 3 map, columns 0 … 3 are centered at u = ⅛, ⅜, ⅝, ⅞, so that rotating by 45° moves them to the
    // axes.
    let sees = |direction: DVec3, map: (u32, Vec<Vec3>), rotate: f64| {
        lit(scene().seen(DVec3::ZERO, direction), map, rotate).value()
    };
    let one = |column: u32, row: u32| map(4, 3, move |x, y| f32::from(u8::from((x, y) == (column, row))));
    // Columns are at azimuths −135°, −45°, 45°, 135° from −z toward +x. Rotated counterclockwise by 45°, they
    // are at −180°, −90°, 0°, 90°.
    let around = [DVec3::Z, DVec3::NEG_X, DVec3::NEG_Z, DVec3::X];
    for (column, direction) in (0..4).zip(around) {
        let sees_it = sees(direction, one(column, 1), 45.0);
        assert!((sees_it - 1.0).abs() < 1e-5, "{direction}: {sees_it}");
        assert!(sees(-direction, one(column, 1), 45.0) < 1e-5);
        // Rotating by another 90° moves +x to −z.
        let turned = DVec3::new(direction.z, 0.0, -direction.x);
        assert!((sees(turned, one(column, 1), 135.0) - 1.0).abs() < 1e-5, "{turned}");
        assert!((sees(turned, one(column, 1), -225.0) - 1.0).abs() < 1e-5, "{turned}");
    }
    for rotate in [0.0, 90.0] {
        let row = |wanted: u32| map(4, 3, move |_, y| f32::from(u8::from(y == wanted)));
        assert_eq!((sees(DVec3::Y, row(0), rotate), sees(DVec3::Y, row(2), rotate)), (1.0, 0.0));
        assert_eq!((sees(DVec3::NEG_Y, row(2), rotate), sees(DVec3::NEG_Y, row(0), rotate)), (1.0, 0.0));
    }
    // Without rotation, −z is between columns 1 and 2, and +x is right of the middle.
    let right = |rotate| {
        [DVec3::NEG_Z, DVec3::X, DVec3::Z, DVec3::NEG_X]
            .map(|direction| sees(direction, map(4, 1, |x, _| [0.0, 1.0, 2.0, 4.0][x as usize]), rotate))
    };
    for (found, expected) in [(right(0.0), [1.5, 3.0, 2.0, 0.5]), (right(90.0), [3.0, 2.0, 0.5, 1.5])] {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
    }
}

#[test]
fn sky_in_mirrors_and_glass_is_emission() {
    let pane = |material| {
        scene().quad(v(-1.0, -1.0, -2.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), material).environment(2.0)
    };
    for build in whitted_and_path(&pane(mirror(0.5))) {
        assert_close("mirror", build.value(), 1.0);
        assert_close("its emission", build.clone().viewed(ViewMode::Emission).value(), 1.0);
        assert_eq!(build.depth(0).value(), 0.0);
    }
    assert_close("by itself", scene().environment(2.0).depth(0).value(), 2.0);
    // Glass is lossless: it transmits all light that it does not reflect.
    let ball = scene().sphere(v(0.3, 0.2, -3.0), 1.0, glass(1.5)).environment(2.0).depth(40);
    assert!((ball.value() - 2.0).abs() < 2e-2, "{}", ball.value());
    assert_mean("glass, path", &path(ball).values(64, 16), 2.0, 1e-6);
}

#[test]
fn phong_ball_in_a_furnace_shows_its_albedo() {
    // For ks = 1, the albedo at 60° is 0.5047 (α = 10) and 0.5000 (α = 100). The camera looks along −z, and
    // the normal is 60° from z.
    for (shininess, albedo) in [(10.0, 0.5047), (100.0, 0.5000)] {
        let normal = v(60.0_f64.to_radians().sin(), 0.0, 60.0_f64.to_radians().cos());
        let center = v(0.0, 0.0, -5.0) - normal;
        for build in whitted_and_path(
            &scene().sphere(center, 1.0, phong(0.0, 1.0, shininess, 0.0)).environment(1.0).depth(1),
        ) {
            let values = build.values(256, 64);
            let mean = values.iter().sum::<f64>() / 64.0;
            assert!((mean - albedo).abs() < 2e-3, "{shininess}: {mean} {albedo}");
        }
        let as_map = lit(
            scene().sphere(center, 1.0, phong(0.0, 1.0, shininess, 0.0)).depth(1),
            map(8, 4, |_, _| 1.0),
            0.0,
        );
        for build in whitted_and_path(&as_map) {
            let mean = build.values(256, 64).iter().sum::<f64>() / 64.0;
            assert!((mean - albedo).abs() < 4e-3, "{shininess}, map: {mean} {albedo}");
        }
    }
}

/// Solid angle of a texel under bilinear interpolation: the integral of its tent function.
fn texel_solid_angle(width: u32, height: u32, row: u32) -> f64 {
    let (steps, texel) = (4096, PI / f64::from(height));
    let tent = |step: i32| {
        let offset = (f64::from(step) + 0.5) / f64::from(steps) * 2.0 - 1.0;
        let theta = (f64::from(row) + 0.5 + offset) * texel;
        (1.0 - offset.abs()) * theta.sin()
    };
    (0..steps).map(tent).sum::<f64>() * 2.0 / f64::from(steps) * texel * TAU / f64::from(width)
}

fn towards(width: u32, height: u32, column: u32, row: u32) -> DVec3 {
    let phi = ((f64::from(column) + 0.5) / f64::from(width) - 0.5) * TAU;
    let theta = (f64::from(row) + 0.5) / f64::from(height) * PI;
    DVec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos())
}

#[test]
fn single_bright_texel_matches_a_sun() {
    let (width, height, column, row) = (1024, 512, 700, 120);
    let sky = map(width, height, |x, y| if (x, y) == (column, row) { 1e5 } else { 0.0 });
    let irradiance = 1e5 * texel_solid_angle(width, height, row);
    let to_light = towards(width, height, column, row);
    let blocked = |at: DVec3| at_origin().sphere(at, 0.5, matte(0.5));
    let exact = 0.7 / PI * irradiance * to_light.y;
    for build in whitted_and_path(&lit(at_origin(), sky.clone(), 0.0).depth(1)) {
        let values = build.values(256, 64);
        let mean = values.iter().sum::<f64>() / 64.0;
        assert!((mean / exact - 1.0).abs() < 2e-3, "{mean} {exact}");
    }
    assert_eq!(lit(blocked(to_light * 40.0), sky.clone(), 0.0).value(), 0.0);
    // Rotating by 90° around +y moves the light.
    let turned = DVec3::new(to_light.z, to_light.y, -to_light.x);
    assert_eq!(lit(blocked(turned * 40.0), sky.clone(), 90.0).value(), 0.0);
    assert!(lit(blocked(to_light * 40.0), sky, 90.0).value() > 0.0);
}

/// A floor with balls on it, viewed from above.
fn courtyard() -> Build {
    let mut build = scene().quad(v(-9.0, 0.0, 9.0), v(18.0, 0.0, 0.0), v(0.0, 0.0, -18.0), matte(0.7));
    for (x, z, radius) in [(-1.5, 0.0, 0.8), (1.0, -1.0, 1.2), (0.5, 1.6, 0.4)] {
        build = build.sphere(v(x, radius, z), radius, phong(0.4, 0.3, 20.0, 0.0));
    }
    build.pictured(v(0.0, 4.0, 6.0), v(0.0, 0.4, 0.0), 45.0, 48, 32).depth(1)
}

/// Checks that two scenes have the same mean in each block of 16 × 16 pixels and in the whole image. Tests
/// the difference's z-score, which is computed from the spread over seeds.
fn assert_same_picture(what: &str, one: &Build, other: &Build, [samples, others]: [u32; 2], seeds: u32) {
    let (width, height) = (48_usize, 32_usize);
    let blocks = |build: &Build, samples| -> Vec<Vec<f64>> {
        let pictures = build.pictures(samples, 0..seeds);
        pictures
            .iter()
            .map(|picture| {
                let mut means = vec![0.0; (width / 16) * (height / 16) + 1];
                let all = means.len() - 1;
                for (place, color) in picture.iter().enumerate() {
                    let block = place / width / 16 * (width / 16) + place % width / 16;
                    means[block] += color.x / 256.0;
                    means[all] += color.x / (width * height) as f64;
                }
                means
            })
            .collect()
    };
    let (one, other) = (blocks(one, samples), blocks(other, others));
    for block in 0..one[0].len() {
        let moments = |of: &[Vec<f64>]| {
            let mean = of.iter().map(|means| means[block]).sum::<f64>() / f64::from(seeds);
            let spread = of.iter().map(|means| (means[block] - mean).powi(2)).sum::<f64>();
            (mean, spread / f64::from(seeds - 1) / f64::from(seeds))
        };
        let ((a, var_a), (b, var_b)) = (moments(&one), moments(&other));
        let error = (var_a + var_b).sqrt();
        // Without a bound on the standard error, noisy images would pass.
        assert!(error < 0.01 * b, "{what}, block {block}: too noisy: {a} vs. {b} ± {error}");
        assert!((a - b).abs() < 4.89 * error.max(1e-4 * b), "{what}, block {block}: {a} vs. {b} ± {error}");
    }
}

#[test]
fn whitted_and_path_agree_on_sky_light() {
    let hills = map(64, 32, |x, y| {
        let sun = if (x, y) == (40, 7) { 500.0 } else { 0.0 };
        sun + f32::from(u8::from(y < 16)) * (0.2 + 0.02 * (x % 7) as f32)
    });
    for (what, build) in [("constant", courtyard().environment(1.0)), ("map", lit(courtyard(), hills, 200.0))]
    {
        assert_same_picture(what, &build, &path(build.clone()), [32, 32], 16);
    }
}

/// A black map with a few equally bright texels, and the equivalent directional lights.
fn map_and_equivalent_lights(width: u32, height: u32, count: u32) -> [Build; 2] {
    let mut bright = std::collections::BTreeSet::new();
    let mut random = TestRandom::new(12_345);
    let mut next = |below: u32| random.below(below as usize) as u32;
    while bright.len() < count as usize {
        bright.insert((next(width), height / 16 + next(height / 3)));
    }
    let radiance = f64::from(width) * f64::from(height) / f64::from(count);
    let sky = map(width, height, |x, y| if bright.contains(&(x, y)) { radiance as f32 } else { 0.0 });
    let suns = bright.iter().map(|&(x, y)| {
        Light::Directional(DirectionalLight {
            direction: -towards(width, height, x, y),
            irradiance: Vec3::splat((radiance * texel_solid_angle(width, height, y)) as f32),
            angle: 0.0,
        })
    });
    [lit(courtyard(), sky, 0.0), courtyard().with(|scene| scene.lights.extend(suns))]
}

#[test]
fn bright_texels_match_directional_lights() {
    let [map, suns] = map_and_equivalent_lights(512, 256, 40);
    assert_same_picture("40 of 512 × 256", &map, &suns, [64, 4], 16);
    assert_same_picture("path, 40 of 512 × 256", &path(map), &suns, [64, 4], 16);
}

/// Ignored by default because it takes ten seconds of CPU time: `cargo test --release --test suite
/// a_thousand_texels -- --ignored`.
#[test]
#[ignore = "ten seconds: cargo test --release --test suite a_thousand_texels -- --ignored"]
fn a_thousand_texels_match_directional_lights() {
    let [map, suns] = map_and_equivalent_lights(4096, 2048, 1000);
    assert_same_picture("1000 of 4096 × 2048", &map, &suns, [64, 1], 16);
    assert_same_picture("path, 1000 of 4096 × 2048", &path(map), &suns, [64, 1], 16);
}

#[test]
fn single_texel_map_is_a_constant_color() {
    for build in whitted_and_path(&lit(receiver(DVec3::ZERO, 0.5), (1, vec![Vec3::new(1.0, 2.0, 4.0)]), 10.0))
    {
        let colors: Vec<DVec3> = build.pictures(64, 0..64).iter().map(|picture| picture[0]).collect();
        for (axis, expected) in [0.5, 1.0, 2.0].into_iter().enumerate() {
            let values: Vec<f64> = colors.iter().map(|color| color[axis]).collect();
            assert_mean("one texel", &values, expected, 6e-4);
        }
    }
}

/// A sky with the sun toward `sun`.
fn clear(sun: DVec3, sun_scale: f32, sky_scale: f32) -> Sky {
    let ground = Vec3::splat(0.3);
    let (sun, ground_scale) = (sun.normalize(), 1.0);
    Sky { sun, turbidity: 3.0, ground, sun_angle: 0.5338, sun_scale, sky_scale, ground_scale }
}

#[test]
fn rotating_a_sky_equals_rotating_its_sun() {
    let from = v(3.0, 2.0, 1.0);
    for (rotate, sun) in [(90.0, v(1.0, 2.0, -3.0)), (180.0, v(-3.0, 2.0, -1.0))] {
        let seen = |sun: DVec3, rotate: f64, at: DVec3| {
            scene().clear_sky(clear(sun, 1.0, 1.0), rotate).seen(DVec3::ZERO, at).color()
        };
        for at in [sun, v(0.3, 0.1, 1.0), v(-1.0, 0.02, 0.2), v(1.0, -0.1, 0.0)] {
            let (rotated, moved) = (seen(from, rotate, at), seen(sun, 0.0, at));
            assert!((rotated - moved).abs().max_element() < 1e-5 * moved.max_element(), "{rotated} {moved}");
        }
    }
}

#[test]
fn clear_sky_ends_at_a_sharp_horizon() {
    let sky = clear(v(1.0, 1.0, 0.0), 0.0, 1.0);
    let toward = |y: f64| scene().clear_sky(sky.clone(), 0.0).seen(DVec3::ZERO, v(-1.0, y, 0.0)).color();
    let (above, below) = (toward(1e-5), toward(-1e-5));
    assert!((toward(1e-4) - above).abs().max_element() < 0.05 * above.max_element(), "{above}");
    assert!((toward(-1.0) - below).abs().max_element() == 0.0);
    // A white plane facing up shows E/π, and the ground below the horizon shows 0.3·E/π.
    let white = path(receiver(DVec3::ZERO, 1.0).clear_sky(sky, 0.0)).depth(1);
    assert_mean("ground", &white.values(64, 64), below.x / 0.3, 1.5e-3);
}

#[test]
fn integrators_agree_under_a_clear_sky() {
    // A low sun, so that the box casts a shadow on the floor. `hard` treats the small sun as fully visible or hidden.
    for sky in [clear(v(1.0, 0.6, 0.5), 1.0, 0.0), clear(v(1.0, 0.6, 0.5), 1.0, 1.0)] {
        let build = receiver(DVec3::ZERO, 0.7)
            .cuboid(v(-0.6, 0.5, 0.0), v(0.5, 1.0, 2.0), DVec3::ZERO, matte(0.0))
            .clear_sky(sky, 0.0)
            .depth(1);
        let reference = mean_and_error(&path(build.clone()).values(64, 32));
        for shadows in [ShadowMode::Soft, ShadowMode::Hard] {
            let whitted = mean_and_error(&build.clone().shadows(shadows, 1).values(64, 32));
            assert_same_mean(&format!("{shadows:?}"), whitted, reference, 3e-3);
        }
    }
}

#[test]
fn photons_match_path_under_a_clear_sky() {
    // A mirror reflects light onto the floor. The sun is so wide that paths find it as well as photons.
    let sky = Sky { sun_angle: 20.0, ..clear(v(1.0, 1.2, 0.3), 1.0, 1.0) };
    let build = scene()
        .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), matte(0.6))
        .quad(v(-0.8, 0.0, -0.8), v(0.0, 0.0, 1.6), v(0.0, 1.0, 0.0), mirror(0.9))
        .clear_sky(sky, 0.0)
        .pictured(v(0.0, 3.0, 2.0), v(-0.2, 0.0, 0.0), 30.0, 8, 8)
        .depth(3);
    assert_same_light("clear sky", path_and_photon_means(&build, 3, [64, 8], (10_000, 0.05)), 8e-3, 4e-3);
}
