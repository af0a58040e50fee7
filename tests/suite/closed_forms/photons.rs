//! Photon mapping against closed forms and path tracing.

use std::f64::consts::PI;
use std::ops::Range;

use glimt::control::{CancelToken, ignore_progress};
use glimt::film::Rect;
use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::{
    PhotonMap, PhotonPassTracer, PhotonPassesBySample, PhotonSettings, ViewMode, render_tile_with_photons,
};
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::Shape;
use glimt::scene::description::light::Falloff;

use super::distant::sun;
use super::glass::boxes;
use super::global::path_traced;
use super::scenes::{Build, IDENTITY_PLACEMENT, emitter, file_material, glass, matte, mirror, phong, scene};
use super::{assert_mean, mean_and_error, v};

/// A box of inward-facing quads.
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

/// A point light in the center of a small glass ball, so that all light arrives through glass, without
/// refraction. Radiance in glass is divided by n²; outside, the intensity is 1.
fn in_glass(build: Build, at: DVec3) -> Build {
    build.point_light(at, 1.0 / (1.5 * 1.5), Falloff::Square).sphere(at, 0.05, glass(1.5))
}

#[test]
fn stored_photons_carry_emitted_power() {
    // The entire power Φ arrives through glass, and every photon is stored once. The walls reflect a fraction
    // ρ of the photons and of Φ, with variance ρ·(1 − ρ).
    for (reflectance, count) in [(0.5_f64, 40_000_u32), (0.8, 40_000)] {
        let build = in_glass(room(|| matte(reflectance as f32)), v(0.2, -0.1, 0.3)).depth(10_000);
        let (world, token) = (build.world(), CancelToken::new());
        let of_photons = PhotonSettings { count, radius: 0.1, bounces: 10_000 };
        let settings = build.photons(count.into(), 0.1).settings(3);
        let (_, pass) = PhotonPassTracer::new_and_trace_first_pass(
            &world,
            &settings,
            of_photons,
            &ignore_progress,
            &token,
        )
        .expect("the token is not canceled");
        let (power, n) = (4.0 * PI, f64::from(count));
        let flux = |map: &PhotonMap| map.iter_photons().map(|photon| f64::from(photon.flux.x)).sum::<f64>();
        let error = (reflectance * (1.0 - reflectance) / n).sqrt();
        let [caustic, bounced] =
            [&pass.caustic, &pass.bounced].map(|map| (flux(map) / power, map.len() as f64 / n));
        assert!((caustic.0 - 1.0).abs() < 1e-3, "ρ {reflectance}: {}", caustic.0);
        assert!((caustic.1 - 1.0).abs() < 1e-3, "ρ {reflectance}: {}", caustic.1);
        assert!((bounced.0 - reflectance).abs() < 4.0 * error, "ρ {reflectance}: {}", bounced.0);
        assert!((bounced.1 - reflectance).abs() < 4.0 * error, "ρ {reflectance}: {}", bounced.1);
        assert_eq!(pass.emitted, u64::from(count));
        assert!(pass.caustic.iter_photons().all(|photon| photon.depth > 0));
    }
}

#[test]
fn no_photons_without_mirrors_or_glass() {
    let build = room(|| matte(0.5)).point_light(v(0.2, -0.1, 0.3), 1.0, Falloff::Square).photons(100, 0.1);
    let (world, settings, token) = (build.world(), build.settings(1), CancelToken::new());
    let of_photons = settings.photons.expect("photons are on");
    let (photons, pass) =
        PhotonPassTracer::new_and_trace_first_pass(&world, &settings, of_photons, &ignore_progress, &token)
            .expect("the token is not canceled");
    assert!(!photons.emits_photons());
    assert_eq!((pass.emitted, pass.stored_photon_count()), (0, 0));
}

#[test]
fn integrating_sphere_has_uniform_photon_light() {
    // R = 1, ρ = 0.5, and I = 1 W/sr at x = 0.5. The indirect irradiance is 1, so L = ρ/π·(1 + I·cos/d²).
    // Camera paths find the bare light, photons the light in glass.
    let at = v(0.5, 0.0, 0.0);
    // Use the largest kernel radius that the variation of irradiance allows.
    for (to, exact, radius) in
        [(v(1.0, 0.0, 0.0), 0.795_774_715_5, 0.06), (v(-1.0, 0.0, 0.0), 0.229_890_473_4, 0.16)]
    {
        let walls = scene().sphere(DVec3::ZERO, 1.0, matte(0.5)).seen(v(0.0, 0.4, 0.0), to).depth(60);
        let bare = walls.clone().point_light(at, 1.0, Falloff::Square).photons(4000, 0.1);
        assert_mean("a bare light", &bare.values(16, 32), exact, 1e-2);
        let wrapped = in_glass(walls, at).photons(12_000, radius);
        assert_mean("a light in glass", &wrapped.values(16, 32), exact, 1e-2);
    }
}

