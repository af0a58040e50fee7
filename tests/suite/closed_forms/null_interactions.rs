//! Straight transmission: thin panes and partial opacity.

use std::f64::consts::PI;

use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    Accel, ColorSource, EmissionSides, Integrator, Material, MaterialKind, NumberSource, OpacitySource,
    ShadowMode, Shape, TextureFilter, Wrap,
};

use super::scenes::{Build, IDENTITY_PLACEMENT, emitter, matte, mirror, phong, plain, receiver, scene};
use super::{assert_close, assert_mean, assert_same_mean, mean_and_error, v};

fn pane(tint: f32) -> Material {
    plain(MaterialKind::Pane { ior: 1.5, tint: ColorSource::Constant(Vec3::splat(tint)) })
}

fn with_opacity(mut material: Material, opacity: f32) -> Material {
    material.opacity = OpacitySource { value: NumberSource::Constant(opacity), cutoff: 0.0 };
    material
}

fn path(build: Build) -> Build {
    build.with(|scene| scene.render.integrator = Integrator::Path)
}

/// Reflectance of a pane with n = 1.5: 2R/(1 + R), where R follows from Fresnel's sine and tangent laws.
fn reflectance(i: f64) -> f64 {
    let t = (i.sin() / 1.5).asin();
    let r = if i == 0.0 {
        0.04
    } else {
        (((i - t).sin() / (i + t).sin()).powi(2) + ((i - t).tan() / (i + t).tan()).powi(2)) / 2.0
    };
    2.0 * r / (1.0 + r)
}

/// A large square at depth `z`, rotated around the x axis.
fn sheet(build: Build, z: f64, degrees: f64, material: Material) -> Build {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (u, w) = (v(2e3, 0.0, 0.0), v(0.0, cos, sin) * 2e3);
    build.quad(v(0.0, 0.0, z) - (u + w) * 0.5, u, w, material)
}

/// A light that fills the background.
fn with_background_light(build: Build, z: f64) -> Build {
    sheet(build, z, 0.0, emitter(1.0))
}

#[test]
fn pane_transmits_by_angle() {
    for degrees in [0.0_f64, 30.0, 60.0, 80.0] {
        let exact = 0.9 * (1.0 - reflectance(degrees.to_radians()));
        // The light is too small to be visible in the pane's reflection.
        let lamp = [v(-10.0, -10.0, -2e3), v(20.0, 0.0, 0.0), v(0.0, 20.0, 0.0)];
        let build = sheet(scene(), -2.0, degrees, pane(0.9));
        let seen = build.quad(lamp[0], lamp[1], lamp[2], emitter(1.0));
        for depth in [0, 8] {
            assert_close(&format!("{degrees}°, depth {depth}"), seen.clone().depth(depth).value(), exact);
        }
        assert_mean(&format!("{degrees}°, path"), &path(seen).values(37, 256), exact, 5e-3);
    }
}

#[test]
fn textured_tint_colors_transmitted_light() {
    let mut build = scene();
    let rows: [&[Vec3]; 1] = [&[Vec3::new(0.9, 0.2, 0.1), Vec3::new(0.1, 0.3, 2.0)]];
    let texture = build.texture(&rows, TextureFilter::Nearest, Wrap::Clamp, Vec2::ONE);
    let stained = plain(MaterialKind::Pane { ior: 1.5, tint: ColorSource::Texture(texture) });
    let [left, right] =
        [DVec3::new(0.9, 0.2, 0.1), DVec3::new(0.1, 0.3, 1.0)].map(|tint| tint * (1.0 - 0.08 / 1.04));
    // The light through both halves of the window.
    let window = build.quad(v(-1.0, -1.0, -2.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), stained);
    for build in
        [with_background_light(window.clone(), -4.0), path(with_background_light(window.clone(), -4.0))]
    {
        for (x, exact) in [(-0.5, left), (0.5, right)] {
            let seen = build.clone().seen(v(x, 0.0, 0.0), v(x, 0.0, -1.0)).depth(0).color();
            assert!((seen - exact).length() < 1e-5, "{seen}, expected {exact}");
        }
    }
    // The transmitted light on a wall behind the window, from a small distant light.
    let floor = |x: f64| {
        window
            .clone()
            .point_light(v(x, 0.0, 1e4), 1e8, Falloff::Square)
            .quad(v(-2.0, -2.0, -3.0), v(4.0, 0.0, 0.0), v(0.0, 4.0, 0.0), matte(0.5))
            .seen(v(x, 0.0, -2.5), v(x, 0.0, -3.0))
            .color()
    };
    for (x, exact) in [(-0.5, left), (0.5, right)] {
        let (seen, exact) = (floor(x), exact * (0.5 / PI));
        assert!((seen - exact).length() < 1e-3, "{seen}, expected {exact}");
    }
}

