//! Photon mapping against path tracing: means over pixel blocks and the whole image, with their spread over
//! seeds. Also tests uniform light near edges and walls, which truncate kernels.

use std::f64::consts::PI;

use glimt::choice::Choice;
use glimt::film::Rect;
use glimt::geometry::mesh::TriangleMesh;
use glimt::integrators::ViewMode;
use glimt::math::{DVec3, Vec3};
use glimt::scene::description::{Material, NumberSource, ReflectingSides, Shape};
use rayon::prelude::*;

use super::distant::sun;
use super::global::path_traced;
use super::scenes::{
    Build, IDENTITY_PLACEMENT, blend, emitter, glass, lat_long_sphere, maps, matte, mirror, phong, scene,
    tile_with_photons,
};
use super::{assert_mean, mean_and_error, v};

/// Seeds per method.
const SEEDS: u32 = 16;
/// Image side length in pixels, and in blocks.
const SIDE: usize = 16;
const BLOCKS: usize = 4;
/// Largest relative standard error of the difference between the two methods. A difference of 3 % is then
/// highly significant.
const MAX_RELATIVE_ERROR: f64 = 4.5e-3;
/// Allowed kernel bias in smooth light, away from edges.
const KERNEL_BIAS: f64 = 1.5e-3;

/// Sample counts for both methods, and the kernel radius.
struct Effort {
    path_samples: u32,
    passes: u32,
    photons: u64,
    radius: f64,
}

/// Block means, row by row, followed by the mean of the whole image.
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

/// Mean and standard error of each value of `means`, for each view.
fn means_and_errors(build: &Build, views: &[ViewMode], samples: u32) -> Vec<Vec<(f64, f64)>> {
    let world = build.world();
    let rect = Rect { x: 0, y: 0, width: SIDE as u32, height: SIDE as u32 };
    let one = |seed: u32| -> Vec<Vec<f64>> {
        let settings = |view| build.clone().viewed(view).settings(seed);
        let maps = maps(&world, &settings(ViewMode::Beauty), samples);
        let picture = |&view| tile_with_photons(maps.as_ref(), &world, &settings(view), rect, samples);
        views.iter().map(picture).map(|picture| means(&picture)).collect()
    };
    let seeds: Vec<Vec<Vec<f64>>> = (0..SEEDS).into_par_iter().map(one).collect();
    let of =
        |view: usize, i: usize| mean_and_error(&seeds.iter().map(|means| means[view][i]).collect::<Vec<_>>());
    (0..views.len()).map(|view| (0..=BLOCKS * BLOCKS).map(|i| of(view, i)).collect()).collect()
}

/// Checks that both methods agree: each block within 5 standard errors plus 1.5 %, the whole image within 4
/// standard errors plus `KERNEL_BIAS`.
#[track_caller]
fn assert_same_light(what: &str, build: &Build, views: &[ViewMode], effort: &Effort) {
    let &Effort { path_samples, passes, photons, radius } = effort;
    let depth = build.scene.render.max_depth;
    let photon_means = means_and_errors(&build.clone().photons(photons, radius), views, passes);
    let path_means = means_and_errors(&path_traced(build.clone(), depth), views, path_samples);
    for (view, (photons, path)) in views.iter().zip(photon_means.iter().zip(path_means)) {
        let what = format!("{what}, {}", view.name());
        let (blocks, whole) = (0..BLOCKS * BLOCKS, BLOCKS * BLOCKS);
        let ((a, da), (b, db)) = (path[whole], photons[whole]);
        let error = da.hypot(db);
        assert!(error < MAX_RELATIVE_ERROR * a, "{what}: too noisy: photons {b} ± {db}, path {a} ± {da}");
        assert!((a - b).abs() < 4.0 * error + KERNEL_BIAS * a, "{what}: photons {b} ± {db}, path {a} ± {da}");
        for i in blocks {
            let ((a, da), (b, db)) = (path[i], photons[i]);
            let allowed = 5.0 * da.hypot(db) + 1.5e-2 * a;
            assert!((a - b).abs() <= allowed, "{what}, block {i}: photons {b} ± {db}, path {a} ± {da}");
        }
    }
}

