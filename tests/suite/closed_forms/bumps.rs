//! Bump maps: a ramp is shaded like a tilted plane, and wave normals match the analytic derivatives.

use std::f64::consts::{PI, TAU};

use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::ViewMode;
use glimt::math::{DVec2, DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{Bump, Integrator, Material, NormalMap, ShadowMode, TextureFilter, Wrap};

use super::scenes::{
    Build, IDENTITY_PLACEMENT, frosted, glass, lat_long_sphere, matte, metal, mirror, phong, plastic,
    principled, scene, translucent,
};
use super::v;

/// A height texture computed from a function of the image position, which is (0, 0) at the bottom left and
/// (1, 1) at the top right.
fn heights(build: &mut Build, size: usize, height: impl Fn(DVec2) -> f64) -> usize {
    let place = |i: usize| (i as f64 + 0.5) / size as f64;
    let row =
        |y: usize| (0..size).map(|x| Vec3::splat(height(DVec2::new(place(x), place(y))) as f32)).collect();
    let rows: Vec<Vec<Vec3>> = (0..size).rev().map(row).collect();
    let rows: Vec<&[Vec3]> = rows.iter().map(Vec::as_slice).collect();
    build.texture(&rows, TextureFilter::Bilinear, Wrap::Repeat, Vec2::ONE)
}

fn bumped(texture: usize, scale: f64, material: Material) -> Material {
    Material { bump: Some(Bump { texture, channel: None, scale: scale as f32 }), ..material }
}

/// One material of each kind that the shading normal affects.
fn materials() -> Vec<(&'static str, Material)> {
    vec![
        ("phong", phong(0.3, 0.5, 20.0, 0.0)),
        ("metal", metal(0.9, 0.3, 0.0)),
        ("plastic", plastic(0.7, 0.2)),
        ("smooth plastic", plastic(0.7, 0.0)),
        ("principled", principled(0.6, 0.3, 0.4)),
        ("mirror", mirror(0.9)),
        ("glass", glass(1.5)),
    ]
}

#[test]
fn ramp_is_shaded_like_a_tilted_plane() {
    // Heights of 0.3·u over edges of length 2 have slope 0.15. The tilted plane contains the visible point.
    // The light is closer to the surface normal than to the shading normal, so no fading applies.
    let slope = 0.15;
    let up = v(-slope, 1.0, 0.0).normalize();
    let eye = v(1.0, 1.5, 0.4);
    let lit = scene()
        .point_light(v(2.0, 4.0, 1.0), 30.0, Falloff::Square)
        .shadows(ShadowMode::Off, 1)
        .seen(eye, DVec3::ZERO);
    for (name, material) in materials().into_iter().filter(|(name, _)| *name != "glass") {
        // A mirror reflects the background, but not a point light.
        let lit = lit.clone().background(if name == "mirror" { 0.25 } else { 0.0 });
        let mut relief = lit.clone();
        let texture = heights(&mut relief, 8, |at| at.x);
        let (u, w) = (v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0));
        let relief = relief.quad(-(u + w) / 2.0, u, w, bumped(texture, 0.3, material.clone()));
        let along = v(1.0, slope, 0.0) * 2.0;
        let tilted = lit.clone().quad(-(along + w) / 2.0, along, w, material);
        assert!(up.dot(along).abs() < 1e-12);
        let [relief, tilted] = [relief, tilted].map(|build| build.depth(1).value());
        assert!(
            (relief - tilted).abs() < 2e-5 * tilted && tilted > 0.0,
            "{name}: {relief}, expected {tilted}"
        );
    }
}

