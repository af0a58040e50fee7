//! Procedural textures: checkerboards, bands and noise.

use std::f64::consts::PI;

use glimt::materials::texture::{Bands, Checker, Noise, Pattern, TextureMapping};
use glimt::materials::{ExtraCoordinates, ObjectPoint, TexturePoint};
use glimt::math::{DMat3, DVec2, DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    AffineMap, ColorSource, EmissionSource, Integrator, Material, MaterialKind, NumberSource, OpacitySource,
    Shape, TextureFilter, Wrap,
};

use super::scenes::{Build, emitter, matte, scene};
use super::{lambert, mean_and_error, v};

const RED: Vec3 = Vec3::new(0.8, 0.1, 0.3);
const BLUE: Vec3 = Vec3::new(0.2, 0.4, 0.9);

fn checker(repeat: Vec2) -> Pattern {
    Pattern::Checker(Checker { mapping: TextureMapping { repeat, moved: None } })
}

fn noise(size: f64) -> Noise {
    Noise { size, octaves: 3, seed: 5 }
}

/// A diffuse material with a texture.
fn textured(texture: usize) -> Material {
    let mut material = matte(0.0);
    if let MaterialKind::Phong(parameters) = &mut material.kind {
        parameters.diffuse = ColorSource::Texture(texture);
    }
    material
}

/// A scene lit only by ambient light, in which surfaces show their diffuse color.
fn ambient_scene() -> Build {
    scene().with(|scene| scene.render.ambient = Vec3::ONE)
}

/// The color of noise between [`RED`] and [`BLUE`] at a point in the shape's own coordinates.
fn noise_color(noise: &Noise, position: DVec3) -> DVec3 {
    let object = ObjectPoint { position, width: 0.0, from_world: DMat3::IDENTITY };
    let extra = Some(Box::new(ExtraCoordinates { second: None, object: Some(object) }));
    let at = TexturePoint { extra, ..TexturePoint::from_uv(DVec2::ZERO) };
    let share = f64::from(0.5 + 0.5 * noise.evaluate(&at, false).value);
    RED.as_dvec3() * (1.0 - share) + BLUE.as_dvec3() * share
}

#[test]
fn cells_and_bands_show_their_colors() {
    // Whether a cell in a column and a row has the second color.
    type IsSecond = fn(i32, i32) -> bool;
    let patterns: [(Pattern, IsSecond); 2] = [
        (checker(Vec2::new(2.0, 3.0)), |column, row| (column + row) % 2 != 0),
        (
            Pattern::Bands(Bands { mapping: TextureMapping { repeat: Vec2::new(2.0, 3.0), moved: None } }),
            |column, _| column % 2 != 0,
        ),
    ];
    for (pattern, is_second) in patterns {
        for filter in [TextureFilter::Nearest, TextureFilter::Bilinear, TextureFilter::Mipmap] {
            let mut build = ambient_scene();
            let texture = build.pattern(pattern.clone(), [RED, BLUE], filter);
            let build = build.quad(v(0.0, 0.0, 0.0), v(8.0, 0.0, 0.0), v(0.0, 12.0, 0.0), textured(texture));
            for (column, row) in (0..4).flat_map(|column| (0..6).map(move |row| (column, row))) {
                // Cells are two units wide. Look at a point near the lower left corner of each.
                let at = v(f64::from(column) * 2.0 + 0.01, f64::from(row) * 2.0 + 0.01, 0.0);
                let seen = build.clone().seen(at + DVec3::Z, at).color();
                let expected = if is_second(column, row) { BLUE } else { RED };
                assert!((seen - expected.as_dvec3()).length() < 1e-6, "{pattern:?} {at}: {seen}");
            }
        }
    }
}

#[test]
fn distant_patterns_show_their_mean() {
    let mean = f64::from(RED.x + BLUE.x) / 2.0;
    let bands = Pattern::Bands(Bands { mapping: TextureMapping { repeat: Vec2::splat(200.0), moved: None } });
    for pattern in [checker(Vec2::splat(200.0)), bands, Pattern::Noise(noise(0.5))] {
        let seen = |filter| {
            let mut build = ambient_scene();
            let texture = build.pattern(pattern.clone(), [RED, BLUE], filter);
            let build =
                build.quad(v(-100.0, 0.0, 0.0), v(200.0, 0.0, 0.0), v(0.0, 0.0, -200.0), textured(texture));
            let build =
                build.pictured(v(0.0, 40.0, 20.0), v(0.0, 0.0, -40.0), 40.0, 16, 16).with_placements();
            build.picture(1, 7).into_iter().map(|color| color.x).collect::<Vec<f64>>()
        };
        for gray in seen(TextureFilter::Mipmap) {
            assert!((gray - mean).abs() < 0.06, "{pattern:?}: {gray} instead of {mean}");
        }
        let (_, error) = mean_and_error(&seen(TextureFilter::Bilinear));
        assert!(error * 16.0 > 0.02, "{pattern:?}: sharp lookups must alias: {error}");
    }
}

