//! Coats over every opaque material.

use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::{
    ColorSource, EmissionSource, Integrator, Material, MaterialKind, NumberSource, PhongParameters,
    TextureFilter, Wrap,
};

use super::global::path_traced;
use super::photons::{assert_same_light, path_and_photon_means};
use super::scenes::{Build, coated, emitter, matte, metal, mirror, phong, plastic, principled, scene};
use super::{assert_same_mean, mean_and_error, v};

/// A ball in a furnace of radiance 1, viewed with a cosine of 1 or about 0.2.
fn in_furnace(material: Material, is_central: bool) -> Build {
    let at = if is_central { v(0.0, 0.0, -4.0) } else { v(0.9, 0.0, -4.5) };
    scene().environment(1.0).sphere(v(0.0, 0.0, -5.0), 1.0, material).depth(1).seen(DVec3::ZERO, at)
}

/// The coat with this tint.
fn tinted(tint: f32, mut material: Material) -> Material {
    material.coat.tint = ColorSource::Constant(Vec3::splat(tint));
    material
}

#[test]
fn coats_never_gain_energy() {
    // A white diffuse or specular base reflects all light. In a wide lobe at grazing angles, the base loses
    // more, because the coat's albedo differs between the two directions. White plastic and principled
    // materials lose at most about c·E of the light that they reflect.
    let bases = [
        ("diffuse", matte(1.0), 0.997),
        ("mirror", mirror(1.0), 0.997),
        ("metal", metal(1.0, 0.3, 0.0), 0.9),
        ("plastic", plastic(1.0, 0.3), 0.85),
        ("smooth plastic", plastic(1.0, 0.0), 0.85),
        ("principled", principled(1.0, 0.0, 0.5), 0.85),
    ];
    for (name, base, least) in bases {
        for (roughness, is_central) in [(0.0, true), (0.3, false), (1.0, false)] {
            let build = in_furnace(coated(1.0, roughness, base.clone()), is_central);
            for (integrator, build) in [("whitted", build.clone()), ("path", path_traced(build, 1))] {
                let (mean, error) = mean_and_error(&build.values(1024, 16));
                let what = format!("{name} under roughness {roughness}, {integrator}: {mean} ± {error}");
                assert!(error < 3e-3, "{what}: too noisy");
                assert!((least - 4.0 * error..1.002 + 4.0 * error).contains(&mean), "{what}");
            }
        }
    }
}

#[test]
fn coated_mirrors_match_the_closed_form() {
    // A smooth layer reflects F = F0 + (1 − F0)(1 − μ)⁵. The mirror below reflects r, and its light is
    // reflected back and forth: F + (1 − F)²·T^(1/cosθₜ)·r/(1 − r·F).
    let (reflectance, tint) = (0.8, 0.5_f64);
    let mirrored = || tinted(tint as f32, coated(1.0, 0.0, mirror(reflectance)));
    for cosine in [1.0_f64, 0.5] {
        let from = v((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
        let build = scene()
            .environment(1.0)
            .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), mirrored())
            .seen(from, DVec3::ZERO)
            .depth(1);
        let fresnel = 0.04 + 0.96 * (1.0 - cosine).powi(5);
        let refracted = (1.0 - (1.0 - cosine * cosine) / 2.25).sqrt();
        let r = f64::from(reflectance);
        let below = (1.0 - fresnel).powi(2) * r / (1.0 - r * fresnel) * tint.powf(1.0 / refracted);
        for (name, build) in [("whitted", build.clone()), ("path", path_traced(build, 1))] {
            let (mean, error) = mean_and_error(&build.values(1024, 16));
            assert!(error < 2e-3, "{name}: too noisy: ± {error}");
            let off = (mean - fresnel - below).abs();
            assert!(off < 1e-3 + 4.0 * error, "{name} at {cosine}: {mean}, not {}", fresnel + below);
        }
    }
}