/// [`assert_same_light`] for the caustic view only.
#[track_caller]
fn assert_same_caustic(what: &str, build: &Build, effort: &Effort) {
    assert_same_light(what, build, &[ViewMode::Caustic], effort);
}

/// A floor at y = 0.
fn floor() -> Build {
    scene().quad(v(-3.0, 0.0, 3.0), v(6.0, 0.0, 0.0), v(0.0, 0.0, -6.0), matte(0.7))
}

/// Views a square around a point from a camera above it, with the specified square width and camera height.
fn viewed_from_above(build: Build, at: DVec3, width: f64, above: f64) -> Build {
    let from = v(at.x, at.y + above, at.z + 1e-4 * above);
    let angle = 2.0 * (0.5 * width / above).atan();
    build.pictured(from, at, angle.to_degrees(), SIDE as u32, SIDE as u32)
}

/// A room with emissive walls, a mirror ball and a glass ball, without a camera.
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
fn glass_and_mirror_caustics_match_path() {
    let middle = viewed_from_above(room(matte(0.7), emitter), v(0.0, 0.0, 0.7), 0.4, 1.9).depth(6);
    let effort = Effort { path_samples: 256, passes: 16, photons: 30_000, radius: 0.06 };
    assert_same_caustic("the middle of a floor", &middle, &effort);
}

#[test]
fn photon_components_match_path_and_add_up() {
    let glossy = room(phong(0.4, 0.4, 20.0, 0.0), |radiance| phong(0.4, 0.0, 1.0, radiance));
    let whole = glossy.pictured(v(0.0, 1.4, 0.9), v(0.15, 0.1, 0.4), 40.0, SIDE as u32, SIDE as u32).depth(5);
    let effort = Effort { path_samples: 128, passes: 20, photons: 15_000, radius: 0.03 };
    let views = [
        ViewMode::Emission,
        ViewMode::Diffuse,
        ViewMode::Specular,
        ViewMode::Caustic,
        ViewMode::Indirect,
        ViewMode::Beauty,
    ];
    assert_same_light("emissive room", &whole, &views, &effort);
    let part = |view| whole.clone().photons(5000, 0.05).viewed(view).picture(4, 3);
    let parts = [ViewMode::Emission, ViewMode::Diffuse, ViewMode::Specular].map(part);
    for (pixel, beauty) in part(ViewMode::Beauty).into_iter().enumerate() {
        let sum: DVec3 = parts.iter().map(|part| part[pixel]).sum();
        assert!((sum - beauty).abs().max_element() <= 1e-5 * beauty.max_element(), "{pixel}: {sum} {beauty}");
    }
}

#[test]
fn water_caustics_match_path() {
    let angle = 20.0_f64.to_radians();
    let ground = scene()
        .shape(Shape::Plane { point: DVec3::ZERO, normal: DVec3::Y }, glass(1.33))
        .quad(v(-1.5, -1.0, 1.5), v(3.0, 0.0, 0.0), v(0.0, 0.0, -3.0), matte(0.5))
        .sphere(v(0.2, -0.5, 0.0), 0.3, mirror(0.8));
    let seen = viewed_from_above(ground, v(0.0, -1.0, 0.0), 2.2, 40.0).depth(5);
    let lit = sun(seen, v(-angle.sin(), -angle.cos(), 0.0), 1.0, 60.0);
    let effort = Effort { path_samples: 96, passes: 3, photons: 30_000, radius: 0.08 };
    assert_same_caustic("water", &lit, &effort);
}

