//! Path-traced global illumination against closed forms.

use std::f64::consts::PI;

use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    ColorSource, Integrator, Material, MaterialKind, PhongParameters, ShadowMode, Shape,
};

use super::distant::sun;
use super::scenes::{Build, emitter, glass, lat_long_sphere, matte, mirror, phong, scene, tinted};
use super::{assert_close, assert_mean, assert_same_mean, lambert, mean_and_error, v};

/// A path-traced scene.
pub fn path_traced(build: Build, max_depth: u32) -> Build {
    build.with(|scene| scene.render.integrator = Integrator::Path).depth(max_depth)
}

/// A closed room with a single wall material. The camera sees the back faces of a sphere, or the front faces
/// of a box of quads.
fn room(emission: f32, reflectance: f32, specular: f32) -> Build {
    let wall = || phong(reflectance, specular, 20.0, emission);
    let (low, side) = (-1.0, 2.0);
    let (x, y, z) = (v(side, 0.0, 0.0), v(0.0, side, 0.0), v(0.0, 0.0, side));
    let (o, far) = (v(low, low, low), v(low + side, low + side, low + side));
    // Front faces point along u × v, inward.
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
fn furnace_sums_bounces_up_to_the_depth() {
    // L = E·(1 + ρ + … + ρᵏ), as every path vertex receives the same light.
    for (reflectance, seeds) in [(0.5_f64, 16), (0.8, 32)] {
        for depth in [0, 1, 2, 3, 8, 60] {
            let values = path_traced(room(1.0, reflectance as f32, 0.0), depth).values(512, seeds);
            let exact = (1.0 - reflectance.powi(depth as i32 + 1)) / (1.0 - reflectance);
            assert_mean(&format!("ρ {reflectance}, depth {depth}"), &values, exact, 5e-3);
        }
    }
}

#[test]
fn integrating_sphere_has_uniform_indirect_light() {
    // R = 1, ρ = 0.5, and I = 1 W/sr at x = 0.5. The indirect irradiance is 1, so L = ρ/π·(1 + I·cos/d²).
    let sphere = |to: DVec3| {
        let walls = scene().sphere(DVec3::ZERO, 1.0, matte(0.5)).seen(v(0.0, 0.1, 0.0), to);
        path_traced(walls.point_light(v(0.5, 0.0, 0.0), 1.0, Falloff::Square), 60)
    };
    for (to, exact) in [(v(1.0, 0.0, 0.0), 0.795_774_715_5), (v(-1.0, 0.0, 0.0), 0.229_890_473_4)] {
        // The direct component is 4 at the near wall and 4/9 at the far wall.
        assert_mean("integrating sphere", &sphere(to).values(1024, 32), exact, 3e-3);
    }
}

#[test]
fn concentric_spheres_exchange_light() {
    // The inner sphere has R = 1, E = 1, ρ = 0.5, the outer sphere R = 2, ρ = 0.8. All light from the inner
    // sphere reaches the outer one, and a quarter of the light from the outer sphere returns. L₁ = 4/3, L₂ =
    // 2/3, or 0.2 with direct light only.
    let spheres =
        || scene().sphere(DVec3::ZERO, 1.0, phong(0.5, 0.0, 1.0, 1.0)).sphere(DVec3::ZERO, 2.0, matte(0.8));
    let inner = path_traced(spheres().seen(v(1.5, 0.2, 0.0), DVec3::ZERO), 80);
    let outer = |depth| path_traced(spheres().seen(v(1.5, 0.2, 0.0), v(2.0, 0.0, 0.3)), depth);
    assert_mean("inner", &inner.values(1024, 32), 4.0 / 3.0, 1e-3);
    assert_mean("outer", &outer(80).values(1024, 32), 2.0 / 3.0, 3e-3);
    assert_mean("outer, direct", &outer(1).values(256, 16), 0.2, 5e-6);
}

#[test]
fn emissive_ball_in_a_mirror_sees_itself() {
    // A ball with E = 1 and ρ = 0.8 inside a mirror sphere with reflectance 0.6. All light from the ball
    // returns after two bounces, so L = Σ 0.48ᵏ with 2k ≤ depth. Russian roulette applies to both kinds of
    // bounces.
    let ball = scene().sphere(DVec3::ZERO, 1.0, phong(0.8, 0.0, 1.0, 1.0));
    let inside = ball.sphere(DVec3::ZERO, 2.0, mirror(0.6)).seen(v(1.5, 0.2, 0.0), DVec3::ZERO);
    for (depth, turns) in [(2, 1), (5, 2), (9, 4), (40, 20)] {
        let exact = (1.0 - 0.48_f64.powi(turns + 1)) / (1.0 - 0.48);
        let values = path_traced(inside.clone(), depth).values(1024, 32);
        assert_mean(&format!("depth {depth}"), &values, exact, 2e-3);
    }
}

#[test]
fn two_plates_exchange_light() {
    // Infinite plates with E₁ = 1, ρ₁ = 0.5 and ρ₂ = 0.8 have radiances 5/3 and 4/3. The quads are 10⁴ times
    // as wide as the gap between them.
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
        // Four standard errors are at most 0.1 %.
        let values = path_traced(plates(at), 100).values(16384, 48);
        assert_mean("plates", &values, exact, 2.5e-4);
        assert!((mean_and_error(&values).0 - exact).abs() <= 1e-3 * exact);
    }
}

