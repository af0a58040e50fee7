//! Light transmitted by rough surfaces: rough glass, and principled materials with transmission.

use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    EmissionSource, Integrator, Material, MaterialKind, NumberSource, ShadowMode, Shape,
};

use super::global::path_traced;
use super::photons::{assert_same_light, path_and_photon_means};
use super::scenes::{
    Build, beckmann, coated, emitter, frosted, glass, matte, metal, mirror, plastic, scene, tinted,
    translucent,
};
use super::{assert_close, assert_same_mean, mean_and_error, v};

/// A half-space of a material below y = 0, with a camera above or below that looks at the origin.
fn boundary(material: Material, side: f64) -> Build {
    let plane = Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y };
    let build = scene().shape(plane, material);
    build.seen(v(-0.1, 0.1 * side, 0.02), DVec3::ZERO)
}

fn sheet(material: Material) -> Build {
    let quad = scene().quad(v(-0.05, 0.0, 0.05), v(0.1, 0.0, 0.0), v(0.0, 0.0, -0.1), material);
    quad.seen(v(-0.1, 0.1, 0.02), DVec3::ZERO)
}

/// Boundaries viewed from above and from below. Each has an area light on the other side, in the direction of
/// the refracted ray.
fn boundaries() -> Vec<(String, Build, DVec3)> {
    let mut all = Vec::new();
    for roughness in [0.1, 0.3, 0.6, 1.0] {
        let glass = match roughness {
            0.6 => beckmann(frosted(1.5, roughness)),
            _ => frosted(1.5, roughness),
        };
        // The refracted angle is asin(sin 45°/1.5). From inside, use a steeper direction to avoid total
        // internal reflection.
        all.push((
            format!("glass {roughness} from outside"),
            boundary(glass.clone(), 1.0),
            v(0.53, -1.0, -0.1),
        ));
        let steep = boundary(glass, 1.0).seen(v(-0.05, -0.1, 0.02), DVec3::ZERO);
        all.push((format!("glass {roughness} from inside"), steep, v(0.9, 1.0, -0.3)));
        let sheet = sheet(translucent(0.8, roughness, 0.7));
        all.push((format!("sheet {roughness}"), sheet, v(1.0, -1.0, -0.2)));
    }
    all
}

#[test]
fn techniques_agree_on_transmitted_light() {
    for (what, build, at) in boundaries() {
        let lit = build.clone().sphere(at, 0.5, emitter(2.0));
        let path = mean_and_error(&path_traced(lit.clone(), 1).values(1024, 16));
        let whitted = lit.clone().depth(1);
        let sampled = whitted.clone().shadows(ShadowMode::Off, 1);
        // Light samples cannot find a light inside a glass shell without refraction, but lobe samples can.
        let inside = what.contains("from outside");
        let shell = glass(if inside { 1.5 } else { 1.0 });
        let hidden = path_traced(lit.clone().sphere(at, 0.55, shell), 2);
        for (technique, build, samples) in
            [("whitted", &whitted, 1024), ("light samples", &sampled, 4096), ("lobes", &hidden, 4096)]
        {
            let found = mean_and_error(&build.values(samples, 16));
            assert_same_mean(&format!("{what}, {technique}"), found, path, 0.03);
        }
    }
}

#[test]
fn every_light_shines_through_rough_glass() {
    // Compares MIS of light and lobe samples with path tracing. There are many lights, and each vertex
    // samples only some of them.
    for (what, build, at) in boundaries().into_iter().skip(3).take(3) {
        let lamps = |build: Build| {
            (0..12_u32).fold(build, |build, number| {
                let turn = f64::from(number) * 0.7;
                let by = v(turn.cos(), 0.2, turn.sin()) * 0.5;
                build.sphere(at + by, 0.08, emitter(f64::from(1 + number) as f32))
            })
        };
        let point = |build: Build| build.point_light(at, 1.0, Falloff::Square);
        for (lit, build) in [("twelve", lamps(build.clone())), ("a point", point(build.clone()))] {
            let path = mean_and_error(&path_traced(build.clone(), 1).values(2048, 16));
            let whitted = mean_and_error(&build.depth(1).values(2048, 16));
            assert_same_mean(&format!("{what}, {lit}"), whitted, path, 0.01);
        }
    }
}