#[test]
fn ring_caustics_match_path() {
    let wall = Shape::Cylinder { a: v(0.0, -0.01, 0.0), b: v(0.0, 1.0, 0.0), radius: 0.8, caps: false };
    let ring = viewed_from_above(floor().shape(wall, mirror(0.95)), DVec3::ZERO, 1.0, 40.0).depth(5);
    let lit = sun(ring, v(-0.6, -0.8, 0.1), 1.0, 80.0);
    let effort = Effort { path_samples: 64, passes: 4, photons: 40_000, radius: 0.04 };
    assert_same_caustic("a ring", &lit, &effort);
}

#[test]
fn sky_caustics_match_path() {
    let sky = [4.0, 3.0, 1.0, 0.5, 1.0, 0.6, 0.3, 0.2].map(Vec3::splat).to_vec();
    let build = floor().sphere(v(0.0, 0.5, 0.0), 0.4, glass(1.5));
    let lit = viewed_from_above(build, v(0.2, 0.0, 0.1), 1.4, 40.0).depth(5).sky(4, sky, 0.0);
    let effort = Effort { path_samples: 256, passes: 8, photons: 40_000, radius: 0.04 };
    assert_same_caustic("a sky", &lit, &effort);
}

#[test]
fn smooth_mesh_caustics_match_path() {
    let build = floor()
        .mesh(lat_long_sphere(8, 12, 0.4, v(0.0, 0.5, 0.0)), IDENTITY_PLACEMENT, glass(1.4))
        .smooth()
        .quad(v(-1.5, 2.5, -1.5), v(3.0, 0.0, 0.0), v(0.0, 0.0, 3.0), emitter(2.0));
    let lit = build.pictured(v(3.0, 1.5, 0.0), v(0.5, 0.0, 0.0), 20.0, SIDE as u32, SIDE as u32).depth(5);
    let effort = Effort { path_samples: 256, passes: 8, photons: 20_000, radius: 0.04 };
    assert_same_caustic("a smooth mesh", &lit, &effort);
}

#[test]
fn caustics_of_light_in_glass_match_path() {
    let center = v(0.0, 0.6, 0.0);
    let build = floor().sphere(center, 0.35, emitter(1.0)).sphere(center, 0.5, glass(1.5));
    let lit = build.pictured(v(3.0, 1.5, 0.0), v(0.5, 0.0, 0.0), 20.0, SIDE as u32, SIDE as u32).depth(5);
    let effort = Effort { path_samples: 128, passes: 8, photons: 20_000, radius: 0.04 };
    assert_same_caustic("a light in glass", &lit, &effort);
}

/// Number of passes after which light at an edge is accurate to within [`EDGE_BIAS`].
const PASSES: u32 = 64;
/// Largest remaining relative energy loss of kernels at edges. Without correction, a kernel of radius r loses
/// a fraction of 8r/15πW in a strip of width W along an edge, where 8r/15π = ∫F and F(x) is the part of the
/// kernel 2/πr²·(1 − ρ²/r²) that lies beyond distance x.
const EDGE_BIAS: f64 = 2e-3;

/// A rectangle on the ground viewed from above, specified by its center and its side lengths along x and z.
/// Pixels are nearly square.
fn view_rectangle(build: Build, middle: DVec3, (x, z): (f64, f64)) -> Build {
    const PIXELS: f64 = 256.0;
    let side = (x * z / PIXELS).sqrt();
    let (across, up) = ((z / side).round().max(1.0), (x / side).round().max(1.0));
    // The image's vertical axis is x. The image width follows from the pixel count.
    let above = 20.0 * x.max(z);
    let fov = 2.0 * (0.5 * x / above).atan().to_degrees();
    assert!((across / up * x / z - 1.0).abs() < 0.3, "{across}×{up}");
    let from = middle + v(0.0, above, 0.0);
    build.pictured(from, middle, fov, across as u32, up as u32).depth(3)
}

