//! Projections of the camera, `shift` and `mirror`.

use std::f64::consts::{PI, TAU};

use glimt::integrators::{RenderSettings, ViewMode};
use glimt::math::random::TestRandom;
use glimt::math::{DMat3, DVec2, DVec3, Vec2, Vec3};
use glimt::scene::description::Projection::{Fisheye, Orthographic, Perspective, Spherical};
use glimt::scene::description::{
    Camera, ColorSource, ImageShiftAndMirror, Integrator, MapOrientation, MaterialKind, PhongParameters,
    Projection, RenderOptions, TextureFilter, Wrap,
};
use glimt::world::{self, FilmPosition};

use super::scenes::{Build, emitter, lat_long_sphere, matte, mirror, phong, scene, tinted};
use super::{assert_close, assert_mean, mean_and_error, v};

/// One projection of each kind.
const ALL: [Projection; 4] =
    [Perspective { fov: 60.0 }, Orthographic { view_height: 6.0 }, Spherical, Fisheye { fov: 250.0 }];

/// A camera at the origin that looks along −z.
fn camera(projection: Projection, window: ImageShiftAndMirror) -> Camera {
    let (position, look_at, up) = (DVec3::ZERO, DVec3::NEG_Z, DVec3::Y);
    Camera::LookAt { position, look_at, up, projection, window, aperture: 0.0, focus: 1.0 }
}

fn unshifted(projection: Projection) -> Camera {
    camera(projection, ImageShiftAndMirror::default())
}

fn with_camera(build: Build, camera: Camera, (width, height): (u32, u32)) -> Build {
    build.with(|scene| {
        (scene.render.width, scene.render.height) = (width, height);
        scene.camera = camera;
    })
}

/// Sum of all pixels, one for each of sixteen seeds.
fn sums(build: &Build, samples: u32) -> Vec<f64> {
    (0..16).map(|seed| build.picture(samples, seed).iter().map(|pixel| pixel.x).sum()).collect()
}

/// Integral with the midpoint rule.
fn integral(from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
    let steps = 20_000;
    let step = (to - from) / f64::from(steps);
    (0..steps).map(|i| f(from + (f64::from(i) + 0.5) * step) * step).sum()
}

/// The image of a ball has a known area in pixels.
#[test]
fn ball_silhouettes_have_their_closed_form_areas() {
    let (width, height) = (48_u32, 32_u32);
    let half = f64::from(height) / 2.0;
    let check = |what: &str, projection, ball: DVec3, radius: f64, area: f64| {
        let build = with_camera(scene(), unshifted(projection), (width, height));
        assert_mean(what, &sums(&build.sphere(ball, radius, emitter(1.0)), 16), area, 0.005);
    };
    // A ball of radius 1 at distance 2.5 covers directions up to α from its center.
    let (distance, alpha) = (2.5, 0.4_f64.asin());
    let ahead = v(0.0, 0.0, -distance);
    let radius = half * alpha.tan() / 30.0_f64.to_radians().tan();
    check("perspective", Perspective { fov: 60.0 }, ahead, 1.0, PI * radius * radius);
    for far in [1.5, 2.5, 200.0] {
        let radius = half / 2.0;
        let projection = Orthographic { view_height: 4.0 };
        check("orthographic", projection, v(0.0, 0.0, -far), 1.0, PI * radius * radius);
    }
    // In azimuth and elevation, the edge of the ball is cos(azimuth)·cos(elevation) = cos α.
    let radians = integral(-alpha, alpha, |elevation| 2.0 * (alpha.cos() / elevation.cos()).acos());
    let pixels_per_radian = [f64::from(width) / TAU, f64::from(height) / PI];
    let area = radians * pixels_per_radian[0] * pixels_per_radian[1];
    check("panorama", Spherical, ahead, 1.0, area);
    check("panorama, right quarter", Spherical, v(distance, 0.0, 0.0), 1.0, area);
    let radius = half * alpha / 70.0_f64.to_radians();
    check("fisheye", Fisheye { fov: 140.0 }, ahead, 1.0, PI * radius * radius);
    // A ball behind the camera, at an angle γ from the view axis.
    let gamma = 2.4_f64;
    let width_at = |theta: f64| {
        let cosine = (alpha.cos() - theta.cos() * gamma.cos()) / (theta.sin() * gamma.sin());
        2.0 * cosine.clamp(-1.0, 1.0).acos()
    };
    let scale = half / PI;
    let area = integral(gamma - alpha, gamma + alpha, |theta| theta * width_at(theta)) * scale * scale;
    let behind = v(-gamma.sin(), 0.0, -gamma.cos()) * distance;
    check("fisheye behind", Fisheye { fov: 360.0 }, behind, 1.0, area);
}