#[test]
fn ramp_equals_constant_normal_map() {
    // On a cube with edges of length 1, the ramp's slope equals the normal map's slope. The faces show the
    // middle half of the image, which has no wrap-around step.
    let slope = 0.25;
    for (name, material) in materials() {
        for integrator in [Integrator::Whitted, Integrator::Path] {
            let lit = scene()
                .sky(2, [0.1, 0.9, 0.6, 0.3].map(Vec3::splat).to_vec(), 0.0)
                .with(|scene| scene.render.integrator = integrator)
                .point_light(v(2.0, 4.0, 3.0), 10.0, Falloff::Square)
                .depth(3)
                .pictured(v(0.0, 0.0, 4.0), DVec3::ZERO, 8.0, 3, 3);
            let cube = |build: Build, material| build.cuboid(DVec3::ZERO, DVec3::ONE, DVec3::ZERO, material);
            let (mut relief, mut mapped) = (lit.clone(), lit);
            let texture = heights(&mut relief, 8, |at| 2.0 * at.x);
            let shown = relief.image_mut(texture);
            (shown.repeat, shown.offset) = (Vec2::splat(0.5), Vec2::splat(0.25));
            let relief = cube(relief, bumped(texture, slope, material.clone()));
            let normal = v(-slope, 0.0, 1.0).normalize().as_vec3() * 0.5 + 0.5;
            let texture = mapped.texture(&[&[normal]], TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE);
            let normal_map = Some(NormalMap { texture, strength: 1.0 });
            let mapped = cube(mapped, Material { normal_map, ..material.clone() });
            for (relief, mapped) in relief.picture(4, 1).into_iter().zip(mapped.picture(4, 1)) {
                let off = (relief - mapped).abs().max_element();
                assert!(
                    off < 2e-4 * mapped.max_element(),
                    "{name} with {integrator:?}: {relief}, expected {mapped}"
                );
            }
        }
    }
}

/// Shading normal at the point that the camera sees.
fn normal(build: &Build) -> DVec3 {
    build.clone().viewed(ViewMode::Normal).color() * 2.0 - 1.0
}

/// Height and gradient of the waves at an image position.
fn waves(at: DVec2) -> (f64, DVec2) {
    let phase = TAU * at;
    let slopes = DVec2::new(phase.x.cos() * phase.y.cos(), -phase.x.sin() * phase.y.sin());
    (phase.x.sin() * phase.y.cos(), slopes * TAU)
}

/// Number of columns in the wave image. Interpolation between texels reduces slopes by 2·10⁻⁴ of the maximum
/// slope.
const COLUMNS: usize = 256;

#[test]
fn tiled_waves_have_analytic_normals() {
    // Image coordinates are s = R(r·(u, v)) + o, so the gradient of h with respect to (u, v) is r·Rᵀ∇ₛh.
    let (u, w) = (v(2.0, 0.0, 0.0), v(0.5, 0.0, -1.5));
    for (repeat, degrees, offset) in [
        (DVec2::ONE, 0.0_f64, DVec2::ZERO),
        (DVec2::new(2.0, -1.0), 0.0, DVec2::new(0.3, 0.1)),
        (DVec2::new(1.0, 2.0), 30.0, DVec2::new(-0.2, 0.7)),
    ] {
        let mut build = scene();
        let texture = heights(&mut build, COLUMNS, |at| waves(at).0);
        let tiled = build.image_mut(texture);
        (tiled.repeat, tiled.rotate, tiled.offset) = (repeat.as_vec2(), degrees, offset.as_vec2());
        let build = build.quad(DVec3::ZERO, u, w, bumped(texture, 0.05, matte(0.5)));
        for at in [DVec2::new(0.21, 0.34), DVec2::new(0.7, 0.55), DVec2::new(0.43, 0.9)] {
            let turn = DVec2::from_angle(degrees.to_radians());
            let slopes = repeat
                * DVec2::from_angle(-degrees.to_radians()).rotate(waves(turn.rotate(repeat * at) + offset).1)
                * 0.05;
            // The tangents of the height field are u and w, each tilted by the slope along it.
            let expected = (u + DVec3::Y * slopes.x).cross(w + DVec3::Y * slopes.y).normalize();
            let point = u * at.x + w * at.y;
            let found = normal(&build.clone().seen(point + v(0.3, 2.0, 0.2), point));
            assert!(
                (found - expected).length() < 5e-4,
                "{at} of {repeat}, {degrees}°: {found}, expected {expected}"
            );
        }
    }
}