#[test]
fn whitted_follows_rough_glass_like_path() {
    // A slab that has only microfacet lobes, with lights on both sides.
    for roughness in [0.1, 0.4, 0.8] {
        let build = scene()
            .cuboid(DVec3::ZERO, v(4.0, 0.3, 4.0), DVec3::ZERO, frosted(1.5, roughness))
            .sphere(v(0.5, -1.5, 0.0), 0.5, emitter(2.0))
            .sphere(v(0.8, 1.2, 0.3), 0.4, emitter(1.0))
            .environment(0.3)
            .seen(v(-1.0, 1.0, 0.2), v(0.0, 0.15, 0.0));
        for depth in [1, 2, 4] {
            let whitted = mean_and_error(&build.clone().depth(depth).values(1024, 16));
            let path = mean_and_error(&path_traced(build.clone(), depth).values(1024, 16));
            assert_same_mean(&format!("roughness {roughness}, depth {depth}"), whitted, path, 0.02);
        }
    }
}

#[test]
fn rough_glass_adds_no_light_in_a_furnace() {
    // Microfacet models lose the energy from multiple scattering, which is very small for narrow lobes.
    for (roughness, least) in [(0.01, 0.999), (0.2, 0.97), (0.5, 0.6), (1.0, 0.2)] {
        for (what, material) in [
            ("glass", frosted(1.5, roughness)),
            ("a bubble in glass", frosted(0.7, roughness)),
            ("a sheet", translucent(1.0, roughness, 1.0)),
        ] {
            let build = scene()
                .environment(1.0)
                .sphere(v(0.0, 0.0, -5.0), 1.0, material)
                .seen(DVec3::ZERO, v(0.3, 0.1, -4.0));
            for (integrator, build) in
                [("whitted", build.clone().depth(64)), ("path", path_traced(build, 64))]
            {
                let (mean, error) = mean_and_error(&build.values(512, 16));
                let told = format!("{what}, roughness {roughness}, {integrator}: {mean} ± {error}");
                assert!(error < 5e-3, "too noisy: {told}");
                assert!(mean < 1.0 + 4.0 * error + 1e-3, "{told}");
                // There is no lower bound for a sheet, because it has a clear coat and loses energy on each
                // side.
                assert!(what == "a sheet" || mean > least, "{told}");
            }
        }
    }
}

#[test]
fn rough_glass_with_ior_1_is_invisible() {
    let build = scene()
        .background(0.7)
        .sphere(v(0.0, 0.0, -5.0), 1.0, frosted(1.0, 0.5))
        .seen(DVec3::ZERO, v(0.3, 0.0, -5.0));
    assert_close("alone", build.value(), 0.7);
    assert_close("path", path_traced(build, 4).value(), 0.7);
}

#[test]
fn later_touching_glass_sets_the_roughness() {
    // Only smooth glass shows the background. If the scene lists a smooth box after a frosted box inside it,
    // all surfaces are smooth. In the other order, the frosted box has rough surfaces.
    let smooth = |build: Build| build.cuboid(v(0.0, 0.0, -5.0), v(2.0, 2.0, 2.0), DVec3::ZERO, glass(1.5));
    let frost = |build: Build, size: f64| {
        build.cuboid(v(0.0, 0.0, -5.0), DVec3::splat(size), DVec3::ZERO, frosted(1.5, 0.5))
    };
    let seen = |build: Build| build.background(1.0).seen(DVec3::ZERO, v(0.1, 0.05, -5.0)).depth(16);
    let reference = seen(smooth(scene())).value();
    for size in [1.0, 2.0] {
        assert_close(&format!("inside, {size}"), seen(smooth(frost(scene(), size))).value(), reference);
    }
    let (rough, _) = mean_and_error(&seen(frost(smooth(scene()), 2.0)).values(64, 16));
    assert_eq!(rough, 0.0, "a rough surface must not show the background");
    let half = seen(frost(smooth(scene()), 1.0)).value();
    assert_close("a frosted core with the same IOR", half, reference);
    // Water on frosted glass. The interface belongs to the water.
    let slab = |build: Build, material: Material, low: f64, high: f64| {
        build.cuboid(v(0.0, 0.5 * (low + high), 0.0), v(8.0, high - low, 8.0), DVec3::ZERO, material)
    };
    let seen = |build: Build| build.background(1.0).seen(v(0.3, 5.0, 0.1), v(0.0, 2.0, 0.0)).depth(16);
    let wet =
        slab(slab(slab(scene(), glass(1.5), 0.0, 1.0), frosted(1.5, 0.5), 0.5, 1.5), glass(1.33), 1.5, 2.0);
    // All surfaces are smooth, because the frosted glass has an interface only with the water, which comes
    // later.
    let smooth = slab(slab(scene(), glass(1.5), 0.0, 1.5), glass(1.33), 1.5, 2.0);
    let (wet, smooth) = (seen(wet), seen(smooth));
    let [wet, smooth] = [wet, smooth].map(|build| mean_and_error(&build.values(256, 16)));
    assert_same_mean("water on frosted glass", wet, smooth, 1e-6);
    assert!(smooth.0 > 0.9, "{smooth:?}");
}

