//! Light by photons beside the same by paths: means of blocks of pixels and of the whole picture, by the spread over seeds; and what
//! kernels lose at an edge.

use std::f64::consts::PI;

use glimt::choice::Choice;
use glimt::film::Rect;
use glimt::integrators::View;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::{Material, Shape};
use rayon::prelude::*;

use super::distant::sun;
use super::global::by_paths;
use super::mean_and_error;
use super::scenes::{
    AS_IT_IS, Build, emitter, glass, lat_long_sphere, maps, matte, mirror, phong, scene, tile_by,
};
use super::v;

/// Seeds of each method.
const SEEDS: u32 = 16;
/// Pixels along a side of a picture, and blocks of them.
const SIDE: usize = 16;
const BLOCKS: usize = 4;
/// The standard error that both methods have together is at most this part of the light: 3 % too much or too little is
/// far outside of what chance allows.
const MOST_ERROR: f64 = 4.5e-3;
/// Bias that kernels may have in smooth light, far from edges.
const SLACK: f64 = 1.5e-3;

/// How long both methods work, and how wide the kernels are.
struct Effort {
    path_samples: u32,
    passes: u32,
    photons: u64,
    radius: f64,
}

/// Means of the blocks, row by row, and then that of the whole.
fn means(picture: &[DVec3]) -> Vec<f64> {
    let of = SIDE / BLOCKS;
    let block = |number: usize| {
        let (x, y) = (number % BLOCKS * of, number / BLOCKS * of);
        let rows = (y..y + of).flat_map(|y| &picture[y * SIDE + x..][..of]);
        rows.map(|color| color.y).sum::<f64>() / (of * of) as f64
    };
    let blocks: Vec<f64> = (0..BLOCKS * BLOCKS).map(block).collect();
    let whole = blocks.iter().sum::<f64>() / blocks.len() as f64;
    blocks.into_iter().chain([whole]).collect()
}

/// Mean and standard error of each of the means, for each of the views.
fn spread(build: &Build, views: &[View], samples: u32) -> Vec<Vec<(f64, f64)>> {
    let world = build.world();
    let rect = Rect { x: 0, y: 0, width: SIDE as u32, height: SIDE as u32 };
    let one = |seed: u32| -> Vec<Vec<f64>> {
        let settings = |view| build.clone().viewed(view).settings(seed);
        let maps = maps(&world, &settings(View::Beauty), samples);
        let picture = |&view| tile_by(maps.as_ref(), &world, &settings(view), rect, samples);
        views.iter().map(picture).map(|picture| means(&picture)).collect()
    };
    let seeds: Vec<Vec<Vec<f64>>> = (0..SEEDS).into_par_iter().map(one).collect();
    let of =
        |view: usize, i: usize| mean_and_error(&seeds.iter().map(|means| means[view][i]).collect::<Vec<_>>());
    (0..views.len()).map(|view| (0..=BLOCKS * BLOCKS).map(|i| of(view, i)).collect()).collect()
}

/// Both methods see the same light: each block within 5 standard errors and 1.5 %, the whole within 4 and SLACK.
#[track_caller]
fn assert_same_light(what: &str, build: &Build, views: &[View], effort: &Effort) {
    let &Effort { path_samples, passes, photons, radius } = effort;
    let depth = build.scene.render.max_depth;
    let by_photons = spread(&build.clone().photons(photons, radius), views, passes);
    let by_paths = spread(&by_paths(build.clone(), depth), views, path_samples);
    for (view, (by_photons, by_paths)) in views.iter().zip(by_photons.iter().zip(by_paths)) {
        let what = format!("{what}, {}", view.name());
        let (blocks, whole) = (0..BLOCKS * BLOCKS, BLOCKS * BLOCKS);
        let ((a, da), (b, db)) = (by_paths[whole], by_photons[whole]);
        let error = da.hypot(db);
        assert!(error < MOST_ERROR * a, "{what}: {b} ± {db} says nothing, by paths {a} ± {da}");
        assert!((a - b).abs() < 4.0 * error + SLACK * a, "{what}: {b} ± {db}, by paths {a} ± {da}");
        for i in blocks {
            let ((a, da), (b, db)) = (by_paths[i], by_photons[i]);
            let allowed = 5.0 * da.hypot(db) + 1.5e-2 * a;
            assert!((a - b).abs() <= allowed, "{what}, block {i}: {b} ± {db}, by paths {a} ± {da}");
        }
    }
}

