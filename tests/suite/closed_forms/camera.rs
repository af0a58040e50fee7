//! Camera: projection and circle of confusion.

use glimt::film::Rect;
use glimt::integrators::RenderSettings;
use glimt::math::random::TestRandom;
use glimt::math::{DVec2, DVec3, Vec2};
use glimt::scene::description::{Camera, ImageShiftAndMirror, Projection, RenderOptions};
use glimt::world::FilmPosition;

use super::scenes::{emitter, scene, tile};
use super::{assert_close, assert_mean, v};

/// A camera looking along −z, with aperture 0.2, focal distance 5, and a field of view of 40° over 480
/// pixels.
fn lens() -> Camera {
    Camera::LookAt {
        position: DVec3::ZERO,
        look_at: v(0.0, 0.0, -5.0),
        up: DVec3::Y,
        projection: Projection::Perspective { fov: 40.0 },
        window: ImageShiftAndMirror::default(),
        aperture: 0.1,
        focus: 5.0,
    }
}

const SIZE: u32 = 480;

/// Pixels per unit length at distance d.
fn pixels_per_length(d: f64) -> f64 {
    f64::from(SIZE) / (2.0 * d * 20.0_f64.to_radians().tan())
}

#[test]
fn rays_pass_through_projected_points() {
    let mut random = TestRandom::new(1);
    for _ in 0..200 {
        let (position, target) = (random.direction() * 7.0, random.direction() * 2.0);
        let (up, fov) = (random.direction(), 20.0 + 80.0 * random.unit());
        let build = scene().with(|scene| {
            let (projection, window) = (Projection::Perspective { fov }, ImageShiftAndMirror::default());
            scene.camera = Camera::LookAt {
                position,
                look_at: target,
                up,
                projection,
                window,
                aperture: 0.0,
                focus: 1.0,
            };
        });
        let camera = build.world().camera;
        // The textbook view matrix with rows s, u, −f, followed by perspective division.
        let f = (target - position).normalize();
        let s = f.cross(up).normalize();
        let u = s.cross(f);
        let point = target + random.direction() * 2.0;
        let eye = v(s.dot(point - position), u.dot(point - position), f.dot(point - position));
        let scale = 1.0 / (0.5 * fov.to_radians()).tan();
        let ndc = DVec2::new(eye.x * scale * 200.0 / 333.0 / eye.z, eye.y * scale / eye.z);
        let settings = build.settings(0);
        let render = RenderOptions { width: 333, height: 200, ..settings.render };
        let settings = RenderSettings { render, ..settings };
        let pixel = DVec2::new((ndc.x + 1.0) / 2.0 * 333.0, (1.0 - ndc.y) / 2.0 * 200.0);
        let ray = camera.ray(settings.film_position_from_pixel(pixel), Vec2::ZERO).expect("a ray");
        let along = (point - ray.origin.as_dvec3()).normalize();
        assert!((along - ray.direction.as_dvec3()).length() < 1e-6, "{point} is not on its ray");
        assert_close("depth", camera.depth_of(point), eye.z);
    }
}

#[test]
fn circle_of_confusion_diameter_is_exact() {
    // A point at distance d is blurred over A·|d − d_f|/d on the focal plane. Convert to pixels at that
    // distance.
    let camera = scene().with(|scene| scene.camera = lens()).world().camera;
    for (d, exact) in [(10.0, 13.187_9), (2.5, 26.375_8)] {
        let formula = 0.2 * f64::abs(d - 5.0) / d * pixels_per_length(5.0);
        assert!((formula - exact).abs() < 1e-4);
        // Intersect a ray through the center pixel and a lens point with the plane at d, and convert to
        // pixels at d.
        let mut extent = DVec3::ZERO;
        for step in 0..3600 {
            let (sin, cos) = (f64::from(step) / 1800.0 * std::f64::consts::PI).sin_cos();
            let film = FilmPosition { offset: DVec2::ZERO, half_width: 1.0 };
            let ray = camera.ray(film, Vec2::new(cos as f32, sin as f32)).expect("a ray");
            let (o, k) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
            extent = extent.max((o + k * ((-d - o.z) / k.z)) * 2.0 * pixels_per_length(d));
        }
        assert_close(&format!("diameter at {d}"), extent.x, formula);
        assert_close(&format!("down at {d}"), extent.y, formula);
    }
}

#[test]
fn small_light_has_analytic_blur_variance() {
    // The light's image is the convolution disk ∗ square ∗ pixel. The variance along an axis is D²/16 + s²/12
    // + 1/12, and the sum of all pixels is s².
    for (d, diameter) in [(10.0, 13.187_9), (2.5, 26.375_8)] {
        let s = 3.0 / pixels_per_length(d);
        let build = scene().quad(v(-s / 2.0, -s / 2.0, -d), v(s, 0.0, 0.0), v(0.0, s, 0.0), emitter(1.0));
        let build = build.with(|scene| {
            scene.camera = lens();
            (scene.render.width, scene.render.height) = (SIZE, SIZE);
        });
        let world = build.world();
        let half = (diameter / 2.0) as u32 + 4;
        let rect = Rect { x: 240 - half, y: 240 - half, width: 2 * half, height: 2 * half };
        let (mut sums, mut variances) = (Vec::new(), Vec::new());
        for seed in 0..16 {
            let pixels = tile(&world, &build.settings(seed), rect, 64);
            let places = (0_u32..).zip(&pixels);
            let offset = |i: u32| f64::from(i % (2 * half)) + 0.5 - f64::from(half);
            sums.push(pixels.iter().map(|pixel| pixel.x).sum());
            variances.push(places.map(|(i, pixel)| pixel.x * offset(i).powi(2)).sum::<f64>() / 9.0);
        }
        assert_mean(&format!("light at {d}"), &sums, 9.0, 0.02);
        let exact: f64 = diameter * diameter / 16.0 + 9.0 / 12.0 + 1.0 / 12.0;
        assert_mean(&format!("variance at {d}"), &variances, exact, 0.02);
    }
}
