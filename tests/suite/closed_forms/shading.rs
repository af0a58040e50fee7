//! The Phong material, its component views, and textures.

use std::f64::consts::PI;

use glimt::choice::Choice;
use glimt::integrators::ViewMode;
use glimt::materials::TexturePoint;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    ColorSource, Material, MaterialKind, PhongParameters, ShadowMode, TextureFilter, Wrap,
};

use super::scenes::{Build, emitter, glass, lat_long_sphere, matte, mirror, phong, scene};
use super::{assert_close, v};

/// A square at the origin, facing up. The light is 20° from the normal, with E = 3·cos 20°. The camera is
/// `degrees` from the normal on the other side.
fn lobe(kind: Material, degrees: f64) -> Build {
    let at = |degrees: f64| v(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
    scene()
        .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), kind)
        .point_light(at(-20.0) * 5.0, 3.0, Falloff::None)
        .seen(at(degrees) * 2.0, DVec3::ZERO)
}

#[test]
fn phong_lobe_is_normalized() {
    // f = kd/π + ks·(α + 2)/2π·cosᵅθ, where θ is the angle between the camera and the mirror direction, which
    // is at 20°.
    for (kd, ks, alpha, degrees) in
        [(0.0, 1.0, 50.0, 30.0), (0.3, 0.5, 10.0, 45.0), (0.2, 0.8, 100.0, 21.0), (0.4, 0.6, 0.0, -50.0)]
    {
        let cosine = f64::to_radians(degrees - 20.0).cos();
        let f = f64::from(kd) / PI
            + f64::from(ks) * (f64::from(alpha) + 2.0) / (2.0 * PI) * cosine.powf(f64::from(alpha));
        let irradiance = 3.0 * 20.0_f64.to_radians().cos();
        assert_close(
            &format!("α = {alpha}"),
            lobe(phong(kd, ks, alpha, 0.0), degrees).value(),
            f * irradiance,
        );
    }
    // There is no highlight 100° from the mirror direction.
    assert_eq!(lobe(phong(0.0, 1.0, 3.0, 0.0), -80.0).value(), 0.0);
}

#[test]
fn components_add_up_to_beauty() {
    // Lₐ = ka·Isa. At depth 0, the image consists only of emission.
    let mut kind = phong(0.3, 0.5, 20.0, 0.25);
    if let MaterialKind::Phong(PhongParameters { ambient, .. }) = &mut kind.kind {
        *ambient = Some(ColorSource::Constant(Vec3::splat(0.6)));
    }
    let lit = lobe(kind, 35.0).with(|scene| scene.render.ambient = Vec3::splat(0.2));
    let view = |view| lit.clone().viewed(view).value();
    let parts = [view(ViewMode::Ambient), view(ViewMode::Diffuse), view(ViewMode::Specular)];
    let emitted = lit.clone().depth(0).value();
    let cosine = 20.0_f64.to_radians().cos();
    assert_close("ambient", parts[0], 0.12);
    assert_close("diffuse", parts[1], 0.3 / PI * 3.0 * cosine);
    assert_close(
        "specular",
        parts[2],
        0.5 * 22.0 / (2.0 * PI) * 15.0_f64.to_radians().cos().powi(20) * 3.0 * cosine,
    );
    assert_close("emitted", emitted, 0.25);
    assert_close("the picture", view(ViewMode::Beauty), parts.iter().sum::<f64>() + emitted);
    // From behind, only ambient light is visible.
    let behind = lit.seen(v(0.5, -2.0, 0.3), DVec3::ZERO);
    assert_close("from behind", behind.value(), 0.12);
}

#[test]
fn ambient_color_defaults_to_diffuse_color() {
    let dark = scene()
        .sphere(v(0.0, 0.0, -5.0), 1.0, phong(0.35, 0.1, 3.0, 0.0))
        .with(|scene| scene.render.ambient = Vec3::new(0.5, 1.0, 2.0));
    let color = dark.color();
    for (channel, exact) in [0.175, 0.35, 0.7].into_iter().enumerate() {
        assert_close("ambient", color[channel], exact);
    }
}

#[test]
fn emission_is_one_sided_at_any_depth() {
    let square = |from| {
        scene()
            .quad(v(-1.0, 0.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), emitter(3.0))
            .depth(0)
            .background(0.5)
            .seen(from, DVec3::ZERO)
    };
    assert_eq!(square(v(0.3, 2.0, 0.1)).value(), 3.0);
    assert_eq!(square(v(0.3, -2.0, 0.1)).value(), 0.0);
    assert_eq!(square(v(0.3, 2.0, 0.1)).seen(v(5.0, 1.0, 0.0), v(5.0, 0.0, 0.0)).value(), 0.5);
}

