//! Hard shadows: one ray to the light's center decides the visibility. Unoccluded light is the same with hard
//! shadows, with soft shadows, and without shadows.

use glimt::integrators::render_tile;
use glimt::math::DVec3;
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{ShadowMode, Shape};

use super::glass::boxes;
use super::scenes::{Build, IDENTITY_PLACEMENT, emitter, matte, metal, receiver, scene};
use super::{assert_mean, assert_same_mean, mean_and_error, v};

/// Every kind of light, with the specified size and height above a receiver.
fn lights(height: f64, size: f64) -> Vec<(&'static str, Build)> {
    let at = v(0.0, height, 0.0);
    let lit = |shape: Shape| receiver(DVec3::ZERO, 0.8).shape(shape, emitter(3.0));
    let x = v(size, 0.0, 0.0);
    let mut all = vec![
        ("point", receiver(DVec3::ZERO, 0.8).point_light(at + x * 0.2, 5.0, Falloff::Square)),
        ("sphere", lit(Shape::Sphere { center: at, radius: size })),
        (
            "quad",
            lit(Shape::Quad { corner: at - v(size, 0.0, size), u: x * 2.0, v: v(0.0, 0.0, 2.0 * size) }),
        ),
        ("box", lit(Shape::Box { center: at, size: v(size, size, 2.0 * size), rotate: v(10.0, 30.0, 0.0) })),
        ("triangle", lit(Shape::Triangle { a: at, b: at + x, c: at + v(0.0, 0.0, size) })),
        ("disk", lit(Shape::Disk { center: at, normal: v(0.2, -1.0, 0.0), radius: size })),
        ("cylinder", lit(Shape::Cylinder { a: at - x, b: at + x, radius: 0.5 * size, caps: true })),
        ("cone", lit(Shape::Cone { base: at, tip: at - v(0.0, size, 0.0), radius: size, cap: true })),
        ("torus", lit(Shape::Torus { center: at, axis: DVec3::Y, radius: size, tube: 0.3 * size })),
    ];
    let cube = receiver(DVec3::ZERO, 0.8).mesh(boxes(&[(at, size, 0)]), IDENTITY_PLACEMENT, emitter(3.0));
    all.push(("mesh", cube));
    all
}

#[test]
fn unoccluded_light_ignores_shadow_mode() {
    // Includes lights close to the receiver.
    for (height, size) in [(2.0, 0.5), (1.2, 1.0), (10.0, 0.3)] {
        for (name, build) in lights(height, size) {
            let values = |shadows: ShadowMode| build.clone().shadows(shadows, 4).values(256, 16);
            let [off, hard, soft] = [ShadowMode::Off, ShadowMode::Hard, ShadowMode::Soft].map(values);
            assert!(off[0] > 0.0, "{name}");
            assert_eq!(off, hard, "{name} at {height}");
            let what = format!("{name} at {height}");
            assert_same_mean(&what, mean_and_error(&soft), mean_and_error(&off), 1.5e-3);
        }
    }
}

#[test]
fn metal_lobes_use_the_same_shadow_ray() {
    // A light and its reflection in a metal floor, with a small ball either in front of the light's center or
    // elsewhere.
    let floor = |roughness: f32| {
        scene()
            .quad(v(-0.05, 0.0, 0.05), v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), metal(0.9, roughness, 0.0))
            .seen(v(-0.1, 0.1, 0.02), DVec3::ZERO)
            .depth(1)
    };
    let corner = v(1.0, 0.2, -1.0);
    let lit = |build: Build| build.quad(corner, v(0.0, 0.0, 2.0), v(0.0, 1.6, 0.0), emitter(2.0));
    let middle = corner + v(0.0, 0.8, 1.0);
    for roughness in [0.1, 0.3] {
        let open = mean_and_error(&lit(floor(roughness)).values(1024, 16));
        let with = |at: DVec3, shadows: ShadowMode| {
            let build = lit(floor(roughness)).sphere(at, 0.02, matte(0.0)).shadows(shadows, 1);
            mean_and_error(&build.values(1024, 16))
        };
        assert_eq!(
            with(middle * 0.5, ShadowMode::Hard).0,
            0.0,
            "no light must arrive if the center is hidden"
        );
        let beside = corner + v(0.0, 1.5, 1.9);
        for (name, found) in [
            ("off-center blocker", with(beside * 0.5, ShadowMode::Hard)),
            ("without shadows", with(middle * 0.5, ShadowMode::Off)),
        ] {
            assert_same_mean(name, found, open, 6e-4);
        }
    }
}