#[test]
fn fisheye_is_black_outside_its_circle() {
    let (width, height) = (30, 20);
    let build = with_camera(scene().environment(1.0), unshifted(Fisheye { fov: 360.0 }), (width, height));
    assert_mean("circle", &sums(&build, 16), PI * 100.0, 0.005);
    for (number, pixel) in (0..).zip(build.picture(4, 0)) {
        let [x, y] = [number % width, number / width].map(f64::from);
        let from_center = v((x - 14.5).abs(), (y - 9.5).abs(), 0.0);
        if (from_center - v(0.5, 0.5, 0.0)).length() > 10.0 {
            assert_eq!(pixel, DVec3::ZERO, "{x}, {y}");
        } else if (from_center + v(0.5, 0.5, 0.0)).length() < 10.0 {
            assert_eq!(pixel, DVec3::ONE, "{x}, {y}");
        }
    }
    // Views of first hits are also black there.
    let inside = scene().sphere(DVec3::ZERO, 3.0, matte(0.5)).viewed(ViewMode::Depth);
    let corner = with_camera(inside, unshifted(Fisheye { fov: 360.0 }), (width, height)).picture(4, 0)[0];
    assert_eq!(corner, DVec3::ZERO);
}

fn world_camera(camera: &Camera) -> world::Camera {
    world::Camera::from_description(camera, None)
}

/// Direction of the ray at an offset from the image center, in units of half the image height.
fn direction(camera: &Camera, x: f64, y: f64) -> DVec3 {
    let film = FilmPosition { offset: DVec2::new(x, y), half_width: 2.0 };
    world_camera(camera).ray(film, Vec2::ZERO).expect("a ray").direction.as_dvec3()
}

#[test]
fn fisheye_angles_are_linear_in_the_radius() {
    for fov in [1e-3, 90.0, 180.0, 360.0_f64] {
        let fisheye = unshifted(Fisheye { fov });
        for step in 0..=20 {
            let (radius, around) = (f64::from(step) / 20.0, f64::from(step) * 0.7);
            let (x, y) = (radius * around.cos(), radius * around.sin());
            let found = direction(&fisheye, x * (1.0 - 1e-12), y * (1.0 - 1e-12));
            let angle = radius * 0.5 * fov.to_radians();
            let expected = v(angle.sin() * around.cos(), angle.sin() * around.sin(), -angle.cos());
            assert!((found - expected).length() < 2e-7, "{fov} {radius}: {found} {expected}");
        }
    }
}

#[test]
fn panorama_directions_match_environment_maps() {
    let panorama = unshifted(Spherical);
    let mut random = TestRandom::new(3);
    for _ in 0..500 {
        let (u, w) = (random.unit(), random.unit());
        let (azimuth, polar) = ((u - 0.5) * TAU, w * PI);
        let expected = v(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos());
        // The image is twice as wide as high.
        let found = direction(&panorama, (u - 0.5) * 4.0, (0.5 - w) * 2.0);
        assert!((found - expected).length() < 2e-7, "{u} {w}: {found} {expected}");
    }
}

/// A panorama of an environment map is the map, filtered: pixels average the bilinear interpolation with
/// weights 1, 6 and 1 along both axes.
#[test]
fn panorama_reproduces_an_environment_map() {
    let (width, height) = (12_usize, 6_usize);
    let mut random = TestRandom::new(5);
    let texels: Vec<f64> = (0..width * height).map(|_| (random.unit() as f32).into()).collect();
    let at = |x: usize, y: isize, step: usize| {
        texels[y.clamp(0, height as isize - 1) as usize * width + (x + width + step - 1) % width]
    };
    let rotation = DMat3::from_axis_angle(v(1.0, 2.0, -2.0).normalize(), 2.0);
    for (what, orientation, axes) in [
        ("upright", MapOrientation::Turn(0.0), DMat3::IDENTITY),
        ("rotated", MapOrientation::Rotation(rotation), rotation),
    ] {
        let position = v(3.0, -1.0, 2.0);
        let camera = Camera::LookAt {
            position,
            look_at: position + axes * DVec3::NEG_Z,
            up: axes * DVec3::Y,
            projection: Spherical,
            window: ImageShiftAndMirror::default(),
            aperture: 0.0,
            focus: 1.0,
        };
        let gray = texels.iter().map(|value| Vec3::splat(*value as f32)).collect();
        let build = scene().oriented_sky(width as u32, gray, orientation);
        let build = with_camera(build, camera, (width as u32, height as u32));
        let pictures: Vec<Vec<DVec3>> = (0..16).map(|seed| build.picture(64, seed)).collect();
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let row = |dy: isize| {
                (at(x, y as isize + dy, 0) + 6.0 * at(x, y as isize + dy, 1) + at(x, y as isize + dy, 2))
                    / 8.0
            };
            let expected = (row(-1) + 6.0 * row(0) + row(1)) / 8.0;
            let values: Vec<f64> = pictures.iter().map(|picture| picture[y * width + x].x).collect();
            let (mean, error) = mean_and_error(&values);
            assert!(error < 2e-3, "{what} {x}, {y}: {error}");
            assert!(
                (mean - expected).abs() < 5.0 * error + 1e-5,
                "{what} {x}, {y}: {mean} ± {error}, {expected}"
            );
        }
    }
}

