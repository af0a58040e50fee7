//! Bit-identical results for vertices in packets and for single vertices.

use std::ops::Range;

use glimt::control::CancelToken;
use glimt::film::Rect;
use glimt::integrators::render_tile;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{
    ColorSource, Material, MaterialKind, PhongParameters, ShadowMode, Shape, TextureFilter, Wrap,
};

use super::scenes::{Build, emitter, glass, mirror, plain, scene};
use super::v;

/// Shapes of each kind between mirrors and glass, under lights. `paint` sets the colors of the Phong
/// materials.
fn mixed_scene(paint: impl Fn(&mut Build, Vec3) -> ColorSource) -> Build {
    let mut build = scene();
    let phong = |build: &mut Build, r: f32, ks: f32| -> Material {
        let (diffuse, specular) = (paint(build, Vec3::new(r, 0.5, 0.3)), paint(build, Vec3::splat(ks)));
        plain(MaterialKind::Phong(PhongParameters {
            diffuse,
            specular,
            shininess: 12.5,
            ambient: None,
            diffuse_transmission: ColorSource::BLACK,
        }))
    };
    let shapes = [
        Shape::Plane { point: v(0.0, -0.3, 0.0), normal: v(0.1, 1.0, 0.0) },
        Shape::Sphere { center: v(-1.0, 0.2, 0.0), radius: 0.5 },
        Shape::Box { center: v(0.3, 0.2, -0.5), size: v(0.5, 0.9, 0.4), rotate: v(10.0, 40.0, 0.0) },
        Shape::Quad { corner: v(1.0, -0.2, -0.5), u: v(0.8, 0.1, 0.2), v: v(0.1, 0.9, 0.0) },
        Shape::Triangle { a: v(-0.5, -0.2, 0.8), b: v(0.4, -0.1, 0.9), c: v(0.0, 0.5, 0.7) },
        Shape::Disk { center: v(-1.9, 0.2, -1.0), normal: v(0.4, 0.1, 1.0), radius: 0.5 },
        Shape::Cylinder { a: v(1.6, -0.2, 0.6), b: v(1.7, 0.4, 0.6), radius: 0.2, caps: true },
    ];
    for (shape, i) in shapes.into_iter().zip(0_u16..) {
        let material = phong(&mut build, 0.1 + 0.1 * f32::from(i), 0.3 * f32::from(i % 3));
        build = build.shape(shape, material);
    }
    build
        .sphere(v(0.9, 0.1, 0.9), 0.35, glass(1.5))
        .sphere(v(-0.2, 0.9, 0.1), 0.3, mirror(0.8))
        .quad(v(-0.4, 2.0, -0.4), v(0.8, 0.0, 0.0), v(0.0, 0.0, 0.8), emitter(4.0))
        .sphere(v(2.0, 1.5, 1.0), 0.2, emitter(5.0))
        .point_light(v(-2.0, 2.0, 2.0), 6.0, Falloff::Square)
        .with(|scene| scene.render.ambient = Vec3::splat(0.1))
        .pictured(v(0.0, 1.0, 4.5), DVec3::ZERO, 45.0, 37, 23)
}

#[test]
fn constant_texture_is_bit_identical_to_color() {
    let by_rows = mixed_scene(|_, color| ColorSource::Constant(color));
    let one_by_one = mixed_scene(|build, color| {
        ColorSource::Texture(build.texture(&[&[color]], TextureFilter::Nearest, Wrap::Repeat, Vec2::ONE))
    });
    for (shadows, count) in
        [(ShadowMode::Soft, 1), (ShadowMode::Soft, 3), (ShadowMode::Hard, 1), (ShadowMode::Off, 1)]
    {
        let picture = |build: &Build| build.clone().shadows(shadows, count).picture(3, 5);
        let (rows, single) = (picture(&by_rows), picture(&one_by_one));
        assert!(rows.iter().any(|pixel| pixel.x > 0.1), "the image is black");
        assert_eq!(rows, single, "{shadows:?}, {count}");
    }
}

#[test]
fn sample_bits_do_not_depend_on_tiling() {
    let build = mixed_scene(|_, color| ColorSource::Constant(color)).shadows(ShadowMode::Soft, 2);
    let (world, settings) = (build.world(), build.settings(4));
    let samples = |rect: Rect, samples: Range<u32>| {
        let done = render_tile(&world, &settings, rect, samples, &CancelToken::new());
        done.expect("the token is not canceled").0.radiance
    };
    let whole = Rect { x: 0, y: 0, width: 37, height: 23 };
    let all = samples(whole, 0..7);
    for (rect, range) in [
        (Rect { x: 0, y: 0, width: 1, height: 23 }, 0..7),
        (Rect { x: 5, y: 3, width: 30, height: 17 }, 3..7),
        (Rect { x: 20, y: 22, width: 17, height: 1 }, 2..3),
    ] {
        let part = samples(rect, range.clone());
        for (i, radiance) in part.iter().enumerate() {
            let (pixel, sample) = (i / range.len(), range.start as usize + i % range.len());
            let (x, y) = (
                rect.x as usize + pixel % rect.width as usize,
                rect.y as usize + pixel / rect.width as usize,
            );
            assert_eq!(
                *radiance,
                all[(y * 37 + x) * 7 + sample],
                "sample {sample} of ({x}, {y}) in {rect:?}"
            );
        }
    }
}