#[test]
fn waves_on_a_sphere_have_displaced_normals() {
    // The displaced point is (R + h)·n. Its derivatives with respect to longitude and latitude span the
    // tangent plane, to first order in h/R.
    let (radius, scale) = (2.0, 1e-2);
    let direction = |uv: DVec2| {
        let (longitude, latitude) = ((uv.x - 0.5) * TAU, (uv.y - 0.5) * PI);
        v(latitude.cos() * longitude.cos(), latitude.sin(), latitude.cos() * longitude.sin())
    };
    let mut build = scene();
    let texture = heights(&mut build, COLUMNS, |at| waves(at).0);
    build.image_mut(texture).repeat = Vec2::new(4.0, 2.0);
    let ball = build.sphere(DVec3::ZERO, radius, bumped(texture, scale, matte(0.5)));
    for uv in [DVec2::new(0.3, 0.4), DVec2::new(0.61, 0.77), DVec2::new(0.93, 0.15)] {
        let repeat = DVec2::new(4.0, 2.0);
        let slopes = repeat * waves(uv * repeat).1 * scale;
        let (n, step) = (direction(uv), 1e-5);
        let tangent = |by: DVec2, slope: f64| {
            (direction(uv + by * step) - direction(uv - by * step)) * (radius / (2.0 * step)) + n * slope
        };
        let across = tangent(DVec2::X, slopes.x).cross(tangent(DVec2::Y, slopes.y)).normalize();
        let expected = across * across.dot(n).signum();
        let found = normal(&ball.clone().seen(n * 5.0, DVec3::ZERO));
        assert!((found - expected).length() < 5e-4, "{uv}: {found}, expected {expected}");
    }
}

#[test]
fn waves_follow_mesh_uvs_and_transform() {
    // Texture coordinates are 2·(x, z) + (0.1, 0.2) in object space. The instance is scaled by three and
    // mirrored. Heights are in scene units, so they do not scale with the instance.
    let corners = [v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 0.0, 1.0), v(0.0, 0.0, 1.0)];
    let coordinates = |at: DVec3| DVec2::new(at.x, at.z) * 2.0 + DVec2::new(0.1, 0.2);
    for mirrored in [1.0, -1.0] {
        let mesh = TriangleMesh {
            positions: corners.map(|corner| corner.as_vec3()).to_vec(),
            uvs: corners.map(|corner| coordinates(corner).as_vec2()).to_vec(),
            triangles: vec![[0, 2, 1], [0, 3, 2]],
            ..TriangleMesh::default()
        };
        let mut build = scene();
        let texture = heights(&mut build, COLUMNS, |at| waves(at).0);
        let placed = [v(3.0 * mirrored, 3.0, 3.0), DVec3::ZERO, v(0.0, 0.5, 0.0)];
        let build = build.mesh(mesh, placed, bumped(texture, 0.05, matte(0.5)));
        for at in [v(0.2, 0.0, 0.1), v(0.3, 0.0, 0.8), v(0.77, 0.0, 0.5)] {
            let slopes = waves(coordinates(at)).1 * 2.0 * 0.05 / 3.0;
            let expected = v(-slopes.x * mirrored, 1.0, -slopes.y).normalize();
            let point = v(3.0 * mirrored * at.x, 0.5, 3.0 * at.z);
            let found = normal(&build.clone().seen(point + v(0.3, 2.0, 0.2), point));
            assert!(
                (found - expected).length() < 5e-4,
                "{at}, mirrored {mirrored}: {found}, expected {expected}"
            );
        }
    }
}

#[test]
fn distant_mipmapped_waves_are_flat() {
    // At a distance of 400 units, a 1° pixel is 7 units wide. A wave is 1 unit wide.
    let mut build = scene();
    let texture = heights(&mut build, 32, |at| waves(at).0);
    build.image_mut(texture).repeat = Vec2::splat(200.0);
    let (u, w) = (v(200.0, 0.0, 0.0), v(0.0, 0.0, -200.0));
    let seen = |filter, distance: f64| {
        let mut build = build.clone();
        build.scene.textures[texture].filter = filter;
        let build = build.quad(-(u + w) / 2.0, u, w, bumped(texture, 0.2, matte(0.5)));
        let at = v(0.03, 0.0, 0.01);
        normal(&build.pictured(at + DVec3::Y * distance, at, 1.0, 1, 1)).y
    };
    assert!(seen(TextureFilter::Bilinear, 400.0) < 0.98);
    assert!(seen(TextureFilter::Mipmap, 400.0) > 0.999);
    let near = [TextureFilter::Bilinear, TextureFilter::Mipmap].map(|filter| seen(filter, 1.0));
    assert!((near[0] - near[1]).abs() < 0.02 && near[0] < 0.98, "{near:?}");
}