/// A room with a light, frosted glass, and a mirror ball and a smooth glass ball that cast caustics.
fn room() -> Build {
    scene()
        .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), matte(0.6))
        .quad(v(-1.0, 0.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), matte(0.7))
        .quad(v(1.0, 0.0, 1.0), v(0.0, 0.0, -2.0), v(0.0, 2.0, 0.0), plastic(0.6, 0.4))
        .cuboid(v(-0.3, 0.25, 0.1), v(0.5, 0.5, 0.5), v(0.0, 30.0, 0.0), beckmann(frosted(1.5, 0.6)))
        .sphere(v(0.4, 0.35, 0.0), 0.35, mirror(0.9))
        .sphere(v(-0.5, 0.75, 0.1), 0.25, glass(1.5))
        .quad(v(-0.9, 0.0, -0.5), v(0.4, 0.0, -0.3), v(0.0, 0.8, 0.0), translucent(0.8, 0.5, 0.6))
        .quad(v(-0.5, 1.9, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(4.0))
        .pictured(v(0.0, 1.0, 3.5), v(0.0, 0.6, -0.4), 30.0, 12, 12)
}

#[test]
fn photons_match_path_through_rough_glass() {
    for depth in [1, 2, 3, 5] {
        let means = path_and_photon_means(&room().depth(depth), depth, [72, 9], (8_000, 0.05));
        assert_same_light(&format!("depth {depth}"), means, 1.2e-2, 4e-3);
    }
}

#[test]
fn photons_scatter_to_both_sides_of_rough_glass() {
    // The only light is inside a glass shell without refraction, so all light on the frosted box and the
    // sheet arrives as photons.
    let at = v(0.0, 1.2, 0.0);
    let room = |depth: u32| {
        scene()
            .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), matte(0.8))
            .cuboid(v(-0.4, 0.3, 0.0), v(0.6, 0.2, 0.6), DVec3::ZERO, frosted(1.5, 0.9))
            // Inside the glass, where radiance is higher by the square of the IOR.
            .cuboid(v(-0.4, 0.25, 0.0), v(0.55, 0.08, 0.55), DVec3::ZERO, matte(0.9))
            .quad(v(0.1, 0.4, 0.4), v(0.6, 0.0, 0.0), v(0.0, 0.0, -0.8), translucent(0.9, 0.9, 0.8))
            .sphere(at, 0.2, emitter(8.0))
            .sphere(at, 0.25, glass(1.0))
            .pictured(v(0.0, 1.5, 3.5), v(0.0, 0.2, 0.0), 26.0, 12, 12)
            .depth(depth)
    };
    for depth in [2, 6] {
        let means = path_and_photon_means(&room(depth), depth, [1024, 28], (20_000, 0.03));
        assert_same_light(&format!("depth {depth}"), means, 1.2e-2, 4e-3);
    }
    // The matte box, seen from inside the frosted one.
    let inside = room(6).pictured(v(-0.2, 0.38, 0.2), v(-0.4, 0.29, 0.0), 60.0, 8, 8);
    let means = path_and_photon_means(&inside, 6, [256, 14], (20_000, 0.03));
    assert_same_light("inside", means, 4e-2, 4e-3);
}

#[test]
fn frosted_glass_components_add_up() {
    let build = room()
        .sphere(v(0.3, 0.9, 0.3), 0.2, metal(0.9, 0.3, 0.0))
        .environment(0.2)
        .background(0.3)
        .point_light(v(0.5, 1.5, 0.8), 1.0, Falloff::Square)
        .pictured(v(0.0, 1.0, 3.5), v(0.0, 0.6, -0.4), 40.0, 24, 16);
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
}

