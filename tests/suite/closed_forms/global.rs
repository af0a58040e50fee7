//! Light that bounces, by paths, against closed forms.

use glimt::integrators::View;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::{ColorSource, Falloff, Integrator, MaterialKind};

use super::scenes::{Build, emitter, glass, matte, mirror, phong, scene};
use super::{mean_and_error, v};

/// A scene that is rendered by paths.
pub fn by_paths(build: Build, max_depth: u32) -> Build {
    build.with(|scene| scene.render.integrator = Integrator::Path).depth(max_depth)
}

/// |mean − exact| ≤ 4 standard errors over seeds, which are at most this part of what is right: noise alone does not pass.
#[track_caller]
pub fn assert_near(what: &str, values: &[f64], exact: f64, most_error: f64) {
    assert!(values.len() >= 16, "too few seeds");
    let (mean, error) = mean_and_error(values);
    assert!(error <= most_error * exact, "{what}: {mean} ± {error} says nothing about {exact}");
    let allowed = (4.0 * error).max(2e-5 * exact);
    assert!((mean - exact).abs() <= allowed, "{what}: {mean} ± {error} is not {exact}");
}

/// The room in which walls of a material are all that a ray can meet: a sphere seen from inside is its back, a box of quads its
/// front.
fn room(emission: f32, reflectance: f32, specular: f32) -> Build {
    let wall = || phong(reflectance, specular, 20.0, emission);
    let (low, side) = (-1.0, 2.0);
    let (x, y, z) = (v(side, 0.0, 0.0), v(0.0, side, 0.0), v(0.0, 0.0, side));
    let (o, far) = (v(low, low, low), v(low + side, low + side, low + side));
    // Fronts along u × v, inwards.
    scene()
        .quad(o, x, y, wall())
        .quad(o, y, z, wall())
        .quad(o, z, x, wall())
        .quad(far, -y, -x, wall())
        .quad(far, -z, -y, wall())
        .quad(far, -x, -z, wall())
        .seen(v(0.1, 0.2, -0.3), v(0.3, -1.0, 0.2))
}

#[test]
fn a_furnace_sums_its_bounces_to_the_depth_asked_for() {
    // L = E·(1 + ρ + … + ρᵏ); every vertex of every path is in the same light.
    for (reflectance, seeds) in [(0.5_f64, 16), (0.8, 32)] {
        for depth in [0, 1, 2, 3, 8, 60] {
            let values = by_paths(room(1.0, reflectance as f32, 0.0), depth).values(512, seeds);
            let exact = (1.0 - reflectance.powi(depth as i32 + 1)) / (1.0 - reflectance);
            assert_near(&format!("ρ {reflectance}, depth {depth}"), &values, exact, 5e-3);
        }
    }
}

#[test]
fn an_integrating_sphere_is_lit_everywhere_alike_by_what_bounces() {
    // R = 1, I = 1 W/sr at x = .5, ρ = .5: indirect irradiance 1; L = ρ/π·(1 + I·cos/d²).
    let sphere = |to: DVec3| {
        let walls = scene().sphere(DVec3::ZERO, 1.0, matte(0.5)).seen(v(0.0, 0.1, 0.0), to);
        by_paths(walls.point_light(v(0.5, 0.0, 0.0), 1.0, Falloff::Square), 60)
    };
    for (to, exact) in [(v(1.0, 0.0, 0.0), 0.795_774_715_5), (v(-1.0, 0.0, 0.0), 0.229_890_473_4)] {
        // 4 at the near wall, 4/9 at the far one, for the direct part.
        assert_near("integrating sphere", &sphere(to).values(1024, 32), exact, 3e-3);
    }
}

#[test]
fn concentric_spheres_exchange_their_light() {
    // Inner: R = 1, E = 1, ρ = .5; outer: R = 2, ρ = .8. All that the inner one sends out meets the outer one, of what that
    // sends a quarter comes back: L₁ = 4/3, L₂ = 2/3, and .2 by direct light alone.
    let spheres =
        || scene().sphere(DVec3::ZERO, 1.0, phong(0.5, 0.0, 1.0, 1.0)).sphere(DVec3::ZERO, 2.0, matte(0.8));
    let inner = by_paths(spheres().seen(v(1.5, 0.2, 0.0), DVec3::ZERO), 80);
    let outer = |depth| by_paths(spheres().seen(v(1.5, 0.2, 0.0), v(2.0, 0.0, 0.3)), depth);
    assert_near("inner", &inner.values(1024, 32), 4.0 / 3.0, 2e-3);
    assert_near("outer", &outer(80).values(1024, 32), 2.0 / 3.0, 4e-3);
    assert_near("outer, direct", &outer(1).values(256, 16), 0.2, 4e-3);
}

#[test]
fn two_plates_exchange_their_light() {
    // Infinite: L₁ = (E + ρ₁·…): 5/3 and 4/3 for E₁ = 1, ρ = .5 and .8. As quads 1e4 times as wide as their distance.
    let half = 5e3;
    let plates = |at: f64| {
        scene()
            .quad(
                v(-half, 0.0, half),
                v(2.0 * half, 0.0, 0.0),
                v(0.0, 0.0, -2.0 * half),
                phong(0.5, 0.0, 1.0, 1.0),
            )
            .quad(v(-half, 1.0, -half), v(2.0 * half, 0.0, 0.0), v(0.0, 0.0, 2.0 * half), matte(0.8))
            .seen(v(0.0, 0.5, 0.0), v(0.1, at, 0.1))
    };
    for (at, exact) in [(0.0, 5.0 / 3.0), (1.0, 4.0 / 3.0)] {
        let values = by_paths(plates(at), 100).values(4096, 48);
        assert_near("plates", &values, exact, 1e-3);
        assert!((mean_and_error(&values).0 - exact).abs() < 1.5e-3 * exact);
    }
}

