use std::sync::Arc;

use super::*;
use crate::assets::LoadedMesh;
use crate::geometry::mesh::TriangleMesh;
use crate::geometry::ray::offset_origin;
use crate::lights::GeometryOfLight;
use crate::math::DVec3;
use crate::math::random::signed_number_generator as random;
use crate::math::transform::Transform;
use crate::scene::description::Accel;
use crate::world::{Geometry, Hit, MeshTree};

/// A mesh of random triangles, some of them duplicated.
pub(in crate::world) fn mesh(seed: u64, count: u32) -> Arc<MeshTree> {
    let mut next = random(seed);
    let mut vector = |scale: f32| Vec3::new(next(), next(), next()) * scale;
    let mut mesh = TriangleMesh::default();
    for i in 0..count {
        let place = vector(1.0);
        mesh.positions.extend([place, place + vector(0.5), place + vector(0.5)]);
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        if i % 5 == 0 {
            mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
        }
    }
    let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
    Arc::new(MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled"))
}

fn objects(of: &[(&Arc<MeshTree>, Transform)]) -> Vec<Object> {
    let instance = |(tree, transform): &(&Arc<MeshTree>, Transform)| {
        Object::Mesh(Box::new(MeshInstance::new(Arc::clone(tree), *transform, false)))
    };
    of.iter().map(instance).collect()
}

fn geometry(objects: Vec<Object>) -> Geometry {
    Geometry::build(objects, &CancelToken::new()).expect("never canceled")
}

fn rays(seed: u64) -> Vec<Ray> {
    let mut next = random(seed);
    let mut vector = || Vec3::new(next(), next(), next());
    (0..4000)
        .map(|i| {
            if i % 2 == 0 {
                Ray::new(vector() * 3.0, vector())
            } else {
                Ray::segment_ending_before_point(vector(), vector())
            }
        })
        .collect()
}

#[test]
fn large_transformed_meshes_are_not_distorted() {
    let corners = [Vec3::new(-1e7, 0.0, 1e7), Vec3::new(1e7, 0.0, 1e7), Vec3::new(0.0, 0.0, -1e7)];
    let ground =
        TriangleMesh { positions: corners.to_vec(), triangles: vec![[0, 1, 2]], ..Default::default() };
    let loaded = Arc::new(LoadedMesh { mesh: ground, ..LoadedMesh::default() });
    let ground = Arc::new(MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled"));
    let small = mesh(7, 100);
    let shift = DVec3::new(0.37, 0.11, -0.21);
    let turned = Transform::scale_rotate_translate(DVec3::ONE, DVec3::new(0.0, 0.0, 17.3), shift);
    let below = turned.point(DVec3::NEG_Y * 9.0);
    let away = Transform::scale_rotate_translate(DVec3::ONE, DVec3::ZERO, below);
    let geometry = geometry(objects(&[(&ground, turned), (&small, away), (&small, away)]));
    assert!(geometry.has_merged_meshes());
    let up = turned.point(DVec3::Y) - shift;
    for ray in rays(8).iter().map(|ray| Ray::new(ray.origin + up.as_vec3() * 5.0, -up.as_vec3())) {
        let hit = geometry.closest_hit(&ray).expect("the ground");
        let exact = (ray.origin.as_dvec3() - shift).dot(up);
        assert_eq!(hit.object, 0);
        assert!((f64::from(hit.shape.t) - exact).abs() < 1e-4, "{} {exact}", hit.shape.t);
    }
}

#[test]
fn merged_and_unmerged_hits_are_equal() {
    let trees = [mesh(1, 30), mesh(2, 50), mesh(3, 7)];
    // The second mesh occurs twice in the same place, so the lower object id wins.
    let of: Vec<_> = [0, 1, 1, 2].iter().map(|&i| (&trees[i], Transform::IDENTITY)).collect();
    let geometry = geometry(objects(&of));
    let alone = objects(&of);
    assert!(geometry.has_merged_meshes());
    let (mut hits, mut blocked) = (0, 0);
    for ray in rays(4) {
        let each = (0_u32..)
            .zip(&alone)
            .filter_map(|(object, own)| Some(Hit { shape: own.closest_hit(&ray, &ray.to_f64())?, object }));
        let expected = each.min_by(|a, b| a.shape.t.total_cmp(&b.shape.t).then(a.object.cmp(&b.object)));
        let found = geometry.closest_hit(&ray);
        assert_eq!(found, expected, "{ray:?}");
        // Ignoring the hit triangle results in a hit on another triangle.
        if let Some(hit) = found {
            let next = geometry.closest_hit(&ray.with_start_triangle(geometry.scene_triangle_number(&hit)));
            let is_own = |next: Hit| (next.object, next.shape.primitive) == (hit.object, hit.shape.primitive);
            assert!(!next.is_some_and(is_own), "{ray:?}");
            assert!(next.is_none_or(|next| next.shape.t >= hit.shape.t), "{ray:?}");
        }
        hits += u32::from(found.is_some());
        let nothing = Hit { shape: ShapeHit::from_t(0.0), object: 3 };
        let Hit { shape, object } = found.unwrap_or(nothing);
        for source in [
            GeometryOfLight::Nothing,
            GeometryOfLight::Object(object),
            GeometryOfLight::Primitive(object, shape.primitive),
        ] {
            let any = (0_u32..).zip(&alone).any(|(id, own)| match source {
                GeometryOfLight::Nothing => own.any_hit(&ray, &ray.to_f64(), None),
                GeometryOfLight::Object(except) | GeometryOfLight::SeeThrough(except) => {
                    id != except && own.any_hit(&ray, &ray.to_f64(), None)
                }
                GeometryOfLight::Primitive(of, part) => {
                    own.any_hit(&ray, &ray.to_f64(), (id == of).then_some(part))
                }
            });
            assert_eq!(geometry.is_occluded_except_by_light(&ray, source), any, "{ray:?} {source:?}");
            blocked += u32::from(any);
        }
    }
    assert!(hits > 900 && blocked > 2000, "{hits} hits, {blocked} blocked");
}

/// Large triangles, each with a small part near the origin.
fn random_mesh_of_large_triangles() -> Arc<MeshTree> {
    let mut next = random(7);
    let mut vector = |scale: f32| Vec3::new(next(), next(), next()) * scale;
    let mut mesh = TriangleMesh::default();
    for i in 0..40 {
        let (a, b) = (vector(50.0), vector(50.0));
        mesh.positions.extend([a, b, vector(0.1) - a - b]);
        mesh.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let loaded = Arc::new(LoadedMesh { mesh, ..LoadedMesh::default() });
    Arc::new(MeshTree::build(loaded, Accel::Bvh, &CancelToken::new()).expect("never canceled"))
}

#[test]
fn rays_do_not_hit_their_starting_triangle() {
    let tree = random_mesh_of_large_triangles();
    let turned =
        |degrees: DVec3, at: DVec3| Transform::scale_rotate_translate(DVec3::new(1.0, 3.0, 0.7), degrees, at);
    let of = [
        (&tree, turned(DVec3::new(13.0, 57.0, 211.0), DVec3::ZERO)),
        (&tree, turned(DVec3::new(-71.0, 5.0, 19.0), DVec3::splat(1e-3))),
    ];
    let geometry = geometry(objects(&of));
    assert!(geometry.has_merged_meshes());
    let mut next = random(9);
    let (mut started, mut again) = (0, 0);
    for _ in 0..4000 {
        let mut vector = |scale: f32| Vec3::new(next(), next(), next()) * scale;
        let ray = Ray { t_max: f32::INFINITY, ..Ray::segment_ending_before_point(vector(1.0), vector(0.02)) };
        let Some(hit) = geometry.closest_hit(&ray) else { continue };
        let surface = geometry.surface(&ray, &hit);
        for side in [1.0, -1.0] {
            let direction = vector(1.0).normalize();
            let direction = direction * if direction.dot(surface.normal) * side < 0.0 { -1.0 } else { 1.0 };
            let origin = offset_origin(surface.point, surface.error, surface.normal, direction);
            let second = geometry.closest_hit(&Ray::new(origin, direction));
            let is_own =
                |second: Hit| (second.object, second.shape.primitive) == (hit.object, hit.shape.primitive);
            (started, again) = (started + 1, again + u32::from(second.is_some_and(is_own)));
        }
    }
    assert!(started > 5000, "{started} rays");
    assert_eq!(again, 0, "none of the {started} rays should hit its starting triangle");
}

#[test]
fn large_distant_or_lone_meshes_are_not_merged() {
    let (small, few) = (mesh(1, 60), mesh(2, 8));
    let here = Transform::IDENTITY;
    let far = Transform::scale_rotate_translate(DVec3::splat(1e-4), DVec3::ZERO, DVec3::splat(9.0));
    let members = |of: &[(&Arc<MeshTree>, Transform)]| {
        let mut objects = objects(of);
        let merged =
            MergedMeshes::merge_small_meshes(&mut objects, &CancelToken::new()).expect("never canceled");
        merged.map(|merged| (0..of.len() as u32).filter(|&id| merged.contains_object(id)).collect::<Vec<_>>())
    };
    assert_eq!(members(&[(&small, here), (&few, here)]), Some(vec![0, 1]));
    assert_eq!(members(&[(&small, here), (&few, far), (&few, here)]), Some(vec![0, 2]));
    assert_eq!(members(&[(&small, here)]), None, "a single mesh");
    // A few triangles are merged without a tree if there are no slivers.
    assert_eq!(members(&[(&few, here), (&few, here)]), Some(vec![0, 1]));
    assert_eq!(members(&[(&few, here)]), Some(vec![0]));
    let (least, needles) = (mesh(5, 3), mesh(6, 8));
    assert_eq!(members(&[(&least, here), (&few, far)]), Some(vec![0]));
    let flat = Transform::scale_rotate_translate(DVec3::new(1.0, 1e-6, 1e-6), DVec3::ZERO, DVec3::ZERO);
    assert_eq!(members(&[(&needles, flat), (&few, here)]), None, "slivers");
    let large = mesh(3, 14_000);
    assert_eq!(members(&[(&large, here), (&small, here), (&few, here)]), Some(vec![1, 2]));
    // The smallest meshes are merged up to the triangle limit.
    let half = mesh(4, 13_000);
    let many: Vec<_> = (0..12).map(|i| (if i == 0 { &few } else { &half }, here)).collect();
    assert_eq!(members(&many), Some((0..9).collect()));
}