/// A sun at 45°, reflected by a lossless mirror at x = 0 onto the ground between x = `far` and x = `near` <
/// 0, with constant width along z. The reflected sun has an irradiance of cos 45° there, and also on walls
/// perpendicular to x that face the mirror. Direct light is excluded from the view.
fn lit_by_mirrored_sun(build: Build, (far, near): (f64, f64), (z, width): (f64, f64)) -> Build {
    let corner = v(0.0, -near, z + 0.5 * width);
    let lit = build.quad(corner, v(0.0, near - far, 0.0), v(0.0, 0.0, -width), mirror(1.0));
    sun(lit, v(1.0, -1.0, 0.0).normalize(), 1.0, 0.0).viewed(ViewMode::Caustic)
}

/// Radiance of a surface with reflectance 0.7 in the reflected sunlight.
fn reflected_radiance() -> f64 {
    0.5_f64.sqrt() * 0.7 / PI
}

/// Checks that the image mean after [`PASSES`] is exact to within [`EDGE_BIAS`] plus noise.
#[track_caller]
fn assert_uniform(what: &str, build: &Build, (photons, radius): (u64, f64), exact: f64) {
    let build = build.clone().photons(photons, radius);
    let world = build.world();
    let rect = Rect { x: 0, y: 0, width: build.scene.render.width, height: build.scene.render.height };
    let one = |seed: u32| -> f64 {
        let settings = build.settings(seed);
        let maps = maps(&world, &settings, PASSES);
        let picture = tile_with_photons(maps.as_ref(), &world, &settings, rect, PASSES);
        picture.iter().map(|color| color.y).sum::<f64>() / picture.len() as f64
    };
    let (mean, error) = mean_and_error(&(0..SEEDS).into_par_iter().map(one).collect::<Vec<_>>());
    let (off, error) = (mean / exact - 1.0, error / exact);
    assert!(error < 1e-3, "{what}: too noisy: {mean} ± {error}");
    assert!(
        off.abs() < EDGE_BIAS + 4.0 * error,
        "{what}: {mean}, expected {exact}, relative error {off} ± {error}"
    );
}

/// A floor with reflectance 0.7 from x = −2 to −1.
fn small_floor() -> Build {
    scene().quad(v(-2.0, 0.0, 0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, -1.0), matte(0.7))
}

/// A larger floor, extended on all sides.
fn long_floor() -> Build {
    scene().quad(v(-3.0, 0.0, 0.9), v(2.0, 0.0, 0.0), v(0.0, 0.0, -1.8), matte(0.7))
}

#[test]
fn photon_light_is_uniform_up_to_floor_edges() {
    let whole = lit_by_mirrored_sun(small_floor(), (-2.1, -0.9), (0.0, 1.2));
    let whole = view_rectangle(whole, v(-1.5, 0.0, 0.0), (0.999, 0.999));
    assert_uniform("the whole floor", &whole, (2500, 0.2), reflected_radiance());
    let edge = lit_by_mirrored_sun(small_floor(), (-1.25, -0.95), (0.0, 0.6));
    let edge = view_rectangle(edge, v(-1.05, 0.0, 0.0), (0.099, 0.3));
    assert_uniform("a strip along an edge", &edge, (3500, 0.1), reflected_radiance());
    let corner = lit_by_mirrored_sun(small_floor(), (-1.25, -0.95), (0.4, 0.3));
    let corner = view_rectangle(corner, v(-1.05, 0.0, 0.45), (0.099, 0.099));
    assert_uniform("a corner", &corner, (5000, 0.1), reflected_radiance());
}