#[test]
fn nothing_is_lost_or_won_at_lossless_mirrors_and_glass() {
    // A white background is behind everything: 1, whatever the path. Roulette never ends a path that loses nothing.
    for (what, material) in [("mirror", mirror(1.0)), ("glass", glass(1.5)), ("diamond", glass(2.4))] {
        let ball =
            scene().sphere(DVec3::ZERO, 1.0, material).pictured(v(0.0, 0.0, 4.0), DVec3::ZERO, 30.0, 16, 16);
        let picture = by_paths(ball.background(1.0), 200).picture(4, 0);
        for pixel in picture {
            assert!((pixel.x - 1.0).abs() < 1e-5, "{what}: {pixel}");
        }
    }
}

#[test]
fn the_background_lights_nothing_but_is_seen_by_mirrors() {
    let floor = || scene().quad(v(-5.0, 0.0, 5.0), v(10.0, 0.0, 0.0), v(0.0, 0.0, -10.0), matte(0.9));
    let lit = by_paths(floor().background(1.0).seen(v(0.0, 1.0, 0.0), DVec3::ZERO), 8);
    assert_eq!(lit.values(64, 1), [0.0]);
    let behind = floor().quad(v(-5.0, 4.0, 5.0), v(0.0, 0.0, -10.0), v(10.0, 0.0, 0.0), mirror(0.5));
    let seen = by_paths(behind.background(1.0).seen(v(0.0, 1.0, 0.0), v(3.0, 4.0, 8.0)), 8);
    let one = seen.values(4, 1)[0];
    assert!(one == 0.5 || one == 1.0, "{one}");
    let indirect = by_paths(seen.seen(v(0.0, 1.0, 0.0), DVec3::ZERO), 8);
    assert_eq!(indirect.values(64, 1), [0.0], "nor by way of a mirror");
}

#[test]
fn emission_through_glass_arrives_by_paths() {
    let inside = |with_glass: bool| {
        let mut build = room(1.0, 0.5, 0.0);
        if with_glass {
            build = build.sphere(v(0.2, -0.3, 0.1), 0.4, glass(1.5));
        }
        by_paths(build, 60).values(512, 16)
    };
    // A closed furnace is in equilibrium: 2 in every direction, with lossless glass in it or without.
    assert_near("without", &inside(false), 2.0, 3e-3);
    assert_near("with", &inside(true), 2.0, 5e-3);
}

#[test]
fn the_parts_of_a_picture_by_paths_add_up_to_it() {
    let build = |view| {
        let lamp = emitter(4.0);
        let room = room(0.0, 0.4, 0.4)
            .quad(v(-0.3, 0.9, -0.3), v(0.6, 0.0, 0.0), v(0.0, 0.0, 0.6), lamp)
            .sphere(v(0.5, -0.5, 0.0), 0.4, glass(1.5))
            .sphere(v(-0.5, -0.5, 0.0), 0.4, mirror(0.8))
            .point_light(v(0.0, 0.5, 0.8), 0.5, Falloff::Square)
            .pictured(v(0.0, 0.0, 0.9), v(0.0, -0.3, 0.0), 80.0, 24, 16);
        by_paths(room, 6).viewed(view).picture(8, 3)
    };
    let beauty = build(View::Beauty);
    let parts = [View::Ambient, View::Diffuse, View::Specular, View::Emission].map(build);
    assert!(parts[0].iter().all(|pixel| *pixel == DVec3::ZERO), "paths have no ambient light");
    for (i, whole) in beauty.iter().enumerate() {
        let sum: DVec3 = parts.iter().map(|part| part[i]).sum();
        assert!(
            (sum - *whole).abs().max_element() <= 1e-5 * whole.max_element().max(0.1),
            "{i}: {sum} {whole}"
        );
    }
    assert!(
        parts[1..].iter().all(|part| part.iter().any(|pixel| pixel.x > 0.01)),
        "every part shows something"
    );
}

#[test]
fn a_clamp_is_a_bias_downwards_and_off_by_default() {
    let dark = |clamp: f32| {
        let lamp = emitter(200.0);
        let room = room(0.0, 0.7, 0.0).quad(v(-0.05, 0.9, -0.05), v(0.1, 0.0, 0.0), v(0.0, 0.0, 0.1), lamp);
        let room = room.with(|scene| scene.render.clamp = clamp);
        mean_and_error(&by_paths(room, 20).values(512, 16)).0
    };
    let (free, loose, tight) = (dark(0.0), dark(1e9), dark(0.05));
    assert_eq!(free, loose);
    assert!(tight < 0.98 * free && tight > 0.2 * free, "{tight} of {free}");
}

#[test]
fn coloured_walls_multiply_their_colours() {
    // A furnace of another reflectance for each colour: L = E/(1 − ρ).
    let colors = Vec3::new(0.2, 0.5, 0.75);
    let room = room(1.0, 0.5, 0.0).with(|scene| {
        for material in &mut scene.materials {
            if let MaterialKind::Phong { diffuse, .. } = &mut material.kind {
                *diffuse = ColorSource::Constant(colors);
            }
        }
    });
    let build = by_paths(room, 60);
    let pixels: Vec<DVec3> = (0..32).map(|seed| build.picture(512, seed)[0]).collect();
    for axis in 0..3 {
        let values: Vec<f64> = pixels.iter().map(|pixel| pixel[axis]).collect();
        assert_near("a colour", &values, 1.0 / (1.0 - f64::from(colors[axis])), 4e-3);
    }
}
