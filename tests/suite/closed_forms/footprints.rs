//! Pixel footprints and the mip levels of textures.

use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec2, Vec3};
use glimt::scene::description::{
    ColorSource, EmissionSource, Integrator, Material, MaterialKind, PhongParameters, TextureFilter, Wrap,
};

use super::scenes::{Build, emitter, lat_long_sphere, matte, mirror, phong, plain, scene};
use super::{mean_and_error, v};

/// A tiled checkerboard of black and white squares, 16 texels wide.
fn checkers(build: &mut Build, filter: TextureFilter, repeat: f32) -> usize {
    let rows: Vec<Vec<Vec3>> = (0..32)
        .map(|y| (0..32).map(|x| Vec3::splat(if (x / 16 + y / 16) % 2 == 0 { 0.0 } else { 1.0 })).collect())
        .collect();
    let rows: Vec<&[Vec3]> = rows.iter().map(Vec::as_slice).collect();
    build.texture(&rows, filter, Wrap::Repeat, Vec2::splat(repeat))
}

/// The checkerboard material, lit only by ambient light.
fn board(filter: TextureFilter, repeat: f32) -> (Build, Material) {
    let mut build = scene().with(|scene| scene.render.ambient = Vec3::ONE);
    let texture = checkers(&mut build, filter, repeat);
    let mut kind = phong(0.0, 0.0, 1.0, 0.0);
    if let MaterialKind::Phong(PhongParameters { diffuse, .. }) = &mut kind.kind {
        *diffuse = ColorSource::Texture(texture);
    }
    (build, kind)
}

/// A floor of unit tiles, 200 units on a side.
fn floor(filter: TextureFilter) -> Build {
    let (build, kind) = board(filter, 200.0);
    build.quad(v(-100.0, 0.0, 0.0), v(200.0, 0.0, 0.0), v(0.0, 0.0, -200.0), kind)
}

fn grays(build: &Build) -> Vec<f64> {
    build.picture(1, 7).into_iter().map(|color| color.x).collect()
}

#[test]
fn distant_board_is_gray_after_one_sample() {
    // At a distance of 60 units, a pixel of 40°/16 is at least 2.6 units wide.
    let seen = |filter| grays(&floor(filter).pictured(v(0.0, 40.0, 20.0), v(0.0, 0.0, -40.0), 40.0, 16, 16));
    let off = |values: &[f64]| values.iter().map(|x| (x - 0.5).abs()).fold(0.0, f64::max);
    let mipmapped = seen(TextureFilter::Mipmap);
    assert!(off(&mipmapped) < 0.01, "{}", off(&mipmapped));
    let (mean, error) = mean_and_error(&seen(TextureFilter::Bilinear));
    assert!(error * 16.0 > 0.4, "bilinear lookups must alias: {mean} ± {error}");
}