#[test]
fn lossless_mirrors_and_glass_conserve_light() {
    // Every path ends in the white background, so every value is 1. Russian roulette never ends a lossless
    // path.
    for (what, material) in [("mirror", mirror(1.0)), ("glass", glass(1.5)), ("diamond", glass(2.4))] {
        let ball =
            scene().sphere(DVec3::ZERO, 1.0, material).pictured(v(0.0, 0.0, 4.0), DVec3::ZERO, 30.0, 16, 16);
        let picture = path_traced(ball.background(1.0), 200).picture(4, 0);
        for pixel in picture {
            assert!((pixel.x - 1.0).abs() < 1e-5, "{what}: {pixel}");
        }
    }
}

#[test]
fn background_is_visible_only_in_mirrors() {
    let floor = || scene().quad(v(-5.0, 0.0, 5.0), v(10.0, 0.0, 0.0), v(0.0, 0.0, -10.0), matte(0.9));
    let lit = path_traced(floor().background(1.0).seen(v(0.0, 1.0, 0.0), DVec3::ZERO), 8);
    assert_eq!(lit.values(64, 1), [0.0]);
    let behind = floor().quad(v(-5.0, 4.0, 5.0), v(0.0, 0.0, -10.0), v(10.0, 0.0, 0.0), mirror(0.5));
    let seen = path_traced(behind.background(1.0).seen(v(0.0, 1.0, 0.0), v(3.0, 4.0, 8.0)), 8);
    let one = seen.values(4, 1)[0];
    assert!(one == 0.5 || one == 1.0, "{one}");
    let indirect = path_traced(seen.seen(v(0.0, 1.0, 0.0), DVec3::ZERO), 8);
    assert_eq!(indirect.values(64, 1), [0.0], "the mirror must not transmit the background");
}

#[test]
fn paths_find_emission_through_glass() {
    let inside = |with_glass: bool| {
        let mut build = room(1.0, 0.5, 0.0);
        if with_glass {
            build = build.sphere(v(0.2, -0.3, 0.1), 0.4, glass(1.5));
        }
        path_traced(build, 60).values(512, 16)
    };
    // A closed furnace in equilibrium has radiance 2 in every direction, with or without lossless glass in
    // it.
    assert_mean("without", &inside(false), 2.0, 3e-3);
    assert_mean("with", &inside(true), 2.0, 5e-3);
}