#[test]
fn shadow_view_includes_rough_glass() {
    // The light is visible from every point on top of the box.
    let build = scene()
        .cuboid(DVec3::ZERO, v(2.0, 0.2, 2.0), DVec3::ZERO, frosted(1.5, 0.5))
        .sphere(v(0.0, 2.0, 0.0), 0.3, emitter(2.0))
        .seen(v(0.3, 1.0, 0.2), v(0.1, 0.1, 0.0))
        .viewed(ViewMode::Shadow);
    assert_close("in sight", build.value(), 1.0);
}

#[test]
fn clear_coat_attenuates_emission() {
    // The factor is 1 − c·E(μ), with c = ½. A sufficiently smooth coat has E = F0 + (1 − F0)(1 − μ)⁵ and F0 =
    // 0.04.
    let left = |cosine: f64| 1.0 - 0.5 * (0.04 + 0.96 * (1.0 - cosine).powi(5));
    let coated_lamp = |radiance: f32| {
        let mut lamp = coated(0.5, 0.02, translucent(0.0, 0.5, 0.0));
        if let MaterialKind::Principled { specular, .. } = &mut lamp.kind {
            *specular = NumberSource::Constant(0.0);
        }
        lamp.emission = EmissionSource::from_constant(Vec3::splat(radiance));
        lamp
    };
    for cosine in [1.0_f64, 0.6, 0.3] {
        let from = v((1.0 - cosine * cosine).sqrt(), cosine, 0.0) * 3.0;
        let lamp = scene().quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), coated_lamp(3.0));
        let seen = lamp.seen(from, DVec3::ZERO);
        for build in [seen.clone(), path_traced(seen, 2)] {
            let value = build.value();
            assert!((value / (3.0 * left(cosine)) - 1.0).abs() < 4e-3, "{cosine}: {value}");
        }
    }
    // Emission onto a floor. Light samples find it directly. Behind glass without refraction, only lobe
    // samples and photons find it.
    let shapes = [
        Shape::Quad { corner: v(-0.5, 1.0, -0.5), u: v(1.0, 0.0, 0.0), v: v(0.0, 0.0, 1.0) },
        Shape::Box { center: v(0.0, 1.0, 0.0), size: DVec3::splat(0.5), rotate: v(10.0, 30.0, 0.0) },
        Shape::Torus { center: v(0.0, 1.0, 0.0), axis: DVec3::Y, radius: 0.4, tube: 0.15 },
    ];
    let floor = || {
        let corner = v(-2.0, 0.0, 2.0);
        let floor = scene().quad(corner, v(4.0, 0.0, 0.0), v(0.0, 0.0, -4.0), matte(0.7));
        floor.pictured(v(0.0, 0.6, 3.0), v(1.0, -0.5, 0.0), 36.0, 8, 8).depth(1)
    };
    for (number, shape) in shapes.into_iter().enumerate() {
        let lit = floor().shape(shape.clone(), coated_lamp(2.0));
        let means = |build: &Build, samples: u32| mean_and_error(&build.mean_reds(samples));
        let samples = means(&lit, 32);
        // Light samples cannot find a light inside a glass shell.
        let hidden = lit.clone().sphere(v(0.0, 1.0, 0.0), 0.75, glass(1.0));
        let photons = hidden.clone().depth(3).photons(5_000, 0.2);
        let mut found = vec![("path", means(&path_traced(lit, 1), 64)), ("photons", means(&photons, 16))];
        // Test lobe samples, the most expensive technique, only with one shape.
        if number == 0 {
            found.push(("lobes", means(&path_traced(hidden, 3), 512)));
        }
        for (technique, found) in found {
            let error = found.1.hypot(samples.1);
            let told = format!("{shape:?}, {technique}: {found:?}, light samples {samples:?}");
            assert!(error < 5e-3 * samples.0, "{told}");
            assert!((found.0 - samples.0).abs() < 4.0 * error + 3e-3 * samples.0, "{told}");
        }
        let bare = means(&floor().shape(shape.clone(), emitter(2.0)), 64);
        assert!(samples.0 < 0.985 * bare.0, "{shape:?}: {samples:?} with a clear coat, {bare:?} without");
    }
}