#[test]
fn pane_reflectance_is_exact() {
    // The pane at 60° reflects the ray down to the light.
    let seen = sheet(scene(), -2.0, 60.0, pane(0.9)).quad(
        v(-1e3, -500.0, 1e3),
        v(2e3, 0.0, 0.0),
        v(0.0, 0.0, -2e3),
        emitter(1.0),
    );
    let exact = reflectance(PI / 3.0);
    assert_close("reflected", seen.clone().depth(1).value(), exact);
    assert_eq!(seen.clone().depth(0).value(), 0.0);
    assert_mean("path", &path(seen).depth(1).values(256, 64), exact, 1.5e-3);
}

/// A receiver on the axis of a disk light with radius 1 at height 2. `between` adds objects between the two.
fn under_disk_light(between: impl Fn(Build) -> Build) -> Build {
    let disk = Shape::Disk { center: v(0.0, 2.0, 0.0), normal: DVec3::NEG_Y, radius: 1.0 };
    between(receiver(DVec3::ZERO, 0.7)).shape(disk, emitter(1.0))
}

fn with_horizontal_quad(build: Build, y: f64, material: Material) -> Build {
    build.quad(v(-9.0, y, 9.0), v(18.0, 0.0, 0.0), v(0.0, 0.0, -18.0), material)
}

#[test]
fn light_passes_through_panes() {
    // E = 2π·∫(1 − R')ⁿ·cos θ·sin θ dθ from θ = 0 to tan θ = ½, where R' is the pane's reflectance.
    let irradiance = |count: i32, tint: f64| {
        let (steps, end) = (2000, 0.5_f64.atan());
        let of = |k: i32| {
            let theta = (f64::from(k) + 0.5) * end / f64::from(steps);
            (tint * (1.0 - reflectance(theta))).powi(count) * theta.cos() * theta.sin()
        };
        2.0 * PI * (0..steps).map(of).sum::<f64>() * end / f64::from(steps)
    };
    for count in [1, 3] {
        let panes = |build: Build| {
            (0..count)
                .fold(build, |build, i| with_horizontal_quad(build, 0.5 + 0.3 * f64::from(i), pane(0.8)))
        };
        let exact = 0.7 * irradiance(count, 0.8) / PI;
        let lit = under_disk_light(panes).depth(1);
        for samples in [1, 16] {
            let values = lit.clone().shadows(ShadowMode::Soft, samples).values(256 / samples, 256);
            assert_mean(&format!("{count} panes, {samples} shadow rays"), &values, exact, 1e-6);
        }
        assert_mean(&format!("{count} panes, path"), &path(lit.clone()).values(256, 256), exact, 3e-5);
        // Photons must not add to the straight transmission.
        assert_mean(
            &format!("{count} panes, photons"),
            &lit.photons(4096, 0.1).values(16, 64),
            exact,
            1.5e-4,
        );
    }
}

#[test]
fn whitted_with_photons_matches_path() {
    // Light reflected by a pane and a half-transparent mirror, including interreflections.
    let lit = under_disk_light(|build| {
        let build = with_horizontal_quad(build, 0.5, pane(0.9));
        build
            .quad(v(-1.0, 0.2, -1.0), v(2.0, 0.0, 0.0), v(0.0, 2.5, 0.0), with_opacity(mirror(0.9), 0.5))
            .quad(v(-2.0, -0.1, 2.0), v(4.0, 0.0, 0.0), v(0.0, 0.0, -4.0), with_opacity(matte(0.8), 0.5))
    });
    let lit = lit.depth(4);
    let photons = mean_and_error(&lit.clone().photons(6_000, 0.04).values(16, 20));
    assert_same_mean("photons", photons, mean_and_error(&path(lit).values(1024, 26)), 0.025);
}