/// A matrix that turns, stretches, shears and mirrors.
fn matrix() -> AffineMap {
    AffineMap {
        linear: [v(0.3, 1.1, 0.2), v(-0.9, 0.4, 0.1), v(0.2, 0.1, -1.4)],
        translate: v(5.0, -3.0, 2.0),
    }
}

#[test]
fn noise_is_fixed_to_the_shape() {
    let scaled = AffineMap { linear: DVec3::AXES.map(|axis| axis * 2.5), translate: v(1.0, 2.0, -3.0) };
    let noise = noise(0.4);
    let shapes = [
        (Shape::Sphere { center: v(1.0, 0.0, 0.0), radius: 0.5 }, v(1.3, 0.4, 0.0), v(0.6, 0.8, 0.0)),
        (
            Shape::Box { center: DVec3::ZERO, size: v(1.0, 2.0, 1.0), rotate: DVec3::ZERO },
            v(0.2, 1.0, 0.1),
            DVec3::Y,
        ),
        (
            Shape::Quad { corner: v(-1.0, 0.0, 1.0), u: v(2.0, 0.0, 0.0), v: v(0.0, 0.0, -2.0) },
            v(0.3, 0.0, 0.77),
            DVec3::Y,
        ),
        (
            Shape::Triangle { a: v(0.0, 0.0, 0.0), b: v(1.0, 0.0, 0.0), c: v(0.0, 0.0, -1.0) },
            v(0.31, 0.0, -0.2),
            DVec3::Y,
        ),
        (Shape::Plane { point: v(0.0, 0.5, 0.0), normal: DVec3::Y }, v(3.3, 0.5, -2.7), DVec3::Y),
    ];
    for (shape, point, normal) in shapes {
        for map in [scaled, matrix()] {
            let mut build = ambient_scene();
            let texture = build.pattern(Pattern::Noise(noise.clone()), [RED, BLUE], TextureFilter::Nearest);
            let build = build.shape_with_matrix(shape.clone(), map, textured(texture));
            let placed = map.to_transform();
            let outside = placed.normal(normal).normalize();
            let at = placed.point(point);
            let seen = build.seen(at + outside * 2.0, at).color();
            let expected = noise_color(&noise, point);
            assert!((seen - expected).length() < 1e-4, "{shape:?} {map:?}: {seen} instead of {expected}");
        }
    }
}

#[test]
fn packets_and_single_hits_equal_an_image() {
    // With ambient light, textured surfaces are shaded one by one, and without it in packets.
    let seen = |is_image: bool, ambient: f32| {
        let mut build = scene().point_light(v(0.0, 5.0, 3.0), 30.0, Falloff::Square);
        let repeat = Vec2::new(7.0, 5.0);
        let rows: [&[Vec3]; 2] = [&[BLUE, RED], &[RED, BLUE]];
        let texture = match is_image {
            true => build.texture(&rows, TextureFilter::Nearest, Wrap::Repeat, repeat),
            false => build.pattern(checker(repeat), [RED, BLUE], TextureFilter::Nearest),
        };
        let build = build
            .quad(v(-2.0, 0.0, 0.0), v(4.0, 0.0, 0.3), v(0.2, 0.0, -6.0), textured(texture))
            .sphere(v(0.3, 1.0, -3.0), 0.9, textured(texture))
            .with(|scene| scene.render.ambient = Vec3::splat(ambient));
        build.pictured(v(0.0, 2.0, 4.0), v(0.0, 0.5, -3.0), 50.0, 48, 32).picture(2, 3)
    };
    for ambient in [0.0, 0.1] {
        let (pattern, image) = (seen(false, ambient), seen(true, ambient));
        assert!(pattern.iter().any(|color| color.x > 0.01));
        assert!(pattern == image, "different bits with an ambient light of {ambient}");
    }
}