#[test]
fn only_closed_unlit_solids_are_dark_inside() {
    let ball = |build: Build, at: DVec3, material: Material| build.sphere(at, 0.5, material);
    let (first, second) = (v(-1.0, 0.0, -5.0), v(1.0, 0.0, -5.0));
    let two = |material: &Material| ball(ball(scene(), first, material.clone()), second, material.clone());
    let dark = |build: &Build| [0, 1].map(|body| build.world().is_glass_interior_shadowed(body));
    let rough = two(&frosted(1.5, 0.4));
    assert_eq!(dark(&rough), [true, true]);
    assert_eq!(dark(&two(&glass(1.5))), [false, false], "smooth glass needs no light sampling");
    let lamp_inside = rough.clone().sphere(first, 0.1, emitter(1.0));
    assert_eq!(dark(&lamp_inside), [false, true]);
    let lamp_around = rough.clone().sphere(v(0.0, 0.0, -5.0), 8.0, emitter(1.0));
    assert_eq!(dark(&lamp_around), [false, false], "the light may be anywhere in its bounding box");
    let point = rough.clone().point_light(second + v(0.2, 0.0, 0.0), 1.0, Falloff::Square);
    assert_eq!(dark(&point), [true, false]);
    let flat = rough.clone().quad(v(-4.0, -3.0, -5.8), v(8.0, 0.0, 0.0), v(0.0, 6.0, 0.0), emitter(1.0));
    assert_eq!(dark(&flat), [true, true], "test the light's bounding box, not its larger bounding sphere");
    let through = rough.clone().quad(v(-4.0, -3.0, -5.3), v(8.0, 0.0, 0.0), v(0.0, 6.0, 0.0), emitter(1.0));
    assert_eq!(dark(&through), [false, false]);
    assert_eq!(dark(&rough.environment(1.0)), [true, true]);
    let open = scene().quad(v(-1.0, -1.0, -5.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), frosted(1.5, 0.4));
    assert!(!open.world().is_glass_interior_shadowed(0), "an open surface has no inside");
    let plane = Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y };
    assert!(
        !scene().shape(plane, frosted(1.5, 0.4)).world().is_glass_interior_shadowed(0),
        "an unbounded solid may contain lights"
    );
}

#[test]
fn rough_glass_is_lit_inside_without_shadows() {
    // A weak light in the glass adds almost no energy, but enables light samples from inside.
    let ball = scene()
        .sphere(v(0.0, 0.0, -5.0), 1.0, frosted(1.5, 0.9))
        .quad(v(-4.0, 3.0, -9.0), v(8.0, 0.0, 0.0), v(0.0, 0.0, 8.0), emitter(8.0))
        .depth(2)
        .with(|scene| scene.render.shadows = ShadowMode::Off)
        .pictured(v(0.0, 0.0, 0.0), v(0.0, 0.0, -5.0), 18.0, 12, 12);
    let spark = ball.clone().point_light(v(0.0, 0.0, -5.0), 1e-6, Falloff::Square);
    assert_eq!([&ball, &spark].map(|build| build.world().is_glass_interior_shadowed(0)), [true, false]);
    let [dark, lit] = [&ball, &spark].map(|build| mean_and_error(&build.values(8192, 16)));
    assert_same_mean("without light samples from inside", dark, lit, 0.01);
}

#[test]
fn light_in_rough_glass_matches_path() {
    // With a large light inside, whitted and path find the same light through the glass surface.
    let build = scene()
        .sphere(v(0.0, 0.0, -5.0), 1.0, frosted(1.5, 0.5))
        .sphere(v(0.0, 0.2, -5.0), 0.4, emitter(1.0))
        .seen(DVec3::ZERO, v(0.5, 0.3, -4.2));
    let whitted = mean_and_error(&build.clone().depth(1).values(1024, 16));
    let path = mean_and_error(&path_traced(build, 1).values(1024, 16));
    assert_same_mean("whitted", whitted, path, 6e-3);
}

