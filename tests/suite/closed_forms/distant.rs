//! Spotlights, and light from outside the scene.

use std::f64::consts::PI;

use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::{DirectionalLight, Falloff, PointLight, SpotLight};
use glimt::scene::description::{ColorSource, Light, MaterialKind, ShadowMode};

use super::direct::at_origin;
use super::scenes::{Build, matte, plain, receiver, scene};
use super::{assert_close, assert_mean, v};

/// Adds a directional light. `angle` is its apparent diameter in degrees.
pub fn sun(build: Build, direction: DVec3, irradiance: f32, angle: f64) -> Build {
    let light = DirectionalLight { direction, irradiance: Vec3::splat(irradiance), angle };
    build.with(|scene| scene.lights.push(Light::Directional(light)))
}

#[test]
fn spotlight_fades_toward_cone_edge() {
    // The light is at height 2 above (1, 0, 0), aimed so that the origin is at angle θ from the axis.
    let from = v(1.0, 2.0, 0.0);
    let lit = |theta: f64, angle: f64, blend: f32, falloff| {
        let (sin, cos) = theta.sin_cos();
        // The axis is the direction to the origin, (−1, −2)/√5, rotated by θ.
        let (x, y) = (-1.0 / 5.0_f64.sqrt(), -2.0 / 5.0_f64.sqrt());
        let axis = v(x * cos - y * sin, x * sin + y * cos, 0.0);
        let point = PointLight { position: from, intensity: Vec3::splat(10.0), falloff };
        let spot = SpotLight { point, look_at: from + axis * 3.0, angle, blend };
        at_origin().with(|scene| scene.lights.push(Light::Spot(spot)))
    };
    for (degrees, angle, blend, share) in [
        (0.0_f64, 45.0, 0.2, 1.0),
        (17.0, 45.0, 0.2, 1.0),
        (20.0, 45.0, 0.2, 2.5 / 4.5),
        (22.0, 45.0, 1.0, 0.5 / 22.5),
        (23.0, 45.0, 0.2, 0.0),
        (10.0, 20.2, 0.0, 1.0),
        (10.0, 19.8, 0.0, 0.0),
        (100.0, 300.0, 1.0, 50.0 / 150.0),
    ] {
        for shadows in [ShadowMode::Soft, ShadowMode::Hard, ShadowMode::Off] {
            let build = |falloff| lit(degrees.to_radians(), angle, blend, falloff).shadows(shadows, 2);
            let (cosine, distance2) = (2.0 / 5.0_f64.sqrt(), 5.0);
            let expected = 0.7 / PI * 10.0 * cosine * share;
            let square = build(Falloff::Square).value();
            assert!((square - expected / distance2).abs() <= 2e-5 * expected, "{degrees} {angle}: {square}");
            let none = build(Falloff::None).value();
            assert!((none - expected).abs() <= 2e-5 * expected, "{degrees} {angle}: {none}");
        }
    }
}

#[test]
fn directional_light_is_uniform() {
    let direction = v(3.0, -4.0, 0.0);
    for place in [DVec3::ZERO, v(1e3, 0.0, -50.0)] {
        for shadows in [ShadowMode::Soft, ShadowMode::Hard, ShadowMode::Off] {
            let lit = sun(receiver(place, 0.7), direction, 5.0, 0.0).shadows(shadows, 3);
            assert_close("lit", lit.value(), 0.7 / PI * 5.0 * 0.8);
            // A blocker on the line to the light, one next to this line, and one on the opposite side.
            let blocked = |at: DVec3| lit.clone().sphere(place + at, 0.5, matte(0.5)).value();
            let expected = if shadows == ShadowMode::Off { lit.value() } else { 0.0 };
            assert_eq!(blocked(v(-300.0, 400.0, 0.0)), expected);
            assert_eq!(blocked(v(-300.0, 400.0, 0.6)), lit.value());
            assert_eq!(blocked(v(300.0, 400.0, 0.0)), lit.value());
        }
    }
}

#[test]
fn sun_disk_irradiance_and_shadow_are_exact() {
    // The whole disk is above the horizon, so E = irradiance · cos θ at its center. `hard` uses the center.
    for degrees in [0.53, 10.0, 60.0] {
        let lit = sun(at_origin(), v(1.0, -2.0, 0.0), 5.0, degrees);
        let expected = 0.7 / PI * 5.0 * 2.0 / 5.0_f64.sqrt();
        assert_mean(&format!("{degrees}"), &lit.values(64, 64), expected, 2.5e-4);
        let hard = lit.clone().shadows(ShadowMode::Hard, 1);
        assert_mean(&format!("{degrees}, hard"), &hard.values(64, 64), expected, 2.5e-4);
    }
    // The half-plane x < 0 at height 1 hides half of the disk from the origin, because its edge crosses the
    // disk's center, which is overhead.
    let overhead = sun(at_origin(), v(0.0, -1.0, 0.0), 5.0, 40.0);
    let half = overhead.quad(v(-100.0, 1.0, -100.0), v(100.0, 0.0, 0.0), v(0.0, 0.0, 200.0), matte(0.5));
    assert_mean("half", &half.values(64, 256), 0.7 / PI * 2.5, 2e-5);
}

#[test]
fn sun_disk_is_visible_to_escaping_rays() {
    // The radiance is E/(π sin²(α/2)). The camera looks along −z, and the light travels along +z.
    let radiance = |angle: f64| 5.0 / (PI * (angle.to_radians() / 2.0).sin().powi(2));
    for angle in [0.53, 20.0, 180.0] {
        let seen = sun(scene(), DVec3::Z, 5.0, angle).value();
        assert!((seen / radiance(angle) - 1.0).abs() < 1e-5, "{angle}: {seen}");
    }
    let beside = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        sun(scene(), v(sin, 0.0, cos), 5.0, 20.0)
            .with(|scene| scene.render.background = Vec3::splat(0.25))
            .value()
    };
    assert!((beside(9.99) - radiance(20.0) - 0.25).abs() < 1e-3 && beside(10.01) == 0.25);
    assert_eq!(sun(scene(), DVec3::Z, 5.0, 0.0).value(), 0.0);
    // The sun reflected in a mirror.
    let mirror = plain(MaterialKind::Mirror { reflectance: ColorSource::Constant(Vec3::splat(0.5)) });
    let build = scene().quad(v(-1.0, -1.0, -2.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), mirror);
    let seen = sun(build, DVec3::NEG_Z, 5.0, 20.0).value();
    assert!((seen - 0.5 * radiance(20.0)).abs() < 1e-3, "{seen}");
}