#[test]
fn photon_furnace_sums_bounces_up_to_depth() {
    // L = E·(1 + ρ + … + ρᵏ).
    let reflectance = 0.5_f64;
    for depth in [0, 1, 2, 3, 8] {
        let build = room(|| phong(reflectance as f32, 0.0, 1.0, 1.0)).depth(depth).photons(20_000, 0.03);
        let exact = (1.0 - reflectance.powi(depth as i32 + 1)) / (1.0 - reflectance);
        assert_mean(&format!("depth {depth}"), &build.values(16, 32), exact, 1e-2);
    }
}

#[test]
fn furnace_with_emitter_in_glass_is_uniform() {
    // Every surface emits 1 − ρ and reflects ρ, so the radiance is 1 everywhere. The ball in the glass has ρ
    // = 0. Photons carry a third of the energy, from this ball through the glass.
    let reflectance = 0.9;
    let furnace = room(|| phong(reflectance, 0.0, 1.0, 1.0 - reflectance))
        .sphere(v(0.0, 0.0, -0.4), 0.2, emitter(1.0))
        .sphere(v(0.0, 0.0, -0.4), 0.35, glass(1.5))
        .pictured(v(0.1, 0.2, 0.6), v(0.3, -1.0, 0.4), 20.0, 8, 8)
        .depth(400);
    for build in [furnace.clone().photons(10_000, 0.03), path_traced(furnace, 400)] {
        let (mean, error) = mean_and_error(&build.mean_reds(10));
        assert!(error < 1e-2, "{mean} ± {error}");
        assert!((mean - 1.0).abs() < 4.0 * error + 2e-3, "{mean} ± {error}");
    }
}

/// A view of a whole room with an area light, a mirror ball and a glass ball.
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

/// A room with a glossy floor and a mirror ball, lit only by a light inside glass.
fn only_caustics(depth: u32) -> Build {
    let mut build = room(|| matte(0.7));
    build.scene.objects.remove(3);
    build
        .quad(v(-1.0, -0.9, 1.0), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), phong(0.3, 0.5, 20.0, 0.0))
        .sphere(v(0.3, 0.4, 0.0), 0.25, emitter(4.0))
        .sphere(v(0.3, 0.4, 0.0), 0.4, glass(1.5))
        .sphere(v(-0.5, -0.4, -0.2), 0.3, mirror(0.9))
        .pictured(v(0.0, 0.0, 3.4), v(0.0, 0.0, 0.0), 38.0, 16, 16)
        .depth(depth)
}

/// Means and standard errors of path-traced and photon-mapped images.
pub fn path_and_photon_means(
    build: &Build,
    depth: u32,
    samples: [u32; 2],
    (count, radius): (u64, f64),
) -> [(f64, f64); 2] {
    let means = |build: &Build, samples| mean_and_error(&build.mean_reds(samples));
    let by_photons = build.clone().photons(count, radius);
    [means(&path_traced(build.clone(), depth), samples[0]), means(&by_photons, samples[1])]
}

/// Checks that both methods agree within 4 standard errors plus some slack for kernels at edges, and limits
/// the standard error to a fraction of the mean.
#[track_caller]
pub fn assert_same_light(what: &str, [(a, da), (b, db)]: [(f64, f64); 2], most_error: f64, slack: f64) {
    let error = da.hypot(db);
    assert!(error < most_error * a, "{what}: too noisy: ± {error} of {a}");
    assert!((a - b).abs() < 4.0 * error + slack * a, "{what}: photons {b} ± {db}, path {a} ± {da}");
}

#[test]
fn photons_match_path_at_every_depth() {
    for (depth, passes) in [(1, 16), (2, 12), (3, 11), (6, 8)] {
        let means = path_and_photon_means(&caustics(depth), depth, [128, passes], (10_000, 0.04));
        assert_same_light(&format!("depth {depth}"), means, 1.2e-2, 4e-3);
    }
}

#[test]
fn photons_match_path_with_light_in_glass() {
    for (depth, passes) in [(2, 8), (3, 13), (6, 11)] {
        let means = path_and_photon_means(&only_caustics(depth), depth, [128, passes], (10_000, 0.01));
        assert_same_light(&format!("depth {depth}"), means, 1e-2, 3e-3);
    }
}

