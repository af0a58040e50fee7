//! Ray kernel: no leaks between triangles, no speckles on flat faces, and bit-identical results with all
//! instruction sets.

use std::collections::HashMap;

use glimt::accel::wide_bvh::InstructionSet;
use glimt::accel::{KdTree, PACKET_SIZE, WideBvh, packet_ray_ends};
use glimt::control::CancelToken;
use glimt::geometry::Ray;
use glimt::geometry::mesh::TriangleMesh;
use glimt::math::Vec3;
use glimt::math::random::TestRandom;

use crate::test_dir::TestDir;

/// A closed ball with radius 2 and `rings` rings of `rings` quads. Bumps make the quads non-planar.
fn ball(rings: u32, bumps: f32) -> TriangleMesh {
    let point = |ring: u32, column: u32| {
        let height = std::f32::consts::PI * ring as f32 / rings as f32;
        let around = 2.0 * std::f32::consts::PI * column as f32 / rings as f32;
        let radius = 2.0 + bumps * (5.0 * height).sin() * (3.0 * around).cos();
        Vec3::new(height.sin() * around.cos(), height.cos(), height.sin() * around.sin()) * radius
    };
    let mut mesh =
        TriangleMesh { positions: vec![Vec3::Y * 2.0, Vec3::NEG_Y * 2.0], ..TriangleMesh::default() };
    for ring in 1..rings {
        mesh.positions.extend((0..rings).map(|column| point(ring, column)));
    }
    let index = |ring: u32, column: u32| match ring {
        0 => 0,
        _ if ring == rings => 1,
        _ => 2 + (ring - 1) * rings + column % rings,
    };
    for ring in 0..rings {
        for column in 0..rings {
            let (a, b) = (index(ring, column), index(ring, column + 1));
            let (c, d) = (index(ring + 1, column), index(ring + 1, column + 1));
            let halves = [[a, b, c], [b, d, c]];
            mesh.triangles.extend(halves.into_iter().filter(|[a, b, c]| a != b && b != c && a != c));
        }
    }
    mesh
}

/// The ball with every other ring moved very close to the previous ring, so that half of the triangles are
/// needles.
fn needles(rings: u32) -> TriangleMesh {
    let mut mesh = ball(rings, 0.0);
    for ring in (2..rings).step_by(2) {
        for column in 0..rings {
            let at = |ring: u32| (2 + (ring - 1) * rings + column) as usize;
            mesh.positions[at(ring)] = mesh.positions[at(ring - 1)].lerp(mesh.positions[at(ring)], 1e-6);
        }
    }
    mesh
}

/// Scales and then moves the mesh.
fn placed(mesh: &TriangleMesh, scale: f32, offset: Vec3) -> TriangleMesh {
    let positions = mesh.positions.iter().map(|&p| p * scale + offset).collect();
    TriangleMesh { positions, ..mesh.clone() }
}

fn tree(mesh: &TriangleMesh) -> WideBvh {
    let tree = WideBvh::build(mesh.triangles.len() as u32, |id| mesh.corners(id), &CancelToken::new());
    tree.expect("the token is not canceled")
}

/// Number of rays that escape from a closed mesh. Each ray starts inside and is aimed at a vertex or an edge.
fn leaks(mesh: &TriangleMesh, scale: f32, offset: Vec3, rays: usize, instructions: InstructionSet) -> usize {
    let tree = tree(mesh).with_instruction_set(instructions);
    let mut random = TestRandom::new(rays as u64);
    let mut leaks = 0;
    for i in 0..rays / PACKET_SIZE {
        let origin = random.in_cube_f32() * 0.5 * scale + offset;
        let corners = mesh.corners(random.below(mesh.triangles.len()) as u32);
        let packet: [Ray; PACKET_SIZE] = std::array::from_fn(|lane| {
            let target = if lane % 2 == 0 {
                corners[lane / 2 % 3]
            } else {
                corners[0].lerp(corners[1], random.unit_f32())
            };
            Ray::new(origin, target - origin)
        });
        if i % 2 == 0 {
            let mut hits = [None; PACKET_SIZE];
            tree.closest_hit_packet(&packet, &packet_ray_ends(&packet), &mut hits);
            leaks += hits.iter().filter(|hit| hit.is_none()).count();
            leaks += PACKET_SIZE
                - tree.any_hit_packet(&packet, &packet_ray_ends(&packet), &[]).count_ones() as usize;
        } else {
            leaks += packet
                .iter()
                .filter(|ray| tree.closest_hit(ray).is_none() || !tree.any_hit(ray, None))
                .count();
        }
    }
    leaks
}