#[test]
fn photon_light_is_uniform_up_to_walls() {
    // A wall at the far edge of the floor, and a wall on a floor that continues behind it in shadow.
    let wall = |build: Build| build.quad(v(-2.0, 0.0, 0.5), v(0.0, 0.0, -1.0), v(0.0, 0.6, 0.0), matte(0.7));
    for (what, floor) in [("at its edge", small_floor()), ("on it", long_floor())] {
        let room = lit_by_mirrored_sun(wall(floor), (-2.2, -1.75), (0.0, 0.6));
        let foot = view_rectangle(room.clone(), v(-1.95, 0.0, 0.0), (0.099, 0.3));
        assert_uniform(&format!("a floor before a wall {what}"), &foot, (3000, 0.1), reflected_radiance());
        // The lower part of the wall, on the side that faces the mirror.
        let low = room.pictured(v(-1.0, 0.05, 0.0), v(-2.0, 0.05, 0.0), 5.65, 48, 16).depth(3);
        assert_uniform(&format!("a wall {what}"), &low, (3000, 0.1), reflected_radiance());
    }
    // No light leaks into the shadow behind the wall.
    let behind = view_rectangle(
        lit_by_mirrored_sun(wall(long_floor()), (-2.2, -1.75), (0.0, 0.6)),
        v(-2.06, 0.0, 0.0),
        (0.1, 0.3),
    );
    assert!(behind.photons(5000, 0.1).picture(4, 1).iter().all(|color| *color == DVec3::ZERO));
}

/// A flat ring around (−1.5, 0, 0) between two radii, divided into `steps` angular steps and `rows` radial
/// steps.
fn flat_ring(steps: u32, rows: u32, inner: f32, outer: f32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for step in 0..steps {
        let (sin, cos) = (std::f32::consts::TAU * step as f32 / steps as f32).sin_cos();
        for row in 0..=rows {
            let radius = inner + (outer - inner) * row as f32 / rows as f32;
            mesh.positions.push(Vec3::new(-1.5 + radius * cos, 0.0, radius * sin));
        }
        let (own, next) = (step * (rows + 1), (step + 1) % steps * (rows + 1));
        for row in 0..rows {
            mesh.triangles.push([own + row, next + row, own + row + 1]);
            mesh.triangles.push([next + row, next + row + 1, own + row + 1]);
        }
    }
    mesh
}

#[test]
fn photon_irradiance_is_uniform_up_to_rims() {
    let disk = Shape::Disk { center: v(-1.5, 0.0, 0.0), normal: DVec3::Y, radius: 0.5 };
    let of_mesh =
        |steps, rows| scene().mesh(flat_ring(steps, rows, 0.35, 0.5), IDENTITY_PLACEMENT, matte(0.7));
    for (what, build) in [
        ("a disk", scene().shape(disk, matte(0.7))),
        ("a coarse ring", of_mesh(96, 1)),
        ("a fine ring", of_mesh(288, 6)),
    ] {
        // A rectangle that ends 4·10⁻³ before the rim.
        let lit = lit_by_mirrored_sun(build, (-1.16, -0.99), (0.0, 0.2));
        let rim = view_rectangle(lit, v(-1.024, 0.0, 0.0), (0.04, 0.06));
        assert_uniform(&format!("the rim of {what}"), &rim, (3000, 0.05), reflected_radiance());
    }
}

#[test]
fn photon_light_is_uniform_up_to_black_backs() {
    // Next to the floor is another that faces down. Its black back stores no photons.
    let front_only = || Material { sides: ReflectingSides::Front, ..matte(0.7) };
    let build = scene().quad(v(-2.0, 0.0, 0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, -1.0), front_only()).quad(
        v(-1.0, 0.0, 0.5),
        v(0.0, 0.0, -1.0),
        v(1.0, 0.0, 0.0),
        front_only(),
    );
    let edge = view_rectangle(
        lit_by_mirrored_sun(build, (-1.25, -0.95), (0.0, 0.6)),
        v(-1.05, 0.0, 0.0),
        (0.099, 0.3),
    );
    assert_uniform("a strip next to a black back", &edge, (3500, 0.1), reflected_radiance());
}

#[test]
fn photons_on_blends_represent_all_that_arrive() {
    // No photons are stored on the mirror. The camera sees the black sky in it.
    let floor = blend(matte(0.7), mirror(1.0), NumberSource::Constant(0.4));
    let build = scene().quad(v(-2.0, 0.0, 0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, -1.0), floor);
    let middle =
        view_rectangle(lit_by_mirrored_sun(build, (-1.7, -1.3), (0.0, 0.4)), v(-1.5, 0.0, 0.0), (0.1, 0.1));
    assert_mean("floor", &middle.photons(6000, 0.1).mean_reds(16), 0.6 * reflected_radiance(), 1.5e-2);
}

