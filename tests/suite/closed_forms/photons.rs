//! Light that photons bring, against closed forms and against paths.

use std::f64::consts::PI;
use std::ops::Range;

use glimt::control::{CancelToken, unwatched};
use glimt::film::Rect;
use glimt::integrators::{PhotonMaps, PhotonSettings, Photons, View, render_tile_by};
use glimt::math::DVec3;
use glimt::scene::description::Falloff;

use super::distant::sun;
use super::global::{assert_near, by_paths};
use super::scenes::{Build, emitter, glass, matte, mirror, phong, scene};
use super::{mean_and_error, v};

/// A box of quads with their fronts inside.
fn room(material: impl Fn() -> glimt::scene::description::Material) -> Build {
    let (low, side) = (-1.0, 2.0);
    let (x, y, z) = (v(side, 0.0, 0.0), v(0.0, side, 0.0), v(0.0, 0.0, side));
    let (o, far) = (v(low, low, low), v(low + side, low + side, low + side));
    scene()
        .quad(o, x, y, material())
        .quad(o, y, z, material())
        .quad(o, z, x, material())
        .quad(far, -y, -x, material())
        .quad(far, -z, -y, material())
        .quad(far, -x, -z, material())
        .seen(v(0.1, 0.2, -0.3), v(0.3, -1.0, 0.2))
}

#[test]
fn what_is_stored_in_a_closed_room_is_the_power_and_how_often_photons_arrive_is_known() {
    // Beside what comes straight: Φ·ρ/(1 − ρ), by ρ/(1 − ρ) arrivals of variance ρ/(1 − ρ)².
    for (reflectance, count) in [(0.5_f64, 40_000_u32), (0.8, 40_000)] {
        let lamp = |build: Build| build.point_light(v(0.2, -0.1, 0.3), 1.0, Falloff::Square);
        let build = lamp(room(|| matte(reflectance as f32))).depth(10_000);
        let (world, token) = (build.world(), CancelToken::new());
        let of_photons = PhotonSettings { count, radius: 0.1, bounces: 10_000 };
        let settings = build.photons(count.into(), 0.1).settings(3);
        let (_, pass) =
            Photons::new(&world, &settings, of_photons, &unwatched, &token).expect("nobody cancels");
        let stored = pass.all.photons();
        let flux: f64 = stored.iter().map(|photon| f64::from(photon.flux.x)).sum();
        let (power, often) = (4.0 * PI, reflectance / (1.0 - reflectance));
        let n = f64::from(count);
        let error = (reflectance / (1.0 - reflectance).powi(2) / n).sqrt();
        assert!(
            (flux / power - often).abs() < 4.0 * error,
            "ρ {reflectance}: {} is not {often}",
            flux / power
        );
        let arrivals = stored.len() as f64 / n;
        assert!((arrivals - often).abs() < 4.0 * error, "ρ {reflectance}: {arrivals} is not {often}");
        assert_eq!(pass.emitted, u64::from(count));
        assert!(pass.caustic.is_empty() && stored.iter().all(|photon| photon.depth > 0));
    }
}

#[test]
fn an_integrating_sphere_is_lit_everywhere_alike_by_photons() {
    // R = 1, I = 1 W/sr at x = .5, ρ = .5: indirect irradiance 1; L = ρ/π·(1 + I·cos/d²).
    let sphere = |to: DVec3| {
        let walls = scene().sphere(DVec3::ZERO, 1.0, matte(0.5)).seen(v(0.0, 0.1, 0.0), to);
        walls.point_light(v(0.5, 0.0, 0.0), 1.0, Falloff::Square).depth(60).photons(4000, 0.1)
    };
    for (to, exact) in [(v(1.0, 0.0, 0.0), 0.795_774_715_5), (v(-1.0, 0.0, 0.0), 0.229_890_473_4)] {
        assert_near("integrating sphere", &sphere(to).values(16, 32), exact, 1e-2);
    }
}

#[test]
fn a_furnace_sums_its_bounces_to_the_depth_asked_for() {
    // L = E·(1 + ρ + … + ρᵏ), seen far from the edges, at which a kernel of this radius loses some light.
    let reflectance = 0.5_f64;
    for depth in [0, 1, 2, 3, 8] {
        let build = room(|| phong(reflectance as f32, 0.0, 1.0, 1.0)).depth(depth).photons(20_000, 0.03);
        let exact = (1.0 - reflectance.powi(depth as i32 + 1)) / (1.0 - reflectance);
        let (mean, error) = mean_and_error(&build.values(16, 32));
        assert!(error < 1e-2 * exact, "depth {depth}: {mean} ± {error}");
        assert!(
            (mean - exact).abs() < 4.0 * error + 6e-3 * exact,
            "depth {depth}: {mean} ± {error} is not {exact}"
        );
    }
}

/// A room with a lamp, a mirror ball and a glass ball, seen whole.
fn caustics(depth: u32) -> Build {
    let white = || matte(0.7);
    let mut build = room(white);
    build.scene.objects.remove(3);
    build
        .quad(v(-0.2, 0.95, -0.2), v(0.4, 0.0, 0.0), v(0.0, 0.0, 0.4), emitter(8.0))
        .sphere(v(-0.45, -0.6, -0.3), 0.4, mirror(0.9))
        .sphere(v(0.4, -0.6, 0.2), 0.4, glass(1.5))
        .pictured(v(0.0, 0.0, 3.4), v(0.0, 0.0, 0.0), 38.0, 16, 16)
        .depth(depth)
}