/// Number of rays that escape from a closed mesh in a k-d tree. See [`leaks`].
fn leaks_of_planes(mesh: &TriangleMesh, scale: f32, offset: Vec3, rays: usize) -> usize {
    let count = mesh.triangles.len() as u32;
    let tree = KdTree::from_triangles(count, |id| mesh.corners(id), &CancelToken::new())
        .expect("the token is not canceled");
    let mut random = TestRandom::new(rays as u64 + 1);
    let mut leaks = 0;
    for i in 0..rays {
        let origin = random.in_cube_f32() * 0.5 * scale + offset;
        let corners = mesh.corners(random.below(mesh.triangles.len()) as u32);
        let target =
            if i % 2 == 0 { corners[i / 2 % 3] } else { corners[0].lerp(corners[1], random.unit_f32()) };
        let ray = Ray::new(origin, target - origin);
        leaks += usize::from(tree.closest_hit(&ray).is_none() || !tree.any_hit(&ray, None));
    }
    leaks
}

/// Checks that no ray leaks, with `rays` rays for each mesh, position, tree and instruction set.
fn assert_watertight(rays: usize) {
    let far = Vec3::new(148_376.0, 1234.0, -223_423.0);
    let places =
        [(1.0, Vec3::ZERO), (1.0, far), (2.0_f32.powi(30), Vec3::ZERO), (2.0_f32.powi(-30), Vec3::ZERO)];
    for shape in [ball(16, 0.0), ball(60, 0.3), needles(24)] {
        for (scale, offset) in places {
            let mesh = placed(&shape, scale, offset);
            for instructions in InstructionSet::ALL {
                let leaks = leaks(&mesh, scale, offset, rays, instructions);
                assert_eq!(leaks, 0, "{} triangles × {scale} + {offset}", mesh.triangles.len());
            }
            assert_eq!(leaks_of_planes(&mesh, scale, offset, rays), 0, "k-d tree × {scale} + {offset}");
        }
    }
}

#[test]
fn no_ray_leaks_at_edges_and_vertices() {
    assert_watertight(22_000);
}

/// Traces 10⁸ rays.
#[test]
#[ignore = "90 s on two cores: cargo test --release --test suite no_leaks_with_many -- --ignored"]
fn no_leaks_with_many_rays() {
    assert_watertight(100_000_000 / 48);
}

/// A grid of axis-aligned boxes with 12 triangles each.
fn boxes(side: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for cell in 0..side * side * side {
        let at =
            Vec3::new((cell % side) as f32, (cell / side % side) as f32, (cell / side / side) as f32) * 1.5;
        let first = mesh.positions.len() as u32;
        let corner = |i: u32| at + Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32);
        mesh.positions.extend((0..8).map(corner));
        for [a, b, c, d] in
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        {
            mesh.triangles.extend([[a, b, c], [a, c, d]].map(|triangle| triangle.map(|i| first + i)));
        }
    }
    mesh
}

/// Distance at which a ray first enters a box of the grid, using the slab method in double precision.
fn first_box(ray: &Ray, side: u32) -> f64 {
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let enter = |cell: u32| {
        let at = [cell % side, cell / side % side, cell / side / side].map(|i| f64::from(i) * 1.5);
        let (mut near, mut far) = (0.0, f64::INFINITY);
        for axis in 0..3 {
            if direction[axis] == 0.0 {
                if !(at[axis]..=at[axis] + 1.0).contains(&origin[axis]) {
                    return f64::INFINITY;
                }
                continue;
            }
            let planes = [at[axis], at[axis] + 1.0].map(|plane| (plane - origin[axis]) / direction[axis]);
            (near, far) = (planes[0].min(planes[1]).max(near), planes[0].max(planes[1]).min(far));
        }
        if near <= far { near } else { f64::INFINITY }
    };
    (0..side * side * side).map(enter).fold(f64::INFINITY, f64::min)
}