const RED: Vec3 = Vec3::new(1.0, 0.0, 0.0);
const GREEN: Vec3 = Vec3::new(0.0, 1.0, 0.0);
const BLUE: Vec3 = Vec3::new(0.0, 0.0, 1.0);
const GRAY: Vec3 = Vec3::new(0.5, 0.5, 0.5);

/// A material with a 2 × 2 diffuse texture in red, green, blue and gray, under ambient light 1.
fn textured_material(filter: TextureFilter, wrap: Wrap, repeat: Vec2) -> (Build, Material) {
    let mut build = scene().with(|scene| scene.render.ambient = Vec3::ONE);
    let texture = build.texture(&[&[RED, GREEN], &[BLUE, GRAY]], filter, wrap, repeat);
    let mut kind = phong(0.0, 0.0, 1.0, 0.0);
    if let MaterialKind::Phong(PhongParameters { diffuse, .. }) = &mut kind.kind {
        *diffuse = ColorSource::Texture(texture);
    }
    (build, kind)
}

#[test]
fn texture_on_a_quad_is_upright_along_v() {
    let at = |filter, wrap, repeat, (s, t): (f64, f64)| {
        let (build, kind) = textured_material(filter, wrap, repeat);
        let (corner, u, w) = (v(-1.0, -2.0, -5.0), v(3.0, 0.5, 0.0), v(-0.5, 4.0, 1.0));
        let point = corner + u * s + w * t;
        build.quad(corner, u, w, kind).seen(v(0.2, 0.1, 1.0), point).color().as_vec3()
    };
    let nearest = |place| at(TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE, place);
    assert_eq!(nearest((0.2, 0.1)), BLUE);
    assert_eq!(nearest((0.9, 0.4)), GRAY);
    assert_eq!(nearest((0.1, 0.6)), RED);
    assert_eq!(nearest((0.6, 0.9)), GREEN);
    // Three tiles across and two up: (0.2, 0.1)·(3, 2) = (0.6, 0.2), (0.52, 0.85)·(3, 2) = (1.56, 1.7) →
    // (0.56, 0.7).
    let tiled = |place| at(TextureFilter::Nearest, Wrap::Repeat, Vec2::new(3.0, 2.0), place);
    assert_eq!(tiled((0.2, 0.1)), GRAY);
    assert_eq!(tiled((0.52, 0.85)), GREEN);
    // Mirroring reverses the second tile: 1.56 → 0.44 and 1.7 → 0.3. Clamping maps both to 1.
    let place = (0.52, 0.85);
    assert_eq!(at(TextureFilter::Nearest, Wrap::Mirror, Vec2::new(3.0, 2.0), place), BLUE);
    assert_eq!(at(TextureFilter::Nearest, Wrap::Clamp, Vec2::new(3.0, 2.0), place), GREEN);
    // Bilinear filtering returns the mean of all texels in the middle of the texture, and only one texel at
    // that texel's center.
    let smooth = |place| at(TextureFilter::Bilinear, Wrap::Clamp, Vec2::ONE, place);
    let mean = (RED + GREEN + BLUE + GRAY) / 4.0;
    assert!((smooth((0.5, 0.5)) - mean).length() < 1e-5);
    assert!((smooth((0.25, 0.25)) - BLUE).length() < 1e-5);
    assert!((smooth((0.5, 0.75)) - (RED + GREEN) / 2.0).length() < 1e-5);
}

#[test]
fn texels_are_half_open_intervals() {
    // Texels are half-open intervals starting at 0. u = 0 is in the left column, v = 0 in the bottom row.
    let (build, kind) = textured_material(TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE);
    let square = build.quad(v(0.0, 0.0, -1.0), DVec3::X, DVec3::Y, kind);
    let world = square.world();
    let bsdf = &world.materials[0].bsdf;
    let at = |u, w| bsdf.main_color(&TexturePoint::from_uv(glimt::math::DVec2::new(u, w)), &mut 0);
    assert_eq!([at(0.0, 0.0), at(0.5, 0.0), at(0.0, 0.5), at(0.5, 0.5)], [BLUE, GRAY, RED, GREEN]);
}

#[test]
fn sphere_uv_is_longitude_and_latitude() {
    // u = ½ + atan2(z, x)/2π, v = ½ + asin(y)/π, so (1, 1, 1)/√3 is at (0.625, 0.6959133).
    let (build, kind) = textured_material(TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE);
    let center = v(3.0, -1.0, 2.0);
    let ball = build.sphere(center, 2.0, kind);
    let from = |direction: DVec3| ball.clone().seen(center + direction * 6.0, center);
    for direction in [v(1.0, 1.0, 1.0), v(-1.0, 0.3, 0.2), v(0.2, -0.9, -0.5), v(-0.7, 0.1, -0.9)] {
        let n = direction.normalize();
        let (u, w) = (0.5 + n.z.atan2(n.x) / (2.0 * PI), 0.5 + n.y.asin() / PI);
        let uv = from(n).viewed(ViewMode::Uv).color();
        assert_close("u", uv.x, u);
        assert_close("v", uv.y, w);
        let color = match (u < 0.5, w < 0.5) {
            (true, true) => BLUE,
            (false, true) => GRAY,
            (true, false) => RED,
            (false, false) => GREEN,
        };
        assert_eq!(from(n).color().as_vec3(), color);
    }
    let known = from(DVec3::ONE.normalize()).viewed(ViewMode::Uv).color();
    assert_close("u", known.x, 0.625);
    assert_close("v", known.y, 0.695_913_3);
}