#[test]
fn photons_match_path_on_smooth_meshes() {
    // A wall with shading normals tilted toward the floor. The floor receives about half of the light that a
    // wall without tilted normals would reflect onto it.
    let wall = TriangleMesh {
        positions: vec![
            Vec3::new(-1.0, 0.0, -0.5),
            Vec3::new(1.0, 0.0, -0.5),
            Vec3::new(1.0, 2.0, -0.5),
            Vec3::new(-1.0, 2.0, -0.5),
        ],
        normals: vec![Vec3::new(0.0, -0.6, 0.8); 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..TriangleMesh::default()
    };
    let build = scene()
        .mesh(wall, IDENTITY_PLACEMENT, matte(0.9))
        .smooth()
        .quad(v(-1.0, 0.0, 1.5), v(2.0, 0.0, 0.0), v(0.0, 0.0, -2.0), matte(0.8))
        .sphere(v(0.0, 1.6, 0.9), 0.4, emitter(3.0))
        .sphere(v(0.0, 1.6, 0.9), 0.5, glass(1.5))
        .pictured(v(0.0, 1.0, 3.0), v(0.0, 0.0, 0.6), 8.0, 16, 16)
        .viewed(ViewMode::Indirect);
    let means = path_and_photon_means(&build.depth(3), 3, [512, 16], (10_000, 0.2));
    assert_same_light("a bent wall", means, 2.5e-2, 0.0);
}

#[test]
fn sun_lights_ground_under_water() {
    // The ground under an infinite plane of water receives E·cosᵢ·T. Light that returns to the ground from
    // the water surface exceeds the depth limit.
    let water = || glass(1.33);
    let angle = 40.0_f64.to_radians();
    let to_sun = v(angle.sin(), angle.cos(), 0.0);
    let ground = scene()
        .shape(Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y }, water())
        .quad(v(-4.0, -1.0, 4.0), v(8.0, 0.0, 0.0), v(0.0, 0.0, -8.0), matte(0.5))
        .seen(v(0.0, -0.5, 0.0), v(0.1, -1.0, 0.05))
        .depth(3)
        .photons(20_000, 0.3);
    let (mean, error) = mean_and_error(&sun(ground, -to_sun, 1.0, 0.0).values(8, 16));
    // The camera is also under water, where it sees radiance/n².
    let inside = (angle.sin() / 1.33).asin();
    let (i, t) = (angle.cos(), inside.cos());
    let (s, p) = ((i - 1.33 * t) / (i + 1.33 * t), (1.33 * i - t) / (1.33 * i + t));
    let passed = 1.0 - 0.5 * (s * s + p * p);
    let exact = angle.cos() * passed * 0.5 / PI / (1.33 * 1.33);
    assert!(error < 7e-3 * exact, "{mean} ± {error}");
    assert!((mean - exact).abs() < 4.0 * error + 5e-3 * exact, "{mean} ± {error}, expected {exact}");
}

#[test]
fn ball_lens_casts_the_analytic_caustic() {
    // E/E₀ on the plane z = 3 at two distances from the axis, for light along the axis through a ball with n
    // = 1.5 and R = 1.
    for (distance, exact) in [(0.206_407_1, 0.813_230_5), (0.456_371_9, 0.552_326_4)] {
        let (x, y) = (0.6 * distance, 0.8 * distance);
        let lens = scene()
            .sphere(DVec3::ZERO, 1.0, glass(1.5))
            .quad(v(-0.7, -0.7, 3.0), v(0.0, 1.4, 0.0), v(1.4, 0.0, 0.0), matte(0.5))
            .seen(v(x, y, 2.0), v(x, y, 3.0))
            .depth(3)
            .photons(20_000, 0.07);
        let (mean, error) = mean_and_error(&sun(lens, DVec3::Z, 1.0, 0.0).values(16, 16));
        let exact = exact * 0.5 / PI;
        assert!(error < 0.012 * exact, "{mean} ± {error}");
        assert!(
            (mean - exact).abs() < 4.0 * error + 4e-3 * exact,
            "at {distance}: {mean} ± {error}, expected {exact}"
        );
    }
}