#[test]
fn bumpy_balls_have_no_black_edge() {
    // Reflections still show the sky where shading normals face away from the viewer. The waves run from pole
    // to pole.
    let mut darkest = Vec::new();
    for (name, material) in materials().into_iter().filter(|(name, _)| *name != "glass") {
        let mut build = scene().environment(1.0);
        let texture = heights(&mut build, 16, |at| (TAU * at.y).cos());
        build.image_mut(texture).repeat = Vec2::new(1.0, 4.0);
        let ball = lat_long_sphere(12, 16, 1.0, DVec3::ZERO);
        let uvs = |p: &Vec3| Vec2::new(0.5 + p.z.atan2(p.x) / TAU as f32, 0.5 + p.y.asin() / PI as f32);
        let mesh = TriangleMesh { uvs: ball.positions.iter().map(uvs).collect(), ..ball };
        let material = bumped(texture, 0.02, material);
        let build = build
            .mesh(mesh, IDENTITY_PLACEMENT, material.clone())
            .smooth()
            .sphere(v(2.5, 0.0, 0.0), 1.0, material)
            .pictured(v(1.25, 0.0, 5.0), v(1.25, 0.0, 0.0), 42.0, 48, 24);
        let least = build.depth(8).picture(32, 0).iter().map(|color| color.x).fold(f64::MAX, f64::min);
        darkest.push((name, least));
    }
    assert!(darkest.iter().all(|(_, least)| *least > 0.2), "{darkest:?}");
}

#[test]
fn no_light_from_behind_the_shading_normal() {
    // Slopes of 60°. The light is 3° to 20° above the surface, behind the shading normal.
    let slope = 3.0_f64.sqrt();
    for (name, material) in materials().into_iter().filter(|(name, _)| !["glass", "mirror"].contains(name)) {
        for (degrees, shadows) in [
            (3.0, ShadowMode::Soft),
            (5.0, ShadowMode::Hard),
            (8.0, ShadowMode::Off),
            (12.0, ShadowMode::Soft),
            (20.0, ShadowMode::Hard),
        ] {
            let (sine, cosine) = f64::to_radians(degrees).sin_cos();
            let mut build = scene()
                .point_light(v(10.0 * cosine, 10.0 * sine, 0.0), 100.0, Falloff::Square)
                .shadows(shadows, 1)
                .seen(v(-1.0, 1.0, 0.3), DVec3::ZERO);
            let texture = heights(&mut build, 8, |at| at.x);
            let (u, w) = (v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0));
            let value =
                build.quad(-(u + w) / 2.0, u, w, bumped(texture, 2.0 * slope, material.clone())).depth(1);
            assert_eq!(value.value(), 0.0, "{name}, {degrees}°");
        }
    }
}

#[test]
fn hard_and_soft_point_shadows_agree_on_bumps() {
    // Lobe samples behind the shading normal have zero pdf.
    for (name, material) in [
        ("translucent", translucent(0.8, 0.3, 0.5)),
        ("plastic", plastic(0.7, 0.3)),
        ("frosted", frosted(1.5, 0.3)),
    ] {
        let [soft, hard] = [ShadowMode::Soft, ShadowMode::Hard].map(|shadows| {
            let mut build =
                scene().point_light(v(1.0, 3.0, 2.0), 10.0, Falloff::Square).shadows(shadows, 1).depth(1);
            let texture = heights(&mut build, 16, |at| 0.5 + 0.5 * (TAU * (2.0 * at.x + at.y)).sin());
            let build = build.sphere(DVec3::ZERO, 1.0, bumped(texture, 0.3, material.clone()));
            let build = build.pictured(v(0.0, 0.0, 4.0), DVec3::ZERO, 30.0, 12, 12);
            let picture = build.picture(256, 1);
            assert!(picture.iter().all(|pixel| pixel.is_finite()), "{name}: {shadows:?}");
            picture.iter().map(|pixel| pixel.element_sum()).sum::<f64>()
        });
        assert!((soft - hard).abs() < 1e-5 * soft && soft > 0.0, "{name}: {soft} soft, {hard} hard");
    }
}