/// A scene with a texture-free room, glossy and mirroring balls, and an area light.
fn room() -> Build {
    scene()
        .quad(v(-5.0, -2.0, 5.0), v(10.0, 0.0, 0.0), v(0.0, 0.0, -10.0), matte(0.6))
        .sphere(v(0.7, 0.2, -3.0), 0.8, phong(0.4, 0.4, 30.0, 0.0))
        .sphere(v(-1.2, -0.3, -2.5), 0.6, mirror(0.9))
        .sphere(v(1.0, 0.5, 3.0), 0.7, matte(0.3))
        .quad(v(-1.0, 3.0, -4.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, 2.0), emitter(9.0))
        .environment(0.2)
}

#[test]
fn mirrored_images_are_flipped_exactly() {
    let (width, height) = (37, 12);
    for projection in ALL {
        let shown = |mirror| {
            let shift = DVec2::new(0.3, -0.1);
            let mut camera = camera(projection, ImageShiftAndMirror { shift, mirror });
            if let Camera::LookAt { aperture, focus, .. } = &mut camera {
                (*aperture, *focus) = (if projection.supports_depth_of_field() { 0.1 } else { 0.0 }, 3.0);
            }
            let build = with_camera(room(), camera, (width, height));
            build.with(|scene| (scene.render.integrator, scene.render.max_depth) = (Integrator::Path, 3))
        };
        for samples in [3, 17] {
            let [plain, mirrored] = [false, true].map(|mirror| shown(mirror).picture(samples, 1));
            for (row, of_mirrored) in plain.chunks(37).zip(mirrored.chunks(37)) {
                assert!(row.iter().rev().eq(of_mirrored), "{projection:?}");
            }
            assert_ne!(plain, mirrored);
        }
    }
}

/// A shifted image is a crop of a larger image, in which a pixel has the same size.
#[test]
fn shifted_image_is_a_crop_of_a_larger_one() {
    let (shift, scale) = (DVec2::new(0.4, -0.25), 3.0);
    let tangent = |fov: f64| (0.5_f64 * fov.to_radians()).tan();
    for (projection, larger) in [
        (Perspective { fov: 50.0 }, Perspective { fov: 2.0 * (scale * tangent(50.0)).atan().to_degrees() }),
        (Orthographic { view_height: 2.0 }, Orthographic { view_height: 2.0 * scale }),
        (Fisheye { fov: 60.0 }, Fisheye { fov: 60.0 * scale }),
    ] {
        let [small, large] =
            [camera(projection, ImageShiftAndMirror { shift, mirror: false }), unshifted(larger)]
                .map(|it| world_camera(&it));
        // All of these are in the circle of the shifted fisheye.
        for (x, y) in [(0.0, 0.0), (-0.4, 0.9), (0.05, 0.1), (0.15, 0.4)] {
            let place = DVec2::new(x, y);
            let ray = |camera: &world::Camera, offset| {
                camera.ray(FilmPosition { offset, half_width: 1.5 }, Vec2::ZERO).expect("a ray")
            };
            let (one, other) = (ray(&small, place), ray(&large, (place + 2.0 * shift) / scale));
            assert!((one.direction - other.direction).length() < 1e-6, "{projection:?}");
            assert!((one.origin - other.origin).length() < 1e-6, "{projection:?}");
        }
    }
    // A panorama that is shifted by its width looks the same, and by a quarter of it, it is turned.
    let film = |x: f64| FilmPosition { offset: DVec2::new(x, 0.3), half_width: 1.5 };
    let shifted = |x: f64| {
        let window = ImageShiftAndMirror { shift: DVec2::new(x, 0.0), mirror: false };
        world_camera(&camera(Spherical, window)).ray(film(0.2), Vec2::ZERO).expect("a ray").direction
    };
    assert!((shifted(1.5) - shifted(0.0)).length() < 1e-6);
    let Vec3 { x, y, z } = shifted(0.0);
    assert!((shifted(0.375) - Vec3::new(-z, y, x)).length() < 1e-6);
}