/// The same of the caustic alone.
#[track_caller]
fn assert_same_caustic(what: &str, build: &Build, effort: &Effort) {
    assert_same_light(what, build, &[View::Caustic], effort);
}

/// A floor at y = 0.
fn floor() -> Build {
    scene().quad(v(-3.0, 0.0, 3.0), v(6.0, 0.0, 0.0), v(0.0, 0.0, -6.0), matte(0.7))
}

/// A square around a point, this wide, seen from this far above.
fn looked_at(build: Build, at: DVec3, width: f64, above: f64) -> Build {
    let from = v(at.x, at.y + above, at.z + 1e-4 * above);
    let angle = 2.0 * (0.5 * width / above).atan();
    build.pictured(from, at, angle.to_degrees(), SIDE as u32, SIDE as u32)
}

/// A room that glows, with a mirror ball and a glass ball, seen by nobody yet.
fn room(floor: Material, wall: impl Fn(f32) -> Material) -> Build {
    let (low, side) = (-1.0, 2.0);
    let (x, y, z) = (v(side, 0.0, 0.0), v(0.0, side, 0.0), v(0.0, 0.0, side));
    let (o, far) = (v(low, 0.0, low), v(low + side, side, low + side));
    scene()
        .quad(o, x, y, wall(0.5))
        .quad(o, y, z, wall(1.0))
        .quad(o, z, x, floor)
        .quad(far, -y, -x, wall(0.7))
        .quad(far, -z, -y, wall(0.3))
        .quad(far, -x, -z, wall(1.0))
        .sphere(v(-0.45, 0.45, 0.0), 0.4, mirror(0.9))
        .sphere(v(0.45, 0.45, 0.1), 0.4, glass(1.5))
}

#[test]
fn a_ball_of_glass_and_a_mirror_in_a_box_throw_the_light_that_paths_find() {
    let middle = looked_at(room(matte(0.7), emitter), v(0.0, 0.0, 0.7), 0.4, 1.9).depth(6);
    let effort = Effort { path_samples: 256, passes: 16, photons: 60_000, radius: 0.06 };
    assert_same_caustic("the middle of a floor", &middle, &effort);
}

#[test]
fn every_part_of_the_light_by_photons_is_that_by_paths_and_they_add_up() {
    let glossy = room(phong(0.4, 0.4, 20.0, 0.0), |radiance| phong(0.4, 0.0, 1.0, radiance));
    let whole = glossy.pictured(v(0.0, 1.4, 0.9), v(0.15, 0.1, 0.4), 40.0, SIDE as u32, SIDE as u32).depth(5);
    let effort = Effort { path_samples: 256, passes: 16, photons: 30_000, radius: 0.03 };
    let views = [View::Emission, View::Diffuse, View::Specular, View::Caustic, View::Indirect, View::Beauty];
    assert_same_light("a glowing room", &whole, &views, &effort);
    let part = |view| whole.clone().photons(5000, 0.05).viewed(view).picture(4, 3);
    let parts = [View::Emission, View::Diffuse, View::Specular].map(part);
    for (pixel, beauty) in part(View::Beauty).into_iter().enumerate() {
        let sum: DVec3 = parts.iter().map(|part| part[pixel]).sum();
        assert!((sum - beauty).abs().max_element() <= 1e-5 * beauty.max_element(), "{pixel}: {sum} {beauty}");
    }
}