/// Checks that a coarse smooth ball is lit like the sphere it approximates, up to 4° from the terminator,
/// where facets are turned away from the light by up to half of their 11.25°. No facet may be black or
/// deviate from the cosine by more than a third, which allows for vertex normals that average adjacent
/// facets.
#[test]
fn facets_are_invisible_at_the_terminator() {
    let normals: Vec<DVec3> = (0..2000)
        .map(|place| {
            let (azimuth, height) = (f64::from(place) * 2.399_963, f64::from(place) / 1000.0 - 0.999_5);
            let ring = (1.0 - height * height).sqrt();
            DVec3::new(ring * azimuth.cos(), height, ring * azimuth.sin())
        })
        .filter(|normal| normal.x >= 4.0_f64.to_radians().sin())
        .collect();
    assert!(normals.len() > 500);
    let from: Vec<DVec3> = normals.iter().map(|normal| normal * 3.0).collect();
    for shadows in [ShadowMode::Hard, ShadowMode::Off] {
        let build = scene()
            .mesh(
                lat_long_sphere(16, 32, 1.0, DVec3::ZERO),
                [DVec3::ONE, DVec3::ZERO, DVec3::ZERO],
                matte(1.0),
            )
            .smooth()
            .point_light(DVec3::X * 1e4, 1.0, Falloff::None)
            .shadows(shadows, 1);
        for (normal, value) in normals.iter().zip(build.values_from(&from)) {
            let ratio = value * std::f64::consts::PI / normal.x;
            assert!((0.67..1.33).contains(&ratio), "{shadows:?} {normal}: {ratio}");
        }
    }
}

#[test]
fn components_add_up_in_mirrors_and_glass() {
    let build = scene()
        .quad(v(-5.0, -1.0, 5.0), v(10.0, 0.0, 0.0), v(0.0, 0.0, -20.0), phong(0.5, 0.4, 20.0, 0.0))
        .sphere(v(-1.2, 0.0, -6.0), 1.0, mirror(0.9))
        .sphere(v(1.2, 0.0, -6.0), 1.0, glass(1.5))
        .cuboid(v(0.0, -0.75, -4.0), v(0.6, 0.5, 0.6), DVec3::ZERO, glass(1.5))
        .quad(v(-1.0, 3.0, -7.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), emitter(4.0))
        .point_light(v(3.0, 4.0, 0.0), 20.0, Falloff::Square)
        .background(0.3)
        .with(|scene| scene.render.ambient = Vec3::new(0.2, 0.1, 0.3))
        .pictured(v(0.0, 1.0, 1.0), v(0.0, 0.0, -6.0), 40.0, 24, 16);
    let picture = |name: &str| {
        let view = ViewMode::named(name).unwrap_or_else(|| panic!("unknown view {name}"));
        build.clone().viewed(view).picture(8, 3)
    };
    let parts = ["ambient", "diffuse", "specular", "emission"].map(picture);
    for (pixel, beauty) in picture("beauty").into_iter().enumerate() {
        let sum: DVec3 = parts.iter().map(|part| part[pixel]).sum();
        let off = (sum - beauty).abs().max_element();
        assert!(off <= 1e-5 * beauty.max_element().max(1.0), "{pixel}: {sum} {beauty}");
    }
    for (part, name) in parts.iter().zip(["ambient", "diffuse", "specular", "emission"]) {
        assert!(part.iter().any(|color| color.max_element() > 0.01), "{name} must have light");
    }
    // In each component view, mirrors and glass show that component of the light they reflect or transmit.
    let through = |at: DVec3, name: &str| {
        let view = ViewMode::named(name).unwrap_or_else(|| panic!("unknown view {name}"));
        build.clone().seen(v(0.0, 1.0, 1.0), at).viewed(view).value()
    };
    for (below, above) in [(v(-1.2, -0.5, -6.0), v(-1.2, 0.7, -6.0)), (v(1.2, 0.4, -6.0), v(1.2, -0.7, -6.0))]
    {
        for (name, at) in [("ambient", below), ("diffuse", below), ("emission", above)] {
            assert!(through(at, name) > 0.0, "{name} at {at}");
        }
    }
}