#[test]
fn boxes_do_not_speckle_from_any_direction() {
    for side in [1, 3] {
        let mesh = boxes(side);
        let middle = Vec3::splat((side - 1) as f32 * 0.75 + 0.5);
        let mut random = TestRandom::new(u64::from(side));
        for instructions in InstructionSet::ALL {
            let tree = tree(&mesh).with_instruction_set(instructions);
            for view in 0..1000 {
                // The first views are along the axes and diagonals, where rays lie in face planes.
                let away = match view {
                    0..26 => {
                        let code = if view < 13 { view } else { view + 1 };
                        Vec3::new((code % 3) as f32, (code / 3 % 3) as f32, (code / 9) as f32) - Vec3::ONE
                    }
                    _ => random.in_cube_f32(),
                };
                let eye = middle + away.normalize() * 20.0;
                for _ in 0..8 {
                    let target = match view % 3 {
                        // Grazing rays at box vertices and edges.
                        0 => mesh.positions[random.below(mesh.positions.len())],
                        1 => {
                            let [a, b, c] = mesh.corners(random.below(mesh.triangles.len()) as u32);
                            a + (b - a) * random.unit_f32() + (c - b) * random.unit_f32() * random.unit_f32()
                        }
                        _ => middle + random.in_cube_f32() * side as f32,
                    };
                    let ray = Ray::new(eye, target - eye);
                    assert_no_speck(&tree, &ray, side);
                }
            }
        }
    }
}

/// Checks that a ray hits the box that it enters, and that a ray that misses all boxes has no hit. Allows
/// for rounding errors.
fn assert_no_speck(tree: &WideBvh, ray: &Ray, side: u32) {
    let shifted = |by: f32| {
        let across = ray.direction.any_orthogonal_vector().normalize() * by;
        let other = ray.direction.cross(across).normalize() * by;
        [across, other, -across, -other]
            .map(|shift| first_box(&Ray { origin: ray.origin + shift, ..*ray }, side))
    };
    let exact = first_box(ray, side);
    let (least, greatest) = shifted(1e-4).into_iter().fold((exact, exact), |(a, b), t| (a.min(t), b.max(t)));
    match tree.closest_hit(ray) {
        Some(hit) => {
            let t = f64::from(hit.t);
            assert!(
                t >= least - 1e-5 && t <= greatest + 1e-5,
                "{ray:?} hit at {t}, expected {least}…{greatest}"
            );
        }
        None => assert!(greatest.is_infinite(), "{ray:?} misses the box at {greatest}"),
    }
}

/// A ray's crossing of a triangle's plane, in double precision.
struct PlaneCrossing {
    /// Distance along the ray.
    t: f64,
    /// Smallest barycentric coordinate.
    least: f64,
    /// Distance between the ray's line and the nearest line through an edge. It is small near an edge, and if
    /// the ray grazes a sliver.
    clearance: f64,
}

/// `None` if the ray is parallel to the plane.
fn crossing(ray: &Ray, corners: &[Vec3; 3]) -> Option<PlaneCrossing> {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3() - ray.origin.as_dvec3());
    let (direction, normal) = (ray.direction.as_dvec3(), (b - a).cross(c - a));
    let edges = [(b, c), (c, a), (a, b)];
    let weights = edges.map(|(from, to)| from.cross(to).dot(direction));
    let sum: f64 = weights.iter().sum();
    let least = weights.iter().map(|weight| weight / sum).fold(f64::INFINITY, f64::min);
    let distances = edges
        .iter()
        .zip(weights)
        .map(|((from, to), weight)| (weight / (to - from).cross(direction).length()).abs());
    let clearance = distances.fold(f64::INFINITY, f64::min);
    (sum != 0.0).then(|| PlaneCrossing { t: normal.dot(a) / normal.dot(direction), least, clearance })
}

