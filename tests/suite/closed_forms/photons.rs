//! Light that photons bring, against closed forms and against paths.

use std::f64::consts::PI;

use glimt::control::{CancelToken, unwatched};
use glimt::integrators::{PhotonSettings, Photons};
use glimt::math::DVec3;
use glimt::scene::description::Falloff;

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
        let (_, pass) = Photons::new(&world, &settings, of_photons, &unwatched, &token).expect("nobody cancels");
        let stored = pass.all.photons();
        let flux: f64 = stored.iter().map(|photon| f64::from(photon.flux.x)).sum();
        let (power, often) = (4.0 * PI, reflectance / (1.0 - reflectance));
        let n = f64::from(count);
        let error = (reflectance / (1.0 - reflectance).powi(2) / n).sqrt();
        assert!((flux / power - often).abs() < 4.0 * error, "ρ {reflectance}: {} is not {often}", flux / power);
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
        assert!((mean - exact).abs() < 4.0 * error + 6e-3 * exact, "depth {depth}: {mean} ± {error} is not {exact}");
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