#[test]
fn hard_shadows_are_exact_for_close_lights() {
    // A unit square at a height of 0.1. E/L = 3.042128 from the closed form for a parallel rectangle.
    let corner = v(-0.5, 0.1, -0.5);
    let lamp = receiver(DVec3::ZERO, 0.8).quad(corner, v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(1.0));
    let values = lamp.shadows(ShadowMode::Hard, 16).values(256, 16);
    assert_mean("close square", &values, 3.042_128 * 0.8 / std::f64::consts::PI, 1e-5);
}

#[test]
fn center_ray_determines_visibility() {
    let lamp = |build: Build| {
        build
            .quad(v(-1.0, 2.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), emitter(1.0))
            .shadows(ShadowMode::Hard, 4)
    };
    let free = lamp(receiver(DVec3::ZERO, 0.8)).value();
    let blocked = |x: f64| {
        let screen = v(x, 1.0, -0.2);
        lamp(receiver(DVec3::ZERO, 0.8).quad(screen, v(0.4, 0.0, 0.0), v(0.0, 0.0, 0.4), matte(0.0))).value()
    };
    assert!(free > 0.0);
    // Place the blocker in front of the center, and next to it, where soft shadows would be partial.
    assert_eq!(blocked(-0.2), 0.0);
    assert_eq!(blocked(0.05), free);
    assert_eq!(scene().value(), 0.0);
}

/// Shadow rays per sample.
fn shadow_rays_per_sample(build: &Build) -> u64 {
    let whole = glimt::film::Rect { x: 0, y: 0, width: 1, height: 1 };
    let token = glimt::control::CancelToken::new();
    render_tile(&build.world(), &build.settings(1), whole, 0..1, &token)
        .expect("the token is not canceled")
        .1
        .shadow_rays
}

#[test]
fn box_and_mesh_use_a_single_shadow_ray() {
    // Three faces of the cube are visible from the receiver.
    let center = v(0.5, 1.5, 0.4);
    let cube = |build: Build| {
        build.shape(Shape::Box { center, size: v(0.8, 0.8, 0.8), rotate: DVec3::ZERO }, emitter(1.0))
    };
    let mesh = |build: Build| build.mesh(boxes(&[(center, 0.8, 0)]), IDENTITY_PLACEMENT, emitter(1.0));
    let screen = |at: DVec3| {
        let half = v(0.05, 0.0, 0.05);
        let sides = [v(0.1, 0.0, 0.0), v(0.0, 0.0, 0.1)];
        receiver(DVec3::ZERO, 0.8).quad(at - half, sides[0], sides[1], matte(0.0))
    };
    for (name, lamp) in [("box", &cube as &dyn Fn(Build) -> Build), ("mesh", &mesh)] {
        let hard = |build: Build| lamp(build).shadows(ShadowMode::Hard, 16);
        let free = hard(receiver(DVec3::ZERO, 0.8));
        assert_eq!(shadow_rays_per_sample(&free), 1, "{name}");
        let value = |build: Build| {
            let (mean, _) = mean_and_error(&build.values(64, 16));
            mean
        };
        let all = value(free);
        assert!(all > 0.0, "{name}");
        // A screen in front of the cube's center blocks all of its light. One lower down blocks none.
        assert_eq!(value(hard(screen(center * 0.5))), 0.0, "{name}");
        let beside = value(hard(screen((center - v(0.0, 0.4, 0.0)) * 0.5)));
        assert_eq!(beside, all, "{name}");
        let soft = value(lamp(receiver(DVec3::ZERO, 0.8)).shadows(ShadowMode::Soft, 16));
        assert!((soft / all - 1.0).abs() < 0.02, "{name}: soft {soft}, hard {all}");
    }
}