/// Rays that start just in front of or behind slivers of various widths, away from their edges. Single
/// precision cannot separate such hits from the origin, so the kernel resolves them in double precision.
#[test]
fn hits_close_to_the_ray_origin_are_found() {
    let mut random = TestRandom::new(91);
    let slivers: Vec<[Vec3; 3]> = (0..2000)
        .map(|_| {
            let (at, along) = (random.in_cube_f32() * 4.0, random.in_cube_f32());
            let width = 10.0_f32.powf(-4.0 * random.unit_f32());
            [at, at + along, at + along * random.unit_f32() + random.in_cube_f32() * width]
        })
        .collect();
    // If a ray of length 0.03 starts farther away than this, it has no crossing with `least` ≥ −0.02.
    let around = |corners: &[Vec3; 3]| {
        let middle = corners.iter().sum::<Vec3>() / 3.0;
        (middle, corners.iter().map(|corner| (*corner - middle).length()).fold(0.0, f32::max) * 1.2 + 0.03)
    };
    // Each grid cell lists the slivers that may be this close to a point in the cell.
    let cell = |at: Vec3| at.to_array().map(|x| x.floor() as i32);
    let mut grid: HashMap<[i32; 3], Vec<usize>> = HashMap::new();
    for (id, corners) in slivers.iter().enumerate() {
        let (middle, reach) = around(corners);
        let (low, high) = (cell(middle - reach), cell(middle + reach));
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    grid.entry([x, y, z]).or_default().push(id);
                }
            }
        }
    }
    let count = slivers.len() as u32;
    let corners = |id: u32| slivers[id as usize];
    let boxes = WideBvh::build(count, corners, &CancelToken::new()).expect("the token is not canceled");
    let planes =
        KdTree::from_triangles(count, corners, &CancelToken::new()).expect("the token is not canceled");
    let trees = InstructionSet::ALL.map(|instructions| boxes.clone().with_instruction_set(instructions));
    let (mut before, mut behind, mut missed, mut wrong) = (0, 0, 0, 0);
    for i in 0..40_000 {
        let id = random.below(slivers.len());
        let [a, b, c] = slivers[id];
        let (u, v) = (0.1 + 0.6 * random.unit_f32(), 0.1 + 0.2 * random.unit_f32());
        let (direction, distance) =
            (random.in_cube_f32().normalize(), 10.0_f32.powf(-6.0 + 4.0 * random.unit_f32()));
        let side = if i % 3 == 0 { -1.0 } else { 1.0 };
        let origin = a + (b - a) * u + (c - a) * v - direction * (distance * side);
        let ray = Ray { t_max: 2.0 * distance, ..Ray::new(origin, direction) };
        let (end, mut is_hit, mut is_free) = (f64::from(ray.t_max), false, true);
        let near = grid.get(&cell(origin)).into_iter().flatten().map(|id| &slivers[*id]).filter(|corners| {
            let (middle, reach) = around(corners);
            (origin - middle).length_squared() < reach * reach
        });
        for PlaneCrossing { t, least, clearance } in near.filter_map(|corners| crossing(&ray, corners)) {
            // The corners relative to the origin are rounded to about 10⁻⁷.
            is_hit |= t > 1e-9 && t < 0.99 * end && least > 0.02 && clearance > 1e-7;
            is_free &= t < -1e-9 || t > 1.01 * end || least < -0.02;
        }
        before += u32::from(is_hit);
        behind += u32::from(is_free);
        let (rays, mut hits) = ([ray; PACKET_SIZE], [None; PACKET_SIZE]);
        let mut answers = vec![planes.any_hit(&ray, None), planes.closest_hit(&ray).is_some()];
        for tree in &trees {
            tree.closest_hit_packet(&rays, &packet_ray_ends(&rays), &mut hits);
            let any = tree.any_hit_packet(&rays, &packet_ray_ends(&rays), &[]) != 0;
            answers.extend([
                tree.any_hit(&ray, None),
                tree.closest_hit(&ray).is_some(),
                any,
                hits[3].is_some(),
            ]);
        }
        missed += u32::from(is_hit && answers.contains(&false));
        wrong += u32::from(is_free && answers.contains(&true));
    }
    assert!(before > 10_000 && behind > 3_000, "{before} rays in front, {behind} behind");
    assert_eq!((missed, wrong), (0, 0), "missed and wrong hits of {before} and {behind} rays");
}

#[test]
fn image_does_not_depend_on_instruction_set() {
    for scene in ["mesh", "textures", "orbiter", "dof"] {
        let dir = TestDir::new();
        let path = format!("{}/scenes/{scene}.toml", env!("CARGO_MANIFEST_DIR"));
        let picture = |instructions: &str| {
            let name = format!("{instructions}.exr");
            let line = format!("{path} --once --width 96 --height 72 --samples 2 -o {name} --progress none");
            let output = dir.glimt(&line).env("GLIMT_SIMD", instructions).output().expect("it runs");
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            dir.bytes(&name)
        };
        let portable = picture("portable");
        assert!(portable == picture("avx2") && portable == picture("avx512"), "{scene}");
    }
}
