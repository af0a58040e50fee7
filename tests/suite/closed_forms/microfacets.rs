//! Metal, plastic and principled materials with every integrator.

use glimt::choice::Choice;
use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    EmissionSource, Integrator, Material, MaterialKind, NumberSource, ShadowMode, TextureFilter, Wrap,
};

use super::global::{lights_over_a_floor, path_traced};
use super::photons::{assert_same_light, path_and_photon_means};
use super::scenes::{
    Build, beckmann, coated, emitter, frosted, glass, lat_long_sphere, matte, metal, mirror, phong, plastic,
    principled, scene, translucent,
};
use super::{assert_close, assert_same_mean, mean_and_error, v};

/// Materials with lobes of every width.
fn materials() -> Vec<(&'static str, Material)> {
    vec![
        ("narrow metal", metal(0.8, 0.1, 0.0)),
        ("metal", metal(0.8, 0.5, 0.0)),
        ("brushed metal", metal(0.8, 0.4, 0.8)),
        ("wide metal", metal(0.8, 1.0, 0.0)),
        ("narrow plastic", plastic(0.6, 0.1)),
        ("plastic", plastic(0.6, 0.5)),
        ("smooth plastic", plastic(0.6, 0.0)),
        ("principled", principled(0.6, 0.3, 0.4)),
        ("rough glass", frosted(1.5, 0.5)),
        ("sheet", translucent(0.6, 0.4, 0.5)),
        ("coated phong", coated(0.8, 0.4, phong(0.5, 0.3, 20.0, 0.0))),
        ("coated mirror", coated(1.0, 0.5, mirror(0.5))),
        ("Beckmann metal", beckmann(metal(0.8, 0.4, 0.3))),
        ("Beckmann plastic", beckmann(plastic(0.6, 0.4))),
    ]
}

/// A ball in a furnace with radiance 1, viewed at its edge.
fn in_furnace(material: Material, depth: u32) -> Build {
    scene()
        .environment(1.0)
        .sphere(v(0.0, 0.0, -5.0), 1.0, material)
        .seen(DVec3::ZERO, v(0.7, 0.0, -4.0))
        .depth(depth)
}

#[test]
fn white_plastic_is_invisible_in_a_furnace() {
    for roughness in [0.0, 0.05, 0.2, 0.5, 0.8, 1.0] {
        for at in [v(0.0, 0.0, -4.0), v(0.7, 0.0, -4.0), v(0.97, 0.0, -4.2)] {
            let build = in_furnace(plastic(1.0, roughness), 1).seen(DVec3::ZERO, at);
            for (what, build) in [("whitted", build.clone()), ("path", path_traced(build, 1))] {
                let (mean, error) = mean_and_error(&build.values(2048, 16));
                assert!(error < 5e-4, "{what}, roughness {roughness} at {at}: too noisy: ± {error}");
                assert!(
                    (mean - 1.0).abs() < 2e-3 + 4.0 * error,
                    "{what}, roughness {roughness} at {at}: {mean}"
                );
            }
        }
    }
}

#[test]
fn smooth_metal_follows_schlick() {
    // Schlick's approximation is F0 + (1 − F0)(1 − cos θ)⁵, here at 60°.
    let build = scene()
        .environment(1.0)
        .quad(v(-1.0, -1.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), metal(0.5, 0.0, 0.0))
        .seen(v(-(3.0_f64.sqrt()), 0.0, 0.0), v(0.0, -1.0, 0.0));
    for build in [build.clone(), path_traced(build, 4)] {
        assert_close("at 60°", build.value(), 0.5 + 0.5 * 0.5_f64.powi(5));
    }
}

#[test]
fn techniques_agree_on_area_lights() {
    for (material, kind) in materials() {
        for (what, build) in lights_over_a_floor(&kind) {
            let whitted = build.clone().depth(1);
            // Without occluders, the shadow mode has no effect.
            let [off, hard] =
                [ShadowMode::Off, ShadowMode::Hard].map(|kind| whitted.clone().shadows(kind, 1));
            let path = mean_and_error(&path_traced(build, 1).values(400, 16));
            let others = [("whitted", &whitted), ("unshadowed", &off), ("hard", &hard)];
            // In these two cases, a ball occludes part of a light.
            let others = if ["two", "half a sun"].contains(&what) { &others[..1] } else { &others[..] };
            for &(technique, build) in others {
                let found = mean_and_error(&build.values(400, 16));
                assert_same_mean(&format!("{material}, {what}, {technique}"), found, path, 0.03);
            }
        }
    }
}