/// Where all samples of a pixel show the same ball, the ray through the pixel's center hits that ball.
#[test]
fn clicks_hit_the_object_shown_at_the_pixel() {
    let mut random = TestRandom::new(8);
    let places: Vec<DVec3> = (0..24).map(|_| random.direction() * (2.0 + 2.0 * random.unit())).collect();
    // Square roots of primes: no mean of several radiances and black equals another radiance.
    let primes = (2_u32..).filter(|n| (2..*n).all(|divisor| n % divisor != 0));
    let primes: Vec<u32> = primes.take(places.len()).collect();
    let radiance = |number: usize| (primes[number] as f32).sqrt();
    let balls = places.iter().enumerate();
    let balls =
        balls.fold(scene(), |build, (number, place)| build.sphere(*place, 0.9, emitter(radiance(number))));
    let (width, height) = (40_u32, 20_u32);
    for projection in ALL {
        for (shift, mirror) in [(DVec2::ZERO, false), (DVec2::new(0.2, 0.1), true)] {
            let camera = camera(projection, ImageShiftAndMirror { shift, mirror });
            let build = with_camera(balls.clone(), camera, (width, height));
            let (world, settings) = (build.world(), build.settings(0));
            let mut checked = 0;
            for (number, pixel) in (0..).zip(build.picture(16, 0)) {
                let shown = (0..places.len()).find(|ball| f64::from(radiance(*ball)) == pixel.x);
                let ray = settings.ray_through_pixel(&world.camera, [number % width, number / width]);
                let hit = ray.and_then(|ray| world.geometry.closest_hit(&ray)).map(|hit| hit.object as usize);
                if shown.is_some() {
                    assert_eq!(hit, shown, "{projection:?} {mirror} {number}");
                    checked += 1;
                }
            }
            assert!(checked > 30, "{projection:?}: {checked}");
        }
    }
}

#[test]
fn panorama_depth_is_distance_from_camera() {
    let room = scene().sphere(DVec3::ZERO, 3.0, matte(0.5)).viewed(ViewMode::Depth);
    for (projection, expected) in [
        (Spherical, 3.0..3.0),
        (Fisheye { fov: 300.0 }, 3.0..3.0),
        (Perspective { fov: 60.0 }, 2.0..3.0),
        (Orthographic { view_height: 2.0 }, 2.5..3.0),
    ] {
        let values = with_camera(room.clone(), unshifted(projection), (8, 8)).picture(1, 0);
        for value in values.into_iter().map(|pixel| pixel.x).filter(|depth| *depth > 0.0) {
            let is_right = value > expected.start - 1e-5 && value < expected.end + 1e-5;
            assert!(is_right, "{projection:?}: {value}");
        }
    }
}

/// The footprint of a pixel, and with it the mip level, does not depend on the distance.
#[test]
fn orthographic_footprints_ignore_distance() {
    let mut build = scene().with(|scene| scene.render.ambient = Vec3::ONE);
    let rows: Vec<Vec<Vec3>> =
        (0..32).map(|y| (0..32).map(|x| Vec3::splat(((x / 16 + y / 16) % 2) as f32)).collect()).collect();
    let rows: Vec<&[Vec3]> = rows.iter().map(Vec::as_slice).collect();
    let texture = build.texture(&rows, TextureFilter::Mipmap, Wrap::Repeat, Vec2::splat(200.0));
    let mut board = phong(0.0, 0.0, 1.0, 0.0);
    if let MaterialKind::Phong(PhongParameters { diffuse, .. }) = &mut board.kind {
        *diffuse = ColorSource::Texture(texture);
    }
    let build = build.quad(v(-100.0, 0.0, 0.0), v(200.0, 0.0, 0.0), v(0.0, 0.0, -200.0), board);
    for distance in [0.1, 10.0, 1000.0] {
        let contrast = |view_height: f64| {
            let camera = Camera::LookAt {
                position: v(0.25, distance, -50.25),
                look_at: v(0.25, 0.0, -50.25),
                up: DVec3::X,
                projection: Orthographic { view_height },
                window: ImageShiftAndMirror::default(),
                aperture: 0.0,
                focus: distance,
            };
            (with_camera(build.clone(), camera, (1, 1)).value() - 0.5).abs()
        };
        assert_eq!(contrast(1e-3), 0.5, "{distance}");
        assert!(contrast(4.0) < 1e-3, "{distance}: {}", contrast(4.0));
    }
}