/// A name, and a function that creates a material with the given texture.
type Textured = (&'static str, fn(texture: usize) -> Material);

#[test]
fn distant_boards_are_gray_for_every_key() {
    let materials: [Textured; 4] = [
        ("diffuse", |board| {
            let diffuse = ColorSource::Texture(board);
            let specular = ColorSource::Constant(Vec3::ZERO);
            plain(MaterialKind::Phong(PhongParameters {
                diffuse,
                specular,
                shininess: 1.0,
                ambient: None,
                diffuse_transmission: ColorSource::BLACK,
            }))
        }),
        ("emission", |board| {
            let own = emitter(1.0);
            Material { emission: EmissionSource { texture: Some(board), ..own.emission }, ..own }
        }),
        ("mirror", |board| plain(MaterialKind::Mirror { reflectance: ColorSource::Texture(board) })),
        // With an IOR of 1, a pane reflects nothing.
        ("pane", |board| plain(MaterialKind::Pane { ior: 1.0, tint: ColorSource::Texture(board) })),
    ];
    for (what, material) in materials {
        let seen = |filter| {
            let mut build = scene().background(1.0).with(|scene| scene.render.ambient = Vec3::ONE);
            let board = checkers(&mut build, filter, 200.0);
            // Also add a material without a texture.
            let build = build
                .quad(v(-100.0, 0.0, 0.0), v(200.0, 0.0, 0.0), v(0.0, 0.0, -200.0), material(board))
                .sphere(v(0.0, 90.0, 0.0), 1.0, matte(0.5))
                .pictured(v(0.0, 40.0, 20.0), v(0.0, 0.0, -40.0), 40.0, 16, 16);
            grays(&build)
        };
        for gray in seen(TextureFilter::Mipmap) {
            assert!((gray - 0.5).abs() < 0.01, "{what}: {gray}");
        }
        let (mean, error) = mean_and_error(&seen(TextureFilter::Bilinear));
        assert!(error * 16.0 > 0.4, "{what}: bilinear lookups must alias: {mean} ± {error}");
    }
}

#[test]
fn contrast_fades_with_distance() {
    // Pixels are 1° wide. Half a square is 0.25 units, which is one pixel at a distance of 14.3.
    let contrast = |distance: f64| {
        let eye = v(0.25, distance, -50.25);
        let build = floor(TextureFilter::Mipmap).pictured(eye, v(0.25, 0.0, -50.25), 1.0, 1, 1);
        (build.value() - 0.5).abs()
    };
    let contrasts = [1.0, 5.0, 10.0, 20.0, 40.0, 80.0].map(contrast);
    assert_eq!(contrasts[0], 0.5);
    assert!(contrasts.windows(2).all(|pair| pair[1] <= pair[0] + 1e-6), "{contrasts:?}");
    assert!(contrasts[2] > 0.2 && contrasts[5] < 1e-3, "{contrasts:?}");
}

#[test]
fn near_texture_uses_full_resolution() {
    let seen = |filter| grays(&floor(filter).pictured(v(0.3, 0.4, -50.0), v(0.4, 0.0, -50.2), 3.0, 16, 16));
    assert_eq!(seen(TextureFilter::Mipmap), seen(TextureFilter::Bilinear));
}

#[test]
fn constant_texture_is_constant_at_every_level() {
    let mut build = scene().with(|scene| scene.render.ambient = Vec3::ONE);
    let texture = build.texture(
        &[&[Vec3::splat(0.3); 7][..]; 5],
        TextureFilter::Mipmap,
        Wrap::Repeat,
        Vec2::splat(99.0),
    );
    let mut kind = matte(0.0);
    if let MaterialKind::Phong(PhongParameters { diffuse, .. }) = &mut kind.kind {
        *diffuse = ColorSource::Texture(texture);
    }
    let build = build.quad(v(-9.0, 0.0, 9.0), v(18.0, 0.0, 0.0), v(0.0, 0.0, -18.0), kind);
    for color in build.pictured(v(0.0, 6.0, 3.0), DVec3::ZERO, 60.0, 8, 8).picture(2, 1) {
        assert!((color.x - f64::from(0.3_f32)).abs() < 1e-6, "{color}");
    }
}

#[test]
fn flat_mirror_keeps_the_mip_level() {
    // The mirror is at z = −5, so a point at z appears at −10 − z.
    let unfolded = |p: DVec3| v(p.x, p.y, -10.0 - p.z);
    let (corner, u, w) = (v(-40.0, -30.0, 12.0), v(80.0, 0.0, 8.0), v(0.0, 60.0, 3.0));
    let eye = v(0.0, 0.0, 0.0);
    let picture = |is_mirrored: bool| {
        let (build, kind) = board(TextureFilter::Mipmap, 20.0);
        let build = if is_mirrored {
            build.quad(corner, u, w, kind).quad(
                v(-50.0, -50.0, -5.0),
                v(100.0, 0.0, 0.0),
                v(0.0, 100.0, 0.0),
                mirror(1.0),
            )
        } else {
            let turn = |a: DVec3| v(a.x, a.y, -a.z);
            build.quad(unfolded(corner), turn(u), turn(w), kind)
        };
        build.pictured(eye, v(0.1, 0.2, -5.0), 50.0, 24, 24).picture(1, 3)
    };
    let (mirrored, plain) = (picture(true), picture(false));
    let gray = |picture: &[DVec3]| picture.iter().filter(|color| color.x > 0.05 && color.x < 0.95).count();
    assert!(gray(&plain) > 100, "intermediate levels must be used");
    for (a, b) in mirrored.iter().zip(&plain) {
        assert!((*a - *b).abs().max_element() < 5e-3, "{a} {b}");
    }
}

#[test]
fn mirror_ball_matches_its_smooth_mesh() {
    // A checkerboard behind the camera. Its reflection in the ball is so small that everything is gray,
    // unlike in a flat mirror.
    let (build, kind) = board(TextureFilter::Mipmap, 12.0);
    let room =
        |build: Build| build.quad(v(-30.0, -30.0, 9.0), v(60.0, 0.0, 0.0), v(0.0, 60.0, 0.0), kind.clone());
    let seen = |build: Build| room(build).pictured(DVec3::ZERO, v(0.0, 0.1, -5.0), 3.0, 8, 8).picture(1, 5);
    let off = |picture: Vec<DVec3>| {
        picture.iter().map(|color| (color.x - 0.5).abs()).sum::<f64>() / picture.len() as f64
    };
    let ball = off(seen(build.clone().sphere(v(0.0, 0.0, -5.0), 0.5, mirror(1.0))));
    let mesh = lat_long_sphere(40, 80, 0.5, v(0.0, 0.0, -5.0));
    let facets = off(seen(build.clone().mesh(mesh, super::scenes::IDENTITY_PLACEMENT, mirror(1.0)).smooth()));
    let flat = off(seen(build.quad(v(-1.0, -1.0, -5.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), mirror(1.0))));
    assert!(ball < 0.2 && flat > 0.35, "{ball} {flat}");
    assert!((ball - facets).abs() < 0.05, "{ball} {facets}");
}

#[test]
fn views_use_the_same_mip_level() {
    let far = floor(TextureFilter::Mipmap).pictured(v(0.0, 40.0, 20.0), v(0.0, 0.0, -40.0), 40.0, 8, 8);
    let albedo = grays(&far.clone().viewed(ViewMode::Albedo));
    assert_eq!(albedo, grays(&far));
}

#[test]
fn mipmapped_bounces_match_bilinear_lookups() {
    // A wall lit by a checkerboard floor. Mip levels at the second hit must preserve the mean irradiance.
    let lit = |filter| {
        let (build, kind) = board(filter, 4.0);
        build
            .with(|scene| {
                scene.render.ambient = Vec3::ZERO;
                scene.render.integrator = Integrator::Path;
            })
            .depth(2)
            .environment(1.0)
            .quad(v(-2.0, 0.0, 2.0), v(4.0, 0.0, 0.0), v(0.0, 0.0, -4.0), kind)
            .quad(v(-2.0, 0.0, -2.0), v(4.0, 0.0, 0.0), v(0.0, 4.0, 0.0), matte(0.8))
            .seen(v(0.0, 1.0, 1.0), v(0.1, 0.7, -2.0))
    };
    let [(sharp, a), (mipmapped, b)] = [TextureFilter::Bilinear, TextureFilter::Mipmap]
        .map(|filter| mean_and_error(&lit(filter).values(256, 64)));
    assert!(a.max(b) < 4e-3 * sharp, "{sharp} ± {a}, {mipmapped} ± {b}");
    assert!((sharp - mipmapped).abs() < 4.9 * a.hypot(b) + 2e-3 * sharp, "{sharp} ± {a}, {mipmapped} ± {b}");
}