#[test]
fn water_in_a_wide_sun_throws_the_light_that_paths_find() {
    let angle = 20.0_f64.to_radians();
    let ground = scene()
        .shape(Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y }, glass(1.33))
        .quad(v(-1.5, -1.0, 1.5), v(3.0, 0.0, 0.0), v(0.0, 0.0, -3.0), matte(0.5))
        .sphere(v(0.2, -0.5, 0.0), 0.3, mirror(0.8));
    let seen = looked_at(ground, v(0.0, -1.0, 0.0), 2.2, 40.0).depth(5);
    let lit = sun(seen, v(-angle.sin(), -angle.cos(), 0.0), 1.0, 60.0);
    let effort = Effort { path_samples: 256, passes: 8, photons: 30_000, radius: 0.08 };
    assert_same_caustic("water", &lit, &effort);
}

#[test]
fn a_ring_throws_the_light_that_paths_find() {
    let wall = Shape::Cylinder { a: v(0.0, -0.01, 0.0), b: v(0.0, 1.0, 0.0), radius: 0.8, caps: false };
    let ring = looked_at(floor().shape(wall, mirror(0.95)), DVec3::ZERO, 1.0, 40.0).depth(5);
    let lit = sun(ring, v(-0.6, -0.8, 0.1), 1.0, 80.0);
    let effort = Effort { path_samples: 128, passes: 8, photons: 40_000, radius: 0.04 };
    assert_same_caustic("a ring", &lit, &effort);
}

#[test]
fn a_sky_through_glass_throws_the_light_that_paths_find() {
    let sky = [4.0, 3.0, 1.0, 0.5, 1.0, 0.6, 0.3, 0.2].map(Vec3::splat).to_vec();
    let build = floor().sphere(v(0.0, 0.5, 0.0), 0.4, glass(1.5));
    let lit = looked_at(build, v(0.2, 0.0, 0.1), 1.4, 40.0).depth(5).sky(4, sky, 0.0);
    let effort = Effort { path_samples: 256, passes: 8, photons: 40_000, radius: 0.04 };
    assert_same_caustic("a sky", &lit, &effort);
}

#[test]
fn a_smooth_mesh_of_glass_throws_the_light_that_paths_find() {
    let build = floor()
        .mesh(lat_long_sphere(8, 12, 0.4, v(0.0, 0.5, 0.0)), AS_IT_IS, glass(1.4))
        .smooth()
        .quad(v(-1.5, 2.5, -1.5), v(3.0, 0.0, 0.0), v(0.0, 0.0, 3.0), emitter(2.0));
    let lit = build.pictured(v(3.0, 1.5, 0.0), v(0.5, 0.0, 0.0), 20.0, SIDE as u32, SIDE as u32).depth(5);
    let effort = Effort { path_samples: 256, passes: 8, photons: 20_000, radius: 0.04 };
    assert_same_caustic("a smooth mesh", &lit, &effort);
}

#[test]
fn a_lamp_inside_glass_throws_the_light_that_paths_find() {
    let center = v(0.0, 0.6, 0.0);
    let build = floor().sphere(center, 0.35, emitter(1.0)).sphere(center, 0.5, glass(1.5));
    let lit = build.pictured(v(3.0, 1.5, 0.0), v(0.5, 0.0, 0.0), 20.0, SIDE as u32, SIDE as u32).depth(5);
    let effort = Effort { path_samples: 128, passes: 8, photons: 20_000, radius: 0.04 };
    assert_same_caustic("a lamp in glass", &lit, &effort);
}

/// The mean of r over r₁ in so many passes: r²ᵢ₊₁ = r²ᵢ·(i + 2/3)/(i + 1).
fn mean_radius(passes: u32) -> f64 {
    let mut squared = 1.0;
    let mut sum = 0.0;
    for i in 1..=passes {
        sum += f64::sqrt(squared);
        squared *= (f64::from(i) + 2.0 / 3.0) / (f64::from(i) + 1.0);
    }
    sum / f64::from(passes)
}