#[test]
fn opacity_blends_surface_and_background() {
    // Radiance 4 with opacity 0.25 in front of radiance 1.
    let seen = with_background_light(sheet(scene(), -2.0, 20.0, with_opacity(emitter(4.0), 0.25)), -9.0);
    for build in [seen.clone(), path(seen)] {
        assert_mean("both", &build.values(256, 64), 0.25 * 4.0 + 0.75, 1e-6);
    }
    // Black mirrors with different opacities and cutoffs.
    let cut = |opacity, cutoff| {
        let mut material = with_opacity(mirror(0.0), opacity);
        material.opacity.cutoff = cutoff;
        with_background_light(sheet(scene(), -2.0, 0.0, material), -9.0).value()
    };
    assert_eq!([cut(0.0, 0.0), cut(0.4, 0.5), cut(0.6, 0.5), cut(1.0, 0.0)], [1.0, 1.0, 0.0, 0.0]);
}

#[test]
fn shadows_multiply_transmittances() {
    let lit = |opacities: &[f32]| {
        let build = receiver(DVec3::ZERO, 0.7).point_light(v(0.0, 20.0, 0.0), 10.0, Falloff::None);
        let layer = |build: Build, (i, opacity): (usize, &f32)| {
            with_horizontal_quad(build, 0.5 + 0.1 * i as f64, with_opacity(matte(0.5), *opacity))
        };
        opacities.iter().enumerate().fold(build, layer)
    };
    let open = lit(&[]).value();
    for integrator in [Integrator::Whitted, Integrator::Path] {
        for accel in [Accel::Bvh, Accel::KdTree] {
            let value = |opacities: &[f32]| {
                let build = lit(opacities).depth(1).accel(accel);
                build.with(|scene| scene.render.integrator = integrator).value()
            };
            assert_close("one", value(&[0.3]), 0.7 * open);
            assert_close("two", value(&[0.3, 0.5]), 0.35 * open);
            assert_close("64", value(&[0.01; 64]), 0.99_f64.powi(64) * open);
            assert_eq!(value(&[0.01; 65]), 0.0);
            assert_eq!(value(&[0.3, 1.0]), 0.0);
        }
    }
    // A single ray to the light's center is also attenuated. Without shadows, light is not attenuated.
    let under = |shadows| {
        let lit = under_disk_light(|build| with_horizontal_quad(build, 1.0, with_opacity(matte(0.5), 0.3)));
        mean_and_error(&lit.shadows(shadows, 1).values(256, 64)).0
    };
    assert!((under(ShadowMode::Hard) / under(ShadowMode::Off) - 0.7).abs() < 0.01);
}

#[test]
fn camera_ray_passes_up_to_64_surfaces() {
    let seen = |count: u32| {
        let build = (0..count)
            .fold(scene(), |build, i| sheet(build, -1.0 - f64::from(i), 0.0, with_opacity(matte(0.5), 0.0)));
        with_background_light(build, -200.0)
    };
    for build in [seen(64), path(seen(64))] {
        assert_eq!(build.depth(0).value(), 1.0);
    }
    assert_eq!(seen(65).value(), 0.0);
    let through = |count: i32| {
        let build = (0..count).fold(scene(), |build, i| sheet(build, -1.0 - f64::from(i), 0.0, pane(1.0)));
        with_background_light(build, -200.0).depth(0).value()
    };
    assert_close("64 panes", through(64), (1.0 - 0.08 / 1.04_f64).powi(64));
    assert_eq!(through(65), 0.0);
}

#[test]
fn light_emission_is_scaled_by_opacity() {
    let full = mean_and_error(&under_disk_light(|build| build).values(256, 64)).0;
    assert_close("the formula", full, 0.7 / 5.0);
    let disk = Shape::Disk { center: v(0.0, 2.0, 0.0), normal: DVec3::NEG_Y, radius: 1.0 };
    let lit = receiver(DVec3::ZERO, 0.7).shape(disk, with_opacity(emitter(1.0), 0.25));
    for build in [lit.clone(), path(lit)] {
        assert_mean("a quarter", &build.values(256, 128), 0.25 * 0.7 / 5.0, 1.5e-3);
    }
}