#[test]
fn photons_do_not_leak_through_a_thin_wall() {
    // A wall lit by a light and by its reflection in a mirror.
    let wall = scene().quad(v(-1.0, -1.0, 0.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), matte(0.8));
    let mirrored = wall.quad(v(-1.0, -1.0, 1.0), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), mirror(0.9));
    let lit = mirrored.point_light(v(0.2, 0.3, 0.5), 1.0, Falloff::Square).depth(8).photons(4000, 0.3);
    let caustic = |from: DVec3| {
        let seen = lit.clone().seen(from, v(0.3, -0.4, 0.0)).viewed(ViewMode::Caustic);
        mean(&seen.values(16, 4).iter().map(|&x| DVec3::splat(x)).collect::<Vec<_>>())
    };
    let (bright, dark) = (caustic(v(0.1, 0.2, 0.9)), caustic(v(0.1, 0.2, -0.9)));
    // The light's mirror image is at (0.2, 0.3, 1.5): L = 0.8/π·0.9·cos/d².
    let squared = (v(0.2, 0.3, 1.5) - v(0.3, -0.4, 0.0)).length_squared();
    let exact = 0.8 / PI * 0.9 * 1.5 * squared.powf(-1.5);
    assert!((bright / exact - 1.0).abs() < 0.08, "{bright}, expected {exact}");
    assert_eq!(dark, 0.0);
}

#[test]
fn photons_do_not_depend_on_threads_or_tiles() {
    let build = caustics(6).photons(5000, 0.0);
    let (world, settings, token) = (build.world(), build.settings(2), CancelToken::new());
    let of_photons = settings.photons.expect("photons are on");
    let maps = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let (photons, _) = PhotonPassTracer::new_and_trace_first_pass(
                &world,
                &settings,
                of_photons,
                &ignore_progress,
                &token,
            )
            .expect("the token is not canceled");
            photons
                .trace_passes_for_samples(&world, &settings, 0..4, &token)
                .expect("the token is not canceled")
        })
    };
    let all = maps(1);
    for threads in [2, 7] {
        let others = maps(threads);
        for (one, other) in all.passes.iter().zip(&others.passes) {
            for (one, other) in [(&one.caustic, &other.caustic), (&one.bounced, &other.bounced)] {
                assert!(!one.is_empty());
                assert!(one.iter_photons().eq(other.iter_photons()));
                assert_eq!(one.radius().to_bits(), other.radius().to_bits());
            }
        }
    }
    let render = |maps: &PhotonPassesBySample, rect: Rect, samples: Range<u32>| {
        let tile = render_tile_with_photons(Some(maps), &world, &settings, rect, samples, &token);
        tile.expect("the token is not canceled").0.radiance
    };
    let whole = Rect { x: 0, y: 0, width: 16, height: 16 };
    let at_once = render(&all, whole, 0..4);
    // Render each sample range with photon maps for only these samples.
    for cuts in [&[0, 1, 2, 3, 4][..], &[0, 1, 4], &[0, 3, 4]] {
        for part in cuts.windows(2) {
            let samples = part[0]..part[1];
            let (photons, _) = PhotonPassTracer::new_and_trace_first_pass(
                &world,
                &settings,
                of_photons,
                &ignore_progress,
                &token,
            )
            .expect("the token is not canceled");
            let maps = photons
                .trace_passes_for_samples(&world, &settings, samples.clone(), &token)
                .expect("the token is not canceled");
            let own: Vec<_> = at_once
                .chunks(4)
                .flat_map(|pixel| &pixel[samples.start as usize..samples.end as usize])
                .copied()
                .collect();
            assert_eq!(render(&maps, whole, samples.clone()), own, "samples {samples:?}");
        }
    }
    // Single rows of pixels.
    for y in 0..16 {
        let row = render(&all, Rect { x: 0, y, width: 16, height: 1 }, 0..4);
        assert_eq!(row, at_once[64 * y as usize..][..64], "row {y}");
    }
}

#[test]
fn photons_are_aimed_at_glass_from_mesh_file() {
    // The mesh covers about 1 % of the directions from the light.
    let mesh = boxes(&[(DVec3::ZERO, 0.4, 0)]);
    let build = room(|| matte(0.5))
        .own_mesh(mesh, vec![file_material(9, 1.5)])
        .point_light(v(0.9, 0.9, 0.9), 1.0, Falloff::Square)
        .photons(1000, 0.1);
    let (world, settings, token) = (build.world(), build.settings(1), CancelToken::new());
    let of_photons = settings.photons.expect("photons are on");
    let (_, pass) =
        PhotonPassTracer::new_and_trace_first_pass(&world, &settings, of_photons, &ignore_progress, &token)
            .expect("the token is not canceled");
    assert!(pass.caustic.len() > 500, "{} of 1000", pass.caustic.len());
}