#[test]
fn path_components_add_up() {
    let build = |view| {
        let lamp = emitter(4.0);
        let room = room(0.0, 0.4, 0.4)
            .quad(v(-0.3, 0.9, -0.3), v(0.6, 0.0, 0.0), v(0.0, 0.0, 0.6), lamp)
            .sphere(v(0.5, -0.5, 0.0), 0.4, glass(1.5))
            .sphere(v(-0.5, -0.5, 0.0), 0.4, mirror(0.8))
            .point_light(v(0.0, 0.5, 0.8), 0.5, Falloff::Square)
            .pictured(v(0.0, 0.0, 0.9), v(0.0, -0.3, 0.0), 80.0, 24, 16);
        path_traced(room, 6).viewed(view).picture(8, 3)
    };
    let beauty = build(ViewMode::Beauty);
    let parts = [ViewMode::Ambient, ViewMode::Diffuse, ViewMode::Specular, ViewMode::Emission].map(build);
    assert!(parts[0].iter().all(|pixel| *pixel == DVec3::ZERO), "path has no ambient light");
    for (i, whole) in beauty.iter().enumerate() {
        let sum: DVec3 = parts.iter().map(|part| part[i]).sum();
        assert!(
            (sum - *whole).abs().max_element() <= 1e-5 * whole.max_element().max(0.1),
            "{i}: {sum} {whole}"
        );
    }
    assert!(
        parts[1..].iter().all(|part| part.iter().any(|pixel| pixel.x > 0.01)),
        "every component must have light"
    );
}

/// Every kind of light, large and close to a floor with the specified material.
pub fn lights_over_a_floor(material: &Material) -> Vec<(&'static str, Build)> {
    let floor = || {
        let corner = v(-0.05, 0.0, 0.05);
        let floor = scene().quad(corner, v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), material.clone());
        // At −45°, so that the mirror direction passes through (1, 1, 0).
        floor.seen(v(-0.1, 0.1, 0.02), DVec3::ZERO)
    };
    let at = v(0.8, 0.9, 0.1);
    let ball = lat_long_sphere(5, 7, 0.6, DVec3::ZERO);
    let shaped = |shape| floor().shape(shape, emitter(2.0));
    vec![
        ("quad", floor().quad(v(0.2, 1.2, -0.5), v(0.9, -0.5, 0.0), v(0.0, 0.0, 1.0), emitter(2.0))),
        ("skewed quad", floor().quad(v(0.2, 1.2, -0.5), v(0.9, -0.5, 0.3), v(0.0, 0.2, 1.0), emitter(2.0))),
        ("sphere", floor().sphere(at, 0.6, emitter(2.0))),
        ("box", floor().cuboid(at, v(0.7, 0.5, 0.8), v(10.0, 30.0, 5.0), emitter(2.0))),
        (
            "triangle",
            floor().triangle([v(0.2, 1.2, -0.8), v(1.3, 0.4, -0.2), v(0.6, 0.9, 1.0)], emitter(2.0)),
        ),
        ("disk", shaped(Shape::Disk { center: at, normal: v(-0.7, -1.0, 0.1), radius: 0.6 })),
        (
            "cylinder",
            shaped(Shape::Cylinder { a: v(0.5, 0.8, -0.5), b: v(0.9, 0.9, 0.6), radius: 0.4, caps: true }),
        ),
        (
            "cone",
            shaped(Shape::Cone { base: v(1.0, 1.2, 0.0), tip: v(0.5, 0.4, 0.1), radius: 0.6, cap: true }),
        ),
        ("torus", shaped(Shape::Torus { center: at, axis: v(0.5, 1.0, 0.2), radius: 0.5, tube: 0.25 })),
        ("mesh", floor().mesh(ball, [DVec3::ONE, DVec3::ZERO, at], emitter(2.0))),
        ("two", floor().sphere(at, 0.4, emitter(2.0)).sphere(v(0.1, 0.6, 0.0), 0.3, emitter(1.0))),
        (
            "with a point light",
            floor().sphere(at, 0.4, emitter(2.0)).point_light(v(0.1, 0.6, 0.0), 0.3, Falloff::Square),
        ),
        ("sun", sun(floor(), -at, 2.0, 40.0)),
        ("narrow sun", sun(floor(), v(-1.0, -1.05, 0.0), 2.0, 3.0)),
        ("sharp sun with a sphere", sun(floor().sphere(at, 0.4, emitter(2.0)), v(1.0, -2.0, 0.0), 0.5, 0.0)),
        ("half a sun", sun(floor().sphere(at * 3.0, 1.0, matte(0.0)), -at, 2.0, 60.0)),
    ]
}