#[test]
fn half_opaque_lights_transmit_their_own_light() {
    // A convex two-sided light with opacity o has radiance o from the front surface and (1 − o)·o from the
    // back surface.
    let outside = receiver(v(3.0, 0.0, 0.0), 0.7);
    let (center, o) = (v(3.0, 2.0, 0.0), 0.4);
    let lit = |shape: &Shape, opacity: f32, sides: EmissionSides| {
        let mut material = with_opacity(emitter(1.0), opacity);
        material.emission.sides = sides;
        outside.clone().shape(shape.clone(), material)
    };
    for shape in [
        Shape::Sphere { center, radius: 0.7 },
        Shape::Box { center, size: v(1.0, 0.6, 2.0), rotate: v(10.0, 20.0, 30.0) },
        Shape::Cylinder { a: center, b: center + v(0.2, 1.0, 0.1), radius: 0.5, caps: true },
        Shape::Cone { base: center, tip: center + v(0.5, 1.0, 0.0), radius: 1.0, cap: true },
    ] {
        let name = shape.kind();
        let whole = mean_and_error(&lit(&shape, 1.0, EmissionSides::Front).values(256, 128)).0;
        let both = lit(&shape, o, EmissionSides::Both);
        let exact = whole * f64::from(o) * (2.0 - f64::from(o));
        for (what, build) in [
            ("whitted", both.clone()),
            ("hard", both.clone().shadows(ShadowMode::Hard, 1)),
            ("path", path(both.clone())),
            ("photons", both.photons(100, 0.1).depth(1)),
        ] {
            let (mean, error) = mean_and_error(&build.values(256, 128));
            assert!(error < 1.5e-3 * exact, "{name} with {what}: too noisy: {mean} ± {error}");
            assert!(
                (mean - exact).abs() < 4.0 * error + 2e-3 * exact,
                "{name} with {what}: {mean}, expected {exact}"
            );
        }
    }
    // There is no closed form for shapes that occlude themselves.
    for shape in [
        Shape::Cylinder { a: center, b: center + v(1.0, 0.5, 0.1), radius: 0.5, caps: false },
        Shape::Torus { center, axis: v(0.2, 1.0, 0.3), radius: 1.0, tube: 0.3 },
    ] {
        for sides in [EmissionSides::Front, EmissionSides::Both] {
            let build = lit(&shape, o, sides);
            let [whitted, path] =
                [build.clone(), path(build)].map(|build| mean_and_error(&build.values(256, 256)));
            assert_same_mean(shape.kind(), whitted, path, 8e-3);
        }
    }
}

#[test]
fn opacity_texture_masks_lights_and_shadows() {
    // A square of side length 2 at height 1, opaque only in its left half, as a light and as a screen in
    // front of the sky.
    let square = |material: Material, build: Build| {
        build.quad(v(-1.0, 1.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), material)
    };
    let half = [v(-1.0, 1.0, -1.0), v(0.0, 1.0, -1.0), v(0.0, 1.0, 1.0), v(-1.0, 1.0, 1.0)];
    let exact = super::lambert(DVec3::ZERO, DVec3::Y, &half);
    let masked = |mut build: Build, mut material: Material| {
        let texture =
            build.texture(&[&[Vec3::ONE, Vec3::ZERO]], TextureFilter::Nearest, Wrap::Clamp, Vec2::ONE);
        material.opacity =
            OpacitySource { value: NumberSource::Texture { texture, channel: None }, cutoff: 0.5 };
        square(material, build)
    };
    let lamp = masked(receiver(DVec3::ZERO, 0.7), emitter(1.0));
    for build in [lamp.clone(), path(lamp)] {
        assert_mean("lamp", &build.values(256, 256), 0.7 * exact / PI, 5e-4);
    }
    let screen = masked(receiver(DVec3::ZERO, 0.7), matte(0.0)).environment(1.0);
    for build in [screen.clone(), path(screen)] {
        assert_mean("screen", &build.values(256, 256), 0.7 * (PI - exact) / PI, 1e-3);
    }
}