#[test]
fn lobe_samples_find_area_lights() {
    // Light samples cannot find a light inside glass. Glass without refraction has no other effect.
    for (material, kind) in materials() {
        let floor = scene()
            .quad(v(-0.05, 0.0, 0.05), v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), kind)
            .seen(v(-0.1, 0.1, 0.02), DVec3::ZERO);
        let at = v(0.8, 0.9, 0.1);
        let lit = path_traced(floor.clone().sphere(at, 0.6, emitter(2.0)), 2);
        let hidden = path_traced(floor.sphere(at, 0.6, emitter(2.0)).sphere(at, 0.65, glass(1.0)), 3);
        let (both, lobes) = (mean_and_error(&lit.values(1024, 16)), mean_and_error(&hidden.values(4096, 16)));
        assert_same_mean(material, lobes, both, 0.02);
    }
}

#[test]
fn whitted_shows_reflections_in_rough_lobes() {
    // A wide, lit board is visible through the rough lobe.
    for (material, kind) in materials() {
        let build = scene()
            .quad(v(-0.05, 0.0, 0.05), v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), kind)
            .quad(v(1.0, 0.0, -4.0), v(0.0, 0.0, 8.0), v(0.0, 4.0, 0.0), matte(0.7))
            .point_light(v(-3.0, 5.0, 0.0), 40.0, Falloff::Square)
            .seen(v(-0.1, 0.1, 0.02), DVec3::ZERO);
        // Whitted excludes indirect light from the diffuse lobe, so compare only the specular components.
        let part = |build: Build| mean_and_error(&build.viewed(ViewMode::Specular).values(1024, 16));
        let (whitted, path) = (part(build.clone().depth(2)), part(path_traced(build, 2)));
        if ["smooth plastic", "coated mirror"].contains(&material) {
            continue;
        }
        assert_same_mean(material, whitted, path, 0.02);
    }
}

#[test]
fn photons_match_path_on_coats_and_metals() {
    let room = |depth: u32| {
        scene()
            .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), plastic(0.6, 0.0))
            .quad(v(-1.0, 0.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), matte(0.7))
            .quad(v(1.0, 0.0, 1.0), v(0.0, 0.0, -2.0), v(0.0, 2.0, 0.0), beckmann(metal(0.9, 0.3, 0.0)))
            .sphere(v(-0.4, 0.35, 0.0), 0.35, metal(0.8, 0.0, 0.0))
            .quad(v(-0.5, 1.9, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(4.0))
            .pictured(v(0.0, 1.0, 3.5), v(0.2, 0.6, -0.9), 30.0, 12, 12)
            .depth(depth)
    };
    for depth in [1, 2, 4] {
        let means = path_and_photon_means(&room(depth), depth, [256, 16], (20_000, 0.05));
        assert_same_light(&format!("depth {depth}"), means, 8e-3, 3e-3);
    }
}

