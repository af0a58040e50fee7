//! Compares the kd-tree and the wide BVH with brute force.

use rayon::prelude::*;

use super::pathological::{closest_by_brute_force, difficult_meshes, difficult_rays, hit_bits};
use super::{KdTree, WideBvh};
use crate::control::CancelToken;
use crate::geometry::watertight::ShearedRay;
use crate::geometry::{Aabb, Ray};
use crate::math::Vec3;
use crate::math::random::signed_number_generator as random;

type TriangleSoup = Vec<[Vec3; 3]>;

fn kd_tree(mesh: &[[Vec3; 3]]) -> KdTree {
    let tree = KdTree::from_triangles(mesh.len() as u32, |id| mesh[id as usize], &CancelToken::new());
    tree.expect("never canceled")
}

fn wide_bvh(mesh: &[[Vec3; 3]]) -> WideBvh {
    let tree = WideBvh::build(mesh.len() as u32, |id| mesh[id as usize], &CancelToken::new());
    tree.expect("never canceled")
}

/// A closed box with `squares` squares along each edge.
fn cuboid(squares: u32) -> TriangleSoup {
    let at = |face: usize, i: u32, j: u32| {
        let (u, v) = (i as f32 / squares as f32 * 2.0 - 1.0, j as f32 / squares as f32 * 2.0 - 1.0);
        let side = if face < 3 { 1.0 } else { -1.0 };
        let mut point = Vec3::splat(side);
        point[(face + 1) % 3] = u;
        point[(face + 2) % 3] = v;
        point
    };
    let squares =
        (0..6).flat_map(|face| (0..squares * squares).map(move |k| (face, k / squares, k % squares)));
    squares
        .flat_map(|(face, i, j)| {
            let [a, b, c, d] =
                [at(face, i, j), at(face, i + 1, j), at(face, i + 1, j + 1), at(face, i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// Triangles of different sizes at random positions. Some are long and thin.
fn noise(seed: u64, count: usize) -> TriangleSoup {
    let mut next = random(seed);
    let mut point = |size: f32| Vec3::new(next(), next(), next()) * size;
    let triangle = |i: usize| {
        let at = point(10.0);
        let size = [0.1, 1.0, 5.0][i % 3];
        [at, at + point(size), at + point(size)]
    };
    (0..count).map(triangle).collect()
}

/// More than fifty meshes: pathological meshes, boxes, and noise. There are four copies of each mesh:
/// unchanged, far from the origin, tiny, and huge.
fn scenes() -> Vec<TriangleSoup> {
    let shorten = |mesh: TriangleSoup| mesh.into_iter().take(240).collect::<TriangleSoup>();
    let mut own: Vec<TriangleSoup> = difficult_meshes().into_iter().map(shorten).collect();
    own.extend([cuboid(1), cuboid(4), noise(1, 40), noise(2, 240), noise(3, 200)]);
    let far = Vec3::new(148_376.0, 1234.0, -223_423.0);
    let placed = |size: f32, at: Vec3| {
        let place =
            move |mesh: &TriangleSoup| mesh.iter().map(|t| t.map(|corner| corner * size + at)).collect();
        own.iter().map(place).collect::<Vec<TriangleSoup>>()
    };
    let (tiny, huge) = (placed(2.0_f32.powi(-30), Vec3::ZERO), placed(2.0_f32.powi(30), Vec3::ZERO));
    let far = placed(1.0, far);
    [own, tiny, huge, far].concat()
}

/// A ray near a mesh. It starts at a corner, on an edge, outside the mesh, or far away. It is aimed at a
/// vertex, in a random direction, along an axis, or in a coordinate plane.
fn aimed(mesh: &[[Vec3; 3]], bounds: &Aabb, kind: usize, next: &mut impl FnMut() -> f32) -> Ray {
    let (center, size) = (bounds.center(), bounds.extent().max_element().max(f32::MIN_POSITIVE));
    let mut pick = || mesh[((next() * 0.5 + 0.5) * mesh.len() as f32) as usize % mesh.len()];
    let (from, to) = (pick(), pick());
    let mut anywhere = |size: f32| Vec3::new(next(), next(), next()) * size;
    let origin = match kind % 7 {
        0 => from[0],
        1 => (from[0] + from[1]) * 0.5,
        2 => center + anywhere(100.0 * size),
        _ => center + anywhere(1.5 * size),
    };
    let target = match kind / 7 % 4 {
        0 => to[0],
        1 => (to[0] + to[1]) * 0.5,
        2 => to[0] * 0.3 + to[1] * 0.3 + to[2] * 0.4,
        _ => center + anywhere(0.5 * size),
    };
    let zero = if kind.is_multiple_of(2) { 0.0 } else { -0.0 };
    let mut direction = target - origin;
    match kind / 28 % 4 {
        0 => direction[kind % 3] = zero,
        1 => {
            // Start at an offset from the target along one axis.
            let axis = kind % 3;
            let mut origin = target;
            origin[axis] = center[axis] + 2.0 * size;
            let mut direction = Vec3::splat(zero);
            direction[axis] = -1.0;
            return Ray::new(origin, direction);
        }
        _ => {}
    }
    let t_max = if kind.is_multiple_of(11) { 1.0 } else { f32::INFINITY };
    Ray { t_max, ..Ray::new(origin, direction) }
}

/// Number of rays for which a tree disagrees with brute force, and a description of the first such ray.
fn differences(mesh: &[[Vec3; 3]], seed: u64, count: usize) -> (usize, Option<String>) {
    let (planes, boxes) = (kd_tree(mesh), wide_bvh(mesh));
    let mut next = random(seed);
    let (mut different, mut first) = (0, None);
    for kind in 0..count {
        let ray = if mesh.is_empty() {
            Ray::new(Vec3::new(next(), next(), next()), Vec3::new(next(), next(), next()))
        } else {
            aimed(mesh, &planes.bounds(), kind, &mut next)
        };
        let expected = closest_by_brute_force(mesh, &ray);
        let except = expected.map(|hit| hit.primitive).filter(|_| kind.is_multiple_of(2));
        let sheared = ShearedRay::new(ray.origin, ray.direction);
        let is_hit = |(corners, id): (&[Vec3; 3], u32)| {
            Some(id) != except && sheared.intersect(corners, ray.t_max).is_some()
        };
        let shadow = expected.is_some() && mesh.iter().zip(0..).any(is_hit);
        let found = [planes.closest_hit(&ray), boxes.closest_hit(&ray)];
        let shadows = [planes.any_hit(&ray, except), boxes.any_hit(&ray, except)];
        if found.iter().any(|&found| hit_bits(found) != hit_bits(expected)) || shadows != [shadow; 2] {
            different += 1;
            first.get_or_insert_with(|| {
                format!("{ray:?}: {expected:?} {shadow}, found {found:?} {shadows:?}")
            });
        }
    }
    (different, first)
}

fn no_difference(rays: usize) {
    let scenes = scenes();
    assert!(scenes.len() >= 50);
    let faults: Vec<_> = (0..scenes.len())
        .into_par_iter()
        .map(|scene| (scene, differences(&scenes[scene], scene as u64, rays.div_ceil(scenes.len()))))
        .filter(|(_, (different, _))| *different > 0)
        .collect();
    assert!(faults.is_empty(), "trees differ from brute force; (scene, (ray count, first ray)): {faults:#?}");
}

#[test]
fn both_trees_match_brute_force() {
    no_difference(1_000_000);
}

#[test]
#[ignore = "43 s on two cores: cargo test --release -p glimt-kernel --lib ten_million_rays -- --ignored"]
fn ten_million_rays_match_brute_force() {
    no_difference(10_000_000);
}

#[test]
fn kd_trees_are_valid_and_match_brute_force() {
    for (number, mesh) in difficult_meshes().into_iter().chain([cuboid(3), noise(4, 3000)]).enumerate() {
        let tree = kd_tree(&mesh);
        tree.validate(mesh.len() as u32, |id| mesh[id as usize])
            .unwrap_or_else(|fault| panic!("{number}: {fault}"));
        for ray in difficult_rays(&mesh).iter().step_by(if mesh.len() > 1000 { 8 } else { 1 }) {
            let expected = closest_by_brute_force(&mesh, ray);
            assert_eq!(hit_bits(tree.closest_hit(ray)), hit_bits(expected), "mesh {number}, {ray:?}");
            assert_eq!(tree.any_hit(ray, None), expected.is_some(), "mesh {number}, {ray:?}");
        }
    }
}

#[test]
fn kd_trees_of_all_scenes_are_valid() {
    for (number, mesh) in scenes().iter().enumerate() {
        let sound = kd_tree(mesh).validate(mesh.len() as u32, |id| mesh[id as usize]);
        assert_eq!(sound, Ok(()), "scene {number}");
    }
}

/// Checks that the mesh is split into many leaves. If it were a single leaf, the other tests would not cover
/// any planes.
#[test]
fn kd_tree_splits_large_meshes() {
    let mesh = noise(9, 3000);
    let (nodes, triangles) = kd_tree(&mesh).expected_visits();
    assert!(nodes > 10.0 && triangles < 100.0, "{nodes} nodes, {triangles} triangles");
}

#[test]
fn kd_tree_does_not_depend_on_thread_count() {
    let mesh = noise(6, 80_000);
    let text = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        format!("{:?}", pool.install(|| kd_tree(&mesh)))
    };
    let one = text(1);
    assert!(one == text(2) && one == text(7));
}

#[test]
fn builds_can_be_canceled() {
    let token = CancelToken::new();
    token.cancel();
    assert!(KdTree::from_triangles(1, |_| [Vec3::ZERO, Vec3::X, Vec3::Y], &token).is_err());
}

#[test]
fn validation_detects_a_moved_triangle() {
    let mesh = noise(9, 400);
    let mut shifted = mesh.clone();
    shifted[17] = shifted[17].map(|corner| corner + Vec3::splat(0.5));
    let tree = kd_tree(&mesh);
    assert!(tree.validate(mesh.len() as u32, |id| shifted[id as usize]).is_err());
}