#[test]
fn sheet_on_glass_transmits_into_the_glass() {
    // A label on black glass shows only its own reflection, like a label on a matte black block.
    let label = |build: Build, height: f64| {
        let material = translucent(1.0, 0.5, 1.0);
        build.quad(v(-0.4, height, 0.4), v(0.8, 0.0, 0.0), v(0.0, 0.0, -0.8), material)
    };
    let seen = |build: Build| {
        let build = build.background(1.0).environment(1.0).depth(8);
        build.pictured(v(0.0, 2.4, 1.5), v(0.0, 0.0, 0.0), 8.0, 4, 4)
    };
    let block =
        |material: Material| scene().cuboid(v(0.0, -0.3, 0.0), v(1.0, 0.6, 1.0), DVec3::ZERO, material);
    let black = seen(label(block(matte(0.0)), 0.01));
    let (exact, _) = mean_and_error(&path_traced(black, 8).values(256, 16));
    for (what, build) in [
        ("after", seen(label(block(tinted(1.5, DVec3::ZERO)), 0.0))),
        (
            "before",
            seen(label(scene(), 0.0).cuboid(
                v(0.0, -0.3, 0.0),
                v(1.0, 0.6, 1.0),
                DVec3::ZERO,
                tinted(1.5, DVec3::ZERO),
            )),
        ),
    ] {
        let means = path_and_photon_means(&build, 8, [256, 64], (2_000, 0.05));
        assert!(
            means.iter().all(|(mean, _)| (mean - exact).abs() < 0.02 * exact),
            "{what}: {means:?}, {exact}"
        );
    }
    // On clear glass, all techniques agree, both from above and from below through the block, and no energy
    // is gained.
    for from in [v(0.0, 2.4, 1.5), v(0.2, -2.4, 1.0)] {
        let clear = label(block(glass(1.5)), 0.0).environment(1.0).depth(8);
        let clear = clear.pictured(from, DVec3::ZERO, 8.0, 4, 4);
        let means = path_and_photon_means(&clear, 8, [128, 14], (20_000, 0.03));
        assert_same_light(&format!("from {from}"), means, 1e-2, 6e-3);
        assert!(means.iter().all(|(mean, error)| *mean < 1.0 + 4.0 * error), "{means:?}");
    }
}

#[test]
fn photons_pass_rough_glass_with_ior_1() {
    // A ball with the IOR of air. Two adjacent blocks of the same glass, with a light in one and a ball in
    // the other.
    let floor = |build: Build| build.quad(v(-2.0, 0.0, 2.0), v(4.0, 0.0, 0.0), v(0.0, 0.0, -4.0), matte(0.7));
    let lamp = |build: Build| build.sphere(v(0.4, 1.9, 0.0), 0.3, emitter(6.0));
    let air = lamp(floor(scene()).sphere(v(0.0, 0.7, 0.0), 0.5, frosted(1.0, 0.3)));
    let block =
        |build: Build, x: f64| build.cuboid(v(x, 1.0, 0.0), v(1.0, 1.0, 1.0), DVec3::ZERO, frosted(1.5, 0.4));
    let two = block(block(floor(scene()), -0.5), 0.5);
    let two = two.sphere(v(-0.5, 1.0, 0.0), 0.2, matte(0.8)).sphere(v(0.5, 1.0, 0.0), 0.2, emitter(6.0));
    for (what, build) in [("IOR of air", air), ("two blocks", two)] {
        let build = build.pictured(v(0.0, 1.6, 4.0), v(0.0, 0.5, 0.0), 24.0, 8, 8).depth(6);
        let means = path_and_photon_means(&build, 6, [512, 16], (20_000, 0.05));
        assert_same_light(what, means, 1.5e-2, 4e-3);
    }
}

#[test]
fn sheet_on_glass_adds_no_light() {
    // A camera in glass below a sheet, with a sky above. The transmitted basic radiance is 1/n² of the
    // transmitted radiance in air. The sky is dark below the horizon, so that nothing is reflected from below.
    // It has many rows, because it is interpolated between the two rows at the horizon.
    let sky: Vec<Vec3> = (0..64).flat_map(|row| [Vec3::splat(f32::from(u8::from(row < 32))); 2]).collect();
    let sheet = |build: Build| {
        let build =
            build.quad(v(-3.0, 0.0, 3.0), v(6.0, 0.0, 0.0), v(0.0, 0.0, -6.0), translucent(0.9, 0.6, 0.8));
        build.sky(2, sky.clone(), 0.0).pictured(v(0.3, -0.5, 0.4), v(0.0, 0.0, 0.0), 6.0, 4, 4)
    };
    let half_space = Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y };
    for (what, build) in [
        ("after", sheet(scene().shape(half_space.clone(), glass(1.5)))),
        ("before", sheet(scene()).shape(half_space, glass(1.5))),
    ] {
        let means = |build: Build| {
            let values: Vec<f64> = path_traced(build, 4).values(1024, 32);
            mean_and_error(&values)
        };
        let (air, inside) = (means(sheet(scene())), means(build));
        assert!(air.0 > 0.3, "{what}: {air:?} in air");
        assert_same_mean(what, inside, (air.0 / 2.25, air.1 / 2.25), 4e-3);
    }
}
