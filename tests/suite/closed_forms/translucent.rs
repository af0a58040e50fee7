//! Diffuse transmission through Phong and principled surfaces.

use std::f64::consts::PI;

use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    ColorSource, Integrator, Material, MaterialKind, PhongParameters, ShadowMode, TextureFilter, Wrap,
};

use super::global::path_traced;
use super::photons::{assert_same_light, path_and_photon_means};
use super::scenes::{Build, emitter, glass, matte, mirror, phong, principled, scene};
use super::{assert_close, assert_same_mean, mean_and_error, v};

/// The material with diffuse transmission.
fn leaf(mut material: Material, transmission: ColorSource) -> Material {
    match &mut material.kind {
        MaterialKind::Phong(PhongParameters { diffuse_transmission, .. })
        | MaterialKind::Principled { diffuse_transmission, .. } => *diffuse_transmission = transmission,
        MaterialKind::Mirror { .. }
        | MaterialKind::Glass { .. }
        | MaterialKind::Pane { .. }
        | MaterialKind::Metal { .. }
        | MaterialKind::Plastic { .. }
        | MaterialKind::Blend { .. } => {}
    }
    material
}

fn gray(transmission: f32) -> ColorSource {
    ColorSource::Constant(Vec3::splat(transmission))
}

/// Phong surfaces with and without a highlight, a surface that only transmits, and a principled surface.
fn materials() -> [(&'static str, Material); 4] {
    [
        ("paper", leaf(matte(0.3), gray(0.5))),
        ("wax paper", leaf(phong(0.2, 0.3, 30.0, 0.0), gray(0.5))),
        ("filter", leaf(matte(0.0), gray(0.8))),
        ("principled leaf", leaf(principled(0.4, 0.1, 0.5), gray(0.5))),
    ]
}

/// An upward-facing square, seen from above or below.
fn sheet(material: Material, side: f64) -> Build {
    let quad = scene().quad(v(-0.05, 0.0, 0.05), v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), material);
    quad.seen(v(-0.1, 0.1 * side, 0.02), DVec3::ZERO)
}

#[test]
fn light_from_behind_is_exact() {
    // L = kt/π · I cosθ/d².
    for side in [1.0, -1.0] {
        let lit = |material: Material| {
            sheet(material, side).point_light(v(1.0, -2.0 * side, 0.5), 10.0, Falloff::Square).depth(1)
        };
        let squared = 1.0 + 4.0 + 0.25_f64;
        let exact = 0.5 / PI * 10.0 * 2.0 / squared.sqrt() / squared;
        for (name, material) in materials().into_iter().take(2) {
            let build = lit(material);
            for (integrator, build) in [("whitted", build.clone()), ("path", path_traced(build, 1))] {
                assert_close(&format!("{name} with {integrator}"), build.value(), exact);
            }
        }
        assert_eq!(lit(matte(0.3)).value(), 0.0, "opaque paper");
    }
}

#[test]
fn transmittance_may_be_a_texture() {
    let mut build = scene();
    let color = Vec3::new(0.1, 0.4, 0.2);
    let texture =
        build.texture(&[&[color][..]], TextureFilter::Nearest, Wrap::Repeat, glimt::math::Vec2::ONE);
    let lit = |build: Build, transmission: ColorSource, material: Material| {
        let corner = v(-0.05, 0.0, 0.05);
        let quad = build.quad(corner, v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), leaf(material, transmission));
        quad.point_light(v(0.0, -2.0, 0.0), 10.0, Falloff::Square)
            .seen(v(-0.1, 0.1, 0.02), DVec3::ZERO)
            .depth(1)
            .color()
    };
    for material in [matte(0.3), principled(0.4, 0.0, 0.5)] {
        let [textured, constant] = [ColorSource::Texture(texture), ColorSource::Constant(color)]
            .map(|source| lit(build.clone(), source, material.clone()));
        assert!(constant.y > 0.02 && (textured - constant).abs().max_element() < 1e-6 * constant.y);
    }
}

#[test]
fn furnace_returns_the_sum_of_the_albedos() {
    for side in [1.0, -1.0] {
        for (material, exact) in [
            (leaf(matte(0.3), gray(0.5)), 0.8),
            (leaf(matte(0.0), gray(1.0)), 1.0),
            (leaf(matte(0.4), gray(0.6)), 1.0),
        ] {
            let build = sheet(material, side).environment(1.0);
            for (what, build) in [("whitted", build.clone().depth(1)), ("path", path_traced(build, 1))] {
                let (mean, error) = mean_and_error(&build.values(256, 16));
                assert!(error < 2e-3, "{what}: too noisy: ± {error}");
                assert!((mean - exact).abs() < 4.0 * error + 1e-5, "{what}: {mean}, expected {exact}");
            }
        }
        // Principled surfaces never return more light than they receive.
        let white = leaf(principled(0.5, 0.0, 0.5), gray(1.0));
        let (mean, error) =
            mean_and_error(&path_traced(sheet(white, side).environment(1.0), 1).values(256, 16));
        assert!(error < 5e-3 && mean < 1.0 + 4.0 * error && mean > 0.9, "{mean} ± {error}");
    }
}

