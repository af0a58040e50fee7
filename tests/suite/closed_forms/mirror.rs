//! Mirrors and the depth limit.

use std::f64::consts::PI;

use glimt::math::DVec3;
use glimt::scene::description::light::Falloff;

use super::scenes::{Build, emitter, matte, mirror, scene};
use super::{assert_close, v};

/// Two mirrors at y = 0 and y = 1 with x in [0, `length`]. A ray that rises at 45° from (−¼, ½) hits them at
/// x = ¼, 1¼, 2¼, …
fn corridor(reflectance: f32, length: f64) -> Build {
    let side = |build: Build, y: f64| {
        build.quad(v(0.0, y, -1.0), v(length, 0.0, 0.0), v(0.0, 0.0, 2.0), mirror(reflectance))
    };
    side(side(scene(), 0.0), 1.0).seen(v(-0.25, 0.5, 0.0), v(0.0, 0.75, 0.0))
}

#[test]
fn nth_reflection_has_nth_power_of_reflectance() {
    for n in [1_u32, 2, 5, 10, 40] {
        let length = f64::from(n) - 0.5;
        let seen = corridor(0.9, length).background(1.0);
        let exact = f64::from(0.9_f32).powi(n as i32);
        assert_close(&format!("{n} reflections of the sky"), seen.clone().depth(n).value(), exact);
        assert_eq!(seen.depth(n - 1).value(), 0.0);
        // An emitter at the end of the corridor that faces the camera (z × y = −x), and one that faces away.
        let (z, y) = (v(0.0, 0.0, 18.0), v(0.0, 18.0, 0.0));
        let seen =
            |u, w| corridor(0.9, length).quad(v(length, -9.0, -9.0), u, w, emitter(2.0)).depth(n).value();
        assert_close(&format!("{n} reflections of a light"), seen(z, y), 2.0 * exact);
        assert_eq!(seen(y, z), 0.0);
    }
}

#[test]
fn mirrors_and_direct_light_count_as_bounces() {
    // The camera sees the ceiling at x = 2 in a mirror floor. A point light 2 units below it has E = 8/4, so
    // L = r·ρE/π.
    let seen = scene()
        .quad(v(-5.0, 0.0, 5.0), v(10.0, 0.0, 0.0), v(0.0, 0.0, -10.0), mirror(0.8))
        .quad(v(-5.0, 4.0, -5.0), v(10.0, 0.0, 0.0), v(0.0, 0.0, 10.0), matte(0.5))
        .point_light(v(2.0, 2.0, 0.0), 8.0, Falloff::Square)
        .seen(v(-1.0, 2.0, 0.0), DVec3::ZERO);
    assert_eq!(seen.clone().depth(0).value(), 0.0);
    assert_eq!(seen.clone().depth(1).value(), 0.0);
    assert_close("in the mirror", seen.depth(2).value(), 0.8 * 0.5 * 2.0 / PI);
}

#[test]
fn lossless_mirror_under_a_sky_is_invisible() {
    // Every ray ends in the sky with L = 1, regardless of the number of reflections.
    let seen = scene()
        .sphere(v(-1.0, 0.0, -5.0), 1.0, mirror(1.0))
        .sphere(v(1.0, 0.0, -5.0), 1.0, mirror(1.0))
        .sphere(v(0.0, 1.7, -5.0), 1.0, mirror(1.0))
        .cuboid(v(0.0, -2.0, -5.0), v(4.0, 1.0, 4.0), v(10.0, 20.0, 30.0), mirror(1.0))
        .background(1.0)
        .depth(1000)
        .pictured(DVec3::ZERO, DVec3::NEG_Z, 60.0, 48, 48);
    for pixel in seen.picture(4, 3) {
        assert_close("sky", pixel.x, 1.0);
    }
}