#[test]
fn rough_reflection_components_add_up() {
    let build = scene()
        .quad(v(-5.0, -1.0, 5.0), v(10.0, 0.0, 0.0), v(0.0, 0.0, -20.0), plastic(0.5, 0.3))
        .sphere(v(-1.2, 0.0, -6.0), 1.0, metal(0.9, 0.3, 0.0))
        .sphere(v(1.2, 0.0, -6.0), 1.0, plastic(0.6, 0.0))
        .sphere(v(0.0, 1.5, -6.5), 0.6, principled(0.7, 0.2, 0.3))
        .sphere(v(1.2, 1.5, -6.5), 0.5, coated(0.7, 0.3, phong(0.4, 0.3, 9.0, 0.0)))
        .sphere(v(-1.2, 1.5, -6.5), 0.5, coated(1.0, 0.2, mirror(0.8)))
        .cuboid(v(0.0, -0.75, -4.0), v(0.6, 0.5, 0.6), DVec3::ZERO, phong(0.5, 0.4, 20.0, 0.0))
        .quad(v(-1.0, 3.0, -7.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), emitter(4.0))
        .point_light(v(3.0, 4.0, 0.0), 20.0, Falloff::Square)
        .environment(0.2)
        .background(0.3)
        .with(|scene| scene.render.ambient = Vec3::new(0.2, 0.1, 0.3))
        .pictured(v(0.0, 1.0, 1.0), v(0.0, 0.0, -6.0), 40.0, 24, 16);
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let build = build.clone().with(|scene| scene.render.integrator = integrator);
        let picture = |name: &str| {
            let view = ViewMode::named(name).unwrap_or_else(|| panic!("unknown view {name}"));
            build.clone().viewed(view).picture(8, 3)
        };
        let parts = ["ambient", "diffuse", "specular", "emission"].map(picture);
        for (pixel, beauty) in picture("beauty").into_iter().enumerate() {
            let sum: DVec3 = parts.iter().map(|part| part[pixel]).sum();
            let off = (sum - beauty).abs().max_element();
            assert!(off <= 2e-5 * beauty.max_element().max(1.0), "{integrator:?}, {pixel}: {sum} {beauty}");
        }
    }
}

#[test]
fn round_metal_mesh_has_no_black_edge() {
    // Reflections still show the sky where shading normals face away from the viewer.
    let ball = lat_long_sphere(12, 16, 1.0, DVec3::ZERO);
    let build = scene()
        .environment(1.0)
        .mesh(ball, [DVec3::ONE, DVec3::ZERO, v(0.0, 0.0, -5.0)], metal(0.9, 0.2, 0.0))
        .smooth()
        .pictured(DVec3::ZERO, v(0.0, 0.0, -5.0), 24.0, 48, 48);
    let darkest = build.picture(64, 0).iter().map(|color| color.x).fold(f64::MAX, f64::min);
    assert!(darkest > 0.6, "{darkest}");
}

#[test]
fn coarse_smooth_meshes_conserve_energy() {
    let ball = lat_long_sphere(8, 16, 1.0, DVec3::ZERO);
    let mut open = scene().environment(1.0);
    // Surfaces with a textured roughness are not prepared in packets.
    let texture = open.texture(&[&[Vec3::splat(0.1)][..]], TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE);
    let mut textured = metal(1.0, 0.1, 0.0);
    if let MaterialKind::Metal { roughness, .. } = &mut textured.kind {
        *roughness = NumberSource::Texture { texture, channel: None };
    }
    for (name, material) in [
        ("textured metal", textured),
        ("polished metal", metal(1.0, 0.01, 0.0)),
        ("narrow metal", metal(1.0, 0.1, 0.0)),
        ("brushed metal", metal(1.0, 0.3, 0.8)),
        ("plastic", plastic(1.0, 0.05)),
        ("principled", principled(1.0, 0.5, 0.1)),
        ("sheet", translucent(1.0, 0.1, 0.5)),
    ] {
        let build = open
            .clone()
            .mesh(ball.clone(), [DVec3::ONE, DVec3::ZERO, v(0.0, 0.0, -5.0)], material)
            .smooth()
            .pictured(DVec3::ZERO, v(0.0, 0.0, -5.0), 24.0, 32, 32);
        for (what, build) in [("whitted", build.clone()), ("path", path_traced(build, 8))] {
            let picture = build.picture(64, 0);
            let brightest = picture.iter().map(|color| color.max_element()).fold(0.0, f64::max);
            assert!(brightest < 1.15, "{name} with {what}: {brightest}");
            // Silhouettes would be darker by 6 % if the normals were not turned to face the viewer.
            let darkest = picture.iter().map(|color| color.min_element()).fold(1.0, f64::min);
            assert!(name != "textured metal" || darkest > 0.95, "{name} with {what}: {darkest}");
        }
    }
}

#[test]
fn metal_emission_adds_to_its_reflection() {
    let mut lamp = metal(0.9, 0.5, 0.0);
    let dark = mean_and_error(&in_furnace(lamp.clone(), 1).values(256, 16));
    lamp.emission = EmissionSource::from_constant(Vec3::splat(2.0));
    let lit = mean_and_error(&in_furnace(lamp, 1).values(256, 16));
    assert_same_mean("without emission", (lit.0 - 2.0, lit.1), dark, 8e-4);
}
