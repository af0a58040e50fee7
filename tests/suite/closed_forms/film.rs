//! Film: filter weights and the error estimate.

use glimt::choice::Choice;
use glimt::control::CancelToken;
use glimt::film::Film;
use glimt::integrators::render_tile;
use glimt::scene::description::light::Falloff;
use glimt::scene::description::{PixelFilter, RenderOptions};
use glimt::world::World;

use super::scenes::{Build, emitter, matte, scene};
use super::v;

/// Adds samples `from..to` of every pixel to a film.
fn add_samples(film: &Film, world: &World, build: &Build, seed: u32, from: u32, to: u32) {
    for tile in 0..film.tile_count() {
        let rect = film.tile_rect(tile).expect("a tile");
        let done = render_tile(world, &build.settings(seed), rect, from..to, &CancelToken::new());
        film.add_samples(tile, done.expect("the token is not canceled").0);
    }
}

fn film(build: &Build) -> Film {
    let RenderOptions { width, height, .. } = build.scene.render;
    Film::new(width, height, None).expect("a film")
}

#[test]
fn filters_preserve_a_constant_image() {
    for &filter in PixelFilter::ALL {
        for samples in [1, 4, 16, 64] {
            let build = scene().background(0.7).pictured(v(0.0, 0.0, 0.0), v(0.0, 0.0, -1.0), 40.0, 40, 33);
            let build = build.with(|scene| scene.render.filter = filter);
            let film = film(&build);
            add_samples(&film, &build.world(), &build, 3, 0, samples);
            for pixel in film.radiance_image().pixels {
                let off = (pixel - 0.7).abs().max_element();
                assert!(off <= 0.7e-5, "{filter:?}, {samples} samples: {pixel}");
            }
        }
    }
}

/// A room with penumbras: walls, a light under the ceiling and a box.
fn room() -> Build {
    let (x, y, z) = (v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), v(0.0, 0.0, 2.0));
    scene()
        .quad(v(-1.0, 0.0, 1.0), x, -z, matte(0.7))
        .quad(v(-1.0, 0.0, -1.0), x, y, matte(0.7))
        .quad(v(-1.0, 0.0, 1.0), -z, y, matte(0.5))
        .quad(v(1.0, 0.0, -1.0), z, y, matte(0.4))
        .quad(v(-0.3, 1.98, -0.3), v(0.6, 0.0, 0.0), v(0.0, 0.0, 0.6), emitter(15.0))
        .cuboid(v(-0.3, 0.6, -0.3), v(0.6, 1.2, 0.6), v(0.0, 18.0, 0.0), matte(0.7))
        .pictured(v(0.0, 1.0, 4.4), v(0.0, 1.0, 0.0), 34.0, 24, 24)
}

/// A scene with only sharp edges: balls under a point light.
fn balls() -> Build {
    let ball = |build: Build, x: f64, z: f64, r: f64| build.sphere(v(x, r, z), r, matte(0.6));
    let floor = scene().quad(v(-9.0, 0.0, 9.0), v(18.0, 0.0, 0.0), v(0.0, 0.0, -18.0), matte(0.6));
    let three = ball(ball(ball(floor, -1.4, 0.0, 0.7), 0.2, -0.8, 0.9), 1.5, 0.5, 0.5);
    three.point_light(v(2.5, 5.0, 3.0), 60.0, Falloff::Square).pictured(
        v(0.0, 2.2, 6.0),
        v(0.0, 0.7, 0.0),
        40.0,
        24,
        24,
    )
}

#[test]
fn error_estimate_matches_spread_over_seeds() {
    const SEEDS: u32 = 16;
    for (name, build) in [("room", room()), ("balls", balls())] {
        let world = build.world();
        let films: Vec<Film> = (0..SEEDS).map(|_| film(&build)).collect();
        let mut done = 0;
        for samples in [16, 64, 256, 1024] {
            for (film, seed) in films.iter().zip(1..) {
                add_samples(film, &world, &build, seed, done, samples);
            }
            done = samples;
            // The variance of a pixel over seeds requires no reference image.
            let luminance = |film: &Film| -> Vec<f64> {
                let color = |c: &glimt::math::Vec3| glimt::math::color::luminance(*c).into();
                film.radiance_image().pixels.iter().map(color).collect()
            };
            let pictures: Vec<Vec<f64>> = films.iter().map(luminance).collect();
            let (pixels, count) = (pictures[0].len(), f64::from(SEEDS));
            let mean = |pixel: usize| pictures.iter().map(|picture| picture[pixel]).sum::<f64>() / count;
            let means: Vec<f64> = (0..pixels).map(mean).collect();
            let squares: f64 = pictures
                .iter()
                .flat_map(|picture| picture.iter().zip(&means))
                .map(|(x, m)| (x - m).powi(2))
                .sum();
            let variance = squares / (count - 1.0) / pixels as f64;
            let truth = variance.sqrt() / (means.iter().sum::<f64>() / pixels as f64);
            let ratios: Vec<f64> =
                films.iter().map(|film| film.relative_error().expect("an estimate") / truth).collect();
            eprintln!("{name}, {samples} samples, {truth:.1e}: {ratios:.2?}");
            let rms = (ratios.iter().map(|ratio| ratio * ratio).sum::<f64>() / count).sqrt();
            // In an image this small, the last doubling of the sample count may reduce the error more than
            // earlier doublings predict.
            let most = if samples > 256 { 1.5 } else { 1.35 };
            assert!((0.9..=most).contains(&rms), "{name}, {samples} samples: {rms:.2}");
            let outside = |least, most| ratios.iter().filter(move |ratio| !(least..=most).contains(*ratio));
            assert!(outside(0.5, 2.0).count() <= 2, "{name}, {samples} samples");
            assert_eq!(outside(0.5, 2.1).next(), None, "{name}, {samples} samples");
        }
    }
}