#[test]
fn kernels_lose_what_hangs_over_an_edge_and_it_vanishes_as_passes_grow() {
    // The even ground under water of `a_sun_lights_what_is_under_water_without_end`. In a strip of width W along its edge a kernel of
    // radius r loses ∫F = 8r/15π of it, F(x) the part of 2/πr²·(1 − ρ²/r²) beyond the distance x.
    let angle = 40.0_f64.to_radians();
    let inside = (angle.sin() / 1.33).asin();
    let (i, t) = (angle.cos(), inside.cos());
    let (s, p) = ((i - 1.33 * t) / (i + 1.33 * t), (1.33 * i - t) / (1.33 * i + t));
    let even = angle.cos() * (1.0 - 0.5 * (s * s + p * p)) * 0.5 / PI / (1.33 * 1.33);
    let (width, radius) = (0.4, 0.3);
    let ground = scene().shape(Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y }, glass(1.33)).quad(
        v(-1.0, -1.0, 1.0),
        v(2.0, 0.0, 0.0),
        v(0.0, 0.0, -2.0),
        matte(0.5),
    );
    let strip = looked_at(ground, v(1.0 - 0.5 * width, -1.0, 0.0), width, 0.9).depth(3);
    let lit = sun(strip, v(-angle.sin(), -angle.cos(), 0.0), 1.0, 0.0).photons(8000, radius);
    for passes in [2, 32] {
        let (mean, error) = spread(&lit, &[View::Caustic], passes)[0][BLOCKS * BLOCKS];
        let lost = 8.0 * radius * mean_radius(passes) / (15.0 * PI * width);
        let exact = even * (1.0 - lost);
        eprintln!(
            "{passes}: {:+.3} ± {:.3} %, {lost} lost",
            100.0 * (mean / exact - 1.0),
            100.0 * error / exact
        );
        assert!(error < MOST_ERROR * exact, "{passes} passes: {mean} ± {error}");
        assert!(
            (mean - exact).abs() < 4.0 * error + SLACK * exact,
            "{passes} passes: {mean} ± {error}, not {exact}"
        );
    }
}

#[test]
fn no_photons_come_round_the_foot_of_a_wall() {
    // A mirror without thickness on the ground, the sun before it: what it throws lights the ground before it, where a kernel hangs
    // over its foot; no light comes behind it.
    let (width, radius, passes) = (0.2, 0.1, 32);
    // On the ground, and a little above it: so little light comes under it that it is none here.
    let ground = |gap| floor().quad(v(0.0, gap, 2.0), v(0.0, 1.0, 0.0), v(0.0, 0.0, -4.0), mirror(0.9));
    let seen = |side: f64, gap: f64| {
        let strip = looked_at(ground(gap), v(side * 0.5 * width, 0.0, 0.0), width, 0.5).depth(3);
        let lit = sun(strip, v(1.0, -1.0, 0.0).normalize(), 1.0, 0.0).photons(8000, radius);
        spread(&lit, &[View::Caustic], passes)[0][BLOCKS * BLOCKS]
    };
    let lost = 8.0 * radius * mean_radius(passes) / (15.0 * PI * width);
    let exact = 0.9 * 0.5_f64.sqrt() * 0.7 / PI * (1.0 - lost);
    let (before, error) = seen(-1.0, 0.0);
    assert!(error < 2.0 * MOST_ERROR * exact, "{before} ± {error}");
    assert!((before - exact).abs() < 4.0 * error + SLACK * exact, "{before} ± {error}, not {exact}");
    for gap in [0.0, 0.005] {
        assert_eq!(seen(1.0, gap).0, 0.0, "{gap}");
    }
}

#[test]
fn what_a_ball_at_rest_throws_to_its_foot_arrives_there() {
    // Under a ball of glass that rests on the ground there is no room above the ground, and light all the same.
    let ball = floor().sphere(v(0.0, 0.5, 0.0), 0.5, glass(1.5));
    let foot = looked_at(ball, v(0.06, 0.0, 0.0), 0.16, 0.15).depth(6);
    let lit = sun(foot, v(0.2, -1.0, 0.0).normalize(), 1.0, 25.0);
    let effort = Effort { path_samples: 1024, passes: 16, photons: 40_000, radius: 0.01 };
    assert_same_caustic("a ball at rest", &lit, &effort);
}