/// Parallel rays that start inside glass are tinted, whether they leave it or end at a light inside. Rays
/// that start in air are not.
#[test]
fn parallel_rays_can_start_in_glass() {
    let gray = || tinted(1.0, DVec3::splat(0.5));
    let center = v(1.5, 0.0, 0.0);
    let mesh = lat_long_sphere(64, 128, 1.0, center);
    for (what, build) in [
        ("shape", scene().sphere(center, 1.0, gray())),
        ("mesh", scene().mesh(mesh, [DVec3::ONE, DVec3::ZERO, DVec3::ZERO], gray())),
    ] {
        let build = build.environment(1.0);
        let with_lamp =
            build.clone().quad(v(0.6, -0.05, -0.25), 1.8 * DVec3::X, 0.1 * DVec3::Y, emitter(1.0));
        let seen = |build: &Build, x: f64| {
            let shift = DVec2::new(x * 1000.0, 0.0);
            let camera =
                camera(Orthographic { view_height: 1e-3 }, ImageShiftAndMirror { shift, mirror: false });
            with_camera(build.clone(), camera, (1, 1)).value()
        };
        for x in [1.2, 1.5, 2.1_f64] {
            let to_surface = (1.0 - (x - 1.5).powi(2)).sqrt();
            for (build, inside) in [(&build, to_surface), (&with_lamp, 0.25)] {
                let (found, expected) = (seen(build, x), 0.5_f64.powf(inside));
                assert!((found - expected).abs() < 2e-3, "{what} at {x}: {found} {expected}");
            }
        }
        assert_close(what, seen(&build, -1.5), 1.0);
        assert_close(what, seen(&build, 0.4), 1.0);
    }
}

/// Powers of two scale without rounding.
#[test]
fn gain_scales_light_but_not_data() {
    for (view, factor) in [
        (ViewMode::Beauty, 4.0),
        (ViewMode::Diffuse, 4.0),
        (ViewMode::Specular, 4.0),
        (ViewMode::Emission, 4.0),
        (ViewMode::Depth, 1.0),
        (ViewMode::Normal, 1.0),
        (ViewMode::Albedo, 1.0),
        (ViewMode::Shadow, 1.0),
        (ViewMode::Cost, 1.0),
    ] {
        let shown = |gain: f32| {
            let build = with_camera(room(), unshifted(Perspective { fov: 60.0 }), (16, 12)).viewed(view);
            build.with(|scene| scene.render.gain = gain).picture(3, 2)
        };
        let (plain, scaled) = (shown(1.0), shown(4.0));
        assert!(plain.iter().any(|pixel| *pixel != DVec3::ZERO), "{view:?}");
        assert!(plain.iter().map(|pixel| *pixel * factor).eq(scaled), "{view:?}");
    }
}

/// A ray through a lens point passes through the pinhole ray's point on the plane of focus.
#[test]
fn orthographic_defocus_is_linear_in_depth() {
    let mut orthographic = unshifted(Orthographic { view_height: 4.0 });
    if let Camera::LookAt { aperture, focus, .. } = &mut orthographic {
        (*aperture, *focus) = (0.2, 5.0);
    }
    let (camera, film) =
        (world_camera(&orthographic), FilmPosition { offset: DVec2::new(0.5, -0.2), half_width: 1.0 });
    let at = |lens, distance: f64| {
        let ray = camera.ray(film, lens).expect("a ray");
        let (origin, along) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        origin + along * (-distance / along.z)
    };
    for distance in [0.0, 2.5, 5.0, 20.0] {
        let across = at(Vec2::X, distance) - at(Vec2::NEG_X, distance);
        assert!((across.x - 0.4 * (1.0 - distance / 5.0)).abs() < 1e-5, "{distance}: {across}");
        let middle = at(Vec2::ZERO, distance);
        assert!((middle - v(1.0, -0.4, -distance)).length() < 1e-5, "{middle}");
    }
}

/// The whole image has the same rays as a smaller or larger version of it.
#[test]
fn pixel_positions_scale_with_the_image() {
    let position = |width, height, x, y| {
        let settings = scene().settings(0);
        let render = RenderOptions { width, height, ..settings.render };
        RenderSettings { render, ..settings }.film_position_from_pixel(DVec2::new(x, y))
    };
    assert_eq!(position(60, 40, 15.0, 30.0), position(30, 20, 7.5, 15.0));
    assert_eq!(position(60, 40, 60.0, 0.0).offset, DVec2::new(1.5, 1.0));
    assert_eq!(position(60, 40, 60.0, 0.0).half_width, 1.5);
}