#[test]
fn techniques_agree_on_light_from_behind() {
    let at = v(0.6, -0.9, -0.2);
    for (name, material) in materials() {
        let lit = sheet(material.clone(), 1.0).sphere(at, 0.5, emitter(2.0));
        let path = mean_and_error(&path_traced(lit.clone(), 1).values(512, 16));
        let whitted = lit.clone().depth(1);
        let unshadowed = whitted.clone().shadows(ShadowMode::Off, 1);
        // Light samples cannot find a light inside a glass shell without refraction, but BSDF samples can.
        let hidden = path_traced(lit.sphere(at, 0.55, glass(1.0)), 2);
        for (technique, build, samples) in
            [("whitted", &whitted, 512), ("light samples", &unshadowed, 512), ("lobes", &hidden, 2048)]
        {
            let found = mean_and_error(&build.values(samples, 16));
            assert_same_mean(&format!("{name}, {technique}"), found, path, 0.02);
        }
    }
}

/// A room lit through a shade, with a mirror ball that casts a caustic on a leaf.
fn room() -> Build {
    let shade = |build: Build, x: f64, material: Material| {
        build.quad(v(x, 0.9, -0.6), v(0.0, 0.0, 1.2), v(0.6, 0.0, 0.0), material)
    };
    let [(_, paper), (_, wax), _, (_, principled)] = materials();
    let lit = shade(shade(scene(), -0.8, paper.clone()), 0.1, principled);
    lit.quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), matte(0.6))
        .quad(v(-1.0, 0.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 1.2, 0.0), paper)
        .quad(v(-0.9, 0.1, 0.3), v(0.8, 0.0, -0.3), v(0.0, 0.7, 0.1), wax)
        .sphere(v(0.4, 0.3, 0.0), 0.3, mirror(0.9))
        .quad(v(-0.5, 1.5, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(6.0))
        .pictured(v(0.0, 0.8, 3.5), v(0.0, 0.5, 0.0), 34.0, 12, 12)
}

#[test]
fn photons_match_path_on_translucent_surfaces() {
    for depth in [2, 3, 5] {
        let means = path_and_photon_means(&room().depth(depth), depth, [96, 8], (10_000, 0.05));
        assert_same_light(&format!("depth {depth}"), means, 1.2e-2, 4e-3);
    }
}

#[test]
fn photons_scatter_to_both_sides() {
    // The light is inside a glass shell without refraction, so all light on the sheets arrives as photons.
    let at = v(0.0, 1.5, 0.0);
    for (name, material) in materials() {
        let lit = scene()
            .quad(v(-0.6, 0.5, 0.6), v(1.2, 0.0, 0.0), v(0.0, 0.0, -1.2), material)
            .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), matte(0.8))
            .sphere(at, 0.7, emitter(2.0))
            .sphere(at, 0.75, glass(1.0))
            .pictured(v(0.0, 0.3, 3.5), v(0.0, 0.25, 0.0), 26.0, 8, 8)
            .depth(4);
        let means = path_and_photon_means(&lit, 4, [192, 5], (10_000, 0.04));
        assert_same_light(name, means, 2e-2, 4e-3);
    }
}

#[test]
fn translucent_components_add_up() {
    let build = room()
        .environment(0.2)
        .background(0.3)
        .with(|scene| scene.render.ambient = Vec3::new(0.2, 0.1, 0.3))
        .point_light(v(0.5, 1.1, 0.8), 1.0, Falloff::Square)
        .pictured(v(0.0, 0.8, 3.5), v(0.0, 0.5, 0.0), 34.0, 24, 16);
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let build = build.clone().with(|scene| scene.render.integrator = integrator);
        let picture = |view: ViewMode| build.clone().viewed(view).picture(8, 3);
        let parts =
            [ViewMode::Ambient, ViewMode::Diffuse, ViewMode::Specular, ViewMode::Emission].map(picture);
        for (pixel, beauty) in picture(ViewMode::Beauty).into_iter().enumerate() {
            let sum: DVec3 = parts.iter().map(|part| part[pixel]).sum();
            let off = (sum - beauty).abs().max_element();
            assert!(off <= 2e-5 * beauty.max_element().max(1.0), "{integrator:?}, {pixel}: {sum} {beauty}");
        }
    }
    // All light through paper is diffuse.
    let lit = sheet(leaf(matte(0.3), gray(0.5)), 1.0).point_light(v(0.0, -1.0, 0.0), 1.0, Falloff::Square);
    let [diffuse, beauty] =
        [ViewMode::Diffuse, ViewMode::Beauty].map(|view| lit.clone().viewed(view).value());
    assert!(beauty > 0.0 && diffuse == beauty, "{diffuse} of {beauty}");
}