#[test]
fn direct_light_of_path_matches_whitted() {
    // MIS of light and lobe samples. Lobe samples matter more for narrow lobes.
    for (diffuse, specular, shininess) in [(0.7, 0.0, 1.0), (0.3, 0.6, 10.0), (0.1, 0.8, 90.0)] {
        for (what, build) in lights_over_a_floor(&phong(diffuse, specular, shininess, 0.0)) {
            let path = path_traced(build.clone(), 1).values(512, 16);
            let whitted = build.depth(1).values(2048, 16);
            let [path, whitted] = [path, whitted].map(|values| mean_and_error(&values));
            assert_same_mean(&format!("{what}, α {shininess}"), path, whitted, 0.01);
        }
    }
}

#[test]
fn sharp_highlight_has_low_variance() {
    // The light covers the whole lobe, so ∫(α + 2)/2π·cos^α·cos θ is cos θ of the mirror direction, here 45°.
    // Add the diffuse component.
    let corners = [v(0.2, 1.8, -0.9), v(1.8, 0.2, -0.9), v(1.8, 0.2, 0.9), v(0.2, 1.8, 0.9)];
    let (u, w) = (corners[1] - corners[0], corners[3] - corners[0]);
    for shininess in [1e3_f32, 1e5] {
        let corner = v(-0.05, 0.0, 0.05);
        let floor =
            scene().quad(corner, v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), phong(0.2, 0.5, shininess, 0.0));
        let lit = floor.quad(corners[0], u, w, emitter(3.0)).seen(v(-0.1, 0.1, 0.0), DVec3::ZERO);
        let diffuse = 0.2 / std::f64::consts::PI * lambert(DVec3::ZERO, DVec3::Y, &corners);
        let exact = 3.0 * (diffuse + 0.5 * 0.5_f64.sqrt());
        // A disk in the sky with the same radiance. At normal incidence, its irradiance is π·L·sin² of half
        // its angle.
        let disc = std::f64::consts::PI * 20_f64.to_radians().sin().powi(2);
        let floor =
            scene().quad(corner, v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), phong(0.2, 0.5, shininess, 0.0));
        let sunny = sun(floor, v(-1.0, -1.0, 0.0), (3.0 * disc) as f32, 40.0);
        let sunny = sunny.seen(v(-0.1, 0.1, 0.0), DVec3::ZERO);
        let exact_sunny = 3.0 * (0.2 / std::f64::consts::PI * disc + 0.5) * 0.5_f64.sqrt();
        for (what, build) in [("whitted", sunny.clone()), ("path", path_traced(sunny, 1))] {
            let values = build.values(256, 16);
            let worst = values.iter().map(|value| (value / exact_sunny - 1.0).abs()).fold(0.0, f64::max);
            assert!(worst < 0.02, "sun, {what}, α {shininess}: {worst}");
        }
        for (what, build) in [("whitted", lit.clone()), ("path", path_traced(lit.clone(), 1))] {
            for value in build.values(256, 16) {
                assert!(
                    (value / exact - 1.0).abs() < 0.02,
                    "{what}, α {shininess}: {value}, expected {exact}"
                );
            }
            let mean = mean_and_error(&build.values(256, 64)).0;
            assert!((mean / exact - 1.0).abs() < 3e-3, "{what}, α {shininess}: {mean}, expected {exact}");
        }
        // Half of the lobe extends past the edge of the light.
        let cut = lit.with(|scene| {
            if let Some(Shape::Quad { v: side, corner, .. }) =
                scene.objects.last_mut().map(|object| &mut object.shape)
            {
                (*corner, *side) = (corners[0] + v(0.0, 0.0, 0.9), v(0.0, 0.0, 0.9));
            }
        });
        let half = [v(0.2, 1.8, 0.0), v(1.8, 0.2, 0.0), v(1.8, 0.2, 0.9), v(0.2, 1.8, 0.9)];
        let diffuse = 0.2 / std::f64::consts::PI * lambert(DVec3::ZERO, DVec3::Y, &half);
        let exact = 3.0 * (diffuse + 0.25 * 0.5_f64.sqrt());
        let mean = mean_and_error(&cut.values(256, 32)).0;
        assert!((mean / exact - 1.0).abs() < 0.02, "edge, α {shininess}: {mean}, expected {exact}");
    }
}