/// A quad light above the origin, and its position at fractions of its edges.
const CORNER: DVec3 = DVec3::new(-1.0, 2.0, -0.5);
const U: DVec3 = DVec3::new(2.0, 0.0, 0.0);
const V: DVec3 = DVec3::new(0.3, 0.0, 2.0);

/// A diffuse floor under a light with an emission texture.
fn under_light(mut build: Build, texture: usize) -> Build {
    let own = emitter(2.0);
    let emission = EmissionSource { texture: Some(texture), ..own.emission };
    build = build.quad(CORNER, U, V, Material { emission, ..own });
    let floor = matte(0.7);
    let build = build.quad(v(-3.0, 0.0, 3.0), v(6.0, 0.0, 0.0), v(0.0, 0.0, -6.0), floor);
    build.seen(v(0.0, 0.9, 1.0), DVec3::ZERO).with_placements()
}

fn assert_radiance(what: &str, build: &Build, irradiance: f64) {
    for integrator in [Integrator::Whitted, Integrator::Path] {
        let build =
            build.clone().with(|scene| (scene.render.integrator, scene.render.max_depth) = (integrator, 1));
        let (mean, error) = mean_and_error(&build.values(256, 64));
        let expected = 0.7 * irradiance / PI;
        assert!(error < 2e-3 * expected, "{what} {integrator:?}: too noisy: {mean} ± {error}");
        assert!((mean - expected).abs() < 4.0 * error, "{what} {integrator:?}: {mean} ± {error}, {expected}");
    }
}

#[test]
fn patterned_lights_match_their_cells() {
    let colors = [Vec3::splat(0.9), Vec3::splat(0.1)];
    let mut build = scene();
    let texture = build.pattern(checker(Vec2::new(1.5, 1.0)), colors, TextureFilter::Bilinear);
    // Three columns and two rows.
    let mut irradiance = 0.0;
    for (i, j) in (0..3).flat_map(|i| (0..2).map(move |j| (i, j))) {
        let corner = CORNER + U * (f64::from(i) / 3.0) + V * (f64::from(j) / 2.0);
        let polygon = [corner, corner + U / 3.0, corner + U / 3.0 + V / 2.0, corner + V / 2.0];
        let radiance = if (i + j) % 2 == 0 { 1.8 } else { 0.2 };
        irradiance += radiance * lambert(DVec3::ZERO, DVec3::Y, &polygon);
    }
    assert_radiance("checker", &under_light(build, texture), irradiance);
}

#[test]
fn noisy_lights_match_a_quadrature() {
    let noise = noise(0.5);
    let mut build = scene();
    let texture = build.pattern(Pattern::Noise(noise.clone()), [RED, BLUE], TextureFilter::Bilinear);
    // The midpoint rule over cells that are small compared with the noise.
    let (mut irradiance, count) = (0.0, 200);
    let area = U.cross(V).length() / f64::from(count * count);
    for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
        let at = |i: i32| (f64::from(i) + 0.5) / f64::from(count);
        let point = CORNER + U * at(i) + V * at(j);
        let squared = point.length_squared();
        irradiance += 2.0 * noise_color(&noise, point).x * point.y * point.y / (squared * squared) * area;
    }
    assert_radiance("noise", &under_light(build, texture), irradiance);
}

#[test]
fn opacity_of_a_checker_hides_half() {
    let mut build = scene().background(1.0);
    let texture = build.pattern(checker(Vec2::splat(40.0)), [Vec3::ONE, Vec3::ZERO], TextureFilter::Mipmap);
    let value = NumberSource::Texture { texture, channel: None };
    let sieve = Material { opacity: OpacitySource { value, cutoff: 0.0 }, ..matte(0.0) };
    let build = build.quad(v(-1.0, -1.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), sieve);
    // The pixels show all of the quad.
    let fov = 2.0 * (1.0_f64 / 3.0).atan().to_degrees();
    let picture = build.pictured(v(0.0, 0.0, 3.0), DVec3::ZERO, fov, 10, 10).picture(64, 1);
    let passed: Vec<f64> = picture.into_iter().map(|color| color.x).collect();
    let (mean, _) = mean_and_error(&passed);
    // 6,400 Bernoulli samples with a probability of one half.
    assert!((mean - 0.5).abs() < 4.0 * 0.5 / 80.0, "{mean}");
}