fn mean(picture: &[DVec3]) -> f64 {
    picture.iter().map(|c| c.x).sum::<f64>() / picture.len() as f64
}

#[test]
fn photons_and_paths_see_the_same_light_to_every_depth() {
    for depth in [1, 2, 3, 4, 6] {
        let means = |build: Build, samples, seeds| -> Vec<f64> {
            (0..seeds).map(|seed| mean(&build.picture(samples, seed))).collect()
        };
        let paths = means(by_paths(caustics(depth), depth), 256, 16);
        let photons = means(caustics(depth).photons(20_000, 0.04), 16, 16);
        let ((a, da), (b, db)) = (mean_and_error(&paths), mean_and_error(&photons));
        let error = da.hypot(db);
        assert!(error < 1.2e-2 * a, "depth {depth}: {error} of {a}");
        assert!((a - b).abs() < 4.0 * error + 4e-3 * a, "depth {depth}: {b} ± {db}, by paths {a} ± {da}");
    }
}

#[test]
fn a_ball_lens_throws_the_caustic_that_is_known() {
    // n = 1.5, R = 1, light along the axis, by two surfaces: E/E₀ on the plane z = 3 at two distances from the axis.
    for (distance, exact) in [(0.206_407_1, 0.813_230_5), (0.456_371_9, 0.552_326_4)] {
        let (x, y) = (0.6 * distance, 0.8 * distance);
        let lens = scene()
            .sphere(DVec3::ZERO, 1.0, glass(1.5))
            .quad(v(-0.7, -0.7, 3.0), v(0.0, 1.4, 0.0), v(1.4, 0.0, 0.0), matte(0.5))
            .seen(v(x, y, 2.0), v(x, y, 3.0))
            .depth(3)
            .photons(40_000, 0.07);
        let (mean, error) = mean_and_error(&sun(lens, DVec3::Z, 1.0, 0.0).values(16, 16));
        let exact = exact * 0.5 / PI;
        assert!(error < 0.02 * exact, "{mean} ± {error}");
        assert!(
            (mean - exact).abs() < 4.0 * error + 4e-3 * exact,
            "at {distance}: {mean} ± {error} is not {exact}"
        );
    }
}

#[test]
fn no_light_comes_through_a_wall_without_thickness() {
    // A quad before a lamp and a mirror, which lights it once more.
    let wall = scene().quad(v(-1.0, -1.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), matte(0.8));
    let mirrored = wall.quad(v(-1.0, -1.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), mirror(0.9));
    let lit = mirrored.point_light(v(0.2, 0.3, 0.5), 1.0, Falloff::Square).depth(8).photons(4000, 0.3);
    let caustic = |from: DVec3| {
        let seen = lit.clone().seen(from, v(0.3, -0.4, 0.0)).viewed(View::Caustic);
        seen.picture(4, 1)[0].x
    };
    let (bright, dark) = (caustic(v(0.1, 0.2, 0.9)), caustic(v(0.1, 0.2, -0.9)));
    // At about 1.5 from the lamp's image: 0.8/π·0.9·cos³/1.5².
    assert!(bright > 0.05 && bright < 0.12, "{bright}");
    assert_eq!(dark, 0.0);
}

#[test]
fn the_bits_are_the_same_whatever_the_threads_and_the_cut() {
    let build = caustics(6).photons(5000, 0.0);
    let (world, settings, token) = (build.world(), build.settings(2), CancelToken::new());
    let of_photons = settings.photons.expect("photons are on");
    let maps = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let (photons, _) =
                Photons::new(&world, &settings, of_photons, &unwatched, &token).expect("nobody cancels");
            photons.maps(&world, &settings, 0..4, &token).expect("nobody cancels")
        })
    };
    let all = maps(1);
    for threads in [2, 7] {
        let others = maps(threads);
        for (one, other) in all.passes.iter().zip(&others.passes) {
            assert_eq!(one.all.photons(), other.all.photons());
            assert_eq!(one.caustic.photons(), other.caustic.photons());
            assert_eq!(one.all.radius().to_bits(), other.all.radius().to_bits());
        }
    }
    let render = |maps: &PhotonMaps, rect: Rect, samples: Range<u32>| {
        let tile = render_tile_by(Some(maps), &world, &settings, rect, samples, &token);
        tile.expect("nobody cancels").0.radiance
    };
    let whole = Rect { x: 0, y: 0, width: 16, height: 16 };
    let at_once = render(&all, whole, 0..4);
    // A pass at a time, with its map alone.
    for number in 0..4 {
        let one = PhotonMaps { first: number, passes: vec![all.passes[number as usize].clone()] };
        let own: Vec<_> = at_once.iter().skip(number as usize).step_by(4).copied().collect();
        assert_eq!(render(&one, whole, number..number + 1), own, "pass {number}");
    }
    // Rows of pixels alone.
    for y in 0..16 {
        let row = render(&all, Rect { x: 0, y, width: 16, height: 1 }, 0..4);
        assert_eq!(row, at_once[64 * y as usize..][..64], "row {y}");
    }
}