#[test]
fn no_rays_for_unreachable_sharp_highlights() {
    let scattered = |shininess: f32, lamp: bool, max_depth: u32| {
        let floor = scene().quad(
            v(-1.0, 0.0, 1.0),
            v(2.0, 0.0, 0.0),
            v(0.0, 0.0, -2.0),
            phong(0.2, 0.5, shininess, 0.0),
        );
        let floor = floor.seen(v(-0.1, 0.1, 0.0), DVec3::ZERO).depth(max_depth);
        let lit = if lamp {
            floor.sphere(v(1.0, 1.0, 0.0), 0.3, emitter(1.0))
        } else {
            floor.point_light(v(1.0, 1.0, 0.0), 1.0, Falloff::Square)
        };
        let rect = glimt::film::Rect { x: 0, y: 0, width: 1, height: 1 };
        let token = glimt::control::CancelToken::new();
        let tile = glimt::integrators::render_tile(&lit.world(), &lit.settings(0), rect, 0..32, &token);
        tile.expect("the token is not canceled").1.scattered_rays
    };
    assert_eq!((scattered(99.0, true, 4), scattered(1e4, false, 4), scattered(1e4, true, 0)), (0, 0, 0));
    assert!(scattered(1e4, true, 1) > 24);
}

#[test]
fn path_follows_mirrors_and_glass_like_whitted() {
    // Emission seen only through delta lobes. Whitted splits each ray, whereas path follows one branch. Both
    // count each surface as a bounce.
    let build = || {
        scene()
            .quad(v(-9.0, -9.0, -9.0), v(18.0, 0.0, 0.0), v(0.0, 18.0, 0.0), emitter(1.0))
            .quad(v(9.0, -9.0, 9.0), v(-18.0, 0.0, 0.0), v(0.0, 18.0, 0.0), emitter(3.0))
            .sphere(v(-1.1, 0.0, 0.0), 1.0, glass(1.5))
            .cuboid(v(1.1, 0.0, 0.0), v(1.2, 1.6, 1.0), v(20.0, 30.0, 0.0), glass(1.3))
            .sphere(v(0.0, 1.3, -0.5), 0.6, mirror(0.7))
            .background(0.25)
            .pictured(v(0.0, 0.3, 6.0), DVec3::ZERO, 35.0, 12, 8)
    };
    for depth in [0, 1, 2, 3, 8] {
        let mean = |build: Build| mean_and_error(&build.mean_reds(64));
        let (path, whitted) = (mean(path_traced(build(), depth)), mean(build().depth(depth)));
        assert_same_mean(&format!("depth {depth}"), path, whitted, 1.5e-3);
    }
}

#[test]
fn paths_find_light_behind_glass() {
    // Glass with an IOR of 1 must have no effect, although it hides the light from light samples. (For other
    // IORs, a slab transmits (1 − R)/(1 + R), and the light on the floor would require numerical integration
    // over all angles.)
    let lit = |ior: Option<f32>| {
        let floor =
            scene().quad(v(-0.05, 0.0, 0.05), v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), phong(0.4, 0.4, 8.0, 0.0));
        let floor = floor.quad(v(-1.0, 1.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), emitter(1.0));
        let floor = match ior {
            Some(ior) => floor.cuboid(v(0.0, 0.75, 0.0), v(4.0, 0.5, 4.0), DVec3::ZERO, glass(ior)),
            None => floor,
        };
        mean_and_error(&path_traced(floor.seen(v(-0.1, 0.1, 0.02), DVec3::ZERO), 6).values(1024, 32))
    };
    assert_same_mean("with glass", lit(Some(1.0)), lit(None), 8e-3);
}

#[test]
fn clamp_darkens_and_is_off_by_default() {
    let dark = |clamp: f32| {
        let lamp = emitter(200.0);
        let room = room(0.0, 0.7, 0.0).quad(v(-0.05, 0.9, -0.05), v(0.1, 0.0, 0.0), v(0.0, 0.0, 0.1), lamp);
        let room = room.with(|scene| scene.render.clamp = clamp);
        mean_and_error(&path_traced(room, 20).values(512, 16)).0
    };
    let (free, loose, tight) = (dark(0.0), dark(1e9), dark(0.05));
    assert_eq!(free, loose);
    assert!(tight < 0.98 * free && tight > 0.2 * free, "{tight}, unclamped {free}");
}