#[test]
fn coats_attenuate_and_tint_emission() {
    // Light leaves through the layer once: (1 − c·F)·√T at normal incidence.
    let lamp = Material { emission: EmissionSource::from_constant(Vec3::splat(3.0)), ..matte(0.0) };
    let lamp = tinted(0.25, coated(1.0, 0.0, lamp));
    let build = scene()
        .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), lamp)
        .seen(v(0.0, 1.0, 0.0), DVec3::ZERO);
    for build in [build.clone(), path_traced(build, 1)] {
        let value = build.value();
        assert!((value - 3.0 * 0.96 * 0.5).abs() < 3e-3, "{value}");
    }
}

#[test]
fn photons_match_path_on_coated_surfaces() {
    let room = scene()
        .quad(
            v(-1.0, 0.0, 1.0),
            v(2.0, 0.0, 0.0),
            v(0.0, 0.0, -2.0),
            tinted(0.7, coated(1.0, 0.5, phong(0.5, 0.2, 10.0, 0.0))),
        )
        .quad(v(-1.0, 0.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), matte(0.7))
        .sphere(v(-0.4, 0.35, 0.0), 0.35, coated(0.8, 0.6, mirror(0.8)))
        .sphere(v(0.5, 0.3, 0.2), 0.3, coated(1.0, 0.4, plastic(0.6, 0.0)))
        .quad(v(-0.5, 1.9, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(4.0))
        .pictured(v(0.0, 1.0, 3.5), v(0.2, 0.6, -0.9), 30.0, 12, 12);
    for depth in [2, 3] {
        let means = path_and_photon_means(&room.clone().depth(depth), depth, [96, 6], (20_000, 0.05));
        assert_same_light(&format!("depth {depth}"), means, 1e-2, 4e-3);
    }
}

#[test]
fn textured_coats_equal_constant_coats() {
    // A coat whose keys are textures is evaluated point by point, a constant coat in packets.
    let mut textured = scene();
    let texel = [Vec3::splat(0.6)];
    let texture = textured.texture(&[&texel[..]], TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE);
    let number = NumberSource::Texture { texture, channel: None };
    let constant = tinted(0.6, coated(0.6, 0.6, matte(0.7)));
    let mut varying = constant.clone();
    (varying.coat.weight, varying.coat.roughness) = (number, number);
    varying.coat.tint = ColorSource::Texture(texture);
    let seen = |build: Build, material: Material| {
        let build = build
            .environment(1.0)
            .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), material)
            .seen(v(1.0, 1.0, 0.0), DVec3::ZERO)
            .depth(1)
            .with(|scene| scene.render.integrator = Integrator::Path);
        mean_and_error(&build.values(256, 16))
    };
    let (one, other) = (seen(textured, varying), seen(scene(), constant));
    assert_same_mean("textured", one, other, 4e-3);
}

/// A surface that only transmits reflects light in its coat.
#[test]
fn coats_reflect_over_surfaces_that_only_transmit() {
    let mut sheet = matte(0.0);
    if let MaterialKind::Phong(PhongParameters { diffuse_transmission, .. }) = &mut sheet.kind {
        *diffuse_transmission = ColorSource::Constant(Vec3::ONE);
    }
    for roughness in [0.3, 1.0] {
        let build = scene()
            .quad(
                v(-0.1, 0.0, 0.1),
                v(0.2, 0.0, 0.0),
                v(0.0, 0.0, -0.2),
                coated(1.0, roughness, sheet.clone()),
            )
            .sphere(v(1.0, 1.0, 0.0), 0.4, emitter(3.0))
            .seen(v(-1.0, 1.0, 0.0), DVec3::ZERO)
            .depth(1);
        let by_lights = mean_and_error(&build.values(256, 16));
        let by_paths = mean_and_error(&path_traced(build, 1).values(256, 16));
        assert!(by_lights.0 > 1e-3, "{by_lights:?}");
        assert_same_mean(&format!("roughness {roughness}"), by_paths, by_lights, 2e-2);
    }
}