#[test]
fn photon_light_is_uniform_around_a_box() {
    // In front of the box and next to it, outside its shadow.
    let standing = long_floor().cuboid(v(-1.7, 0.1, 0.0), v(0.2, 0.2, 0.6), DVec3::ZERO, matte(0.5));
    let before = lit_by_mirrored_sun(standing.clone(), (-1.75, -1.4), (0.0, 0.6));
    let before = view_rectangle(before, v(-1.55, 0.0, 0.0), (0.099, 0.4));
    assert_uniform("before a box", &before, (4500, 0.08), reflected_radiance());
    let beside = lit_by_mirrored_sun(standing, (-1.9, -1.5), (0.35, 0.35));
    let beside = view_rectangle(beside, v(-1.7, 0.0, 0.35), (0.18, 0.099));
    assert_uniform("beside a box", &beside, (4500, 0.08), reflected_radiance());
    // The top of a box that is low enough for kernels to reach the floor around it.
    let low = long_floor().cuboid(v(-1.7, 0.01, 0.0), v(0.2, 0.02, 0.6), DVec3::ZERO, matte(0.7));
    let top = view_rectangle(
        lit_by_mirrored_sun(low, (-1.95, -1.45), (0.0, 0.85)),
        v(-1.7, 0.02, 0.0),
        (0.199, 0.599),
    );
    assert_uniform("on a low box", &top, (4500, 0.08), reflected_radiance());
}

#[test]
fn photons_do_not_leak_under_a_wall() {
    // An infinitely thin mirror stands on the ground and faces the sun. It reflects light onto the ground in
    // front of it, where kernels extend under its lower edge. No light reaches the ground behind it.
    let (width, radius, passes) = (0.2, 0.1, 32);
    // Test the mirror on the ground, and slightly above it, where little light passes underneath.
    let ground = |gap| floor().quad(v(0.0, gap, 2.0), v(0.0, 1.0, 0.0), v(0.0, 0.0, -4.0), mirror(0.9));
    let seen = |side: f64, gap: f64| {
        let strip = viewed_from_above(ground(gap), v(side * 0.5 * width, 0.0, 0.0), width, 0.5).depth(3);
        let lit = sun(strip, v(1.0, -1.0, 0.0).normalize(), 1.0, 0.0).photons(8000, radius);
        means_and_errors(&lit, &[ViewMode::Caustic], passes)[0][BLOCKS * BLOCKS]
    };
    let exact = 0.9 * 0.5_f64.sqrt() * 0.7 / PI;
    let (before, error) = seen(-1.0, 0.0);
    assert!(error < 2.0 * MAX_RELATIVE_ERROR * exact, "{before} ± {error}");
    assert!((before - exact).abs() < 4.0 * error + EDGE_BIAS * exact, "{before} ± {error}, expected {exact}");
    for gap in [0.0, 0.005] {
        assert_eq!(seen(1.0, gap).0, 0.0, "{gap}");
    }
}

#[test]
fn caustic_under_a_resting_ball_matches_path() {
    // A glass ball rests on the ground. There is no gap under it, but light still arrives there.
    let ball = floor().sphere(v(0.0, 0.5, 0.0), 0.5, glass(1.5));
    let foot = viewed_from_above(ball, v(0.06, 0.0, 0.0), 0.16, 0.15).depth(6);
    let lit = sun(foot, v(0.2, -1.0, 0.0).normalize(), 1.0, 25.0);
    let effort = Effort { path_samples: 160, passes: 4, photons: 20_000, radius: 0.01 };
    assert_same_caustic("a resting ball", &lit, &effort);
}