#[test]
fn furnace_with_panes_has_radiance_one() {
    let build = scene()
        .environment(1.0)
        .sphere(v(0.0, 0.0, -6.0), 1.0, matte(1.0))
        .sphere(v(0.0, 0.0, -6.0), 1.5, pane(1.0))
        .sphere(v(0.5, 0.5, -6.0), 2.5, with_opacity(mirror(1.0), 0.4));
    let build =
        sheet(sheet(build, -2.0, 30.0, pane(1.0)), -2.5, -50.0, with_opacity(pane(1.0), 0.5)).depth(10_000);
    assert_mean("path", &path(build).values(256, 64), 1.0, 1e-6);
    // Without diffuse surfaces, whitted includes all light.
    let clear =
        sheet(sheet(scene().environment(1.0), -2.0, 30.0, pane(1.0)), -4.0, -50.0, pane(1.0)).depth(60);
    let (mean, _) = mean_and_error(&clear.values(64, 16));
    assert!((mean - 1.0).abs() < 1e-3, "{mean}");
}

#[test]
fn highlights_pass_partial_opacity() {
    // Sharp lobes trace separate rays, which must pass through partial opacity like shadow rays and paths.
    let lit = |material: Material| {
        scene()
            .quad(v(-9.0, 0.0, 9.0), v(18.0, 0.0, 0.0), v(0.0, 0.0, -18.0), phong(0.2, 0.7, 3000.0, 0.0))
            .quad(v(-0.5, 2.0, -2.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), material)
            .quad(v(-2.0, 1.2, -3.0), v(4.0, 0.0, 0.0), v(0.0, 0.0, 4.0), with_opacity(matte(0.0), 0.4))
            .quad(v(-2.0, 1.5, -3.0), v(4.0, 0.0, 0.0), v(0.0, 0.0, 4.0), pane(0.9))
            .seen(v(0.0, 1.0, 1.0), DVec3::ZERO)
            .depth(1)
    };
    for material in [emitter(1.0), with_opacity(emitter(2.0), 0.5)] {
        let build = lit(material);
        let [whitted, path] = [build.values(256, 64), path(build).values(1024, 64)];
        assert_same_mean("highlight", mean_and_error(&whitted), mean_and_error(&path), 8e-3);
    }
}

#[test]
fn merged_small_meshes_attenuate_separately() {
    // Grids of 8 × 8 squares, small enough to share a tree. With `shift`, the opaque grid does not block the
    // light.
    let grid = |y: f64, x: f64| {
        let mut mesh = TriangleMesh::default();
        for i in 0..9 {
            for j in 0..9 {
                mesh.positions.push(v(x + f64::from(i) - 4.1, y, f64::from(j) - 4.2).as_vec3());
            }
        }
        for i in 0..8_u32 {
            for j in 0..8 {
                let a = 9 * i + j;
                mesh.triangles.extend([[a, a + 1, a + 10], [a, a + 10, a + 9]]);
            }
        }
        mesh
    };
    let lit = |shift: f64| {
        receiver(DVec3::ZERO, 0.7)
            .point_light(v(0.0, 20.0, 0.0), 10.0, Falloff::None)
            .mesh(grid(1.0, 0.0), IDENTITY_PLACEMENT, with_opacity(matte(0.5), 0.3))
            .mesh(grid(2.0, 0.0), IDENTITY_PLACEMENT, with_opacity(matte(0.5), 0.5))
            .mesh(grid(3.0, shift), IDENTITY_PLACEMENT, matte(0.5))
    };
    assert!(lit(20.0).world().geometry.objects().len() == 4);
    assert_close("beside", lit(20.0).value(), 0.35 * 0.7 * 10.0 / PI);
    assert_eq!(lit(0.0).value(), 0.0);
}

#[test]
fn first_hit_views_pass_transparent_surfaces() {
    let build = |opacity: f32| {
        let near = sheet(scene(), -2.0, 45.0, with_opacity(matte(0.5), opacity));
        sheet(near, -7.0, 0.0, matte(0.25))
    };
    for (opacity, depth, albedo) in [(0.0, 7.0, 0.25), (1.0, 2.0, 0.5)] {
        assert_close("depth", build(opacity).viewed(ViewMode::Depth).value(), depth);
        assert_close("albedo", build(opacity).viewed(ViewMode::Albedo).value(), albedo);
    }
    let shadow = under_disk_light(|build| with_horizontal_quad(build, 1.0, with_opacity(matte(0.5), 0.25)))
        .viewed(ViewMode::Shadow);
    assert_mean("shadow", &shadow.values(64, 16), 0.75, 1e-6);
}
