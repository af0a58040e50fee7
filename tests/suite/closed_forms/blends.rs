//! Blends of two materials.

use std::f64::consts::PI;

use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    ColorSource, EmissionSides, Integrator, Material, MaterialKind, NumberSource, OpacitySource,
    TextureFilter, Wrap,
};

use super::global::path_traced;
use super::photons::{assert_same_light, path_and_photon_means};
use super::scenes::{Build, blend, emitter, glass, matte, metal, mirror, plain, principled, receiver, scene};
use super::{assert_mean, assert_same_mean, lambert, mean_and_error, v};

const fn number(weight: f32) -> NumberSource {
    NumberSource::Constant(weight)
}

/// The scene with each integrator, with its name.
fn with_each_integrator(build: &Build, depth: u32) -> [(&'static str, Build); 3] {
    let whitted = build.clone().depth(depth);
    let photons = whitted.clone().photons(256, 0.1);
    [("whitted", whitted), ("path", path_traced(build.clone(), depth)), ("photons", photons)]
}

/// A ball under an environment of radiance 1, viewed near its edge.
fn in_furnace(material: Material) -> Build {
    scene().environment(1.0).sphere(v(0.0, 0.0, -5.0), 1.0, material).seen(DVec3::ZERO, v(0.7, 0.0, -4.0))
}

#[test]
fn constant_blends_are_weighted_means() {
    // A convex diffuse object shows its reflectance, and so does a mirror.
    let cases = [
        (blend(matte(0.8), mirror(0.5), number(0.3)), 0.7 * 0.8 + 0.3 * 0.5),
        (blend(matte(0.8), matte(0.2), number(1.0)), 0.2),
        (
            blend(blend(matte(0.8), mirror(0.5), number(0.5)), matte(0.1), number(0.25)),
            0.375 * 0.8 + 0.375 * 0.5 + 0.25 * 0.1,
        ),
        (
            blend(mirror(0.9), blend(matte(0.8), mirror(0.5), number(0.2)), number(0.75)),
            0.25 * 0.9 + 0.6 * 0.8 + 0.15 * 0.5,
        ),
    ];
    for (number, (material, exact)) in cases.into_iter().enumerate() {
        for (integrator, build) in with_each_integrator(&in_furnace(material), 2) {
            // With photons, each sample traces a pass of photons.
            let samples = if integrator == "photons" { 256 } else { 2048 };
            let values = build.values(samples, 16);
            assert_mean(&format!("{number} with {integrator}"), &values, exact, 5e-3);
        }
    }
}

#[test]
fn blends_of_rough_materials_are_weighted_means() {
    let [first, second] = [metal(0.9, 0.4, 0.0), principled(0.5, 0.0, 0.6)];
    let mean = |material: Material| mean_and_error(&path_traced(in_furnace(material), 1).values(512, 16));
    let (a, b) = (mean(first.clone()), mean(second.clone()));
    let weighted = (0.35 * a.0 + 0.65 * b.0, (0.35 * a.1).hypot(0.65 * b.1));
    assert_same_mean("blend", mean(blend(first, second, number(0.65))), weighted, 5e-3);
}

#[test]
fn textured_weights_show_the_parts() {
    for (at, exact) in [(-0.5, 0.8), (0.5, 0.3)] {
        let mut build = scene();
        let texels = [Vec3::ZERO, Vec3::ONE];
        let mask = build.texture(&[&texels[..]], TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE);
        let weight = NumberSource::Texture { texture: mask, channel: None };
        let build = build
            .environment(1.0)
            .quad(
                v(-1.0, 0.0, 1.0),
                v(2.0, 0.0, 0.0),
                v(0.0, 0.0, -2.0),
                blend(mirror(0.8), mirror(0.3), weight),
            )
            .seen(v(at, 1.0, 0.0), v(at, 0.0, 0.0));
        for (integrator, build) in with_each_integrator(&build, 2) {
            let values = build.values(4, 4);
            assert!(
                values.iter().all(|value| (value - exact).abs() < 1e-5),
                "{integrator} at {at}: {values:?}"
            );
        }
    }
}

#[test]
fn blends_emit_the_weighted_sum() {
    // The light faces down, 1 above the receiver. Its parts emit 6 and 1 with weights 0.25 and 0.75.
    let corners = [v(-0.5, 1.0, -0.5), v(0.5, 1.0, -0.5), v(0.5, 1.0, 0.5), v(-0.5, 1.0, 0.5)];
    let lit = lambert(DVec3::ZERO, DVec3::Y, &corners) * 0.5 / PI;
    for name in ["constant", "textured"] {
        let mut build = receiver(DVec3::ZERO, 0.5);
        let texels = [Vec3::splat(0.75); 4];
        let texture = build.texture(&[&texels[..]], TextureFilter::Bilinear, Wrap::Repeat, Vec2::ONE);
        let weight = match name {
            "textured" => NumberSource::Texture { texture, channel: None },
            _ => number(0.75),
        };
        let lamp = blend(emitter(6.0), blend(emitter(1.0), emitter(1.0), number(0.5)), weight);
        let (corner, across) = (v(-0.5, 1.0, -0.5), v(1.0, 0.0, 0.0));
        let build = build.quad(corner, across, v(0.0, 0.0, 1.0), lamp);
        for (integrator, build) in with_each_integrator(&build, 1) {
            let values = build.values(256, 16);
            assert_mean(&format!("{name}, {integrator}"), &values, lit * 2.25, 1e-2);
        }
        // The light as seen by the camera.
        let seen = build.seen(v(0.0, 0.5, 0.0), v(0.0, 1.0, 0.0));
        assert_mean(&format!("{name}, seen"), &seen.values(256, 16), 2.25, 4e-3);
    }
}

#[test]
fn techniques_agree_on_emission_with_opacity() {
    // One part is two-sided and half opaque, and the other emits nothing. The mean emission from the back is
    // 0.4·0.5·5 = 1. Behind glass without refraction, only BSDF samples and photons find it.
    let mut veil = emitter(5.0);
    veil.emission.sides = EmissionSides::Both;
    veil.opacity = OpacitySource { value: number(0.5), cutoff: 0.0 };
    let lamp = blend(matte(0.0), veil, number(0.4));
    let corners = [v(-0.5, 1.0, -0.5), v(0.5, 1.0, -0.5), v(0.5, 1.0, 0.5), v(-0.5, 1.0, 0.5)];
    let exact = lambert(DVec3::ZERO, DVec3::Y, &corners) * 0.5 / PI;
    // The front faces up.
    let open = receiver(DVec3::ZERO, 0.5).quad(v(-0.5, 1.0, 0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, -1.0), lamp);
    for (integrator, build) in with_each_integrator(&open, 1) {
        assert_mean(integrator, &build.values(512, 16), exact, 1.5e-2);
    }
    let hidden = open.cuboid(v(0.0, 1.0, 0.0), v(1.5, 0.5, 1.5), DVec3::ZERO, glass(1.0));
    assert_mean("BSDF samples", &path_traced(hidden, 3).values(4096, 16), exact, 2e-2);
}

#[test]
fn shadow_rays_use_mean_transmittance_of_blends() {
    // A point light 2 above the receiver shines straight down through a pane with weight 0.4 and an opaque
    // part. The pane transmits (1 − R')·tint, with R = 0.04 and R' = 2R/(1 + R).
    let tint = ColorSource::Constant(Vec3::splat(0.5));
    let pane = plain(MaterialKind::Pane { ior: 1.5, tint });
    let passed = 0.4 * (1.0 - 2.0 * 0.04 / 1.04) * 0.5;
    let build = receiver(DVec3::ZERO, 0.5)
        .quad(v(-1.0, 1.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), blend(matte(0.0), pane, number(0.4)))
        .point_light(v(0.0, 2.0, 0.0), 8.0, Falloff::Square);
    let exact = 0.5 / PI * 8.0 / 4.0 * passed;
    for (integrator, build) in with_each_integrator(&build, 1) {
        let (mean, error) = mean_and_error(&build.values(16, 16));
        assert!((mean / exact - 1.0).abs() < 1e-4 + 4.0 * error / exact, "{integrator}: {mean}, {exact}");
    }
}

#[test]
fn techniques_agree_on_light_behind_blends() {
    // A veil between a light and the receiver: half of it is absent, and half is a pane.
    let mut veil = matte(0.0);
    veil.opacity = OpacitySource { value: number(0.25), cutoff: 0.0 };
    let tint = ColorSource::Constant(Vec3::ONE);
    let pane = plain(MaterialKind::Pane { ior: 1.0, tint });
    let passed = 0.5 * 0.75 + 0.5;
    let corners = [v(-0.5, 1.0, -0.5), v(0.5, 1.0, -0.5), v(0.5, 1.0, 0.5), v(-0.5, 1.0, 0.5)];
    let exact = lambert(DVec3::ZERO, DVec3::Y, &corners) * 0.5 / PI * 3.0 * passed;
    let build = receiver(DVec3::ZERO, 0.5)
        .quad(v(-0.5, 1.0, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(3.0))
        .quad(v(-2.0, 0.5, 2.0), v(4.0, 0.0, 0.0), v(0.0, 0.0, -4.0), blend(veil, pane, number(0.5)));
    for (integrator, build) in with_each_integrator(&build, 1) {
        assert_mean(integrator, &build.values(512, 16), exact, 1e-2);
    }
}

#[test]
fn photons_match_path_on_blends() {
    // Photons are stored on the diffuse part of the floor and reflected by its mirror part.
    let floor = blend(matte(0.6), blend(mirror(0.8), metal(0.9, 0.6, 0.0), number(0.5)), number(0.6));
    let room = scene()
        .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), floor)
        .quad(v(-1.0, 0.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), matte(0.7))
        .sphere(v(-0.3, 0.4, 0.0), 0.4, blend(mirror(0.9), matte(0.3), number(0.5)))
        .quad(v(-0.5, 1.9, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(4.0))
        .pictured(v(0.0, 1.0, 3.5), v(0.2, 0.6, -0.9), 30.0, 12, 12);
    for depth in [2, 3] {
        let means = path_and_photon_means(&room.clone().depth(depth), depth, [96, 6], (20_000, 0.05));
        assert_same_light(&format!("depth {depth}"), means, 1.2e-2, 4e-3);
    }
}

#[test]
fn albedo_layer_is_the_mean_of_the_parts() {
    let build = in_furnace(blend(matte(0.8), matte(0.2), number(0.25)))
        .viewed(ViewMode::Albedo)
        .with(|scene| scene.render.integrator = Integrator::Path);
    assert_mean("albedo", &build.values(256, 16), 0.65, 4e-3);
}