#[test]
fn reflectances_multiply_per_color_channel() {
    // A furnace with a different reflectance in each channel: L = E/(1 − ρ).
    let colors = Vec3::new(0.2, 0.5, 0.75);
    let room = room(1.0, 0.5, 0.0).with(|scene| {
        for material in &mut scene.materials {
            if let MaterialKind::Phong(PhongParameters { diffuse, .. }) = &mut material.kind {
                *diffuse = ColorSource::Constant(colors);
            }
        }
    });
    let build = path_traced(room, 60);
    let pixels: Vec<DVec3> = build.pictures(512, 0..32).iter().map(|picture| picture[0]).collect();
    for axis in 0..3 {
        let values: Vec<f64> = pixels.iter().map(|pixel| pixel[axis]).collect();
        assert_mean("a color", &values, 1.0 / (1.0 - f64::from(colors[axis])), 4e-3);
    }
}

#[test]
fn light_samples_inside_glass_are_tinted() {
    // Floor, light and camera are in the same glass. The transmittance is tint^(light to floor) · tint^(floor
    // to camera).
    let tint = 0.5_f64;
    let inside = || {
        let glass = tinted(1.5, DVec3::splat(tint));
        let floor = Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y };
        let room = scene().shape(floor, matte(0.6)).cuboid(DVec3::Y, v(8.0, 6.0, 8.0), DVec3::ZERO, glass);
        room.seen(v(0.0, 1.5, 0.0), DVec3::ZERO)
    };
    let to_eye = tint.powf(1.5);
    let lit = inside().point_light(v(0.5, 1.0, 0.0), 1.0, Falloff::Square);
    let distance = 1.25_f64.sqrt();
    let exact = 0.6 / PI * (1.0 / distance) / 1.25 * tint.powf(distance) * to_eye;
    for (what, build) in [("whitted", lit.clone()), ("path", path_traced(lit, 1))] {
        for shadows in [ShadowMode::Soft, ShadowMode::Hard, ShadowMode::Off] {
            assert_close(what, build.clone().shadows(shadows, 1).value(), exact);
        }
    }
    // A 6 × 6 light at a height of 1.6, integrated numerically with the midpoint rule.
    let (side, height, steps) = (6.0, 1.6, 600);
    let mut sum = 0.0;
    for i in 0..steps {
        for j in 0..steps {
            let at = |k: i32| ((f64::from(k) + 0.5) / f64::from(steps) - 0.5) * side;
            let d2 = at(i) * at(i) + at(j) * at(j) + height * height;
            sum += height * height / (d2 * d2) * tint.powf(d2.sqrt()) * (side / f64::from(steps)).powi(2);
        }
    }
    let exact = 0.6 / PI * sum * to_eye;
    let lit = inside().quad(v(-3.0, height, -3.0), v(side, 0.0, 0.0), v(0.0, 0.0, side), emitter(1.0));
    let lit = lit.seen(v(0.0, 1.5, 0.0), DVec3::ZERO);
    for (what, build) in [("whitted", lit.clone()), ("path", path_traced(lit, 1))] {
        assert_mean(what, &build.values(256, 64), exact, 2e-4);
    }
    // The same light in a sharp highlight.
    let glossy = |build: Build| build.with(|scene| scene.materials[0] = phong(0.1, 0.8, 1e4, 0.0));
    let lit = inside().quad(v(-3.0, height, -3.0), v(side, 0.0, 0.0), v(0.0, 0.0, side), emitter(1.0));
    let lit = glossy(lit.seen(v(0.5, 0.5, 0.0), DVec3::ZERO));
    let reach = height * 2.0_f64.sqrt() + 0.5_f64.sqrt();
    let (diffuse, gloss) =
        (0.1 / PI * sum * tint.powf(0.5_f64.sqrt()), 0.8 * 0.5_f64.sqrt() * tint.powf(reach));
    for (what, build) in [("whitted", lit.clone()), ("path", path_traced(lit, 1))] {
        let ((mean, error), exact) = (mean_and_error(&build.values(256, 64)), diffuse + gloss);
        assert!(error < 6e-4 * exact, "{what}: too noisy: {mean} ± {error}");
        assert!((mean - exact).abs() < 4.0 * error + 2e-3 * gloss, "{what}: {mean}, expected {exact}");
    }
}
